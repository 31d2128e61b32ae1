"""Pulses, signals, several foci and paths by points: one load, whichever model receives it."""

from dataclasses import replace

import numpy as np
import pytest

import simple_model
from simple_model import MovingPressure, Rhythm, Signal, Tacton, Trajectory, joined, point_kernel
from simple_model.load.path_cells import path_fourier, path_samples
from simple_model.load.spectrum import load_lines, path_forces
from skinwave import Body, Scene
from skinwave.planning.plan_warnings import rhythm_unresolved
from skinwave.planning.simulate import compute

TIMES = np.arange(10_000) / 10_000
PULSES = Rhythm(pulses=((0.010, 0.006), (0.004, 0.0053)))
CIRCLE = Trajectory(shape="circle", size=0.01, speed=6.0)
PLACES = np.array([[0.005, 0.0], [0.002, -0.003]])
FREQUENCY = 185.0
BENT = ((0, 0), (0.008, 0.003), (0, 0.01))
ENVELOPE = Signal(rate=60, samples=(0.0, 0.4, 1.0, 0.3), role="envelope")
STRAIGHT = (
    Trajectory(shape="square", size=0.015, centre=(-0.015, 0.010)),
    Trajectory(shape="line", size=0.020, centre=(0.020, 0.0)),
    Trajectory(shape="triangle", size=0.010, centre=(0.0, -0.020)),
    Trajectory(shape="point", centre=(0.0, 0.020)),
)
WITH_ROUND = (Trajectory(shape="circle", size=0.020, centre=(-0.010, 0.0)), STRAIGHT[1])
RAMPED = Rhythm(pulses=((0.010, 0.006), (0.004, 0.013)), ramp=0.001)
AROUND = np.array([[0.0, 0.0], [-0.015, 0.010], [0.020, 0.001], [0.004, -0.018]])


def wandering(seconds=0.03, count=601, **more):
    t = np.linspace(0, seconds, count)
    x, y = 0.008 * np.sin(440 * t), 0.006 * np.cos(710 * t + 1)
    level = np.where(t < 0.02, 0.5 + 0.5 * np.sin(560 * t), 0.2)
    return Trajectory(
        shape="recorded", points=tuple(zip(x.tolist(), y.tolist(), strict=True)),
        times=tuple(t.tolist()), levels=tuple(level.tolist()), **more,
    )  # fmt: skip


@pytest.mark.parametrize("drive", ["linear", "pressure_squared"])
def test_gaps_have_no_pressure(drive):
    tacton = Tacton(am_frequency=140, trajectory=CIRCLE, rhythm=PULSES)
    x = point_kernel(MovingPressure(tacton=tacton, drive=drive), PLACES, TIMES).displacement
    into = np.mod(TIMES + 1e-9, PULSES.period)
    on = (into < 0.010) | ((into >= 0.016) & (into < 0.020))
    assert not x[~on].any()
    assert not simple_model.commanded_signal(tacton, TIMES)[~on].any()
    plain = replace(tacton, rhythm=None)
    same = point_kernel(MovingPressure(tacton=plain, drive=drive), PLACES, TIMES).displacement
    np.testing.assert_array_equal(x[on], same[on])


def test_levels_are_linear_in_ramps_and_between_samples():
    ramped = Rhythm(pulses=((0.010, 0.006),), ramp=0.002)
    found = ramped.level([0.001, 0.005, 0.009, 0.0095, 0.012, 0.017])
    np.testing.assert_allclose(found, [0.5, 1, 0.5, 0.25, 0, 0.5], atol=1e-9)
    signal = Signal(rate=100, samples=(0.0, 1.0, 0.5))
    np.testing.assert_allclose(signal.at([0, 0.005, 0.01, 0.025, 0.035]), [0, 0.5, 1, 0.25, 0.5])


def test_forces_on_a_grid_are_the_integral_of_the_focal_spot():
    line = 5e-4 * np.arange(-80, 81)
    points = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    areas = np.full((len(points), 1), 5e-4**2)
    found = path_forces(MovingPressure(tacton=Tacton()), points, areas)
    assert found[0, 0] == pytest.approx(2 * np.pi * 0.00435**2, rel=1e-6)


def test_pulses_make_lines_of_their_period():
    tacton = Tacton(rhythm=Rhythm(pulses=((0.010, 0.010),)))
    load = MovingPressure(tacton=tacton, peak_pressure=1.0)
    table = simple_model.line_table(load, point_kernel(load, [[0, 0]], TIMES), candidates=["2f_r"])
    assert table.frequencies["f_r"] == pytest.approx(50.0)
    found = table.amplitudes
    # Half on, half off: 2/(pi n) for odd n, and nothing for even ones.
    for n, name in ((1, "f_r"), (3, "3f_r")):
        assert found[name][0] == pytest.approx(2 / np.pi / n, rel=1e-2)
    assert found["2f_r"] < 1e-3


def beaten(seconds, am=60.0, **more):
    """Two pulses in 0.3 s."""
    rhythm = Rhythm(pulses=((0.1, 0.05), (0.04, 0.11)), ramp=0.02)
    return MovingPressure(tacton=Tacton(am_frequency=am, duration=seconds, rhythm=rhythm, **more))


@pytest.mark.parametrize("seconds", [0.4, 0.6, 0.9])
def test_a_line_is_that_of_one_period_of_the_rhythm(seconds):
    t = np.arange(round(2000 * seconds)) / 2000
    load = beaten(seconds)
    response = point_kernel(load, [[0, 0]], t)
    period = 2 * (np.exp(-2j * np.pi * 60 * t) @ np.diag(t < 0.3) @ response.values)[0] / 600
    table = simple_model.line_table(load, response)
    assert table.amplitudes["f_AM"][0] == pytest.approx(abs(period), rel=1e-4)
    assert table.frequencies["f_AM+f_r"] == pytest.approx(60 + 1 / 0.3)
    assert not table.unresolved
    found = simple_model.lines(response, [60.0])[0]
    assert found == pytest.approx(abs(period), rel=1e-4)


@pytest.mark.parametrize(("seconds", "am"), [(0.35, 60.0), (0.2, 0.0), (0.6, 61.7)])
def test_a_rhythm_too_short_to_resolve_is_said_with_a_cure_that_works(seconds, am):
    scene = Scene(pressure=beaten(seconds, am), body=Body())
    response = compute(scene, "point-kernel")
    table = simple_model.line_table(scene.pressure, response)
    assert table.unresolved or not table.frequencies
    (warning,) = rhythm_unresolved(scene, response)
    if "multiples" in warning:
        multiple = round(am / float(warning.partition(" Hz")[0].split()[-1])) / 0.3
        assert float(warning.split()[-3]) == 0.4
        longer = replace(scene, pressure=beaten(0.4, multiple))
    else:
        longer = replace(scene, pressure=beaten(float(warning.split()[-1]), am))
    response = compute(longer, "point-kernel")
    assert rhythm_unresolved(longer, response) == ()
    assert simple_model.line_table(longer.pressure, response).frequencies


def together(paths, **more):
    foci = simple_model.even_phases(len(paths))
    return Tacton(trajectory=joined(paths, FREQUENCY), foci=foci, **more)


def on_circle(**more):
    return Tacton(
        am_frequency=90.0, second_am_frequency=131.0, superposition=(0.75, 0.25), duration=0.25,
        trajectory=CIRCLE, **more,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("tacton", "places", "most"),
    [
        (on_circle(foci=(0.0, 0.3), rhythm=PULSES), PLACES, 2e-4),
        (on_circle(signal=Signal(rate=800, samples=(0.0, 0.4, 1.0, 0.3, -0.8, 0.1))), PLACES, 2e-4),
        (on_circle(foci=(0.0, 0.3), signal=ENVELOPE), PLACES, 2e-4),
        (together(STRAIGHT, rhythm=RAMPED, duration=0.297), AROUND, 5e-4),
        (together(WITH_ROUND, am_frequency=140.0, duration=0.2), AROUND, 5e-4),
    ],
    ids=["rhythm", "signal", "envelope", "joined", "joined with a circle"],
)
def test_lines_match_a_transform_of_the_sampled_load(tacton, places, most):
    load, count = MovingPressure(tacton=tacton), round(tacton.duration * 320_000)
    kept = 251 if tacton.duration == 0.25 else 200
    sampled = np.fft.rfft(load(places, (np.arange(count) + 0.5) / 320_000), axis=0)[:kept] / count
    sampled *= np.exp(-1j * np.pi * np.arange(kept) / count)[:, None]
    sampled[1:] *= 2
    f, a = load_lines(load).gather(path_fourier(load, load.spot(places, path_samples(load)).T).T)
    rank = np.round(f * tacton.duration).astype(int)
    np.testing.assert_allclose(f, rank / tacton.duration, atol=1e-6)
    computed = np.zeros_like(sampled)
    computed[rank[rank < kept]] = a[rank < kept]
    assert np.abs(computed - sampled).max() < most * np.abs(sampled).max()


@pytest.mark.parametrize("more", [{"am_frequency": 140.0}, {"rhythm": RAMPED}])
def test_the_pressure_of_joined_paths_is_the_mean_of_each(more):
    rng = np.random.default_rng(1)
    points, times = rng.uniform(-0.04, 0.04, (200, 2)), rng.random(300)
    for paths, error in ((STRAIGHT, 1e-6), (STRAIGHT[1:2], 1e-6), (WITH_ROUND, 2e-3)):
        each = [replace(path, speed=FREQUENCY * path.length) for path in paths]
        alone = [MovingPressure(tacton=Tacton(trajectory=path, **more)) for path in each]
        mean = sum(load(points, times) for load in alone) / len(paths)
        pressure = MovingPressure(tacton=together(paths, **more))(points, times)
        assert np.abs(pressure - mean).max() < error * np.abs(mean).max()


def test_lines_of_joined_paths_have_the_names_of_the_common_frequency():
    load = MovingPressure(tacton=together(STRAIGHT, am_frequency=83.0, duration=0.2))
    names = simple_model.named_lines(load)
    assert load.tacton.drawing_frequency == pytest.approx(FREQUENCY)
    assert [name for name in names if name.endswith("f_d")][:3] == ["f_d", "2f_d", "3f_d"]
    assert names["f_d"] == pytest.approx(FREQUENCY)
    assert names["2f_d-f_AM"] == pytest.approx(2 * FREQUENCY - 83)
    # Lines at a quarter of it cancel between the paths.
    f = load_lines(MovingPressure(tacton=together(STRAIGHT))).frequencies
    assert len(f) > 8
    np.testing.assert_allclose(f / FREQUENCY, np.round(f / FREQUENCY), atol=1e-9)
    response = point_kernel(load, AROUND, np.arange(8000) / 4e4)
    assert (simple_model.lines(response, [names["f_d"], names["f_d-f_AM"]]).max(axis=1) > 0.1).all()
    once = together(STRAIGHT, duration=1 / FREQUENCY)
    assert not simple_model.named_lines(MovingPressure(tacton=once))


def test_even_foci_leave_only_multiples_of_their_number():
    for n in (2, 3):
        foci = tuple(np.arange(n) / n)
        load = MovingPressure(tacton=Tacton(trajectory=CIRCLE, foci=foci))
        assert (np.abs(load_lines(load).harmonics) % n == 0).all()
        response = point_kernel(load, PLACES, TIMES)
        found = simple_model.lines(response, CIRCLE.drawing_frequency * np.arange(17))[:, 0]
        others = np.arange(17) % n != 0
        assert found[others].max() < 1e-8 * found[0]
        names = simple_model.named_lines(load)
        assert list(names) == [f"{n * k}f_d" for k in range(1, len(names) + 1)]


def test_several_foci_push_with_the_force_of_one():
    line = np.linspace(-0.04, 0.04, 161)
    everywhere = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    one = MovingPressure(tacton=Tacton(am_frequency=140, trajectory=CIRCLE))
    for phases in ((0.0, 0.1, 0.35), tuple(np.arange(8) / 8)):
        many = replace(one, tacton=replace(one.tacton, foci=phases))
        forces = (load(everywhere, [0.0, 0.0013]).sum(axis=1) for load in (many, one))
        np.testing.assert_allclose(*forces, rtol=1e-6)
        assert many.gain(0.0013) == pytest.approx(one.gain(0.0013) / len(phases))


def test_polylines_run_at_constant_speed_round_or_there_and_back():
    corners = ((0.0, 0.0), (0.006, 0.0), (0.006, 0.008))
    there = Trajectory(shape="polyline", points=corners, speed=1.4)
    assert there.drawing_frequency == pytest.approx(1.4 / 0.028)
    round_ = Trajectory(shape="polyline", points=(*corners, corners[0]), speed=1.2)
    assert round_.drawing_frequency == pytest.approx(1.2 / 0.024)
    once = Trajectory(shape="polyline", points=corners, speed=1.4, sweep="one_way")
    assert once.drawing_frequency == pytest.approx(1.4 / 0.014)
    for path, at in ((there, 6 / 28), (there, 22 / 28), (round_, 6 / 24), (once, 6 / 14)):
        np.testing.assert_allclose(path.at_phase(at), corners[1], atol=1e-15)
        along = path.at_phase(np.linspace(0, 1, 28001)[:-1])
        steps = np.linalg.norm(np.diff(along, axis=0), axis=1)
        assert np.median(steps) == pytest.approx(path.length / 28000, rel=1e-6)


def test_a_recording_keeps_its_positions_and_times():
    path = wandering()
    now = np.array(path.times)[:-1]
    np.testing.assert_allclose(path.position(now), np.array(path.points)[:-1], atol=1e-12)
    np.testing.assert_allclose(path.level_at_phase(path.phase(now)), path.levels[:-1], atol=1e-9)
    held = replace(path, hold=True)
    between = now + 0.4 * now[1]
    np.testing.assert_array_equal(held.position(between), np.array(path.points)[:-1])
    np.testing.assert_array_equal(held.position(now), np.array(path.points)[:-1])
    moved = replace(path, centre=(0.01, -0.02))
    np.testing.assert_allclose(moved.position(now) - path.position(now), [[0.01, -0.02]] * 600)


def test_levels_of_a_recording_follow_the_drive_law():
    path = wandering()
    t, plain = np.array([0.001, 0.0025]), replace(path, levels=())
    level = path.level_at_phase(path.phase(t))
    for drive, power in (("linear", 1), ("pressure_squared", 2), ("force_corrected", 1)):
        loud, soft = (
            MovingPressure(tacton=Tacton(trajectory=p), drive=drive)(PLACES, t)
            for p in (plain, path)
        )
        np.testing.assert_allclose(soft, loud * level[:, None] ** power, rtol=1e-12)


LOADS = {
    "foci in pulses": {"foci": (0.0, 0.25), "rhythm": PULSES, "trajectory": CIRCLE},
    "recorded": {"trajectory": wandering()},
    "signal": {"signal": Signal(rate=800, samples=(0, 0.4, 1.0, 0.3, -0.8, 0.1))},
    "polyline": {"trajectory": Trajectory(shape="polyline", points=BENT, speed=4.0)},
}


def small_scene(duration=0.03, **tacton):
    body = Body(width=0.03, height=0.03, depth=0.006)
    load = MovingPressure(tacton=Tacton(duration=duration, **tacton))
    return Scene(pressure=load, body=body, probes=((0.0, 0.0), (0.005, 0.001)))


@pytest.mark.parametrize("name", LOADS)
def test_lines_and_time_steps_give_the_same_motion(name):
    scene = small_scene(0.02 if "pulses" in name else 0.015, **LOADS[name])
    scene = replace(scene, body=replace(scene.body, sides="clamped"))  # no layer around it
    x = compute(scene, "fem", h=0.006).displacement
    y = compute(scene, "fem-transient", h=0.006, dt=2.5e-5).displacement
    error = np.linalg.norm(x - y, axis=0) / np.linalg.norm(y, axis=0)
    assert error.max() < 2e-3 if "pulses" in name else error.max() < 1e-3


def test_invalid_rhythms_signals_and_paths_are_refused():
    for build in (
        lambda: Rhythm(pulses=((0.0, 0.1),)),
        lambda: Rhythm(pulses=((0.01, 0.0),), ramp=0.006),
        lambda: Signal(rate=10, samples=(0, -0.5), role="envelope"),
        lambda: Tacton(foci=(0.0, 1.5)),
        lambda: Tacton(trajectory=wandering(), rhythm=PULSES),
        lambda: Trajectory(shape="polyline", points=((0, 0), (0.4, 0))),
        lambda: Trajectory(shape="polyline", points=((0, 0), (0, 1, 2))),
        lambda: Trajectory(shape="circle", points=((0, 0), (0, 1))),
        lambda: replace(wandering(), levels=(1.0,)),
        lambda: Trajectory(shape="recorded", points=((0, 0),) * 2, times=(1, 2)),
        lambda: joined((), 100.0),
        lambda: joined(STRAIGHT, float("nan")),
        lambda: joined((joined(STRAIGHT, 1.0),), 1.0),
    ):
        with pytest.raises(ValueError, match="[a-z]") as error:
            build()
        assert "\n" not in str(error.value)
