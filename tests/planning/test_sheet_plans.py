"""Sheets from rest by their modes, linear and stretched, and plans that choose them."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import fem
from simple_model import MovingPressure, Stack, Tacton, Trajectory, flat_body, from_young
from simple_model.layers.compliance import layered
from skinwave import plan
from skinwave.bodies.supports import Mounting
from skinwave.models import named
from skinwave.models.limits import cures_for
from skinwave.models.options import SolveOptions
from skinwave.models.plate_modes import FROM_REST, sheet_motion
from skinwave.planning.plan import cheapest_model, why_modes
from skinwave.planning.plan_warnings import large_deflection
from skinwave.planning.simulate import compute, solve_as_planned
from skinwave.results.comparison import compare
from skinwave.scene.file import loads
from skinwave.scene.scene import BODIES, Body, Scene

SOLID = from_young(density=800, young=4e9, poisson=0.3)
VISCOUS = replace(SOLID, viscosity=0.06 * SOLID.shear_modulus / (2 * np.pi * 200))
STRETCHED = Body(
    kind="sheet", width=0.06, height=0.05, depth=1e-4, material=VISCOUS, base="free",
    sides="clamped", mounting=Mounting(support="simply", tension_x=20.0, tension_y=20.0),
)  # fmt: skip


def test_modes_from_rest_agree_with_elements():
    circle = Trajectory(shape="circle", size=0.012, speed=3.0)
    pressure = MovingPressure(tacton=Tacton(am_frequency=140, duration=0.1, trajectory=circle))
    scene = Scene(pressure=pressure, body=STRETCHED, probes=((0.0, 0.0), (0.01, 0.005)))
    times, options = np.arange(1000) / 1e4, SolveOptions(h=2.5e-3)
    elements, modes, steady = (
        named(model).solve(scene, times, options).values
        for model in ("fem", FROM_REST.name, "plate-modes")
    )
    size = np.linalg.norm(elements)
    assert np.linalg.norm(modes - elements) < 0.02 * size
    assert np.linalg.norm(steady - elements) > 0.3 * size
    assert np.abs(modes[0]).max() < 1e-5 * np.abs(modes).max()
    velocity = replace(scene, quantity="velocity")
    rate = compute(velocity, FROM_REST.name).values[1:-1]
    assert rate == pytest.approx(np.gradient(modes, 1e-4, axis=0)[1:-1], abs=0.01 * rate.max())


@pytest.mark.parametrize(
    ("size", "edges"), [("297, 210", "left, right, front, back"), ("210, 148", "left, right")]
)
def test_sheets_in_frames_and_between_edges_are_planned_and_run(size, edges):
    (x, y), held = size.split(", "), edges.split(", ")
    scene = loads(
        "[tacton]\nam_frequency_hz = 140\nshape = 'circle'\nsize_mm = 20\nspeed_m_per_s = 12\n"
        f"[focus]\npeak_pressure_pa = 0.01\n[body]\nkind = 'sheet'\nsize_x_mm = {x}\n"
        f"size_y_mm = {y}\nthickness_mm = 0.12\nair = true\nmaterial = 'paper-grain'\n"
        f"[body.mounting]\nedges = {held}\ntension_x_n_per_m = 20\n"
        "[probes]\npoints_mm = [[0, 2], [5, 2]]\nquantity = 'velocity'"
    )
    required = plan(scene)
    assert (required.model, required.h) == (FROM_REST.name, None)
    assert "need no mesh" in required.rows[1].reason
    found = solve_as_planned(scene, required)
    assert found.model == FROM_REST.name
    assert 0 < found.expected_error <= 0.05
    assert np.abs(found.values[0]).max() < 0.01 * np.abs(found.values).max()


def test_curled_sheets_other_bodies_and_small_tolerances_stay_with_elements():
    sheet = BODIES["a4-sheet"]
    curled = replace(sheet, mounting=Mounting(curl_x=1e-3))
    for body, tolerance in ((BODIES["skin-slab"], 0.05), (curled, 0.05), (sheet, 5e-3)):
        scene = Scene(pressure=MovingPressure(tacton=Tacton()), body=body)
        assert why_modes(scene, tolerance) == ""


@pytest.mark.parametrize(
    ("pressure", "model"), [(5.0, "plate-modes-nonlinear"), (0.1, FROM_REST.name)]
)
def test_a_sheet_that_stretches_is_planned_as_one(pressure, model):
    load = MovingPressure(tacton=Tacton(am_frequency=140, duration=0.05), peak_pressure=pressure)
    scene = Scene(pressure=load, body=BODIES["paper-sheet-loose"], probes=((0.01, 0.005),))
    assert plan(scene).model == model
    assert cheapest_model(scene) == model


@pytest.mark.parametrize("pressure", [3.0, 10.0])
def test_the_error_of_linear_bending_is_stated(pressure):
    load = MovingPressure(tacton=Tacton(am_frequency=140, duration=0.1), peak_pressure=pressure)
    scene = Scene(pressure=load, body=BODIES["paper-sheet-loose"], probes=((0.01, 0.005),))
    required = plan(scene, SolveOptions(model=FROM_REST.name))
    linear = solve_as_planned(scene, required)
    true = compare(compute(scene, "plate-modes-nonlinear"), linear).relative_l2.max()
    assert true < 1.1 * linear.expected_error
    assert linear.expected_error < 2 * true + 0.02


SLOW = replace(SOLID, loss_factor=0.003)


def test_stretching_is_stated_for_a_resonance_that_builds_up_slowly():
    """The first 0.2 s deflect the sheet half as far as the whole record."""
    load = MovingPressure(tacton=Tacton(am_frequency=132.478, duration=0.6), peak_pressure=0.03)
    body = replace(STRETCHED, material=SLOW, mounting=Mounting())
    scene = Scene(pressure=load, body=body, probes=((0.0, 0.0), (0.01, 0.005)))
    linear = plan(scene, SolveOptions(model=FROM_REST.name))
    largest = linear.statement.parts[0]
    assert largest.name == "stretching"
    assert any("stretching" in sentence for sentence in linear.warnings)
    bent = compute(scene, "plate-modes-nonlinear", tolerance=0.1).values
    change = np.linalg.norm(compute(scene, FROM_REST.name).values - bent, axis=0)
    true = (change / np.linalg.norm(bent, axis=0)).max()
    assert true > 0.1
    assert true / 1.1 < linear.error < 1.5 * true
    assert plan(scene).model == "plate-modes-nonlinear"


def test_errors_of_steps_and_modes_are_those_of_the_whole_record():
    """They grow with a record in which a resonance builds up."""
    material = replace(SOLID, loss_factor=0.005)
    body = replace(STRETCHED, material=material, mounting=Mounting())
    load = MovingPressure(tacton=Tacton(am_frequency=160, duration=0.3), peak_pressure=25)
    scene = Scene(pressure=load, body=body, probes=((0.0, 0.0), (0.01, 0.005)))
    found = compute(scene, "plate-modes-nonlinear", tolerance=0.1)
    options = SolveOptions(dt=found.effort.dt, tolerance=0.005)  # with the most modes
    finer = named("plate-modes-nonlinear").solve(scene, found.times, options).values
    change = (np.linalg.norm(found.values - finer, axis=0) / np.linalg.norm(finer, axis=0)).max()
    (stated,) = (p.error for p in found.effort.errors.parts if p.name == "steps and modes")
    assert change < 1.1 * stated
    assert stated < 5 * change


def test_extrapolated_steps_converge_with_the_fourth_power_of_their_length():
    load = MovingPressure(tacton=Tacton(am_frequency=140, duration=0.05), peak_pressure=50)
    scene = Scene(pressure=load, body=STRETCHED, probes=((0.0, 0.0), (0.01, 0.005)))
    times = np.arange(500) / 1e4
    coarse, fine, finest = (
        named("plate-modes-nonlinear").solve(scene, times, SolveOptions(dt=dt)).values
        for dt in (1e-4, 5e-5, 2.5e-5)
    )
    assert np.linalg.norm(fine - finest) < np.linalg.norm(coarse - finest) / 8


def test_the_map_of_a_stretching_sheet_shows_the_motion_of_its_probes():
    load = MovingPressure(tacton=Tacton(am_frequency=140, duration=0.05), peak_pressure=50)
    scene = Scene(pressure=load, body=STRETCHED, probes=((0.0, 0.0), (0.01, 0.005)))
    found = compute(scene, "plate-modes-nonlinear").values
    _, z, shapes = sheet_motion(scene, 0.05)
    moved = z @ shapes(scene.probe_points).T
    assert moved == pytest.approx(found, abs=1e-3 * np.abs(found).max())


THICK = """
[tacton]
am_frequency_hz = 88.58
duration_s = 0.2
[focus]
drive = "linear"
peak_pressure_pa = 0.01
[body]
kind = "sheet"
size_x_mm = 60
size_y_mm = 60
thickness_mm = THICKNESS
[body.material]
density_kg_m3 = 1000
young_modulus_pa = 1e6
poisson = 0.3
loss_factor = 0.05
[body.mounting]
support = "simply"
[probes]
points_mm = [[0, 0]]
"""


def test_the_theory_of_thin_plates_is_not_used_for_thick_ones():
    """Mindlin's first frequency is 88.58 Hz where that of a thin plate is 100 Hz."""
    scene = loads(THICK.replace("THICKNESS", "12"))
    thin = plan(scene, SolveOptions(model=FROM_REST.name))
    assert thin.statement.parts[0].name == "thin plate"
    assert "--model fem" in thin.warnings[0]
    elements = compute(scene, "fem", h=6e-3).values
    change = np.linalg.norm(compute(scene, FROM_REST.name).values - elements)
    true = change / np.linalg.norm(elements)
    assert true > 0.5
    assert true / 1.1 < thin.error < 3 * true
    planned = plan(scene, SolveOptions(tolerance=0.2))
    assert planned.model == "fem"
    assert planned.error < 0.2  # elements have the shear and inertia of a sheet as thick as theirs
    assert plan(loads(THICK.replace("THICKNESS", "0.5"))).model == FROM_REST.name


@pytest.mark.parametrize("thickness", [3, 12])
def test_a_wavenumber_integral_of_a_thick_sheet_states_its_shear(thickness):
    text = THICK.replace('support = "simply"', "").replace("THICKNESS", str(thickness))
    scene = loads(text.replace("[body.material]", 'sides = "absorbing"\n[body.material]'))
    planned = plan(scene, SolveOptions(model="flat-body"))
    (part,) = (part for part in planned.statement.parts if part.name == "thin plate")
    exact = layered(
        Stack(materials=(scene.body.solid,), thicknesses=(scene.body.depth,), base="free")
    )
    thin = compute(scene, "flat-body")
    elastic = flat_body(exact, scene.pressure, scene.probe_points, thin.times).values
    true = np.linalg.norm(thin.values - elastic) / np.linalg.norm(elastic)
    assert true / 1.1 < part.error < 3 * true


@pytest.mark.parametrize("mounting", ['edges = ["left", "right"]', "tension_x_n_per_m = 5"])
def test_the_cure_of_a_stretching_warning_can_be_computed(mounting):
    text = (
        "[tacton]\nam_frequency_hz = 140\nduration_s = 0.02\n[body]\nkind = 'sheet'\n"
        "size_x_mm = 40\nsize_y_mm = 40\nair = true\n[body.mounting]\n" + mounting
    )
    scene = loads(text + "\n[probes]\npoints_mm = [[0, 0]]")
    response = compute(scene, FROM_REST.name)
    (said,) = large_deflection(scene, response)
    (cure,) = cures_for(scene, named("plate-modes-nonlinear"))
    assert cure.words in said
    assert np.isfinite(compute(cure.scene, cure.model).values).all()


def test_a_reduction_out_of_reach_names_the_model_that_works(monkeypatch):
    monkeypatch.setattr(fem, "reduce", partial(fem.reduce, most_moments=6))
    pressure = MovingPressure(tacton=Tacton(am_frequency=140, duration=0.05))
    scene = Scene(pressure=pressure, body=STRETCHED, probes=((0.01, 0.005),))
    with pytest.raises(ValueError, match="6 moments.*use --model"):
        plan(scene, SolveOptions(model="fem", h=0.005))
    slab = Scene(pressure=pressure, body=Body(width=0.04, height=0.04, sides="clamped"))
    with pytest.raises(ValueError, match="6 moments.*use --model"):
        plan(slab, SolveOptions(model="fem", h=0.01))
