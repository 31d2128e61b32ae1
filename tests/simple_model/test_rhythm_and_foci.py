"""Pulses, signals, several foci and paths by points: one load, whichever model receives it."""

from dataclasses import replace

import numpy as np
import pytest

from simple_model import (
    MovingPressure,
    Rhythm,
    Signal,
    Tacton,
    Trajectory,
    commanded_signal,
    line_table,
    lines,
    named_lines,
    point_kernel,
)
from simple_model.load.path_cells import path_fourier, path_samples
from simple_model.load.spectrum import load_lines
from skinwave import Body, Scene
from skinwave.planning.simulate import compute

TIMES = np.arange(10_000) / 10_000
PULSES = Rhythm(pulses=((0.010, 0.006), (0.004, 0.0053)))
CIRCLE = Trajectory(shape="circle", size=0.01, speed=6.0)
PLACES = np.array([[0.005, 0.0], [0.002, -0.003]])


def kernel(times=TIMES, **tacton):
    load = MovingPressure(tacton=Tacton(**tacton))
    return point_kernel(load, PLACES, times)


def wandering(seconds=0.03, count=601, **more):
    """A recorded path that closes nowhere, with levels."""
    t = np.linspace(0, seconds, count)
    x, y = 0.008 * np.sin(440 * t), 0.006 * np.cos(710 * t + 1)
    level = np.where(t < 0.02, 0.5 + 0.5 * np.sin(560 * t), 0.2)
    return Trajectory(
        shape="recorded", points=tuple(zip(x.tolist(), y.tolist(), strict=True)),
        times=tuple(t.tolist()), levels=tuple(level.tolist()), **more,
    )  # fmt: skip


@pytest.mark.parametrize("drive", ["linear", "pressure_squared"])
def test_there_is_silence_in_the_gaps(drive):
    tacton = Tacton(am_frequency=140, trajectory=CIRCLE, rhythm=PULSES)
    x = point_kernel(MovingPressure(tacton=tacton, drive=drive), PLACES, TIMES).displacement
    into = np.mod(TIMES + 1e-9, PULSES.period)
    on = (into < 0.010) | ((into >= 0.016) & (into < 0.020))
    assert not x[~on].any()
    assert not commanded_signal(tacton, TIMES)[~on].any()
    plain = replace(tacton, rhythm=None)
    same = point_kernel(MovingPressure(tacton=plain, drive=drive), PLACES, TIMES).displacement
    np.testing.assert_array_equal(x[on], same[on])


def test_pulses_make_lines_of_their_period():
    tacton = Tacton(rhythm=Rhythm(pulses=((0.010, 0.010),)))
    load = MovingPressure(tacton=tacton, peak_pressure=1.0)
    table = line_table(load, point_kernel(load, [[0, 0]], TIMES), candidates=["2f_r"])
    assert table.frequencies["f_r"] == pytest.approx(50.0)
    found = table.amplitudes
    # Half on, half off: 2/(pi n) for odd n, and nothing for even ones.
    np.testing.assert_allclose(
        [found["f_r"][0], found["3f_r"][0]], [2 / np.pi, 2 / 3 / np.pi], rtol=1e-2
    )
    assert found["2f_r"] < 1e-3


@pytest.mark.parametrize(
    ("foci", "extra"),
    [
        ((0.0, 0.3), {"rhythm": PULSES}),
        ((0.0,), {"signal": Signal(rate=800, samples=(0.0, 0.4, 1.0, 0.3, -0.8, 0.1))}),
        ((0.0, 0.3), {"signal": Signal(rate=60, samples=(0.0, 0.4, 1.0, 0.3), role="envelope")}),
    ],
)
def test_lines_are_those_of_the_load_sampled(extra, foci):
    """Against a transform of the point kernel at 320 kHz, up to 1 kHz."""
    tacton = Tacton(
        am_frequency=90.0, second_am_frequency=131.0, superposition=(0.75, 0.25), duration=0.25,
        trajectory=CIRCLE, foci=foci, **extra,
    )  # fmt: skip
    load = MovingPressure(tacton=tacton)
    fine = (np.arange(80_000) + 0.5) / 320_000
    sampled = np.fft.rfft(load(PLACES, fine), axis=0)[:251] / 80_000
    sampled *= np.exp(-1j * np.pi * np.arange(251) / 80_000)[:, None]
    sampled[1:] *= 2
    f, a = load_lines(load).gather(path_fourier(load, load.spot(PLACES, path_samples(load)).T).T)
    np.testing.assert_allclose(f[:251], np.arange(251) / 0.25, atol=1e-8)
    assert np.abs(a[:251] - sampled).max() < 2e-4 * np.abs(sampled).max()


def test_even_foci_leave_only_multiples_of_their_number():
    for n in (2, 3):
        foci = tuple(np.arange(n) / n)
        kept = load_lines(MovingPressure(tacton=Tacton(trajectory=CIRCLE, foci=foci)))
        assert (np.abs(kept.harmonics) % n == 0).all()
        response = kernel(trajectory=CIRCLE, foci=foci)
        found = lines(response, CIRCLE.drawing_frequency * np.arange(17))[:, 0]
        others = np.arange(17) % n != 0
        assert found[others].max() < 1e-8 * found[0]
        names = named_lines(MovingPressure(tacton=Tacton(trajectory=CIRCLE, foci=foci)))
        assert list(names) == [f"{n * k}f_d" for k in range(1, len(names) + 1)]
        assert names


def test_several_foci_push_with_the_force_of_one():
    line = np.linspace(-0.04, 0.04, 161)
    everywhere = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    one = MovingPressure(tacton=Tacton(am_frequency=140, trajectory=CIRCLE))
    for phases in ((0.0, 0.1, 0.35), tuple(np.arange(8) / 8)):
        tacton = replace(one.tacton, foci=phases)
        many = replace(one, tacton=tacton)
        np.testing.assert_allclose(
            many(everywhere, [0.0, 0.0013]).sum(axis=1),
            one(everywhere, [0.0, 0.0013]).sum(axis=1),
            rtol=1e-6,
        )
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
        steps = np.linalg.norm(
            np.diff(path.at_phase(np.linspace(0, 1, 28001)[:-1]), axis=0), axis=1
        )
        assert np.median(steps) == pytest.approx(path.length / 28000, rel=1e-6)


def test_a_recording_is_where_and_when_it_was():
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
    "polyline": {
        "trajectory": Trajectory(
            shape="polyline", points=((0, 0), (0.008, 0.003), (0, 0.01)), speed=4.0
        )
    },
}


def small_scene(duration=0.03, **tacton):
    body = Body(width=0.03, height=0.03, depth=0.006)
    load = MovingPressure(tacton=Tacton(duration=duration, **tacton))
    return Scene(pressure=load, body=body, probes=((0.0, 0.0), (0.005, 0.001)))


@pytest.mark.parametrize("name", LOADS)
def test_lines_and_time_steps_answer_the_same_load(name):
    scene = small_scene(0.03 if "pulses" in name else 0.015, **LOADS[name])
    scene = replace(scene, body=replace(scene.body, sides="clamped"))  # no layer around it
    x = compute(scene, "fem", h=0.006).displacement
    y = compute(scene, "fem-transient", h=0.006, dt=2.5e-5).displacement
    error = np.linalg.norm(x - y, axis=0) / np.linalg.norm(y, axis=0)
    assert error.max() < 2e-3 if "pulses" in name else error.max() < 1e-3


def test_what_cannot_be_is_refused_in_one_sentence():
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
    ):
        with pytest.raises(ValueError, match="[a-z]") as error:
            build()
        assert "\n" not in str(error.value)
