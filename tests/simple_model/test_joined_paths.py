"""Foci on paths of their own: one recording, and what every model makes of it."""

from dataclasses import replace

import numpy as np
import pytest

from simple_model import (
    MovingPressure,
    Rhythm,
    Tacton,
    Trajectory,
    even_phases,
    joined,
    lines,
    named_lines,
    point_kernel,
)
from simple_model.load.path_cells import path_fourier, path_samples
from simple_model.load.spectrum import load_lines

FREQUENCY = 185.0
STRAIGHT = (
    Trajectory(shape="square", size=0.015, centre=(-0.015, 0.010)),
    Trajectory(shape="line", size=0.020, centre=(0.020, 0.0)),
    Trajectory(shape="triangle", size=0.010, centre=(0.0, -0.020)),
    Trajectory(shape="point", centre=(0.0, 0.020)),
)
WITH_ROUND = (Trajectory(shape="circle", size=0.020, centre=(-0.010, 0.0)), STRAIGHT[1])
PULSES = Rhythm(pulses=((0.010, 0.006), (0.004, 0.013)), ramp=0.001)
PLACES = np.array([[0.0, 0.0], [-0.015, 0.010], [0.020, 0.001], [0.004, -0.018]])


def together(paths, **more):
    """The load of all paths at once."""
    path = joined(paths, FREQUENCY)
    return MovingPressure(tacton=Tacton(trajectory=path, foci=even_phases(len(paths)), **more))


def alone(path, **more):
    """The load of one of them."""
    own = replace(path, speed=FREQUENCY * path.length)
    return MovingPressure(tacton=Tacton(trajectory=own, **more))


@pytest.mark.parametrize("more", [{"am_frequency": 140.0}, {"rhythm": PULSES}])
def test_the_pressure_is_the_mean_of_each(more):
    rng = np.random.default_rng(1)
    points, times = rng.uniform(-0.04, 0.04, (200, 2)), rng.random(300)
    for paths, error in ((STRAIGHT, 1e-6), (STRAIGHT[1:2], 1e-6), (WITH_ROUND, 2e-3)):
        summed = sum(alone(path, **more)(points, times) for path in paths) / len(paths)
        found = together(paths, **more)(points, times)
        assert np.abs(found - summed).max() < error * np.abs(summed).max()


@pytest.mark.parametrize(
    ("paths", "more"),
    [
        (STRAIGHT, {"rhythm": PULSES, "duration": 0.297}),
        (WITH_ROUND, {"am_frequency": 140.0}),
    ],
    ids=["straight", "with a circle"],
)
def test_lines_are_those_of_the_load_sampled(paths, more):
    load = together(paths, **({"duration": 0.2} | more))
    count = round(load.tacton.duration * 320_000)
    sampled = np.fft.rfft(load(PLACES, (np.arange(count) + 0.5) / 320_000), axis=0)[:200] / count
    sampled *= np.exp(-1j * np.pi * np.arange(200) / count)[:, None]
    sampled[1:] *= 2
    f, a = load_lines(load).gather(path_fourier(load, load.spot(PLACES, path_samples(load)).T).T)
    found = np.zeros_like(sampled)
    rank = np.round(f * load.tacton.duration).astype(int)
    np.testing.assert_allclose(f, rank / load.tacton.duration, atol=1e-6)
    found[rank[rank < 200]] = a[rank < 200]
    assert np.abs(found - sampled).max() < 5e-4 * np.abs(sampled).max()


def test_lines_have_the_names_of_the_common_frequency():
    load = together(STRAIGHT, am_frequency=83.0, duration=0.2)
    names = named_lines(load)
    assert load.tacton.drawing_frequency == pytest.approx(FREQUENCY)
    assert [name for name in names if name.endswith("f_d")][:5] == ["f_d", "2f_d", "3f_d", "4f_d",
                                                                    "5f_d"]  # fmt: skip
    assert names["f_d"] == pytest.approx(FREQUENCY)
    assert names["2f_d-f_AM"] == pytest.approx(2 * FREQUENCY - 83)
    # A quarter of it cancels between them and is named by nothing.
    found = load_lines(together(STRAIGHT)).frequencies
    assert len(found) > 8
    np.testing.assert_allclose(found / FREQUENCY, np.round(found / FREQUENCY), atol=1e-9)
    response = point_kernel(load, PLACES, np.arange(8000) / 4e4)
    assert (lines(response, [names["f_d"], names["f_d-f_AM"]]).max(axis=1) > 0.1).all()
    assert not named_lines(together(STRAIGHT, duration=1 / FREQUENCY))  # which is run once


def test_what_cannot_be_joined_is_refused():
    for paths, frequency in (
        ((), 100.0),
        (STRAIGHT, float("nan")),
        ((joined(STRAIGHT, 1.0),), 1.0),
    ):
        with pytest.raises(ValueError, match="no paths|above 0|points of its own"):
            joined(paths, frequency)
