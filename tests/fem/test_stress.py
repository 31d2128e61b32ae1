"""Strain and stress recovered from ten-node tetrahedra, at points inside and on the surface."""

from dataclasses import replace

import numpy as np
import pytest
from half_space import WIDTH, boussinesq

import fem
import meshes
from fem.stress import materials_at, nodal_strain, solid_parts, strain_operator
from simple_model.layers.tensors import hooke

POISSON = [0.3, 0.4999]
FOCI = [(a * 5e-3, b * 5e-3) for a in (1, -1) for b in (1, -1)]


def solid(poisson):
    return fem.Material(density=1000, shear_modulus=25e3, poisson=poisson)


def stress_at(mesh, materials, points, u):
    strain = (strain_operator(mesh, materials, points) @ u).reshape(-1, 6)
    solids = materials_at(mesh, materials, points)
    return np.array([hooke(m) @ e for m, e in zip(solids, strain, strict=True)])


def tensor(matrix):
    return np.array([matrix[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))])


@pytest.mark.parametrize("poisson", POISSON)
def test_linear_displacement_has_exact_strain_and_stress(poisson):
    mesh = meshes.block((0.02, 0.02, 0.012), 3e-3)
    rng = np.random.default_rng(0)
    corners = np.unique(mesh.tets[:, :4])
    shift = np.zeros_like(mesh.points)
    shift[corners] = rng.uniform(-3e-4, 3e-4, (len(corners), 3))
    ends = mesh.tets[:, meshes.tetmesh.EDGES]
    shift[mesh.tets[:, 4:]] = (shift[ends[:, :, 0]] + shift[ends[:, :, 1]]) / 2
    mesh = replace(mesh, points=mesh.points + shift)
    slope = rng.standard_normal((3, 3))
    low, high = mesh.points.min(axis=0) + 4e-4, mesh.points.max(axis=0) - 4e-4
    points = np.vstack([rng.uniform(low, high, (12, 3)), mesh.points[corners[[0, 57]]]])
    material, u = solid(poisson), (mesh.points @ slope.T).ravel()
    expected = tensor((slope + slope.T) / 2)
    found = (strain_operator(mesh, material, points) @ u).reshape(-1, 6)
    np.testing.assert_allclose(found, np.tile(expected, (14, 1)), rtol=0, atol=1e-9)
    stress = stress_at(mesh, material, points, u)
    lam, mu = material.first_lame, material.shear_modulus
    exact = tensor(lam * np.trace(slope) * np.eye(3) + mu * (slope + slope.T))
    assert np.abs(stress - exact).max() < 1e-9 * np.abs(exact).max()


def test_displacement_inside_a_body_is_interpolated():
    mesh = meshes.block((0.02, 0.02, 0.012), 4e-3)
    points = np.random.default_rng(1).uniform([-9e-3, -9e-3, -11e-3], [9e-3, 9e-3, 0], (9, 3))
    quadratic = [lambda p: p[:, 0] * p[:, 2], lambda p: p[:, 1] ** 2, lambda p: p[:, 2] - p[:, 0]]
    u, expected = (np.stack([f(p) for f in quadratic], axis=1) for p in (mesh.points, points))
    found = fem.displacement_operator(mesh, points) @ u.ravel()
    np.testing.assert_allclose(found.reshape(-1, 3), expected, rtol=0, atol=1e-15)
    with pytest.raises(ValueError, match="not in the body"):
        fem.locate(mesh, [[0, 0, 1e-3]])
    with pytest.raises(ValueError, match="ten-node"):
        strain_operator(meshes.block((1.0, 1.0, 1.0), 0.5, order=1), solid(0.3), [[0, 0, -0.2]])


def four_foci(poisson, point):
    total = np.zeros((3, 3))
    for x, y in FOCI:
        r, angle = np.hypot(point[0] - x, point[1] - y), np.arctan2(point[1] - y, point[0] - x)
        c, s = np.cos(angle), np.sin(angle)
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        rr, tt, zz, rz = boussinesq(poisson, r, -point[2])
        total += turn @ np.array([[rr, 0, rz], [0, tt, 0], [rz, 0, zz]]) @ turn.T
    return total


@pytest.fixture(scope="module")
def half_space():
    along = meshes.Grading(radius=12e-3, growth=1.5, coarsest=0.02)
    mesh = meshes.block((0.16, 0.16, 0.08), 2e-3, grading=along)
    return meshes.half(meshes.half(mesh, "x"), "y")


def test_stress_below_a_focus_matches_boussinesq(half_space):
    poisson = 0.4999
    mesh, material = half_space, solid(poisson)
    ops = fem.assemble(mesh, material, fixed={"clamped": "xyz", "mirror_x": "x", "mirror_y": "y"})
    away = fem.facet_points(mesh)[:, None, :2] - FOCI
    pressure = np.exp(-(away**2).sum(axis=2) / 2 / WIDTH**2).sum(axis=1)
    u = fem.static(ops, fem.pressure_operator(mesh) @ pressure)
    around = [(5e-3, 5e-3), (7.3e-3, 5e-3), (9e-3, 8e-3)]
    points = [(x, y, -z) for x, y in around for z in (0.0, 0.7e-3, 2e-3, 5e-3)]
    found = stress_at(mesh, material, points, u)
    exact = np.array([tensor(four_foci(poisson, point)) for point in points])
    largest = pressure.max()
    np.testing.assert_allclose(found, exact, rtol=0, atol=0.03 * largest)
    on_top = np.array([np.exp(-((np.array(points[0][:2]) - f) ** 2).sum() / 2 / WIDTH**2)
                       for f in FOCI]).sum()  # fmt: skip
    np.testing.assert_allclose(exact[0, [2, 4, 5]], [-on_top, 0, 0], rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("poisson", POISSON)
def test_thick_cylinder_under_pressure_matches_lame(poisson):
    """Stress (A -+ B / r^2) p, A = 1/3, B = 4/3 (Timoshenko and Goodier, section 28)."""
    mesh = meshes.extrude(np.linspace(0, 1, 7), np.linspace(0, 1, 9), np.linspace(-0.3, 0, 3))
    along, turn, z = mesh.points.T
    r, angle = 1 + along, turn * np.pi / 2
    bent = np.column_stack([r * np.cos(angle), r * np.sin(angle), z])
    mesh = replace(mesh, points=bent)
    material = fem.Material(density=1, shear_modulus=1.0, poisson=poisson)
    ops = fem.assemble(mesh, material, fixed={"front": "y", "back": "x", "top": "z", "bottom": "z"})
    P = fem.pressure_operator(mesh, "left")
    u = fem.static(ops, P @ np.ones(P.shape[1]))
    radii = np.array([1.01, 1.2, 1.5, 1.9])
    points = np.column_stack([radii * np.cos(0.7), radii * np.sin(0.7), 0 * radii - 0.15])
    found = stress_at(mesh, material, points, u)
    c, s = np.cos(0.7), np.sin(0.7)
    rr = found @ [c * c, s * s, 0, 2 * c * s, 0, 0]
    tt = found @ [s * s, c * c, 0, -2 * c * s, 0, 0]
    hoop, radial = (1 / 3 + 4 / 3 / radii**2), (1 / 3 - 4 / 3 / radii**2)
    np.testing.assert_allclose(tt, hoop, rtol=0.02)
    np.testing.assert_allclose(rr, radial, rtol=0, atol=0.02)
    np.testing.assert_allclose(found[:, 2], 2 / 3 * poisson, rtol=0, atol=0.02)


def test_strain_jumps_between_materials():
    """Two layers in series under one pressure, without lateral strain: stress over modulus each."""
    mesh = meshes.extrude(np.linspace(0, 1, 4), np.linspace(0, 1, 4), np.linspace(-1, 0, 5))
    middle = mesh.points[mesh.tets[:, :4], 2].mean(axis=1)
    mesh = replace(mesh, region=(middle < -0.5).astype(int))
    materials = {0: fem.Material(density=1, shear_modulus=1.0, poisson=0.3),
                 1: fem.Material(density=1, shear_modulus=3.0, poisson=0.4999)}  # fmt: skip
    sides = {"left": "x", "right": "x", "front": "y", "back": "y", "bottom": "z"}
    ops = fem.assemble(mesh, materials, fixed=sides)
    P = fem.pressure_operator(mesh)
    u = fem.static(ops, P @ np.ones(P.shape[1]))
    points = [(0.4, 0.6, z) for z in (-0.05, -0.45, -0.55, -0.95)]
    found = (strain_operator(mesh, materials, points) @ u).reshape(-1, 6)[:, 2]
    stiff = [m.first_lame + 2 * m.shear_modulus for m in materials.values()]
    np.testing.assert_allclose(found, [-1 / stiff[0]] * 2 + [-1 / stiff[1]] * 2, rtol=1e-8)
    stress = stress_at(mesh, materials, points, u)[:, 2]
    np.testing.assert_allclose(stress, -1.0, rtol=1e-8)


def test_nodal_strain_equals_strain_at_points():
    mesh = meshes.block((0.012, 0.012, 0.012), 3e-3)
    middle = mesh.points[mesh.tets[:, :4], 2].mean(axis=1)
    mesh = replace(mesh, region=(middle < -6e-3).astype(int))
    materials = {0: solid(0.3), 1: solid(0.4999)}
    x = 50 * mesh.points
    u = np.stack([np.sin(x[:, 0]), x[:, 2] ** 2, np.cos(x[:, 1]) * x[:, 2]], axis=1).ravel()
    above, below = solid_parts(mesh, materials)
    both = np.intersect1d(above.nodes, below.nodes)
    np.testing.assert_allclose(mesh.points[both, 2], -6e-3, atol=1e-12)
    found = nodal_strain(below, np.stack([u, -2 * u], axis=1))
    corners = np.isin(below.nodes, mesh.tets[:, :4]) & (mesh.points[below.nodes, 2] < -7e-3)
    inside = mesh.points[below.nodes[corners]]
    exact = (strain_operator(mesh, materials, inside) @ u).reshape(-1, 6)
    np.testing.assert_allclose(found[corners, :, 0], exact, atol=1e-9 * np.abs(exact).max())
    np.testing.assert_allclose(found[..., 1], -2 * found[..., 0], rtol=1e-9, atol=1e-12)
    some = np.arange(3, len(below.nodes), 7)
    part_of_it = nodal_strain(below, u[:, None], some)[..., 0]
    np.testing.assert_allclose(part_of_it, found[some, :, 0], rtol=0, atol=1e-9)
