"""Foci so fast that lines of the load lie above half the sampling rate: none may fold back."""

from dataclasses import replace

import numpy as np
import pytest

from simple_model import (
    MovingPressure,
    Rhythm,
    Tacton,
    Trajectory,
    flat_body,
    joined,
    lines,
    point_kernel,
    steady_state,
)
from simple_model.compliance import slab
from simple_model.flat_body import steady_lines
from simple_model.load_spectrum import load_lines, synthesise
from simple_model.material import PRESETS
from simple_model.path_cells import path_fourier, path_samples
from simple_model.sampling import resolving_step
from skinwave import Body, Scene, simulate
from skinwave.simulation import compute

PALM = slab(PRESETS["palm"], 0.015)
PROBES = np.array([[0.01, 0.0], [0.02, 0.0]])
TIMES = np.arange(4000) / 1e4
LATE = slice(2500, 3800)  # the transient has died out, and the end has no effect yet
SKIN = Body(width=0.06, height=0.06, sides="clamped")


def circling(size, speed, am=0.0, **load):
    path = Trajectory(shape="circle", size=size, speed=speed)
    return MovingPressure(
        tacton=Tacton(am_frequency=am, trajectory=path), **{"peak_pressure": 1.0} | load
    )


def misfit(found, expected, alternating, late=LATE):
    """Root mean square (p,) of what differs late, relative to that of the alternating part."""
    return np.sqrt(((found - expected)[late] ** 2).mean(axis=0)) / alternating


def alternating(load):
    f, a = steady_lines(PALM, load, PROBES)
    return np.sqrt((np.abs(a[f > 0]) ** 2).sum(axis=0) / 2)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("size", "speed", "am"),
    [(5e-3, 100.0, 140.0), (10e-3, 100.0, 0.0), (20e-3, 30.0, 140.0), (20e-3, 100.0, 140.0),
     (40e-3, 100.0, 140.0)],
)  # fmt: skip
def test_flat_body_settles_into_the_steady_state_on_fast_circles(size, speed, am):
    load, times = circling(size, speed, am), TIMES[:3000]
    found, expected = (
        model(PALM, load, PROBES, times).displacement for model in (flat_body, steady_state)
    )
    late = slice(2500, 2850)
    assert misfit(found, expected, alternating(load), late).max() < 0.01


@pytest.mark.parametrize("model", [flat_body, steady_state])
@pytest.mark.parametrize(
    ("size", "speed", "folded"),
    [(0.02, 100.0, 450.7), (0.01, 100.0, 3633.8), (0.005, 60.0, 2360.6)],
)
def test_no_line_of_a_fast_circle_shows_at_another_frequency(model, size, speed, folded):
    load = circling(size, speed)
    false = lines(model(PALM, load, PROBES, TIMES), [folded], settle=0.5)
    assert (false < 1e-3 * alternating(load)).all()


def test_a_fast_recorded_circle_moves_a_body_as_the_circle_does():
    load = circling(0.02, 100.0)
    path = load.tacton.trajectory
    recorded = joined([path], path.drawing_frequency)
    again = replace(load, tacton=replace(load.tacton, trajectory=recorded))
    found = flat_body(PALM, again, PROBES, TIMES).displacement
    expected = steady_state(PALM, load, PROBES, TIMES).displacement
    differs = (found - expected)[LATE].std(axis=0)  # the polygon's mean is another by 3e-5
    assert (differs < 0.01 * alternating(load)).all()


def test_pulses_of_a_fast_circle_do_not_fold():
    load = circling(0.02, 100.0)
    pulsed = Tacton(trajectory=load.tacton.trajectory, rhythm=Rhythm(pulses=((0.3, 0.0),)))
    found, expected = (
        model(PALM, its, PROBES, TIMES[:2850]).displacement
        for model, its in ((flat_body, replace(load, tacton=pulsed)), (steady_state, load))
    )
    assert misfit(found, expected, alternating(load), slice(2500, 2850)).max() < 0.01


@pytest.mark.parametrize("load", [circling(0.02, 100.0, 140.0), circling(0.0, 0.0, 6200.0)])
def test_the_kernel_has_the_lines_of_its_load_below_half_the_rate(load):
    found = point_kernel(load, PROBES, TIMES).displacement
    parts = load_lines(load)
    spots = path_fourier(load, load.spot(PROBES, path_samples(load)).T)
    f, a = parts.gather(spots.T)
    expected = synthesise(f[f < 4800], a[f < 4800], TIMES)
    misfit = np.abs(lines_of(found) - lines_of(expected))[:4600] / np.ptp(expected)
    assert misfit.max() < 1e-4


def lines_of(x):
    """Amplitudes (f, p) at 0, 1, 2, ... Hz."""
    window = np.hanning(len(x))[:, None]
    return 2 * np.abs(np.fft.rfft(window * x, n=10_000, axis=0)) / window.sum()


@pytest.mark.parametrize("am", [0.0, 200.0])
@pytest.mark.parametrize("speed", [6.0, 18.0])
def test_the_kernel_of_ordinary_paths_is_the_load_itself(speed, am):
    load = circling(0.03, speed, am)
    found = point_kernel(load, PROBES, TIMES).displacement
    np.testing.assert_array_equal(found, load(PROBES, TIMES))


def test_elements_answer_no_line_at_another_frequency():
    load = circling(0.005, 60.0)
    load = replace(load, tacton=replace(load.tacton, duration=0.4))
    found = simulate(Scene(pressure=load, body=SKIN, probes=((0.005, 0.0),)), "fem", h=6e-3)
    false, true = lines(found, [2360.6, 3819.7], settle=0.5)[:, 0]
    assert false < 1e-3 * true


def test_time_steps_resolve_a_fast_focus_and_leave_others_alone():
    assert resolving_step(circling(0.03, 18.0, 200.0), 5e-5) == 5e-5
    load = circling(0.005, 100.0)
    assert 1 / resolving_step(load, 5e-5) > 6 * load.tacton.drawing_frequency
    brief = replace(load, tacton=replace(load.tacton, duration=0.01))
    found = compute(Scene(pressure=brief, body=SKIN), "fem-transient", h=10e-3)
    assert found.effort.steps > 0.0099 * 6 * load.tacton.drawing_frequency
