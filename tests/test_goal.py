"""Goal-oriented estimates against true errors, and grid lines made of them."""

import numpy as np
import pytest

import fem
from meshes import equidistributed, extrude
from meshes.shapes.equidistributed import error_ratio

SIDE, DEPTH = 0.03, 0.01


def grid(n, layers):
    along = np.linspace(-SIDE / 2, SIDE / 2, n + 1)
    return extrude(along, along, np.linspace(-DEPTH, 0, layers + 1))


def solved(mesh, solid, frequency):
    """Operators' solution of a spot, dual solution of a probe beside it, and its reading."""
    operators = fem.assemble(mesh, solid, fixed={"bottom": "xyz", "sides": "xyz"})
    top = mesh.facets["top"]
    places = fem.facet_points(mesh, top)
    spot = np.exp(-((places[:, :2] ** 2).sum(axis=1)) / (2 * 4e-3**2))
    probes = fem.probe_operator(mesh, [[4e-3, 0.0]])
    right = np.column_stack([fem.load_operator(mesh, top) @ spot, probes.toarray().T])
    u = fem.harmonic(operators, right, frequency)[0]
    return u, (probes @ u[:, 0])[0]


@pytest.mark.parametrize("poisson", [0.3, 0.4999])
def test_estimate_is_within_a_factor_3_of_the_true_error(poisson):
    solid = fem.Material(density=1000.0, shear_modulus=25e3, poisson=poisson, viscosity=5.0)
    _, exact = solved(grid(10, 4), solid, 200.0)
    mesh = grid(4, 2)
    u, found = solved(mesh, solid, 200.0)
    shares = fem.goal_error(mesh, solid, (u[:, 0], u[:, 1:]), 200.0).shares
    assert shares.shape == (len(mesh.tets), 1)
    estimate, true = shares.sum(), exact - found
    assert abs(true) > 0.01 * abs(exact)  # a mesh that has an error
    assert 1 / 3 < abs(estimate) / abs(true) < 3
    assert (estimate / true).real > 0


def test_fields_without_error_have_none():
    mesh = grid(3, 2)
    x, y, z = mesh.points.T
    u = np.stack([x**2 - y * z, x * z + y, x + z**2 - x * y], axis=1).ravel()
    solid = fem.Material(density=1000.0, shear_modulus=25e3, poisson=0.3)
    found = fem.goal_error(mesh, solid, (u, u[:, None]))
    energy = u @ fem.assemble(mesh, solid, fixed=np.zeros(mesh.points.shape, bool)).K @ u
    assert np.abs(found.shares).sum() < 1e-12 * energy
    assert found.along.sum() == pytest.approx(np.abs(found.shares).sum())


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_error_lies_along_the_axis_that_the_strain_is_curved_along(axis):
    mesh = grid(6, 3)
    u = np.zeros(mesh.points.shape)
    u[:, (axis + 1) % 3] = np.sin(mesh.points[:, axis] / 4e-3)  # a shear wave
    solid = fem.Material(density=1000.0, shear_modulus=25e3, poisson=0.3)
    along = fem.goal_error(mesh, solid, (u.ravel(), u.ravel()[:, None])).along.sum(axis=0)
    assert along[axis] > 0.95 * along.sum()


def test_two_materials_are_recovered_apart():
    mesh = grid(3, 2)
    upper = mesh.points[mesh.tets[:, :4], 2].mean(axis=1) > -DEPTH / 2
    mesh = type(mesh)(points=mesh.points, tets=mesh.tets, region=upper.astype(int))
    z = mesh.points[:, 2] + DEPTH / 2
    u = np.zeros(mesh.points.shape)
    u[:, 0] = np.where(z > 0, 1.0, 3.0) * z  # shear that jumps where the material does
    soft = fem.Material(density=1000.0, shear_modulus=10e3, poisson=0.3)
    fields = u.ravel(), u.ravel()[:, None]
    both = {0: soft, 1: fem.Material(density=1000.0, shear_modulus=30e3, poisson=0.3)}
    jump = fem.goal_error(mesh, soft, fields).along.sum()
    assert fem.goal_error(mesh, both, fields).along.sum() < 1e-12 * jump


def test_lines_have_the_density_that_errors_ask_for():
    line = np.linspace(-1.0, 1.0, 201)
    middles = (line[1:] + line[:-1]) / 2
    cells = np.column_stack(3 * [np.arange(200)])
    error = np.exp(-3 * np.abs(middles))[:, None] * np.ones(3)
    found = equidistributed(3 * [line], cells, error, dofs=24 * 40**3, order=2.0)
    for each in found:  # the same error along each axis: as many cells, of h ~ g^(-1/3)
        assert len(each) == 41
        assert (each[0], each[-1]) == (-1, 1)
        ratio = np.diff(each) * np.exp(-np.abs(each[1:] + each[:-1]) / 2)
        assert ratio[1:-1].max() < 1.05 * ratio[1:-1].min()
    error[:, 2] *= 16  # which four times as many cells along z make up for
    x, _, z = equidistributed(3 * [line], cells, error, dofs=24 * 40**3, order=2.0)
    assert (len(x) - 1, len(z) - 1) == (26, 101)


def test_lines_have_no_cells_above_a_limit():
    line = np.linspace(-1.0, 1.0, 201)
    cells = np.column_stack(3 * [np.arange(200)])
    error = np.exp(-20 * np.abs(line[1:] + line[:-1]) / 2)[:, None] * np.ones(3)
    free = equidistributed(3 * [line], cells, error, dofs=24 * 20**3)
    limit = np.where(line[1:] > 0.5, 0.05, 1.0)
    found = equidistributed(3 * [line], cells, error, 24 * 20**3, coarsest=(limit, 0.1, np.inf))
    assert np.diff(free[0]).max() > 0.15
    right = found[0][:-1] > 0.5
    assert np.diff(found[0])[right].max() < 1.1 * 0.05
    assert np.diff(found[0])[:3].max() > 0.15
    assert np.diff(found[1]).max() < 1.1 * 0.1
    np.testing.assert_array_equal(found[2], free[2])


def test_predicted_errors_of_other_lines_have_the_order_that_is_asked_for():
    line = np.linspace(0.0, 1.0, 11)
    cells = np.column_stack(3 * [np.arange(10)])
    error = np.ones((10, 3))
    halved = np.linspace(0.0, 1.0, 21)
    for order in (2.0, 3.0):
        ratio = error_ratio(3 * [line], cells, error, 3 * [halved], order=order)
        assert ratio == pytest.approx(2.0**-order)
    error[:, 1] = 0.0
    only_y = error_ratio(3 * [line], cells, error, (line, halved, line))
    assert only_y == pytest.approx(1.0, abs=1e-3)
