"""Coats of thin layers: patch tests, closed forms, wavenumber integrals, and bodies with them."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.sparse.linalg import eigsh

import fem
import meshes
from fem.assembly import by_region
from fem.boundary import fixed_dofs
from fem.coat import coat_operators, coat_stiffness, surface_of
from fem.sparsity import dofs_of
from simple_model import PronyTerm, Stack
from simple_model.layers.compliance import layered
from simple_model.layers.wavenumber_integral import point_response
from skinwave.bodies import BODIES, Body, Layer, sizes
from skinwave.bodies.sizes import check_mesh, coat, coat_count, default_size, meshed_strata
from skinwave.planning.rows import coat_rows
from skinwave.planning.simulate import compute
from skinwave.scene.file import loads

SOFT = fem.Material(density=1000, shear_modulus=1.0, poisson=0.4999)
STIFF = fem.Material(density=1100, shear_modulus=1e5, poisson=0.3)
THIN = fem.Coat(materials=(STIFF,), thicknesses=(0.4e-3,))
EPIDERMIS = Layer(thickness=0.3e-3, material="epidermis")
PLANE_STRESS = STIFF.young / (1 - STIFF.poisson**2)
FOREARM = fem.PRESETS["forearm"]
SKIN = fem.from_young(density=1000, young=300e3, poisson=0.4999, viscosity=40.0)
WIDTH, DEPTH = 4.35e-3, 15e-3
RADII = np.arange(5) * 5e-3


@cache
def block(bent=(0.0, 0.0)):
    rng = np.random.default_rng(3)
    grid = np.arange(-12, 12.1, 3)
    x, y = (np.sort(1e-3 * (grid + np.r_[0, rng.uniform(-0.8, 0.8, 7), 0])) for _ in "xy")
    flat = meshes.extrude(x, y, np.array([-6e-3, -3e-3, 0.0]))
    points = flat.points.copy()
    for axis, curvature in enumerate(bent):
        if curvature:
            angle, radius = curvature * points[:, axis], 1 / curvature + points[:, 2]
            points[:, axis] = radius * np.sin(angle)
            points[:, 2] = radius * np.cos(angle) - 1 / curvature
    return replace(flat, points=points)


def added(mesh, coat=THIN, soft=SOFT, fixed=None):
    mask = np.zeros(mesh.points.shape, bool) if fixed is None else fixed
    return coat_operators(mesh, coat, *by_region(mesh, soft), fixed_dofs(mesh, mask))


def inside(mesh, margin=4.5e-3):
    """Bump (n,) that vanishes next to the sides of the block."""
    across = np.abs(mesh.points[:, :2]).max(axis=1)
    return np.clip(1 - (across / (across.max() - margin)) ** 2, 0, None)


def test_coat_of_the_replaced_material_changes_nothing():
    same = fem.Coat(materials=(SOFT, SOFT), thicknesses=(0.1e-3, 0.3e-3))
    K, C, M, branches = added(block(), same)
    assert K.nnz == C.nnz == M.nnz == len(branches) == 0 or abs(K).max() == abs(M).max() == 0


def test_uniform_in_plane_strain_is_exact():
    mesh, strain = block(), np.array([[2e-3, 7e-4], [7e-4, -1e-3]])
    u = np.zeros_like(mesh.points)
    u[:, :2] = mesh.points[:, :2] @ strain
    force = (added(mesh)[0] @ u.ravel()).reshape(-1, 3)
    top, sides = np.unique(mesh.facets["top"]), np.unique(mesh.facets["sides"])
    # A facet at the edge takes part in the moment that acts there, about the surface.
    at_edge = mesh.facets["top"][np.isin(mesh.facets["top"], sides).any(axis=1)]
    free = np.setdiff1d(top, at_edge)
    assert len(free)
    scale = np.abs(force).max()
    assert np.abs(force[free]).max() < 1e-9 * scale
    assert np.abs(np.delete(force, top, axis=0)).max() == 0
    energy = u.ravel() @ force.ravel()
    stress = [2 * m.shear_modulus * (strain + m.poisson / (1 - m.poisson) * np.trace(strain)
                                     * np.eye(2)) for m in (STIFF, SOFT)]  # fmt: skip
    expected = 0.4e-3 * 24e-3**2 * ((stress[0] - stress[1]) * strain).sum()
    assert energy == pytest.approx(expected, rel=1e-9)


def test_uniform_curvature_is_exact():
    """Normals stay normal: the strain at a height z is z times the curvature."""
    mesh, curvature = block(), 0.3
    u = np.zeros_like(mesh.points)
    u[:, 2] = -curvature * mesh.points[:, 0] ** 2 / 2
    soft = SOFT.young / (1 - SOFT.poisson**2)
    energy = u.ravel() @ (added(mesh)[0] @ u.ravel())
    stiffness = (PLANE_STRESS - soft) * 0.4e-3**3 / 3
    assert energy == pytest.approx(stiffness * curvature**2 * 24e-3**2, rel=1e-9)


def test_layers_are_stacked_from_the_surface_downwards():
    """Bending about the surface: the lower of two layers has seven times the stiffness."""
    mesh = block()
    u = np.zeros_like(mesh.points)
    u[:, 2] = mesh.points[:, 0] ** 2
    weak = STIFF.scaled(modulus=1e-9)
    energy = {}
    for materials in ((STIFF, weak), (weak, STIFF)):
        pair = fem.Coat(materials=materials, thicknesses=(0.2e-3, 0.2e-3))
        K = added(mesh, pair, SOFT.scaled(modulus=1e-9))[0]
        energy[materials[0] is STIFF] = u.ravel() @ (K @ u.ravel())
    assert energy[False] == pytest.approx(7 * energy[True], rel=1e-6)


@pytest.mark.parametrize("bent", [(0.0, 0.0), (40.0, 40.0)])
def test_rigid_rotation_has_no_energy(bent):
    mesh = block(bent)
    turned = np.cross([0.3, -0.5, 0.8], mesh.points).ravel()
    K = added(mesh)[0]
    assert np.abs(K @ turned).max() < 1e-9 * abs(K).max() * np.abs(turned).max()


@pytest.mark.parametrize("bent", [(0.0, 0.0), (40.0, 40.0)])
def test_coat_alone_has_no_negative_stiffness(bent):
    """At the least penalty that is enough: with 0.85 of it some modes are negative."""
    mesh, free = block(bent), np.zeros(block().n_dofs, bool)
    surface = surface_of(mesh, THIN, free)
    alike = np.full((1, len(surface.facets)), STIFF.shear_modulus)
    dofs = dofs_of(np.unique(surface.facets)).ravel()
    K = coat_stiffness(surface, THIN, alike, 0.9 * alike)[dofs][:, dofs]
    stiffness = np.linalg.eigvalsh(K.toarray())
    assert stiffness[0] > -1e-12 * stiffness[-1]


@pytest.mark.parametrize("bent", [(40.0, 0.0), (40.0, 40.0)], ids=["cylinder", "sphere"])
def test_curved_membrane_under_pressure_has_laplace_tension(bent):
    """p = t (sigma_1 / R_1 + sigma_2 / R_2), by the virtual work of a bump."""
    mesh, radius, growth = block(bent), 25e-3, 1e-6
    thin = fem.Coat(materials=(STIFF,), thicknesses=(1e-5,))
    centre = np.array([0.0 if bent[0] else np.nan, 0.0, -radius])
    out = mesh.points - centre
    out[:, 1] *= bent[1] > 0
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    u, bump = growth * out, inside(mesh)[:, None] * out
    strain = growth / radius * np.array([1.0, float(bent[1] > 0)])
    sigma = PLANE_STRESS * (strain + STIFF.poisson * strain[::-1])
    pressure = 1e-5 * (sigma[0] + sigma[1] * (bent[1] > 0)) / radius
    found = bump.ravel() @ (added(mesh, thin)[0] @ u.ravel())
    P = fem.pressure_operator(mesh)  # into the body
    expected = -bump.ravel() @ (P @ np.full(P.shape[1], pressure))
    assert found == pytest.approx(expected, rel=0.01)


def test_mass_of_a_coat_is_the_difference_of_densities():
    mesh = block((40.0, 40.0))
    up = np.tile([0.0, 0.0, 1.0], len(mesh.points))
    M = added(mesh)[2]
    area = np.linalg.norm(
        fem.load_and_probe.facet_geometry(mesh.points[mesh.facets["top"]])[1], axis=2
    )
    inner = area.sum() * ((1 - 40 * 0.4e-3 / 2) ** 2 + (40 * 0.4e-3) ** 2 / 12)
    assert up @ (M @ up) == pytest.approx(100 * 0.4e-3 * inner, rel=2e-3)


def test_stiffness_of_a_coat_has_the_complex_moduli():
    zener = PronyTerm(modulus=3e4, time=1e-3)
    skin = replace(STIFF, viscosity=20.0, prony=(zener, PronyTerm(modulus=1e4, time=1e-4)))
    below = replace(SOFT, shear_modulus=2e4, poisson=0.49, viscosity=4.0, prony=(zener,))
    mesh, w = block(), 2 * np.pi * 140
    coat = fem.Coat(materials=(skin,), thicknesses=(0.4e-3,))
    K, C, _, branches = added(mesh, coat, below)
    assert [branch.time for branch in branches] == [1e-4, 1e-3]
    surface = surface_of(mesh, coat, np.zeros(mesh.n_dofs, bool))
    expected = 0
    for m, sign in ((skin, 1), (below, -1)):
        alike = np.ones((1, len(surface.facets)))
        lam = 2 * m.shear_modulus * m.poisson / (1 - m.poisson)
        part = coat_stiffness(surface, coat, m.shear_modulus * alike, lam * alike)
        expected += sign * m.complex_modulus(w) / m.shear_modulus * part
    found = K + 1j * w * C + sum(branch.share(1j * w) * branch.K for branch in branches)
    dofs = dofs_of(np.unique(surface.facets)).ravel()
    difference = (found - expected)[dofs][:, dofs]
    assert abs(difference).max() < 1e-12 * abs(expected).max()


def test_body_and_coat_share_branches_of_equal_time():
    term = (PronyTerm(modulus=1e3, time=1e-3),)
    mesh, below = block(), fem.Material(density=1000, shear_modulus=2e4, poisson=0.3, prony=term)
    stronger = (PronyTerm(modulus=9e3, time=1e-3),)
    skin = fem.Coat(materials=(replace(STIFF, prony=stronger),), thicknesses=(0.4e-3,))
    plain = fem.assemble(mesh, below, fixed="bottom")
    coated = fem.assemble(mesh, below, fixed="bottom", coat=skin)
    assert len(coated.branches) == 1
    extra = added(mesh, skin, below, {"bottom": "xyz"})[3][0].K
    difference = coated.branches[0].K - plain.branches[0].K - extra[plain.free][:, plain.free]
    assert abs(difference).max() < 1e-12 * abs(extra).max()


def test_half_of_a_symmetric_body_moves_like_the_whole():
    x = np.linspace(-9e-3, 9e-3, 7)
    mesh = meshes.extrude(x, x, np.array([-6e-3, -3e-3, 0.0]))
    soft = fem.Material(density=1000, shear_modulus=2e4, poisson=0.4)
    found = {}
    for axes in ("", "x", "xy"):
        part, fixed = mesh, {"bottom": "xyz"}
        for axis in axes:
            part = meshes.half(part, axis)
            fixed[f"mirror_{axis}"] = axis
        operators = fem.assemble(part, soft, fixed=fixed, coat=THIN)
        at = fem.facet_points(part)
        load = np.exp(-(at[:, :2] ** 2).sum(axis=1) / 2 / 3e-3**2)
        u = fem.static(operators, fem.pressure_operator(part) @ load)
        found[axes] = fem.probe_operator(part, [[0.0, 0.0], [2e-3, 3e-3]]) @ u
    np.testing.assert_allclose(found["x"], found[""], rtol=1e-7)
    np.testing.assert_allclose(found["xy"], found[""], rtol=1e-7)


def test_coat_of_half_an_element_keeps_the_stiffness_positive():
    soft = fem.Material(density=1000, shear_modulus=2e4, poisson=0.4999)
    thick = fem.Coat(materials=(soft.scaled(modulus=1e3),), thicknesses=(1.5e-3,))
    operators = fem.assemble(block(), soft, fixed="bottom", coat=thick)
    lowest = eigsh(operators.K, 1, M=operators.M, sigma=0, return_eigenvectors=False)
    assert lowest[0] > 0


@cache
def quarter():
    x = np.arange(0, 30.1, 3) * 1e-3
    mesh = meshes.extrude(x, x, np.arange(-15, 0.1, 3) * 1e-3)
    mask = np.zeros(mesh.points.shape, bool)
    for axis in (0, 1):
        mask[mesh.points[:, axis] < 1e-9, axis] = True
        mask[mesh.points[:, axis] > x[-1] - 1e-9] = True
    mask[mesh.points[:, 2] < -DEPTH + 1e-9] = True
    at = fem.facet_points(mesh)
    load = fem.pressure_operator(mesh) @ np.exp(-(at[:, :2] ** 2).sum(axis=1) / 2 / WIDTH**2)
    probes = fem.probe_operator(mesh, np.c_[RADII, 0 * RADII])
    return mesh, mask, fem.assemble(mesh, FOREARM, fixed=mask), load, probes


@cache
def response(hertz, coat=None):
    mesh, mask, plain, load, S = quarter()
    if coat is None:
        return S @ fem.harmonic(plain, load, hertz)[0]
    K, C, M, _ = added(mesh, coat, FOREARM, mask)
    free = plain.free
    parts = {name: part[free][:, free] for name, part in zip("KCM", (K, C, M), strict=True)}
    coated = replace(plain, **{name: getattr(plain, name) + part for name, part in parts.items()})
    return S @ fem.harmonic(coated, load, hertz)[0]


@pytest.mark.parametrize(
    ("thickness", "hertz", "most"), [(0.3e-3, 400.0, 0.03), (1e-3, 140.0, 0.05)]
)
def test_coated_slab_matches_its_wavenumber_integral(thickness, hertz, most):
    coated = Stack(materials=(SKIN, FOREARM), thicknesses=(thickness, DEPTH - thickness))
    plain = Stack(materials=(FOREARM,), thicknesses=(DEPTH,))
    true, bare = (
        point_response(layered(stack), RADII, [2 * np.pi * hertz], WIDTH)[0]
        for stack in (coated, plain)
    )
    found = response(hertz, fem.Coat(materials=(SKIN,), thicknesses=(thickness,)))
    size = np.abs(true).max()
    assert np.abs(found - true).max() < most * size
    # The change by the coat is more accurate, because the error of the mesh cancels.
    change = np.abs(found - response(hertz) - (true - bare)).max()
    assert change < 0.25 * np.abs(true - bare).max()


def test_invalid_coats_are_refused():
    for materials, thickness, said in (((), 1e-3, "0 materials"), ((STIFF,), 0.0, "above 0")):
        with pytest.raises(ValueError, match=said):
            fem.Coat(materials=materials, thicknesses=(thickness,))
    linear = meshes.extrude(*(np.linspace(0, 1e-2, 3) for _ in "xyz"), order=1)
    with pytest.raises(ValueError, match="order=2"):
        added(linear)


def palm(*layers):
    return Body(kind="palm", layers=layers)


def test_thin_layers_on_a_palm_become_a_coat():
    body = palm(EPIDERMIS)
    assert default_size(body) == default_size(BODIES["palm"])
    check_mesh(body, 5e-3)
    found = coat(body, 5e-3)
    assert found.materials == (fem.PRESETS["epidermis"],)
    assert found.thicknesses == (0.3e-3,)
    assert [m for _, m in meshed_strata(body, 5e-3)] == [fem.PRESETS["palm"]]
    assert len(coat_rows(body, 5e-3)) == 1
    assert not coat_rows(BODIES["palm"], 5e-3)
    # Those alone that are thinner than elements.
    dermis = Layer(thickness=0.8e-3, material="dermis")
    both = palm(EPIDERMIS, dermis)
    assert sizes.coarsest_size(both) == np.inf
    assert coat_count(both, 5e-3) == 2
    assert coat_count(both, 2e-3) == 1
    assert [start for start, _ in meshed_strata(both, 2e-3)] == [0.0, pytest.approx(1.1e-3)]


def test_thin_layers_that_cannot_be_a_coat_are_refused():
    thick = Layer(thickness=3e-3, material="fat"), EPIDERMIS
    for layers in (thick, (Layer(thickness=0.8e-3, material="forearm-hypodermis"),)):
        with pytest.raises(ValueError, match="coat|at most"):
            check_mesh(palm(*layers), 5e-3)
    assert coat(Body(kind="slab", layers=(EPIDERMIS,)), 3e-3) is None


@pytest.fixture(scope="module")
def lump(tmp_path_factory):
    x = np.linspace(-15e-3, 15e-3, 7)
    mesh = meshes.extrude(x, x, np.linspace(-12e-3, 0, 4))
    file = tmp_path_factory.mktemp("coat") / "lump.vtu"
    meshes.write(file, replace(mesh, facets={}))
    layer = "\n[[body.layers]]\nthickness_mm = {}\nmaterial = 'forearm-epidermis'"
    text = "[tacton]\nam_frequency_hz=140\nduration_s=0.03\n[probes]\npoints_mm=[[0, 0], [5, 0]]\n"
    text += f"[body]\nkind = 'mesh'\nfile = '{file}'\n"
    return {mm: loads(text + (layer.format(mm) if mm else "")) for mm in (0, 0.3)}


def test_all_linear_models_include_the_coat(lump):
    reduced = {mm: compute(scene, "fem").displacement for mm, scene in lump.items()}
    assert np.linalg.norm(reduced[0.3]) < 0.95 * np.linalg.norm(reduced[0])
    stepped = compute(lump[0.3], "fem-transient", dt=1e-4).displacement
    assert np.linalg.norm(stepped - reduced[0.3]) < 0.01 * np.linalg.norm(stepped)
    steady = compute(lump[0.3], "fem-harmonic").displacement
    late = slice(len(steady) // 2, None)
    assert np.linalg.norm((steady - reduced[0.3])[late]) < 0.03 * np.linalg.norm(steady[late])
