"""Supports and layers of a body: moduli, sides one by one, elastic bases, stacks of layers."""

from dataclasses import replace
from math import inf

import numpy as np
import pytest

import fem
from bench.layered_skin import RANGES, values_of
from fem.boundary import springs
from fem.load_and_probe import facet_normals
from meshes import block, boundary_facets
from simple_model import Material, MovingPressure, Stack, Tacton, flat_body, from_young
from simple_model.layers.compliance import layered
from simple_model.layers.flat_quantities import quantity_field
from simple_model.layers.layered import surface_compliance
from simple_model.layers.wavenumber_integral import point_integrals
from simple_model.quantities import DISPLACEMENT
from skinwave import dumps, loads
from skinwave.bodies import BODIES, Sides
from skinwave.bodies.analytic import stack
from skinwave.bodies.build import build, operators
from skinwave.bodies.tissue import support
from skinwave.models.meshed import surface_load
from skinwave.models.options import SolveOptions
from skinwave.models.reduced import answer, reduce_scene
from skinwave.planning.extent import symmetry
from skinwave.planning.plan import plan
from skinwave.planning.simulate import compute
from skinwave.scene.scene import Body, Layer, Load, Scene, solid_of
from skinwave.verify.predictions import leading_wave

SOLID = Material(density=1000, shear_modulus=2e4, poisson=0.3, viscosity=6.0)
SOFT = Material(density=1000, shear_modulus=6e3, poisson=0.49, viscosity=2.0)
YOUNG = "[body.material]\ndensity_kg_m3 = 1000\npoisson = 0.25\nyoung_modulus_pa = 75e3\n"
WIDTH = 7e-3  # m, standard deviation: a spot that coarse elements resolve
BED = 3e6  # N/m3: a slab of 10 mm of SOLID is about twice as stiff in shear
LAYERS = (Layer(thickness=0.3e-3, material="epidermis"), Layer(thickness=4e-3, material="fat"))
SKIN = Scene(
    pressure=MovingPressure(tacton=Tacton(am_frequency=140, duration=0.05)),
    body=Body(material="muscle", layers=LAYERS), probes=((0.0, 0.0), (0.01, 0.0)),
)  # fmt: skip
TIMES = np.arange(500) / 1e4


def test_youngs_modulus_gives_the_shear_modulus():
    scene = loads(YOUNG)
    assert scene.body.solid == from_young(density=1000, young=75e3, poisson=0.25)
    assert scene.body.solid.shear_modulus == 30e3
    assert "shear_modulus_pa = 30000.0" in dumps(scene)
    assert "young" not in dumps(scene)
    assert loads(dumps(scene)) == scene
    assert loads(YOUNG + "shear_modulus_pa = 30e3").body == scene.body


def test_contradictory_moduli_are_refused():
    for text, said in [
        (YOUNG + "shear_modulus_pa = 29e3", r"a shear modulus of 30000 Pa .* = 29000"),
        (YOUNG.replace("poisson = 0.25", ""), "has young_modulus_pa without poisson"),
        (YOUNG.replace("75e3", "-1"), "has young_modulus_pa = -1"),
    ]:
        with pytest.raises(ValueError, match=said):
            loads(text)


def test_sides_have_one_condition_or_one_each():
    scene = loads('[body]\nsides = { left = "clamped", right = "free" }')
    free = {"left": "clamped", "right": "free", "front": "absorbing", "back": "absorbing"}
    assert scene.body.sides == Sides(**free)
    assert loads(dumps(scene)) == scene
    assert scene.body.is_held
    assert scene.body.symmetry == symmetry(scene) == "y"
    every = ", ".join(f'{side} = "free"' for side in ("left", "right", "front", "back"))
    assert loads(f"[body]\nsides = {{ {every} }}").body == loads('[body]\nsides = "free"').body


def test_invalid_supports_are_refused():
    for text, said in [
        ('sides = { lft = "free" }', "did you mean 'left'"),
        ('sides = { left = "elastic" }', "side 'elastic' is unknown, use one of clamped"),
        ('kind = "palm"\nsides = { left = "free" }', "its sides are front and back"),
        ('kind = "sheet"\nsides = { left = "free" }', "edges in its mounting"),
        ('base = "elastic"', "base_stiffness = 0 N/m3 of an elastic base must be"),
        ("base_stiffness_n_per_m3 = 1e6", "needs base = .elastic."),
        ('base = "elastic"\nbase_stiffness_n_per_m3 = 1e6\nthickness_mm = inf', "not a half-space"),
        ('kind = "sheet"\nbase = "elastic"\nbase_stiffness_n_per_m3 = 1e6', "not a sheet"),
    ]:
        with pytest.raises(ValueError, match=said):
            loads(f"[body]\n{text}")


def only(side):
    free = dict.fromkeys(("left", "right", "front", "back"), "free")
    return Sides(**free | {side: "clamped"})


@pytest.mark.parametrize(("side", "axis", "end"), [("left", 0, 1), ("back", 1, -1)])
def test_a_block_clamped_at_one_side_is_a_cantilever(side, axis, end):
    """Tip deflection q L^4 / 8 E I + q L^2 / 2 kappa G A (Timoshenko, kappa = 5/6)."""
    length, across, depth, solid = 0.02, 0.004, 0.004, replace(SOLID, poisson=0.0)
    size = {"width": across, "height": across} | {("width", "height")[axis]: length}
    body = Body(material=solid, **size, depth=depth, base="free", sides=only(side))
    made = build(body, 2e-3)
    assert made.fixed == {side: "xyz"}
    P, points = surface_load(made)
    u = fem.static(operators(made), P @ np.ones(len(points)))
    tip = np.zeros((1, 2))
    tip[0, axis] = end * length / 2
    bent = across * length**4 / (8 * solid.young * across * depth**3 / 12)
    sheared = across * length**2 / (2 * 5 / 6 * solid.shear_modulus * across * depth)
    found = (fem.probe_operator(made.mesh, tip) @ u)[0]
    assert found == pytest.approx(bent + sheared, rel=0.02)


def test_an_absorbing_base_replaces_a_half_space():
    scene = loads(
        "[tacton]\nam_frequency_hz = 20\nduration_s = 0.06\n[body]\nbase = 'absorbing'\n"
        "size_x_mm = 30\nsize_y_mm = 30\nthickness_mm = 12\n[probes]\npoints_mm = [[0, 0], [12, 0]]"
    )
    prepared = reduce_scene(scene, SolveOptions(h=10e-3), symmetry="xy")
    found, exact = answer(prepared, scene).values, compute(scene, "flat-body").values
    error = np.linalg.norm(found - exact, axis=0) / np.linalg.norm(exact, axis=0)
    assert error.max() < 0.08
    with pytest.raises(ValueError, match="gravity"):
        replace(scene, load=Load(gravity=9.81))


def elastic(*thicknesses, stiffness=BED, solids=(SOFT, SOLID)):
    base = {"base": "elastic", "base_stiffness": stiffness}
    return Stack(materials=solids[: len(thicknesses)], thicknesses=thicknesses, **base)


def test_a_column_on_springs_adds_both_compliances():
    """u = q (1 / k + sum H / M) of a uniform static pressure, and a resonance of the rigid slab."""
    stack = elastic(4e-3, 6e-3)
    moduli = [m.first_lame + 2 * m.shear_modulus for m in stack.materials]
    column = 1 / BED + 4e-3 / moduli[0] + 6e-3 / moduli[1]
    found = surface_compliance(stack, np.array([1e-2 + 0j]), np.zeros((1, 1), complex))
    assert found[0, 0].real == pytest.approx(column, rel=1e-5)
    hard = elastic(5e-3, solids=(replace(SOLID, shear_modulus=1e9),))
    w = np.array([[0.9 * np.sqrt(BED / 5.0)]], complex)
    rigid = surface_compliance(hard, np.array([1e-3 + 0j]), w)[0, 0]
    assert rigid.real == pytest.approx(1 / (BED * (1 - 0.81)), rel=1e-3)


def test_elements_on_springs_meet_the_wavenumber_integral():
    size = {"width": 0.06, "height": 0.06, "depth": 0.006}
    body = Body(material=SOLID, **size, base="elastic", base_stiffness=BED)
    made, xy, hz = build(body, 3e-3), np.array([[0.0, 0.0], [6e-3, 0], [0, 9e-3]]), 150.0
    P, points = surface_load(made)
    spot = np.exp(-(points[:, :2] ** 2).sum(axis=1) / 2 / WIDTH**2)
    u = fem.probe_operator(made.mesh, xy) @ fem.harmonic(operators(made), P @ spot, [hz])[0]
    field = quantity_field(DISPLACEMENT, stack(body))
    exact = point_integrals(field, np.hypot(*xy.T), [2 * np.pi * hz], WIDTH)[1, 0]
    # Of it 1.6 %: elements of 3 mm, and what the absorbing layer returns without a plan.
    assert np.abs(u - exact).max() < 0.02 * np.abs(exact).max()


def test_a_hand_rests_on_springs_where_it_faces_down():
    body = Body(kind="palm", base="elastic", base_stiffness=BED, sides="free")
    mesh = block((0.02, 0.03, 0.01), 5e-3)
    mesh = replace(mesh, facets={"top": mesh.facets["top"]})
    found = support(body, mesh, facet_normals(mesh, boundary_facets(mesh.tets)), [])
    below = facet_normals(mesh, found.facets)[:, 2] < -0.5
    np.testing.assert_array_equal(found.stiffness > 0, below)
    forces = springs(mesh, found) @ np.ones(mesh.n_dofs)
    np.testing.assert_allclose(forces.reshape(-1, 3).sum(axis=0), BED * 0.02 * 0.03)
    assert not found.absorbed.any()


def changed(**body):
    return replace(SKIN, body=replace(SKIN.body, **body))


@pytest.mark.parametrize(
    ("body", "base", "last"),
    [
        ({}, "clamped", 10.7e-3),
        ({"base": "free"}, "free", 10.7e-3),
        ({"base": "absorbing"}, "clamped", inf),
        ({"depth": inf}, "clamped", inf),
    ],
)
def test_a_slab_is_the_stack_of_its_layers(body, base, last):
    found = stack(changed(**body).body)
    assert found.materials == tuple(map(solid_of, ("epidermis", "fat", "muscle")))
    assert found.thicknesses == pytest.approx((0.3e-3, 4e-3, last))
    assert found.base == base or last == inf


@pytest.mark.parametrize("body", [{}, {"base": "absorbing"}])
def test_a_plan_takes_the_wavenumber_integral_of_layers(body):
    scene = changed(**body)
    required = plan(scene)
    assert required.model in ("flat-body", "flat-body-harmonic")
    found = compute(scene, "flat-body").displacement
    own = flat_body(layered(stack(scene.body)), scene.pressure, scene.probe_points, TIMES)
    np.testing.assert_array_equal(found, own.displacement)


@pytest.mark.parametrize(
    ("preset", "speeds", "lengths"),
    [("palm-layers", (8.5, 5.1), (40, 30)), ("forearm-layers", (3.5, 3.2), (21, 7.8))],
)
def test_wave_speeds_of_layers_agree_with_the_manual(preset, speeds, lengths):
    wave = leading_wave(BODIES[preset], [100.0, 200.0])
    assert wave.speed == pytest.approx(speeds, rel=0.03)
    assert 1e3 * wave.length == pytest.approx(lengths, rel=0.03)


@pytest.mark.parametrize("preset", RANGES)
def test_each_fitted_number_is_within_its_range(preset):
    found = values_of(BODIES[preset], RANGES[preset])
    for name, each in RANGES[preset].items():
        assert each.low <= found[name] <= each.high or found[name] == pytest.approx(each.low)
        assert each.source
