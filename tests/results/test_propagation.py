"""Effect of propagation, and of nothing else: kernel and bodies under the same load."""

from dataclasses import replace
from math import inf, pi
from pathlib import Path

import numpy as np
import pytest

from simple_model import MovingPressure, Response, Rhythm, Tacton, Trajectory, phasors
from simple_model.load.spectrum import load_lines, synthesise
from simple_model.numbers import significant
from skinwave.models.options import SolveOptions
from skinwave.planning.simulate import compute, simulate
from skinwave.report.figures import REPORT
from skinwave.report.maps import rms_text
from skinwave.results import surface
from skinwave.results.claims import evaluate
from skinwave.results.comparison import compare, steady_lines, steady_rms
from skinwave.results.propagation import (
    area_of,
    distance_along,
    half_within,
    mach_angle,
    propagation,
    share_outside,
)
from skinwave.results.run import Run
from skinwave.results.surface import SurfaceField, body_map, grid, kernel_map
from skinwave.scene.file import read
from skinwave.scene.paper15 import beside_kernels, tactons
from skinwave.scene.scene import BODIES, Body, Scene, with_body
from skinwave.studies import overview
from skinwave.studies.first_screen import first_screen, quick_maps, with_kernels
from skinwave.studies.pages import four_numbers, sentences
from skinwave.sweeps.ensemble import method_of, solve_sample
from skinwave.sweeps.measures import result_columns

CIRCLE = Trajectory(shape="circle", size=0.02, speed=12.0)
BOTH = Tacton(am_frequency=140, trajectory=CIRCLE, duration=0.5)
BODIES_OF_TABLE = (Body(), Body(depth=inf), Body(depth=inf, material="forearm"))


def circle(am, size, speed):
    path = Trajectory(shape="circle", size=1e-3 * size, speed=speed) if size else Trajectory()
    return Tacton(am_frequency=am, trajectory=path)


# Share in per cent and furthest place at -6 dB in mm from the centre, of a palm slab and half-space
# and a forearm; that of the kernel; all under a squared drive and a Gaussian focus on a grid of 2
# mm to 44 mm. From an independent computation, which gives whole millimetres.
@pytest.mark.parametrize(
    ("tacton", "shares", "spreads", "of_kernel"),
    [
        (circle(140, 0, 0), (40, 48, 23), (6, 6, 4), 4),
        (circle(140, 20, 12), (31, 23, 30), (16, 16, 17), 15),
        (circle(80, 10, 6), (28, 46, 28), (12, 12, 9), 9),
    ],
)
def test_share_outside_and_spread(tacton, shares, spreads, of_kernel):
    pressure = MovingPressure(tacton=tacton)
    for body, share, spread in zip(BODIES_OF_TABLE, shares, spreads, strict=True):
        scene = Scene(pressure=pressure, body=body)
        x, y = grid(scene, step=2e-3)
        kernel, motion = kernel_map(pressure, x, y), body_map(scene, x, y)
        assert 100 * share_outside(kernel.rms, motion.rms) == pytest.approx(share, abs=1)
        away = 1e3 * np.hypot(*np.moveaxis(kernel.places, -1, 0))
        for rms, expected in ((motion.rms, spread), (kernel.rms, of_kernel)):
            assert away[rms >= 0.5 * rms.max()].max() == pytest.approx(expected, abs=1)


def test_maps_agree_with_probes_on_any_path():
    square = Tacton(trajectory=Trajectory(shape="square", size=0.02, speed=8.0), duration=0.5)
    scene = Scene(pressure=MovingPressure(tacton=square), body=Body())
    x, y = grid(scene, reach=0.012, step=6e-3)
    drawn = body_map(scene, x, y)
    places = tuple(map(tuple, drawn.places.reshape(-1, 2).tolist()))
    motion = compute(replace(scene, probes=places), "flat-body-harmonic").displacement
    whole = motion[: int(10_000 / square.drawing_frequency) * 10]  # ten periods, 100 Hz
    assert drawn.rms.ravel() == pytest.approx(whole.std(axis=0), rel=1e-3)


def test_all_functions_use_the_same_point_kernel():
    scene = Scene(pressure=MovingPressure(tacton=BOTH), body=Body())
    on_body = compute(scene, "point-kernel").displacement
    assert (on_body == scene.pressure(scene.probe_points, np.arange(5000) / 1e4)).all()
    bare = with_body(scene, BODIES["none"])
    assert (simulate(bare, "auto").displacement == on_body).all()
    published = compute(scene, "point-kernel-published")
    assert published.model == "point-kernel-published"
    assert published.displacement.min() < 0 <= on_body.min()


def test_only_the_squared_load_has_the_drawing_frequency():
    """At 10 mm, on the path: a_1 / a_0 of a Gaussian focus on a circle of 20 mm, over m."""
    scene = read(Path(__file__).parents[2] / "examples/skin-slab.toml")
    published, same = (
        Run(tacton="one", body="none", scene=its, response=compute(its, model))
        for model, its in beside_kernels(scene).items()
    )
    assert same.lines["f_d"][2] / same.lines["f_AM"][2] == pytest.approx(1.35, rel=0.05)
    assert published.lines["f_d"][2] < 1e-6 * published.lines["f_AM"][2]


def test_responses_to_different_loads_are_not_compared():
    scene = Scene(pressure=MovingPressure(tacton=BOTH), body=Body())
    published, kernel, run = with_kernels(_run(scene, "flat-body-harmonic"))
    assert propagation(run, kernel).strongest.name == "f_d"
    with pytest.raises(ValueError, match="have different loads"):
        propagation(run, published)


def test_steady_lines_of_a_linear_body_are_those_of_the_load():
    path = Trajectory(shape="circle", size=0.017, speed=20 * 7 * pi * 0.017)
    tacton = Tacton(am_frequency=60.0, trajectory=path, duration=0.3)
    pressure = MovingPressure(tacton=tacton, drive="force_corrected", depth_of_modulation=0.7)
    scene = Scene(pressure=pressure, body=Body(), probes=((0.0, 0.0), (0.01, 0.0)))
    motion = compute(scene, "flat-body")
    kept = motion.times >= 0.15
    moving = motion.displacement[kept] - motion.displacement[kept].mean(axis=0)
    found = load_lines(pressure, 1e-5).frequencies
    lines = np.unique(np.round(found[(found > 1e-3) & (found < 4900)], 6))
    a = phasors(motion, lines, settle=0.5)
    explained = synthesise(lines, a, motion.times[kept])
    assert np.linalg.norm(moving - explained) < 1e-3 * np.linalg.norm(moving)


def ringing(pressure, seconds):
    """A steady line of 6 um at 140 Hz, and a free vibration of 9 um at 71 Hz that hardly decays."""
    t = np.arange(round(1e4 * seconds)) / 1e4
    wave = 6e-6 * np.sin(2 * pi * 140 * t) + 9e-6 * np.exp(-0.9 * t) * np.cos(2 * pi * 71 * t)
    return replace(_response(t, 5e-6 + wave, "displacement"), load=pressure)


@pytest.mark.parametrize("seconds", [1.0, 0.2])
def test_spread_and_rms_leave_out_free_vibration(seconds):
    load = MovingPressure(tacton=replace(BOTH, duration=seconds))
    expected = 6e-6 / np.sqrt(2) * np.array([1.0, 0.5])
    np.testing.assert_allclose(steady_rms(ringing(load, seconds)), expected, rtol=0.01)


def test_maps_of_a_stretching_sheet_leave_out_free_vibration(monkeypatch):
    load, (x, y) = MovingPressure(tacton=BOTH), (np.linspace(-1e-3, 1e-3, n) for n in (3, 2))
    pulsed = replace(load, tacton=replace(BOTH, rhythm=Rhythm(pulses=((0.1, 0.1),))))
    sheet = Scene(pressure=load, body=BODIES["paper-sheet"], probes=((0.0, 0.0),))
    shapes = lambda places: np.tile([1.0, 2.0], (len(places), 1))  # noqa: E731
    found = ringing(load, 0.5)
    motion = lambda scene, tolerance: (found.times, found.values, shapes)  # noqa: E731
    monkeypatch.setattr(surface, "sheet_motion", motion)
    monkeypatch.setattr(surface, "stretches", lambda *_: True)
    drawn = body_map(sheet, x, y)
    np.testing.assert_allclose(drawn.rms, 2 * 6e-6 / np.sqrt(2), rtol=0.01)
    # Pulses have no steady vibration: the map is that of the whole motion, and says so.
    whole = body_map(replace(sheet, pressure=pulsed), x, y)
    np.testing.assert_allclose(whole.rms, 2 * found.values[:, 0].std(), rtol=0.01)
    assert "with free vibration" in whole.note
    assert "steady vibration about" in rms_text(load)
    assert "whole Tacton" in rms_text(pulsed)


def test_lines_that_a_response_does_not_resolve_are_not_called_steady():
    slow = replace(BOTH, trajectory=Trajectory(shape="circle", size=0.02, speed=0.06))
    assert steady_lines(ringing(None, 0.5), MovingPressure(tacton=slow)) is None


def test_claims_about_presence_of_lines_agree_for_kernel_and_body():
    """M4, M5 and S4 are about amplitudes, which propagation changes; all others about presence."""
    runs = []
    for name, tacton in tactons():
        scene = Scene(name=name, pressure=MovingPressure(tacton=tacton), body=Body())
        runs += with_kernels(_run(scene, "flat-body-harmonic", name))[1:]
    holds = {(v.claim, v.column): v.holds for v in evaluate(runs)}
    for claim in ("S1", "S2", "S3", "S5", "M1", "M2", "M3"):
        assert holds[claim, "point-kernel"] == holds[claim, "skin-slab"], claim


def test_delay_and_gain_are_removed_from_a_periodic_signal():
    t = np.arange(10_000) / 1e4

    def signal(t):
        return np.sin(2 * pi * 140 * t) + 0.4 * np.sin(2 * pi * 280 * t + 1)

    later = _response(t, 5e-6 + 3e-6 * signal(t - 1.23e-3), "displacement")
    found = compare(_response(t, signal(t), "pressure"), later, (140.0, 280.0))
    assert found.delay == pytest.approx([1.23e-3] * 2, abs=2e-5)
    assert found.shape_misfit.max() < 0.02
    assert found.phase_delay == pytest.approx(np.full((2, 2), 1.23e-3), abs=1e-6)
    assert (found.relative_l2 > 0.5).all()


def test_phase_delay_is_unwrapped_outwards_and_absent_where_nothing_moves():
    t = np.arange(10_000) / 1e4
    probes = np.column_stack([np.linspace(0, 0.08, 9), np.zeros(9)])
    fall = np.exp(-probes[:, 0] / 0.03)
    kernel = np.sin(2 * pi * 200 * t)[:, None] * np.ones(9)
    waves = fall * np.sin(2 * pi * 200 * (t[:, None] - 1e-3 - probes[:, 0] / 5))
    a = Response(model="point-kernel", times=t, probes=probes, values=kernel, quantity="pressure")
    b = Response(model="fem", times=t, probes=probes, values=1e-6 * waves)
    delay = compare(a, b, (200.0, 300.0)).phase_delay
    heard = fall > 0.1
    assert delay[0, heard] == pytest.approx(1e-3 + probes[heard, 0] / 5, abs=1e-6)
    assert np.isnan(delay[0, ~heard]).all()
    assert np.isnan(delay[1]).all()  # round-off has a phase, and no delay


def test_claim_m1_needs_more_than_one_harmonic():
    scene = Scene(pressure=MovingPressure(tacton=Tacton(am_frequency=140)), body=Body())
    t = np.arange(10_000) / 1e4

    def assessed(third):
        wave = np.sin(2 * pi * 140 * t) + 0.2 * np.sin(2 * pi * 280 * t)
        wave += third * np.sin(2 * pi * 420 * t)
        motion = 1e-6 * wave[:, None] * np.ones(5)
        response = Response(model="fem", times=t, probes=scene.probe_points, values=motion)
        run = Run(tacton="am", body="slab", scene=scene, response=response)
        return next(v for v in evaluate([run]) if v.claim == "M1")

    assert assessed(0.05).holds
    assert not assessed(0.0).holds
    assert "< -120 dB" in assessed(0.0).sentence


def test_the_first_screen_has_a_verdict_and_four_numbers():
    scene = Scene(pressure=MovingPressure(tacton=BOTH), body=Body())
    first = first_screen({"one": with_kernels(_run(scene, "flat-body-harmonic"))}, quick_maps)
    waves, drive = sentences(first)
    found = first.own["skin-slab"]
    assert f"{100 * found.share:.0f} %" in waves
    assert "f_d" in drive
    level, reach, share, delay = ([str(row[0]), *row[1:]] for row in four_numbers(first).rows)
    assert level[2].startswith(f"{found.highest_sensation.level:+.0f} dB")
    assert reach[2].split()[0] == f"{1e3 * found.above_threshold[1].metre:.0f}"
    assert share[1:] == ["0 %", f"{100 * found.share:.0f} %"]
    assert delay[1] == "0 ms"
    assert float(delay[2].removesuffix(" ms")) == pytest.approx(1e3 * found.delay, rel=0.05)


def test_spread_reach_and_delay_of_a_known_motion():
    load = MovingPressure(tacton=Tacton(am_frequency=140, duration=0.5))
    scene = Scene(pressure=load, body=Body(), probes=((0.004, 0.0), (0.0, 0.0)))
    times = np.arange(5000) / 1e4
    later = times[:, None] - [2e-3, 1e-3]
    motion = Response(
        model="known", times=times, probes=scene.probe_points,
        values=1e-6 * np.sin(2 * pi * 140 * later),
    )  # fmt: skip
    kernel, run = (
        Run(tacton="one", body=body, scene=scene, response=response)
        for body, response in (("none", compute(scene, "point-kernel")), ("slab", motion))
    )
    x = 5e-4 * np.arange(-40, 41)
    away = 1e3 * np.hypot(*np.meshgrid(x, x))  # mm
    # 2 dB less for each millimetre, or 4 dB; 13 dB above the threshold in the middle.
    surface = SurfaceField(x=x, y=x, rms=10 ** (-away / 10), level=13 - 2 * away)
    narrow = SurfaceField(x=x, y=x, rms=10 ** (-away / 5))
    found = propagation(run, kernel, surface, narrow)
    assert found.delay == pytest.approx(1e-3, abs=1e-5)
    assert 1e3 * found.spread.metre == pytest.approx(3, abs=0.26)
    assert 1e3 * found.kernel_spread.metre == pytest.approx(1.5, abs=0.26)
    reaches = [1e3 * reach.metre for reach in found.above_threshold]
    np.testing.assert_allclose(reaches, [3.49, 6.5, 9.51], atol=0.26)
    assert not any(reach.beyond for reach in found.above_threshold)
    near_edge = SurfaceField(x=x, y=x, rms=surface.rms, level=40 - 2 * away)
    assert propagation(run, kernel, near_edge, narrow).above_threshold[1].beyond
    outside = narrow.rms < 0.1
    share = (surface.rms[outside] ** 2).sum() / (surface.rms**2).sum()
    assert found.share == pytest.approx(share)
    assert mach_angle(6.0, 12.0) == pytest.approx(pi / 6)
    assert mach_angle(6.0, 5.0) is None


def test_lines_above_the_known_thresholds_have_no_level():
    fast = MovingPressure(tacton=Tacton(am_frequency=1200, duration=0.05))
    run = _run(Scene(pressure=fast, body=Body()), "flat-body-harmonic")
    level = four_numbers(first_screen({"one": with_kernels(run)}, lambda run: ())).rows[0]
    assert level[-1] == "none (no threshold is known at 1200 Hz)"


def test_a_constant_pressure_at_rest_moves_nothing():
    still = MovingPressure(tacton=Tacton(duration=0.3))
    run = _run(Scene(pressure=still, body=Body()), "flat-body-harmonic")
    first = first_screen({"one": with_kernels(run)}, quick_maps)
    assert sentences(first)[0].startswith("Nothing vibrates")
    assert "nothing vibrates" in four_numbers(first).rows[0][-1]
    # The map of a body that ends within it has no values beyond.
    x = 1e-3 * np.arange(-3, 4)
    rest = SurfaceField(x=x, y=x, rms=np.where(np.add.outer(x, x) > 2e-3, np.nan, 0.0))
    assert propagation(run, first.kernel, rest, rest).share is None


def test_the_strongest_component_has_the_largest_amplitude():
    scene = Scene(pressure=MovingPressure(tacton=circle(80, 0, 0)), body=Body())
    _, kernel, run = with_kernels(_run(scene, "flat-body-harmonic"))
    found = propagation(run, kernel)
    assert found.kernel_strongest.name == found.strongest.name == "f_AM"
    assert found.highest_sensation.name == "2f_AM"
    assert found.highest_sensation.amplitude < found.strongest.amplitude
    paper = Scene(pressure=scene.pressure, body=BODIES["paper-sheet-loose"])
    _, kernel, run = with_kernels(_run(paper, "flat-body-harmonic"))
    assert propagation(run, kernel).strongest.level is None


def _run(scene, model, name="one"):
    known = next((k for k, body in BODIES.items() if body == scene.body), scene.body.kind)
    body = known if scene.body.kind != "sheet" else "sheet"
    return Run(tacton=name, body=body, scene=scene, response=compute(scene, model))


def _response(t, wave, quantity):
    motion, probes = wave[:, None] * np.array([1.0, 0.5]), np.array([[0, 0], [0.01, 0]])
    return Response(model="fem", times=t, probes=probes, values=motion, quantity=quantity)


def test_levels_and_reach_are_those_while_a_pulse_is_on():
    plain = Tacton(am_frequency=150, duration=0.16)
    rhythm = Rhythm(pulses=((0.04, 0.02), (0.016, 0.044)), ramp=0.008)
    probes, places = ((0.001, 0.0),), 0.005 * np.arange(-2.0, 3.0)
    found = []
    for tacton in (replace(plain, rhythm=rhythm), plain):
        load = MovingPressure(tacton=tacton)
        scene = Scene(pressure=load, body=Body(), probes=probes)
        body, kernel = (
            Run(tacton="", body=name, scene=scene, response=compute(scene, model))
            for name, model in (("slab", "flat-body"), ("none", "point-kernel"))
        )
        maps = body_map(scene, places, places), kernel_map(load, places, places)
        effect, row = propagation(body, kernel, *maps), result_columns(scene, body.response)
        highest = effect.highest_sensation
        method = method_of(scene, SolveOptions(model="flat-body"))
        sample = solve_sample(scene, replace(method, mapped=False))
        levels = [highest.level, row["level_db"][0], sample.level[0]]
        found.append((highest.name, row["sensation_line"], effect.above_threshold, levels))
    assert found[0][:3] == found[1][:3]
    assert found[0][2][1].metre > 0
    # The body settles in some milliseconds of 160: 0.14 dB.
    np.testing.assert_allclose(found[0][3], found[1][3], atol=0.2)
    np.testing.assert_allclose(found[0][3], found[0][3][0], atol=1e-6)


def test_a_rhythm_alone_has_the_level_of_its_lines():
    tacton = Tacton(duration=0.2, rhythm=Rhythm(pulses=((0.005, 0.005),)))
    scene = Scene(pressure=MovingPressure(tacton=tacton), body=Body(), probes=((0.0, 0.0),))
    run = Run(tacton="", body="slab", scene=scene, response=compute(scene, "flat-body"))
    assert set(run.levels) == set(run.table.frequencies) > {"f_r"}


def test_half_of_a_gaussian_and_lengths_on_a_cylinder():
    x = 2.5e-4 * np.arange(-60, 61)
    still = MovingPressure(tacton=Tacton(am_frequency=100))
    scene = Scene(pressure=still, body=Body())
    flat = SurfaceField(x=x, y=x, rms=np.exp(-np.add.outer(x**2, x**2) / (2 * 4e-3**2)))
    distance = distance_along(scene, flat)
    half = half_within(flat.rms, area_of(flat), distance)
    assert half == pytest.approx(4e-3 * np.sqrt(np.log(2)), rel=0.01)
    radius = 2e-2
    curved = replace(flat, height=np.tile(np.sqrt(radius**2 - x**2), (len(x), 1)))
    along = distance_along(scene, curved)
    np.testing.assert_allclose(along[60], radius * np.arcsin(np.abs(x) / radius), atol=3e-5)
    np.testing.assert_allclose(along[:, 60], np.abs(x), atol=1e-9)
    area = area_of(curved)
    np.testing.assert_allclose(area[60, 1:-1], 1 / np.cos(np.arcsin(x[1:-1] / radius)), rtol=0.01)
    # Places count by their area: the half of a cylinder reaches further along its curve.
    assert half_within(np.ones_like(flat.rms), area, along) > half_within(
        np.ones_like(flat.rms), area_of(flat), distance
    )


def test_the_verdict_over_tactons_counts_lines_and_states_medians():
    tactons_ = [Tacton(am_frequency=f, duration=0.3) for f in (80, 140, 200)]
    groups = {}
    for k, tacton in enumerate(tactons_):
        scene = Scene(pressure=MovingPressure(tacton=tacton), body=Body())
        groups[str(k)] = with_kernels(_run(scene, "flat-body-harmonic", name=str(k)))
    first = first_screen(groups, quick_maps)
    values = 1e3 * np.array([each["skin-slab"].half for each in first.effects.values()])
    rows = {row[0]: row[1:] for row in overview.table(first.effects).rows}
    assert rows[overview.NUMBERS[0].name][1].startswith(significant(float(np.median(values)), 2))
    assert rows["motion outside the kernel's -20 dB region"][0] == "0 %"
    (motion,) = overview.sentences(first.effects, groups)  # all have the kernel's strongest line
    assert "same 3 loads" in motion
    strongest = replace(first.effects["1"]["skin-slab"].strongest, name="2f_AM")
    other = replace(first.effects["1"]["skin-slab"], strongest=strongest)
    changed = dict(first.effects) | {"1": {"skin-slab": other}}
    assert "In 1 of 3 Tactons" in overview.sentences(changed, groups)[1]
    bodies_only = {name: group[2:] for name, group in groups.items()}
    assert len(overview.sentences(changed, bodies_only)) == 1
    drawn = overview.figure(first.effects, REPORT)
    assert len(drawn.axes) == len(rows)
