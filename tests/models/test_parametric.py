"""One reduced body, or sheet, for every material of a range, against each one's own bodies."""

from dataclasses import replace

import numpy as np
import pytest

import fem
import skinwave
from fem.affine import Solids, assemble_affine, line_solution, operators_of, weights
from fem.affine_model import AffineModel, line_errors
from fem.greedy import line_bases
from fem.harmonic import dynamic_stiffness
from fem.load_and_probe import facet_normals
from meshes import boundary_facets
from simple_model import MovingPressure, PronyTerm, Tacton, Trajectory
from simple_model.load.spectrum import pressure_lines
from skinwave.bodies import tissue
from skinwave.bodies.absorbing_layer import layer_drag, layer_of
from skinwave.bodies.build import build, operators
from skinwave.measure import predicted
from skinwave.measure.parameters import parse
from skinwave.models import free_bodies, parametric
from skinwave.models.free_bodies import build_at
from skinwave.models.free_keys import free_keys, values_at, with_values
from skinwave.models.meshed import surface_load, surface_motion
from skinwave.models.options import SolveOptions
from skinwave.models.reduced import answer as own_answer
from skinwave.models.reduced import components, reduce_scene
from skinwave.scene.scene import BODIES, Body, Layer, Scene
from skinwave.system.effort import silent

MODULUS, VISCOSITY = "body.material.shear_modulus_pa", "body.material.viscosity_pa_s"
RANGES = {MODULUS: (15e3, 40e3), VISCOSITY: (3.0, 10.0)}
H = 5e-3
SMALL = {"width": 0.04, "height": 0.04, "depth": 0.01}
LOSS = "body.material.loss_factor"
DENSITY, THICKNESS = "body.material.density_kg_m3", "body.thickness_mm"
OF_SHEETS = {
    MODULUS: (0.7e9, 1.4e9), LOSS: (0.02, 0.08), DENSITY: (600, 1000), THICKNESS: (0.08, 0.14),
}  # fmt: skip
COARSE = 6e-3
SHEET = replace(BODIES["paper-sheet-loose"], width=0.06, height=0.06, air=True)
PATH = Trajectory(shape="circle", size=0.012, speed=5.0)
LOAD = MovingPressure(tacton=Tacton(am_frequency=140, duration=0.1, trajectory=PATH))
SCENE = Scene(pressure=LOAD, body=SHEET, probes=((0.0, 0.0), (0.01, 0.004)))


def scene_of(body, **changes):
    probes = ((0.0, 0.0), (0.006, 0.0), (0.01, 0.004))
    return Scene(pressure=LOAD, body=body, probes=probes, **changes)


@pytest.fixture(scope="module")
def slab():
    return scene_of(Body(sides="clamped", **SMALL))


@pytest.fixture(scope="module")
def prepared(slab):
    return skinwave.prepare(slab, RANGES, h=H)


def random_values(keys, count, seed=1):
    shares = np.random.default_rng(seed).random((count, len(keys)))
    return [values_at(keys, each) for each in shares]


def full_lines(scene, body, frequencies, h=H, made=None):
    """Steady state (f, p) of the full body by a factorisation a line, without any reduction."""
    made = made or build(body, h)
    P, points = surface_load(made)
    every, pressures = pressure_lines(scene.pressure, points)
    S = surface_motion(body, made, scene.probe_points)
    found = []
    for f in frequencies:
        force = P @ pressures[np.argmin(np.abs(every - f))]
        found.append(S @ fem.harmonic(operators(made), force, f)[0])
    return np.array(found)


def test_lines_are_those_of_the_full_body_at_least_loss(slab, prepared):
    strong = [280.0, prepared.frequencies[2]]
    assert prepared.effort.estimate < 0.01
    for shares in ((0, 0), (1, 0)):
        values = values_at(prepared.keys, shares)
        frequencies, found = parametric.lines(prepared, values)
        body = with_values(slab.body, prepared.keys, values)
        expected = full_lines(slab, body, strong)
        near = found[[np.argmin(np.abs(frequencies - f)) for f in strong]]
        least = np.linalg.norm(expected, axis=1).min()
        assert np.linalg.norm(near - expected, axis=1).max() < 0.01 * least


def test_the_waveform_from_rest_is_that_of_the_materials_own_body(slab, prepared):
    (values,) = random_values(prepared.keys, 1, seed=2)
    body = with_values(slab.body, prepared.keys, values)
    own = own_answer(reduce_scene(replace(slab, body=body), SolveOptions(h=H)), slab)
    found = parametric.answer(prepared, values)
    moving = np.linalg.norm(own.values - own.values.mean(axis=0))
    assert np.linalg.norm(found.values - own.values) < 0.005 * moving
    other = replace(slab.pressure.tacton, am_frequency=90.0)
    scene = replace(slab, pressure=replace(slab.pressure, tacton=other))
    expected = own_answer(reduce_scene(replace(slab, body=body), SolveOptions(h=H)), scene).values
    found = own_answer(parametric.at(prepared, values), scene).values
    assert np.linalg.norm(found - expected) < 0.01 * np.linalg.norm(expected)


def test_the_offline_stage_is_cached(slab, tmp_path, monkeypatch):
    monkeypatch.setenv("SKINWAVE_CACHE", str(tmp_path))
    few = replace(slab, probes=slab.probes[:1])
    free = {VISCOSITY: (9.0, 10.0)}
    first = skinwave.prepare(few, free, 0.05, h=9e-3)
    monkeypatch.setattr(parametric, "reduce_affine", None)  # of no use from here on
    again = skinwave.prepare(few, free, 0.05, h=9e-3)
    one, other = (parametric.answer(body, {VISCOSITY: 9.4}).values for body in (first, again))
    np.testing.assert_array_equal(one, other)
    with pytest.raises(TypeError, match="not callable"):
        skinwave.prepare(few, {VISCOSITY: (9.0, 11.0)}, 0.05, h=9e-3)


def test_springs_and_absorbing_layers_go_with_the_material():
    term = PronyTerm(modulus=10e3, time=1e-3)
    soft = fem.Material(density=1000, shear_modulus=30e3, poisson=0.45, prony=(term,))
    other = replace(soft, density=900.0, shear_modulus=24e3)
    before, after = (Body(material=m, width=0.03, height=0.03, depth=0.01) for m in (soft, other))
    made = build(before, 1e-2)
    mesh = made.mesh
    outward = facet_normals(mesh, boundary_facets(mesh.tets))
    rests = [tissue.support(body, mesh, outward, []).stiffness for body in (before, after)]
    keys = free_keys(before, {MODULUS: (20e3, 40e3)})
    on_springs = replace(made, support=tissue.support(before, mesh, outward, []))
    solids = free_bodies.solids_of(free_bodies.reference_of(before, on_springs, keys), after)
    assert solids.materials == (other,)
    assert rests[1] == pytest.approx(solids.springs * rests[0])
    drags = [layer_drag(body, layer_of(body), mesh) for body in (before, after)]
    assert drags[1] == pytest.approx(solids.drag * drags[0])
    assert solids.springs != pytest.approx(solids.drag)


def test_affine_sums_are_the_operators():
    upper = Layer(thickness=0.004, material="dermis")
    made = build(Body(material="fat", layers=(upper,), width=0.02, height=0.02, depth=0.01), 1e-2)
    prony = (PronyTerm(modulus=9e3, time=1e-3), PronyTerm(modulus=5e3, time=1e-2))
    materials = (
        fem.Material(density=1100, shear_modulus=90e3, poisson=0.45, viscosity=9.0),
        fem.Material(density=1000, shear_modulus=60e3, poisson=0.49, prony=prony[:1]),
        fem.Material(density=900, shear_modulus=30e3, poisson=0.48, loss_factor=0.1),
        fem.Material(density=1000, shear_modulus=20e3, poisson=0.4, loss_factor=0.2, prony=prony),
    )
    assert free_bodies.meshed_materials(made) == tuple(made.material.values())
    facets = made.mesh.facets["sides"]
    shares = np.random.default_rng(0).random((2, 6 * len(facets)))
    made = replace(
        made, material=dict(enumerate(materials[2:])), fixed={"bottom": "xyz"},
        coat=fem.Coat(materials=materials[:2], thicknesses=(1e-4, 3e-4)),
        support=fem.Support(facets=facets, stiffness=1e6 * shares[0], absorbed=shares[1]),
    )  # fmt: skip
    assert made.drag.any()
    expected = operators(made)
    affine = assemble_affine(
        made.mesh, materials, fixed=made.fixed, absorbing=made.absorbing, drag=made.drag,
        support=made.support, coat=made.coat,
    )  # fmt: skip
    solids = Solids(materials=materials)
    found = operators_of(affine, solids)
    for one in "KCMR":
        wanted = getattr(expected, one)
        assert abs(getattr(found, one) - wanted).max() <= 1e-12 * abs(wanted).max(), one
    assert len(affine.parts) == 4 + 4 + 4 + 4 + 1
    stiff = dynamic_stiffness(expected.K, expected.C, expected.M, expected.branches, 2e3j)
    (at,) = weights(affine.terms, solids, [1e3 / np.pi])
    summed = sum(w * A for w, A in zip(at, affine.parts, strict=True))
    assert abs(summed - stiff).max() < 1e-12 * abs(stiff).max()


def test_matrices_of_a_stretched_body_are_sums_over_known_geometries():
    body = Body(
        kind="disc", sides="absorbing", layers=(Layer(thickness=3e-3, material="dermis"),), **SMALL
    )
    keys = free_keys(body, {"body.layers.0.thickness_mm": (2.0, 4.0), THICKNESS: (8.0, 12.0)})
    bodies = parametric._range(body, keys, H)
    at = [key.share(value) for key, value in zip(keys, (2.7, 11.0), strict=True)]
    shares = free_bodies.geometry_shares(bodies, bodies.body(at))
    expected = operators(build_at(bodies, at))
    known = [operators(build_at(bodies, each)) for each in bodies.geometries]
    for name in "KCM":
        parts = [s * getattr(each, name) for s, each in zip(shares, known, strict=True)]
        A = getattr(expected, name)
        assert abs(sum(parts) - A).max() < 1e-9 * abs(A).max()


def test_the_ends_of_a_range_of_thickness_are_as_accurate_as_its_middle():
    thickness = 12.0
    tacton = Tacton(am_frequency=200, trajectory=Trajectory(shape="circle", size=0.01, speed=6.0))
    body = Body(sides="clamped", **(SMALL | {"depth": 1e-3 * thickness}))
    probes = ((0.0, 0.0), (0.01, 0.0))
    scene = Scene(pressure=MovingPressure(tacton=tacton), body=body, probes=probes)
    key = "body.thickness_mm"
    prepared = skinwave.prepare(scene, {key: (10.0, 12.0)}, h=7e-3)
    frequencies, found = parametric.lines(prepared, {key: thickness})
    made = build_at(prepared.bodies, [prepared.keys[0].share(thickness)])
    assert prepared.effort.dofs < 0.6 * len(operators(made).free), "the part on one side alone"
    strong = np.argsort(-np.linalg.norm(found, axis=1))[:3]
    expected = full_lines(scene, body, frequencies[strong], made=made)
    assert line_errors(found[strong], expected).max() < 0.01


def of_one_line(parts, outputs):
    q, r, _ = parts.shape
    return AffineModel(
        terms=(("stiffness", 0),) * q, parts=parts[None], outputs=outputs[None], basis=np.eye(r),
        forces=np.ones((1, 1, r), complex),
    )  # fmt: skip


def test_ranges_that_few_states_do_not_span_are_refused():
    # Each material resonates elsewhere, without loss: no few states span that.
    at = np.random.default_rng(0).uniform(0, 1, (30, 1, 30)).astype(complex)
    model = of_one_line(np.stack([np.diag(row) for row in np.eye(30)]), np.ones((1, 30)))
    with pytest.raises(ValueError, match="30 materials"):
        line_bases(model, at, np.ones((30, 1)), 1e-6, lambda x: None)


def test_keys_that_cannot_be_free_are_refused(slab):
    for free in (
        {}, {"body.size_x_mm": (30, 40)}, {"body.layers.0.thickness_mm": (1.0, 2.0)},
        {MODULUS: (2e4, 1e4)}, {MODULUS: (-1e4, 1e4)},
        {"body.material.prony.0.modulus_pa": (1e3, 2e3)},
    ):  # fmt: skip
        with pytest.raises(ValueError, match=next(iter(free), "free")):
            free_keys(slab.body, free)
    with pytest.raises(ValueError, match="finger"):
        free_keys(BODIES["fingertip"], {"body.thickness_mm": (13.0, 15.0)})
    strain = replace(slab, quantity="largest_shear_strain", depth=1e-3)
    with pytest.raises(ValueError, match="largest shear strain"):
        skinwave.prepare(strain, {"body.thickness_mm": (8.0, 12.0)})


def test_values_out_of_range_are_refused(prepared):
    for values, part in (
        ({MODULUS: 50e3, VISCOSITY: 5.0}, "15000 to 40000"),
        ({MODULUS: 20e3}, "body.material.viscosity_pa_s"),
        ({MODULUS: 20e3, VISCOSITY: 5.0, "body.size_x_mm": 3.0}, "body.size_x_mm"),
    ):
        with pytest.raises(ValueError, match=part):
            parametric.lines(prepared, values)


def test_scenes_that_sums_of_matrices_cannot_solve_are_refused(slab):
    for quantity in ("von_mises_stress", "energy_density"):
        with pytest.raises(ValueError, match="free material"):
            skinwave.prepare(replace(slab, quantity=quantity), RANGES)
    constant = replace(slab.pressure, tacton=Tacton(duration=0.01))
    with pytest.raises(ValueError, match="no oscillating line"):
        skinwave.prepare(replace(slab, pressure=constant), RANGES)
    open_sheet = "[body]\npreset='paper-sheet-loose'\n[body.mounting]\nedges=['left', 'right']"
    with pytest.raises(ValueError, match="frame"):
        skinwave.prepare(skinwave.loads(open_sheet), {"body.material.density_kg_m3": (700, 900)})


@pytest.fixture(scope="module")
def prepared_sheet():
    return skinwave.prepare(SCENE, OF_SHEETS, h=COARSE)


def own_lines(scene, body, frequencies):
    own = components(
        reduce_scene(replace(scene, body=body), SolveOptions(h=COARSE)), scene.pressure
    )
    return own.lines[[np.argmin(np.abs(own.frequencies - f)) for f in frequencies]]


def test_lines_in_air_are_those_of_each_sheets_own_reduction(prepared_sheet):
    for values in random_values(prepared_sheet.keys, 2):
        frequencies, found = parametric.lines(prepared_sheet, values)
        body = with_values(SHEET, prepared_sheet.keys, values)
        assert line_errors(found, own_lines(SCENE, body, frequencies)).max() < 0.003
        still = own_lines(SCENE, replace(body, air=False), frequencies)
        assert line_errors(found, still).max() > 0.1


def test_the_waveform_from_rest_is_that_of_the_sheets_own_body_and_balances_energy(prepared_sheet):
    (values,) = random_values(prepared_sheet.keys, 1, seed=2)
    scene = replace(SCENE, body=with_values(SHEET, prepared_sheet.keys, values))
    own = reduce_scene(scene, SolveOptions(h=COARSE))
    found, expected = parametric.answer(prepared_sheet, values), own_answer(own, SCENE)
    moving = np.linalg.norm(expected.values - expected.values.mean(axis=0))
    assert np.linalg.norm(found.values - expected.values) < 1e-3 * moving
    assert found.effort.energy_imbalance < 1e-6
    both = parametric.at(prepared_sheet, values), own
    free = [np.abs(each.poles.values).min() for each in both]
    assert free[0] == pytest.approx(free[1], rel=1e-4)


def test_a_line_of_the_full_body_in_air_is_that_of_dense_matrices():
    made = build(SHEET, 1.5e-2)
    affine = free_bodies.affine_operators(SHEET, made)
    (of_line,) = weights(affine.terms, Solids(materials=tuple(made.material.values())), [180.0])
    every = np.eye(len(affine.free))
    A = sum(w * (part @ every) for w, part in zip(of_line, affine.parts, strict=True))
    force = [1, 1j] @ np.random.default_rng(0).standard_normal((2, len(A)))
    expected = np.linalg.solve(A, force)
    for share in (0.0, 0.5):
        found = line_solution(affine, of_line, force, fluid_share=share)
        assert np.linalg.norm(found - expected) < 1e-6 * np.linalg.norm(expected)
    with pytest.raises(fem.Diverged, match="residual of 1e-08 in 1 iterations"):
        line_solution(affine, of_line, force, fluid_share=0.5, restart=1, cycles=1)


def test_a_fit_reduces_a_sheet_in_air_once(monkeypatch):
    whole = parametric.prepare
    coarse = lambda *given, **how: whole(*given, **how | {"h": 0.015})  # noqa: E731
    monkeypatch.setattr(parametric, "prepare", coarse)
    target = predicted.target_of(SCENE, "fem", SCENE.reading.record, SCENE.probe_points)
    parameters = parse([f"{MODULUS}=0.9e9:1.1e9", f"{THICKNESS}=0.09:0.11"], [])
    found = predicted.with_reduction(target, parameters, silent).reduced
    assert {key.key for key in found.keys} == {MODULUS, THICKNESS}


def test_sheets_that_one_reduction_does_not_serve_are_refused():
    narrow = replace(SHEET, width=0.03)
    with pytest.raises(ValueError, match=r"0\.3 mm"):
        free_keys(narrow, {THICKNESS: (0.2, 0.7)})
    assert free_keys(narrow, {THICKNESS: (0.2, 0.3)})
    with pytest.raises(ValueError, match="free thickness"):
        skinwave.prepare(replace(SCENE, quantity="displacement_x"), {THICKNESS: (0.1, 0.2)})
    open_edged = replace(SHEET, sides="absorbing", base="clamped")
    with pytest.raises(ValueError, match="absorbing sides"):
        skinwave.prepare(replace(SCENE, body=open_edged), {DENSITY: (700, 900)})
