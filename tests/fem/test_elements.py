"""Properties that a finite element must have exactly."""

from dataclasses import replace
from itertools import product
from math import factorial

import numpy as np
import pytest

import fem
import meshes
from fem.assembly import element_stiffness
from fem.geometry import gradients, jacobians, shape_nodes
from fem.pressure_projection import macroelements, projected_divergence
from fem.sparsity import SparsityPattern
from meshes import TetMesh
from meshes.elements import shape_derivatives, shape_functions, tetrahedron_rule, triangle_rule


@pytest.mark.parametrize(
    ("rule", "degree", "corners"),
    [(tetrahedron_rule(2), 2, 4), (tetrahedron_rule(5), 5, 4), (triangle_rule(), 4, 3)],
)
def test_quadrature_is_exact_to_its_degree(rule, degree, corners):
    points, weights = rule
    volume = factorial(corners - 1)
    for powers in product(range(degree + 1), repeat=corners):
        if sum(powers) <= degree:
            exact = volume * np.prod([factorial(p) for p in powers])
            exact /= factorial(sum(powers) + corners - 1)
            assert weights @ np.prod(points**powers, axis=1) == pytest.approx(exact, abs=1e-15)


@pytest.mark.parametrize(("corners", "nodes"), [(3, 3), (3, 6), (4, 4), (4, 10)])
def test_shape_functions_sum_to_one_and_match_their_derivatives(corners, nodes):
    point = np.random.default_rng(1).dirichlet(np.ones(corners), 5)
    np.testing.assert_allclose(shape_functions(point, nodes).sum(axis=1), 1, atol=1e-14)
    derivatives, eps = shape_derivatives(point, nodes), 1e-6
    for k in range(1, corners):
        nudge = eps * (np.eye(corners)[k] - np.eye(corners)[0])
        ahead, behind = (shape_functions(point + s * nudge, nodes) for s in (1, -1))
        np.testing.assert_allclose(derivatives[..., k - 1], (ahead - behind) / 2 / eps, atol=1e-8)


def test_rigid_motion_has_no_energy(distorted_cube):
    material = fem.Material(density=1, shear_modulus=1, poisson=0.4999)
    K = fem.assemble(distorted_cube, material, fixed=np.zeros_like(distorted_cube.points, bool)).K
    x = distorted_cube.points
    for motion in (np.eye(3)[0] + 0 * x, np.cross([0.3, -0.2, 0.9], x)):
        u = motion.ravel()
        assert abs(u @ K @ u) < 1e-12 * abs(K).sum() / len(u)


def test_projection_is_exact_for_linear_dilatation(distorted_cube):
    mesh = distorted_cube
    cluster, sloping = macroelements(mesh)
    assert set(cluster) == set(range(len(sloping)))
    assert sloping.all()
    x, y, z = mesh.points.T
    for u, squared in (
        (np.stack([x, y, z], axis=1), 9.0),
        (np.stack([x**2 / 2, 0 * y, y * z], axis=1), 2 / 3 + 1 / 2),  # (x + y)^2
    ):
        found = projected_divergence(mesh) @ u.ravel()
        assert found @ found == pytest.approx(squared, rel=1e-12)
    rough = np.random.default_rng(0).standard_normal(mesh.n_dofs)
    lam = np.ones(len(mesh.tets))
    pattern = SparsityPattern.of(mesh.tets, len(x))
    direct = pattern.blocks(element_stiffness(mesh, 0 * lam, lam))
    found = projected_divergence(mesh) @ rough
    assert found @ found < 0.6 * (rough @ direct @ rough)


def test_element_without_inner_edges_is_its_own_macroelement():
    points = np.vstack([np.zeros(3), np.eye(3)])
    mesh = meshes.quadratic(TetMesh(points=points, tets=[[0, 1, 2, 3]]))
    cluster, sloping = macroelements(mesh)
    np.testing.assert_array_equal(cluster, [0])
    np.testing.assert_array_equal(sloping, [False])
    swelling = projected_divergence(mesh) @ mesh.points.ravel()
    assert (swelling**2).sum() == pytest.approx(3**2 / 6)  # div u squared, times the volume


def test_mass_matrix_has_the_mass_of_the_body(distorted_cube):
    material = fem.Material(density=700, shear_modulus=1, poisson=0.3)
    M = fem.assemble(distorted_cube, material, fixed=np.zeros_like(distorted_cube.points, bool)).M
    up = np.tile([0, 0, 1.0], len(distorted_cube.points))
    assert up @ M @ up == pytest.approx(700, rel=1e-12)
    linear = np.zeros_like(distorted_cube.points)
    linear[:, 2] = distorted_cube.points[:, 0]
    assert linear.ravel() @ M @ linear.ravel() == pytest.approx(700 / 3, rel=1e-12)


def test_operators_are_symmetric_and_positive(distorted_cube):
    material = fem.Material(density=1, shear_modulus=1, poisson=0.499, viscosity=0.1)
    ops = fem.assemble(distorted_cube, material, fixed="bottom", absorbing="sides")
    for operator in (ops.K, ops.C, ops.M):
        assert abs(operator - operator.T).max() < 1e-12 * abs(operator).max()
        assert np.linalg.eigvalsh(operator.toarray()).min() > 0


@pytest.mark.parametrize(
    ("bend", "fixed"), [(0.0, {"bottom": "xyz", "sides": "x"}), (0.05, {"bottom": "z"})]
)
def test_operators_equal_their_defining_integrals(distorted_cube, bend, fixed):
    x = distorted_cube.points
    mesh = replace(distorted_cube, points=x + bend * np.sin(5 * x[:, [1, 2, 0]]))
    mu, lam, rho = 2.0, 3.0, 700.0
    material = fem.Material(density=rho, shear_modulus=mu, poisson=lam / 2 / (lam + mu))
    found = fem.assemble(mesh, material, fixed=fixed)
    K, M = np.zeros((2, len(x), 3, len(x), 3))
    slopes, volumes = gradients(shape_nodes(mesh), 10, 2, 0)
    H = np.einsum("eq,eqia,eqjb->eaibj", volumes, slopes, slopes, optimize=True)
    shear = np.einsum("eakbk,ij->eaibj", H, np.eye(3))
    blocks = lam * H + mu * (H.transpose(0, 1, 4, 3, 2) + shear)
    N, volumes = shape_functions(tetrahedron_rule(5)[0], 10), jacobians(shape_nodes(mesh), 5, 0)[2]
    masses = np.einsum("eq,qa,qb,ij->eaibj", rho * volumes, N, N, np.eye(3), optimize=True)
    for nodes, block, mass in zip(mesh.tets, blocks, masses, strict=True):
        K[nodes[:, None], :, nodes] += block.transpose(0, 2, 1, 3)
        M[nodes[:, None], :, nodes] += mass.transpose(0, 2, 1, 3)
    for A, by_definition in ((found.K, K), (found.M, M)):
        dense = by_definition.reshape(mesh.n_dofs, -1)[np.ix_(found.free, found.free)]
        assert abs(A - dense).max() < 1e-14 * abs(dense).max()


def test_regions_have_their_own_material():
    mesh = meshes.block((0.02, 0.02, 0.02), 0.005)
    below = mesh.points[mesh.tets].mean(axis=1)[:, 2] < -0.01
    half = replace(mesh, region=below.astype(int))
    soft = fem.Material(density=1000, shear_modulus=1e4, poisson=0.45, viscosity=2)
    stiff = fem.Material(density=1200, shear_modulus=1e6, poisson=0.45, viscosity=3)
    one, two = fem.assemble(mesh, soft), fem.assemble(half, {0: soft, 1: soft})
    for name in "KCM":
        difference = abs(getattr(one, name) - getattr(two, name)).max()
        assert difference < 1e-13 * abs(getattr(one, name)).max()
    mixed = fem.assemble(half, {0: soft, 1: stiff}, fixed=np.zeros(mesh.points.shape, bool))
    assert mixed.M.sum() / 3 == pytest.approx(1100 * 8e-6, rel=1e-12)
    # Sheared as one, each half stores its own modulus and loses its own viscosity.
    sheared = np.zeros_like(mesh.points)
    sheared[:, 0] = mesh.points[:, 2]
    x = sheared.ravel()
    assert x @ mixed.K @ x == pytest.approx((1e4 + 1e6) / 2 * 8e-6, rel=1e-9)
    assert x @ mixed.C @ x == pytest.approx((2 + 3) / 2 * 8e-6, rel=1e-9)
    with pytest.raises(ValueError, match=r"regions \[1\] have no material"):
        fem.assemble(half, {0: soft})


def test_probes_read_the_displacement_into_the_body(distorted_cube):
    u = np.zeros_like(distorted_cube.points)
    u[:, 2] = -(1 + distorted_cube.points[:, 0] ** 2)
    S = fem.probe_operator(distorted_cube, [[0.3, 0.4], [0.71, 0.2]])
    np.testing.assert_allclose(S @ u.ravel(), [1.09, 1.5041], rtol=1e-12)
    with pytest.raises(ValueError, match="not on the surface"):
        fem.probe_operator(distorted_cube, [[1.1, 0.0]])


def test_inverted_elements_and_incompressible_solids_are_refused():
    mesh = meshes.block((1.0, 1.0, 1.0), 1.0)
    points = mesh.points.copy()
    points[mesh.tets[3, 4]] += 2.0
    bent = replace(mesh, points=points)
    touched = np.flatnonzero((mesh.tets == mesh.tets[3, 4]).any(axis=1))
    with pytest.raises(meshes.MeshError) as refused:
        next(element_stiffness(bent, *np.ones((2, len(mesh.tets)))))
    assert any(f"element {e} " in str(refused.value) for e in touched)
    with pytest.raises(ValueError, match="poisson"):
        fem.Material(density=1, shear_modulus=1, poisson=0.5)
