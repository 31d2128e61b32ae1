"""Plans: model, extent, mesh and stated error of a scene, and of the start from rest."""

import re
import warnings
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from corpus import FREE, SHORT
from scipy.integrate import simpson
from scipy.special import i0, i1, j0, j1

import skinwave.planning.extent
from bench.plans import MOST, stated_and_true
from simple_model import Effort, Material, MovingPressure, Tacton, Trajectory
from simple_model.load.spectrum import load_lines
from skinwave import SkinwaveWarning, loads, simulate
from skinwave.bodies.build import build
from skinwave.bodies.sizes import check_mesh, coarsest_size, default_size
from skinwave.bodies.slab import discretise
from skinwave.bodies.supports import Mounting
from skinwave.models import named
from skinwave.models.options import SolveOptions
from skinwave.models.reduced import answer, reduce_scene
from skinwave.planning.estimates import ESTIMATE, cutoff_frequency, side_reflections
from skinwave.planning.extent import absorbing_error, extent
from skinwave.planning.plan import plan
from skinwave.planning.refinement import (
    SizeController,
    above_band,
    element_sizes,
    refine,
    refinement_ratio,
)
from skinwave.planning.simulate import compute
from skinwave.results.comparison import compare
from skinwave.scene.scene import BODIES, Body, Layer, Scene, Sides

LOSSLESS = (
    "material = {density_kg_m3=1000, shear_modulus_pa=25e3, poisson=0.4999, viscosity_pa_s=VISCOUS}"
)
SILICONE = LOSSLESS.replace("VISCOUS", "3")
OVERDAMPED = LOSSLESS.replace("25e3, poisson=0.4999", "1e3, poisson=0.499").replace("VISCOUS", "50")
ADRIFT = """
size_x_mm = 30
base = "free"
sides = {left = "absorbing", right = "free", front = "free", back = "free"}
"""
UPPER, MIDDLE, LOWER = (
    Material(density=1000, shear_modulus=mu, poisson=nu, viscosity=eta)
    for mu, nu, eta in ((23400, 0.4999, 4.8), (26300, 0.49, 7.5), (20500, 0.49, 6.4))
)
LAYERS = Scene(
    pressure=MovingPressure(tacton=Tacton(am_frequency=136, duration=0.041)),
    body=Body(
        width=0.021, height=0.0244, depth=0.0085, sides="clamped", material=LOWER,
        layers=tuple(Layer(thickness=1.8e-3, material=solid) for solid in (UPPER, MIDDLE)),
    ),
    probes=((0.8e-3, 7.6e-3), (1.1e-3, 4.4e-3), (8.0e-3, 6.2e-3)),
)  # fmt: skip
LAYER = Scene(
    pressure=MovingPressure(tacton=Tacton(am_frequency=140, duration=0.03)),
    body=Body(width=0.024, height=0.024, depth=0.01), probes=((0.0, 0.0), (0.005, 0.0)),
)  # fmt: skip
SMALL = Body(width=0.012, height=0.012, depth=0.006)
BLOCK = replace(LAYER, body=SMALL, probes=((0.0, 0.0), (0.003, 0.0)))
TONGUE = {"width": 0.03, "height": 0.03, "depth": 2e-4, "mounting": Mounting(edges=("front",))}
CANTILEVER = Scene(
    pressure=MovingPressure(tacton=Tacton(am_frequency=60, duration=0.05), peak_pressure=0.1),
    body=replace(BODIES["paper-sheet-loose"], **TONGUE), probes=((0.0, 0.0), (0.005, 0.005)),
)  # fmt: skip


def test_the_plan_prefers_wavenumber_integrals():
    assert plan(loads(SHORT)).model == "flat-body"
    assert plan(loads("[body]\nkind = 'none'")).model == "point-kernel"
    assert plan(loads("[body]\nthickness_mm = inf")).model == "flat-body"


def test_a_slab_without_loss_is_planned():
    text = SHORT.replace("[body]", f"[body]\n{LOSSLESS}")
    scene = loads(text.replace("VISCOUS", "1e-6"))
    for required in (plan(scene), plan(scene, SolveOptions(model="flat-body"))):
        assert required.model == "flat-body"
        assert required.error < 0.05
        assert required.warnings == ()
    assert np.isfinite(simulate(scene).displacement).all()


@pytest.mark.parametrize(
    ("body", "profile"),
    [({"width": 0.026, "height": 0.026, "sides": "free"}, "gaussian"),
     ({"width": 0.04, "height": 0.04}, "array")],
)  # fmt: skip
def test_the_plan_takes_elements_where_sides_reflect_or_the_focus_has_lobes(body, profile):
    load = MovingPressure(tacton=Tacton(duration=0.1), profile=profile)
    scene = replace(LAYER, pressure=load, body=Body(**body))
    loose, tight = (plan(scene, SolveOptions(tolerance=x)) for x in (0.3, 0.1))
    assert loose.model == tight.model == "fem"
    assert tight.h <= loose.h
    assert loose.error <= 0.3
    assert tight.error <= 0.1
    assert tight.highest >= loose.highest


def test_a_long_steady_pattern_needs_no_start():
    scene = loads(SHORT.replace("duration_s = 0.05", "duration_s = 0.5"))
    for shape in ("point", "circle"):
        path = Trajectory(shape=shape, size=0.02, speed=9.0)
        asked = replace(scene, pressure=replace(scene.pressure, tacton=replace(
            scene.tacton, trajectory=path)))  # fmt: skip
        required = plan(asked, SolveOptions(tolerance=0.25))
        assert required.model == "flat-body-harmonic"
        whole, steady = (compute(asked, model) for model in ("flat-body", required.model))
        left = compare(whole, steady).relative_l2.max()
        assert left > 0.01
        assert required.error == pytest.approx(left, rel=0.02)
        late = whole.times > 0.4
        np.testing.assert_allclose(steady.displacement[late], whole.displacement[late],
                                   atol=3e-3 * np.abs(whole.displacement).max())  # fmt: skip
        tight = 0.9 * left
        assert plan(asked, SolveOptions(tolerance=tight)).model == "flat-body"
        said = plan(asked, SolveOptions(tolerance=tight, model="flat-body-harmonic")).warnings
        assert any("initial transient" in warning for warning in said)
    assert plan(scene, SolveOptions(tolerance=0.25, model="fem")).model == "fem"


def test_sides_without_reflections_need_no_elements():
    lossy = LOSSLESS.replace("25e3, poisson=0.4999", "10e3, poisson=0.499").replace("VISCOUS", "9")
    text = f"[tacton]\nam_frequency_hz = 200\n[body]\nsides = 'free'\n{lossy}"
    for tolerance, model in ((0.12, "flat-body-harmonic"), (0.08, "flat-body")):
        required = plan(loads(text), SolveOptions(tolerance=tolerance))
        assert required.model == model
        assert 0 < required.error < tolerance


@pytest.mark.parametrize(
    ("material", "width", "duration", "h", "low"),
    [(SILICONE, 100, 0.03, 0.005, 0.15), (OVERDAMPED, 80, 0.02, 0.004, 0.25)],
)
def test_the_estimated_reflections_bound_the_true_ones(material, width, duration, h, low):
    scene = loads(
        f"[tacton]\nduration_s = {duration}\n[body]\nsides = 'free'\nsize_x_mm = {width}\n"
        f"size_y_mm = {width}\n{material}"
    )
    returned = side_reflections(scene)
    found = compare(compute(scene, "fem", h=h), compute(scene, "flat-body")).relative_l2
    assert low < found.max() < 1.5 * returned
    assert returned < 6 * found.max()


THIN = """
[tacton]
am_frequency_hz = 1361
duration_s = 0.05
[focus]
drive = "linear"
profile = "gaussian"
[body]
kind = "disc"
size_x_mm = 40
size_y_mm = 40
thickness_mm = 1
base = "free"
sides = "clamped"
[body.material]
density_kg_m3 = 1200
young_modulus_pa = 3e9
poisson = 0.3
viscosity_pa_s = 100
[probes]
points_mm = [[0, 0]]
"""


def clamped_disc(scene):
    """Amplitude in m at the middle of a clamped circular plate, by its modes (Leissa 1969)."""
    body, f = scene.body, scene.tacton.am_frequency
    a, omega = body.width / 2, 2 * np.pi * f
    stiffness = body.bending_stiffness * (1 + 1j * omega * 100 / body.solid.shear_modulus)
    grid = np.linspace(1, 40, 4000)
    value = j0(grid) * i1(grid) + i0(grid) * j1(grid)
    turns = np.flatnonzero(value[1:] * value[:-1] < 0)
    r = np.linspace(0, a, 2001)
    spot = scene.pressure.spot(np.column_stack([r, 0 * r, 0 * r]), np.zeros((1, 2)))[0]
    total = 0.0
    for k in (grid[turns] + grid[turns + 1]) / 2:
        shape = j0(k * r / a) - j0(k) / i0(k) * i0(k * r / a)
        force = simpson(shape * spot * r, x=r) / simpson(shape**2 * r, x=r)
        total += shape[0] * force / (stiffness * (k / a) ** 4 - body.mass_per_area * omega**2)
    return abs(total) * load_lines(scene.pressure, 1e-6).strengths[-1]


def test_thin_bodies_have_wide_elements_and_a_band_for_their_load():
    scene = loads(THIN)
    planned = plan(scene, SolveOptions(tolerance=0.4))
    assert planned.h > 0.5 * scene.body.depth
    assert planned.error < 0.4  # without the motion above 1 kHz
    steady = compute(scene, "fem-harmonic", h=planned.h).values
    true = clamped_disc(scene)
    assert np.ptp(steady) / 2 == pytest.approx(true, rel=0.02)
    slab = loads(THIN.replace('"disc"', '"slab"'))
    assert side_reflections(slab) == ESTIMATE.unknown  # at 1361 Hz, too


def test_a_quantity_that_converges_at_the_order_of_the_controller_is_extrapolated_exactly():
    controller = SizeController(order=2.0, margin=1.0, safety=0.5, largest_factor=1.6)
    limit = np.array([[3.0, -2.0], [4.0, 1.0]])

    def value(h):  # of which the change is the error itself
        return limit * (1 + h**2)

    fine, true = value(0.1), 0.1**2 / (1 + 0.1**2)
    assert controller.error(value(0.15), fine, 1.5) == pytest.approx(true, rel=1e-12)
    assert controller.error(value(0.05), fine, 0.5) == pytest.approx(true, rel=1e-12)
    size = controller.size(0.1, 0.1**2, 0.08)
    assert size**2 == pytest.approx(0.04)  # half of what is asked for is left
    sizes = np.array([0.1, 0.08, 0.0625, 0.05])
    assert controller.nearest(sizes, 0.1, 1e-2, 0.0124) == 0.08
    assert controller.nearest(sizes, 0.1, 1.0, 0.01) == 0.0625  # by the largest factor at most


@pytest.mark.parametrize("h", [0.0075, 0.0049])
def test_the_expected_error_of_a_mesh_is_near_the_true_one(h):
    scene = loads(SHORT.replace("size_x_mm = 60\nsize_y_mm = 60", "size_x_mm = 40\nsize_y_mm = 40"))
    found = refine(scene, scene.body, SolveOptions(tolerance=0.05, h=h))
    true = compare(answer(found.prepared, scene), compute(scene, "flat-body")).relative_l2.max()
    assert 0.9 < found.error / true < 3.3


def test_an_unconstrained_body_is_warned_of():
    text = SHORT.replace("size_x_mm = 60", ADRIFT)
    scene = loads(text)
    warnings = plan(scene, SolveOptions(tolerance=0.3, model="fem", h=0.01)).warnings
    assert any("unconstrained" in warning for warning in warnings)
    steady = compute(scene, "fem-harmonic", h=0.01).displacement
    assert np.abs(steady).max() < 1e-4  # and no mean, which would have no bound


def test_meshes_of_a_palm_resolve_its_layers():
    fat = Layer(thickness=3e-3, material="fat")  # what is below it is no coat
    thin = Body(kind="palm", layers=(fat, Layer(thickness=1e-3, material="dermis")))
    assert default_size(thin) == coarsest_size(thin) == 2e-3
    thick = Body(kind="palm", layers=(Layer(thickness=2.5e-3, material="dermis"),))
    assert default_size(thick) == default_size(Body(kind="palm"))
    fine = Body(kind="palm", layers=(fat, Layer(thickness=0.6e-3, material="epidermis")))
    for body, h, cure in ((thin, 2.1e-3, "elements of 2 mm"), (fine, 2e-3, "elements of 1.2 mm")):
        with pytest.raises(ValueError, match=f"thinner than half an element.*use {cure}, thicker"):
            check_mesh(body, h)


def test_a_layer_that_no_mesh_of_a_palm_resolves_is_refused():
    fat = Layer(thickness=3e-3, material="fat")
    thin = Body(kind="palm", layers=(fat, Layer(thickness=0.3e-3, material="epidermis")))
    for do in (check_mesh, build):
        with pytest.raises(ValueError, match="thicker layers, or a slab"):
            do(thin, 0.6e-3)


def test_a_wide_body_is_cut_where_reflections_are_negligible():
    text = "[tacton]\nam_frequency_hz = 200\n[focus]\nprofile = 'main_lobe'\n[body]\n"
    text += "size_x_mm = 600\nsize_y_mm = 40\n[probes]\npoints_mm = [[0, 0]]"
    required = plan(loads(text), SolveOptions(tolerance=0.4))
    assert required.body.width < 0.3
    assert required.body.height == 0.04
    assert "extent" in {row.what for row in required.rows}


@pytest.mark.parametrize(
    ("path", "axes"),
    [("", "xy"), ("shape='line'\nsize_mm=20\nspeed_m_per_s=5", "y"),
     ("shape='circle'\nsize_mm=20\nspeed_m_per_s=5", "")],
)  # fmt: skip
def test_a_symmetric_scene_is_halved(path, axes):
    text = SHORT.replace("[body]", f'{path}\n[body]\nsides = "clamped"')
    scene = loads(text.replace("[5, 0]", "[-5, 3]"))
    required = plan(scene, SolveOptions(tolerance=0.3, model="fem"))
    assert required.symmetry == axes
    assert required.error <= 0.3
    size = SolveOptions(h=0.008)
    whole, part = (answer(reduce_scene(scene, size, symmetry=both), scene) for both in ("", axes))
    assert part.effort.dofs <= whole.effort.dofs / 2 ** len(axes) * 1.2
    np.testing.assert_allclose(
        part.displacement, whole.displacement, atol=2e-3 * np.abs(whole.displacement).max()
    )


def test_meshes_are_refined_until_they_meet_the_tolerance():
    text = "[tacton]\nam_frequency_hz = 80\nduration_s = 0.1\n[body]\nkind = 'sheet'\n"
    scene = loads(text + "[focus]\npeak_pressure_pa = 0.1\n[probes]\npoints_mm = [[0, 0], [5, 0]]")
    loose, tight = (plan(scene, SolveOptions(tolerance=x, model="fem")) for x in (0.2, 0.04))
    assert tight.h < loose.h
    finer = answer(reduce_scene(scene, SolveOptions(h=1.6e-3), symmetry="xy"), scene)
    for required in (loose, tight):
        misfit = compare(finer, answer(required.prepared, scene)).relative_l2.max()
        assert required.error / 5 < misfit < 2 * required.error


def test_errors_above_the_tolerance_are_warned_of():
    text = "[tacton]\nam_frequency_hz = 80\nduration_s = 0.05\n[body]\nkind = 'sheet'\n"
    small = "size_x_mm = 60\nsize_y_mm = 60\n[probes]\npoints_mm = [[0, 0], [5, 0]]"
    scene = loads(text + small)
    assert plan(scene, SolveOptions(tolerance=0.1)).warnings == ()
    for arguments, part in [
        ({"model": "point-kernel"}, "point kernel"),
        ({"model": "flat-body"}, "reflections"),
        ({"h": 0.005}, "elements of 5 mm"),
        ({"h": 0.01}, "focal spot"),
        ({"model": "fem-transient", "dt": 4e-3, "h": 0.01}, "time step of 4 ms"),
        ({"model": "fem-harmonic", "h": 0.005}, "initial transient"),
    ]:
        found = plan(scene, SolveOptions(tolerance=0.1, **arguments))
        assert found.error > 0.1, part
        (warning,) = (each for each in found.warnings if part in each)
        assert re.search(r"[\d.]+ (%|times|mm)", warning), part


def test_the_error_of_a_time_step_is_that_of_the_motion():
    scene = replace(BLOCK, body=replace(SMALL, sides="clamped"))
    given = [{"h": 2e-3, "dt": dt} for dt in (1e-4, 1e-3)]
    small, large = (plan(scene, SolveOptions(model="fem-transient", **x)).error for x in given)
    fine, coarse = (compute(scene, "fem-transient", **x) for x in given)
    true = compare(fine, coarse).relative_l2.max()
    assert true > 0.05
    assert true / 2 < large - small < 2 * true


def test_the_error_of_absorbing_sides_is_the_change_with_a_wide_layer():
    scene = replace(LAYER, body=Body(width=0.03, height=0.03, depth=8e-3))
    options = SolveOptions(h=float(element_sizes(scene.body)[0]))
    usual, wide = (
        answer(reduce_scene(scene, options, discretise=partial(discretise, wider=x)), scene)
        for x in (1.0, 4.0)
    )
    true = compare(wide, usual).relative_l2.max()
    assert true > 1e-4
    assert true < absorbing_error(scene, scene.body) < 3 * true


def test_absorbing_ends_move_out_by_the_width_of_their_layer(monkeypatch):
    monkeypatch.setattr(skinwave.planning.extent, "absorbing_error", lambda *given: 1.0)
    monkeypatch.setattr(skinwave.planning.extent, "check_mesh", lambda *given: None)
    body = Body(width=0.03, height=0.04, depth=8e-3, base="absorbing")
    larger, (row,), _ = extent(replace(LAYER, body=body), SolveOptions(), 200.0)
    sides = [larger.width - body.width, larger.height - body.height]
    assert larger.depth > body.depth + 1e-3
    np.testing.assert_allclose(sides, 2 * (larger.depth - body.depth))
    assert row.what == "extent"


def test_lines_beyond_a_third_of_the_tolerance_are_left_out():
    shares = np.array([[0.95, 0.9799], [0.04, 0.0], [0.0099, 0.02], [0.0001, 0.0001]])
    frequencies = np.array([0.0, 100.0, 200.0, 300.0])
    found = [cutoff_frequency(frequencies, shares, x) for x in (0.02, 0.2, 0.5, 1.0)]
    assert found == [300, 200, 100, 0]


def test_meshes_from_files_are_compared_by_their_elements_under_the_focus():
    coarse, fine = Effort(cells=1000, h=0.01), Effort(cells=1728, h=0.005)
    assert refinement_ratio(Body(kind="palm"), coarse, fine) == pytest.approx(1.2)
    flat = replace(fine, cells=1440)  # a sheet has one layer of cells
    assert refinement_ratio(Body(kind="sheet"), coarse, flat) == pytest.approx(1.2)
    scan = Body(kind="mesh", file="hand.stl")
    assert refinement_ratio(scan, coarse, fine) == 2
    assert refinement_ratio(scan, coarse, replace(fine, cells=1000)) == 1  # the same mesh


def test_motion_above_the_band_is_an_error_of_twice_its_energy():
    t, share = (np.arange(1000) + 0.5) / 1e4, 0.1
    low, high = (np.cos(2 * np.pi * f * t) for f in (200, 3000))
    found = above_band(np.column_stack([low, low + np.sqrt(share) * high]), 1e-4)
    assert found == pytest.approx(np.sqrt(2 * share / (1 + share)), rel=1e-6)


@pytest.mark.parametrize(("scene", "tolerance"), [(FREE, 0.1), (LAYERS, 0.1)])
def test_stated_errors_of_small_bodies_are_true(scene, tolerance):
    stated, true = stated_and_true(scene, tolerance)
    assert true < MOST * stated
    assert stated < tolerance


def stated(scene, steady, rest, **given):
    """Stated error, relative difference from rest at the worst probe, and warnings."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SkinwaveWarning)
        found = simulate(scene, steady, **given)
    whole = compute(scene, rest, **given).values
    left = np.linalg.norm(found.values - whole, axis=0) / np.linalg.norm(whole, axis=0)
    return found.expected_error, left.max(), found.effort.warnings


@pytest.mark.parametrize("quantity", ["displacement", "acceleration"])
def test_modes_of_a_plate_state_the_start(quantity):
    scene = replace(CANTILEVER, quantity=quantity)
    error, left, said = stated(scene, "plate-modes", "plate-modes-transient")
    assert left > 0.2
    assert left <= error < 1.05 * left + 0.02
    assert any("use --model plate-modes-transient" in sentence for sentence in said)
    assert plan(scene, SolveOptions(model="plate-modes-transient")).warnings == ()


@pytest.mark.parametrize("quantity", ["acceleration", "strain_zz"])
def test_wavenumber_integrals_state_the_start_of_the_quantity(quantity):
    scene = replace(LAYER, quantity=quantity, depth=2e-3 if quantity == "strain_zz" else 0.0)
    error, left, said = stated(scene, "flat-body-harmonic", "flat-body")
    assert left > 0.05
    assert error == pytest.approx(left, rel=0.02)
    assert any("use --model flat-body" in sentence for sentence in said)


@pytest.mark.parametrize("quantity", ["velocity", "acceleration"])
def test_wavenumber_integrals_state_a_jump_above_their_band(quantity):
    scene = replace(LAYER, quantity=quantity)
    found = compute(scene, "flat-body")
    times = found.times[1] / 16 * np.arange(16 * len(found.times))
    fine = named("flat-body").solve(scene, times, SolveOptions(tolerance=1e-3))
    true = compare(replace(found, values=fine.values[::16]), found).relative_l2.max()
    assert true > (5e-3 if quantity == "acceleration" else 1e-3)
    assert true < 1.1 * plan(scene, SolveOptions(model="flat-body")).error < 5 * true


def test_elements_state_the_start_of_the_quantity():
    scene = replace(BLOCK, quantity="acceleration")
    error, left, _ = stated(scene, "fem-harmonic", "fem", h=6e-3)
    assert left > 0.1
    of_mesh = plan(scene, SolveOptions(model="fem", h=6e-3)).error
    assert np.sqrt(error**2 - of_mesh**2) == pytest.approx(left, rel=0.05)


def test_the_error_of_the_start_is_that_of_the_requested_times():
    load = MovingPressure(tacton=Tacton(am_frequency=140, duration=0.5))
    scene = replace(LAYER, pressure=load)
    whole, *parts = (
        stated(scene, "flat-body-harmonic", "flat-body", times=np.arange(*span) / 1e4)
        for span in ((5000,), (100,), (4000, 5000))
    )
    for error, left, _ in (whole, *parts):
        assert error == pytest.approx(left, rel=0.02, abs=2.1e-3)  # beside that of the integral
    assert parts[0][1] > 2 * whole[1] > 50 * parts[1][1]


def test_the_drift_of_an_unconstrained_body_is_in_its_error():
    sides = Sides(left="absorbing", right="free", front="free", back="free")
    scene = replace(BLOCK, body=replace(SMALL, base="free", sides=sides))
    error, left, _ = stated(scene, "fem-harmonic", "fem", h=6e-3)
    assert 0.9 < left < 1.2
    assert left < error + 0.01 < 2.0
