"""Sheets that are orthotropic, stretched or held in part: closed forms, elements beside Ritz."""

from dataclasses import replace

import numpy as np
import pytest

import fem
import meshes
from fem.finite_strain import shell_stiffness
from simple_model import MovingPressure, Tacton, from_young, orthotropic
from simple_model.plates.modes import plate_modes
from skinwave import dumps, loads, plan
from skinwave.bodies.build import build, operators
from skinwave.bodies.sheet import bending_equivalent
from skinwave.bodies.supports import EDGES, Mounting
from skinwave.models import named
from skinwave.models.limits import beyond
from skinwave.models.options import SolveOptions
from skinwave.models.plate_modes import middle_compliance, plate_of
from skinwave.planning.deflection import mean_sag
from skinwave.scene.scene import BODIES, Body, Scene

PAPER = orthotropic(density=800, young_x=5.5e9, young_y=2.5e9, poisson_xy=0.35)
WIDE, HIGH, DEEP = 0.12, 0.09, 1e-4
TENSION = (3.0, 1.0)  # N/m, as much as bending in the lowest mode
SMALL = Body(
    kind="sheet", width=0.06, height=0.05, depth=DEEP, material=PAPER, base="free", sides="clamped"
)
TWO = Mounting(edges=("left", "right"), tension_x=30.0, tension_y=10.0)
CLIPPED = Mounting(edges=("back",), clips=((-0.02, -0.02), (0.02, -0.02)), clip_radius=4e-3)
STRETCHED = """
[body]
kind = "sheet"
grammage_g_m2 = 60
[body.material]
density_kg_m3 = 750
young_x_pa = 6e9
young_y_pa = 2.5e9
poisson_xy = 0.3
shear_xy_pa = 1.4e9
[body.mounting]
clips_mm = [[-40, 40], [40, 40]]
clip_radius_mm = 6
tension_y_n_per_m = 12.5
curl_x_mm = -1.5
"""


def stiffnesses(material=PAPER):
    """D1, D2 and D3 of physics of thin plates, N m."""
    nu_yx = material.orthotropy.poisson_xy * material.orthotropy.young_y / 5.5e9
    inner = 12 * (1 - material.orthotropy.poisson_xy * nu_yx)
    D1, D2 = (E * DEEP**3 / inner for E in (5.5e9, 2.5e9))
    mean = np.sqrt(material.orthotropy.poisson_xy * nu_yx)
    shear = np.sqrt(5.5e9 * 2.5e9) / (2 * (1 + mean))
    return D1, D2, D1 * nu_yx + 2 * shear * DEEP**3 / 12


def closed_form(tension, most=6):
    """Natural frequencies in Hz of a simply supported plate, by half waves along x and y."""
    p, q = np.arange(1, most)[:, None], np.arange(1, most)
    a, b = p * np.pi / WIDE, q * np.pi / HIGH
    D1, D2, D3 = stiffnesses()
    stiffness = D1 * a**4 + 2 * D3 * a**2 * b**2 + D2 * b**4
    return np.sqrt((stiffness + tension[0] * a**2 + tension[1] * b**2) / 0.08) / (2 * np.pi)


def equivalent(thickness, material=PAPER):
    return bending_equivalent(material, DEEP / thickness)


def quarter(thickness, cells, x, y):
    lines = (np.linspace(0, side / 2, cells + 1) for side in (WIDE, HIGH))
    mesh = meshes.extrude(*lines, [-thickness, 0])
    middle = {"left": "x" if x == "even" else "yz", "front": "y" if y == "even" else "xz"}
    return mesh, {"right": "yz", "back": "xz", **middle}


@pytest.mark.parametrize("tension", [(0.0, 0.0), TENSION])
def test_six_frequencies_of_an_orthotropic_stretched_plate(tension):
    exact, thickness, found = np.sort(closed_form(tension), axis=None)[:6], 0.01 * HIGH, []
    for x, y in (("even", "even"), ("even", "odd"), ("odd", "even"), ("odd", "odd")):
        mesh, fixed = quarter(thickness, 15, x, y)
        stretched = fem.Tension(x=tension[0], y=tension[1])
        ops = fem.assemble(mesh, equivalent(thickness), fixed=fixed, tension=stretched)
        found.extend(fem.modes(ops, 3)[0])
    np.testing.assert_allclose(np.sort(found)[:6], exact, rtol=5e-3)
    mounting = Mounting(support="simply", tension_x=tension[0], tension_y=tension[1])
    body = replace(SMALL, width=WIDE, height=HIGH, mounting=mounting)
    np.testing.assert_allclose(plate_modes(plate_of(body)).frequencies[:6], exact, rtol=1e-6)


def test_stiffness_turns_with_the_axes_of_the_sheet():
    # A sheet that is tilted, and one whose grain is along y and whose sides are exchanged.
    mesh = meshes.sheet(0.06, 0.05, 1e-3, 0.012)
    material = equivalent(1e-3)
    along, across = (fem.Tension(x=x, y=y) for x, y in (TENSION, TENSION[::-1]))
    ops = fem.assemble(mesh, material, fixed="sides", tension=along)
    turn = np.array([[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]])
    tilted = replace(mesh, points=mesh.points @ turn.T)
    other = fem.assemble(tilted, material, fixed="sides", tension=along, axes=turn.T[:2])
    np.testing.assert_allclose(fem.modes(other, 3)[0], fem.modes(ops, 3)[0], rtol=1e-6)
    exchanged = orthotropic(density=800, young_x=2.5e9, young_y=5.5e9, poisson_xy=0.35 * 2.5 / 5.5)
    given = {"tension": across, "axes": np.eye(3)[[1, 0]] * [[1], [-1]]}
    third = fem.assemble(mesh, equivalent(1e-3, exchanged), fixed="sides", **given)
    assert abs(third.K - ops.K).max() < 1e-9 * abs(ops.K).max()


def test_frequencies_of_a_curled_sheet_are_those_of_a_shallow_shell():
    # m w^2 = D k^4 + E h kappa^2 b^4 / k^4, k^2 = a^2 + b^2: Donnell's equations on shear
    # diaphragms, by Airy's function of the membrane forces.
    solid, thickness = from_young(density=800, young=4e9, poisson=0.3), 0.01 * HIGH
    curvature = 8 * 2e-3 / WIDE**2
    a, b = np.arange(1, 6, 2)[:, None] * np.pi / WIDE, np.arange(1, 6, 2) * np.pi / HIGH
    bent = 4e9 * DEEP**3 / 12 / 0.91 * (a**2 + b**2) ** 2
    shell = 4e9 * DEEP * curvature**2 * b**4 / (a**2 + b**2) ** 2
    exact = np.sort(np.sqrt((bent + shell) / 0.08), axis=None)[:2] / (2 * np.pi)
    mesh, fixed = quarter(thickness, 15, "even", "even")
    middle = fem.Membrane(triangles=meshes.middle_plane(mesh), thickness=DEEP, material=solid)
    bend, share = lambda at: at * [-curvature, 0], (DEEP / thickness) ** 2
    stiffener = shell_stiffness(mesh, middle, bend, meshed=share)
    ops = fem.assemble(mesh, equivalent(thickness, solid), fixed=fixed, stiffener=stiffener)
    assert exact[0] > 1.5 * np.sqrt(bent[0, 0] / 0.08) / (2 * np.pi)
    np.testing.assert_allclose(fem.modes(ops, 2)[0], exact, rtol=7e-3)


@pytest.mark.parametrize("mounting", [TWO, CLIPPED, Mounting(support="simply")])
def test_elements_deflect_as_ritzs_plate_does(mounting):
    body, places = replace(SMALL, mounting=mounting), np.array([[0, 0], [0.011, 0.004]])
    made = build(body, 0.05 / 20)
    P = fem.pressure_operator(made.mesh)
    points = fem.facet_points(made.mesh)
    spot = np.exp(-(points[:, :2] ** 2).sum(axis=1) / 2 / 0.00435**2)
    u = fem.probe_operator(made.mesh, places) @ fem.static(operators(made), P @ spot)
    modes = plate_modes(plate_of(body))
    x, weight = np.polynomial.legendre.leggauss(40)
    shapes = modes.on_grid(0.025 * x, 0.025 * x)
    y = np.exp(-((0.025 * x) ** 2) / 2 / 0.00435**2) * weight * 0.025
    exact = modes.at(places) @ (np.outer(y, y).ravel() @ shapes / modes.squared)
    np.testing.assert_allclose(u, exact, rtol=0.025 if mounting.clips else 0.015)


def test_modes_of_a_sheet_in_clips_are_those_of_ritzs_plate():
    corners = tuple((x, y) for x in (-0.025, 0.025) for y in (-0.02, 0.02))
    body = replace(SMALL, mounting=Mounting(edges=(), clips=corners, clip_radius=5e-3))
    found = fem.modes(operators(build(body, 0.05 / 32, symmetry="xy")), 4)[0]
    even = plate_modes(plate_of(body)).families[0].squared[:4]
    np.testing.assert_allclose(found, np.sqrt(even) / 2 / np.pi, rtol=4e-3)


def test_steady_motion_by_plate_modes_is_that_of_elements():
    lossy = replace(PAPER, loss_factor=0.03)
    body = replace(SMALL, material=lossy, mounting=replace(TWO, edges=tuple(EDGES),
                   support="simply"), air=True)  # fmt: skip
    pressure = MovingPressure(tacton=Tacton(am_frequency=140, duration=1.0))
    scene = Scene(pressure=pressure, body=body, probes=((0.0, 0.0), (0.01, 0.005)))
    times, options = np.arange(10_000) / 1e4, SolveOptions(h=2.5e-3)
    wave = np.exp(-2j * np.pi * 140 * np.arange(1000) / 1e4)
    ritz, elements = (
        abs(wave @ named(model).solve(scene, times, options).values[9000:])
        for model in ("plate-modes", "fem")
    )
    np.testing.assert_allclose(ritz, elements, rtol=0.01)


def test_the_sag_of_any_support():
    scene = Scene(pressure=MovingPressure(tacton=Tacton(am_frequency=140)), body=SMALL)
    elastic = replace(fem.PRESETS["paper"], loss_factor=0.0)
    square = replace(SMALL, width=0.1, height=0.1, material=elastic)
    simply = replace(square, mounting=Mounting(support="simply"))
    # Timoshenko and Woinowsky-Krieger (1959), tables 23 and 37.
    two = replace(scene.tacton, foci=(0.0, 0.5))  # with half the pressure each
    halved = replace(scene, pressure=replace(scene.pressure, tacton=two))
    assert mean_sag(halved) == pytest.approx(mean_sag(scene), rel=1e-3)
    for body, published in ((square, 0.0056), (simply, 0.0116)):
        found = middle_compliance(body) * body.bending_stiffness / 0.1**2
        assert found == pytest.approx(published, rel=5e-3)
    lossy = replace(elastic, loss_factor=0.1)
    sags = [mean_sag(replace(scene, body=replace(b, material=lossy))) for b in (simply, square)]
    assert sags[0] / sags[1] == pytest.approx(0.0116 / 0.0056, rel=5e-3)
    softer = lossy.complex_modulus(0.0).real / lossy.shear_modulus
    assert sags[1] * softer == pytest.approx(mean_sag(replace(scene, body=square)), rel=1e-9)


def test_scenes_of_sheets_are_read_and_written():
    scene = loads(STRETCHED)
    assert loads(dumps(scene)) == scene
    body = scene.body
    assert body.depth == pytest.approx(80e-6)
    assert body.mass_per_area == pytest.approx(0.06)
    assert (body.mounting.edges, body.mounting.tension_y) == ((), 12.5)
    assert body.solid.plane_stress[2, 2] == 1.4e9
    thick = loads(STRETCHED.replace("grammage_g_m2 = 60", "grammage_g_m2 = 60\nthickness_mm = 0.1"))
    assert (thick.body.depth, thick.body.solid.density) == (1e-4, pytest.approx(600))
    assert loads(dumps(thick)) == thick
    assert loads(dumps(replace(scene, body=BODIES["a4-sheet"]))).body == BODIES["a4-sheet"]


def test_invalid_sheets_are_refused():
    for text, said in [
        ('[body]\nkind = "slab"\nmaterial = "paper-grain"', "orthotropic material is for a sheet"),
        ('[body]\nkind = "slab"\ngrammage_g_m2 = 80', "grammage_g_m2 is for a sheet"),
        ('[body]\nkind = "sheet"\nmounting = {edges = []}', "unconstrained"),
        ('[body]\nkind = "sheet"\nmounting = {tension_x_n_per_m = -1}', "0 or above"),
        ('[body]\nkind = "sheet"\nmounting = {clips_mm = [[80, 0]]}', "outside the sheet"),
        ('[body]\nkind = "sheet"\nmounting = {edges=["left"], support="simply"}', "turns about"),
        ('[body]\nkind="sheet"\nsides="absorbing"\nmounting={tension_x_n_per_m=1}', "absorb"),
        ('[body]\nkind = "sheet"\ngrammage_g_m2 = 0', "above 0"),
    ]:
        with pytest.raises(ValueError, match=said):
            loads(text)


def test_models_refuse_sheets_that_they_do_not_cover():
    def refused(model, body):
        load = MovingPressure(tacton=Tacton(am_frequency=140))
        return beyond(named(model), Scene(pressure=load, body=body, probes=((0.0, 0.0),)))

    assert [limit.cure for limit in refused("flat-body", SMALL)] == ["use an isotropic material"]
    two = replace(SMALL, material="paper", mounting=TWO)
    assert len(refused("flat-body", two)) == 1
    assert not refused("flat-body", replace(two, mounting=replace(TWO, tension_y=30.0)))
    for model in ("flat-body", "plate-modes", "fem-nonlinear"):
        assert len(refused(model, replace(two, mounting=Mounting(curl_y=1e-3)))) == 1
    (limit,) = refused("fem-transient", replace(two, air="free"))
    assert limit.cure == "set air = false"
    assert not refused("plate-modes", replace(two, air="free"))
    assert not refused("fem", replace(two, air="free"))
    with pytest.raises(ValueError, match='hold all edges, or use air = "free"'):
        replace(two, air="baffle")
    for unknown in ("none", ""):
        with pytest.raises(ValueError, match="or false for vacuum"):
            replace(two, air=unknown)
    lossy = replace(two, mounting=replace(TWO, edge_loss=0.01))
    assert [limit.cure for limit in refused("fem", lossy)] == ["set edge_loss = 0"]
    assert not refused("plate-modes", lossy)
    assert len(refused("plate-modes", replace(SMALL, sides="absorbing"))) == 1
    scene = Scene(pressure=MovingPressure(tacton=Tacton(am_frequency=140)), body=two)
    required = plan(scene, SolveOptions(model="plate-modes"))
    assert (required.model, required.h) == ("plate-modes", None)


@pytest.mark.parametrize("losses", [{"viscosity": 5e4}, {"loss_factor": 0.3}])
def test_a_sheet_from_rest_starts_by_pressure_over_mass(losses):
    solid = from_young(density=800, young=1.3e9, poisson=0.3, **losses)
    body = replace(SMALL, material=solid, width=0.02, height=0.02, depth=2e-4)
    load, places = MovingPressure(tacton=Tacton(duration=0.03)), ((0.0, 0.0), (0.005, 0.0))
    scene = Scene(pressure=load, body=body, probes=places, quantity="acceleration")
    times = np.arange(300) / 1e4
    found = named("plate-modes-transient").solve(scene, times, SolveOptions()).values[0]
    pressed = scene.pressure(np.array([[0.0, 0.0, 0.0], [0.005, 0.0, 0.0]]), 0.0)
    np.testing.assert_allclose(found, pressed / 0.16, rtol=0.03)


def test_modes_that_loss_couples_are_at_rest_at_first():
    body = replace(SMALL, material=replace(PAPER, loss_factor=0.3), mounting=TWO)
    load = MovingPressure(tacton=Tacton(am_frequency=140, duration=0.05))
    scene = Scene(pressure=load, body=body, probes=((0.005, 0.0),))
    motion = named("plate-modes-transient").solve(scene, np.arange(500) / 1e4, SolveOptions())
    assert np.abs(motion.values[0]).max() < 1e-6 * np.abs(motion.values).max()


def test_a_sheet_smaller_than_the_default_frame_can_be_stretched():
    small = replace(BODIES["a6-sheet"], width=0.01, height=0.01, mounting=Mounting(tension_x=10.0))
    with pytest.raises(ValueError, match="frame_width_mm = 30 is wider than the sheet"):
        replace(small, mounting=Mounting(frame_width=0.03))
