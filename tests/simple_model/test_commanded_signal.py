"""Equation 1 of the paper, its parameter ranges, and the paths of the focus."""

import numpy as np
import pytest

from simple_model import SHAPES, SUPERPOSITIONS, Tacton, Trajectory, commanded, modulation


@pytest.mark.parametrize(("size", "speed"), [(0.010, 6), (0.020, 12), (0.030, 18)])
def test_the_papers_circles_are_drawn_at_191_hz(size, speed):
    path = Trajectory(shape="circle", size=size, speed=speed)
    assert path.drawing_frequency == pytest.approx(190.986, abs=5e-4)


@pytest.mark.parametrize(
    ("path", "expected"),
    [
        ({"shape": "triangle"}, 6 / (3 * 0.02)),
        ({"shape": "square"}, 6 / (4 * 0.02)),
        ({"shape": "line"}, 6 / (2 * 0.02)),
        ({"shape": "line", "sweep": "one_way"}, 6 / 0.02),
        ({"shape": "point"}, 0),
    ],
)
def test_drawing_frequency_is_speed_over_length_of_one_period(path, expected):
    assert Trajectory(size=0.02, speed=6, **path).drawing_frequency == pytest.approx(expected)


@pytest.mark.parametrize("shape", [s for s in SHAPES if s != "point"])
def test_the_focus_keeps_its_speed_and_comes_back(shape):
    path = Trajectory(shape=shape, size=0.03, speed=5.0)
    period = 1 / path.drawing_frequency
    t = np.linspace(0, period, 36001)
    steps = np.linalg.norm(np.diff(path.position(t), axis=0), axis=1)
    assert steps.sum() == pytest.approx(path.length, rel=1e-6)
    assert np.median(steps) / np.diff(t)[0] == pytest.approx(5.0, rel=1e-6)
    np.testing.assert_allclose(path.position(0.0), path.position(period), atol=1e-12)


def test_a_one_way_line_jumps_back():
    path = Trajectory(shape="line", size=0.02, speed=2.0, sweep="one_way")
    np.testing.assert_allclose(path.position([0.0, 0.0099999]), [[-0.01, 0], [0.01, 0]], atol=1e-6)
    np.testing.assert_allclose(path.position(0.0100001), [-0.01, 0], atol=1e-6)


def test_the_square_and_the_triangle_have_the_side_they_are_asked_for():
    for shape, corners in (("square", 4), ("triangle", 3)):
        at = Trajectory(shape=shape, size=0.06, speed=1).at_phase(np.arange(corners) / corners)
        sides = np.linalg.norm(at - np.roll(at, 1, axis=0), axis=1)
        np.testing.assert_allclose(sides, 0.06, rtol=1e-12)
        np.testing.assert_allclose(at.mean(axis=0), 0, atol=1e-15)


def test_positions_do_not_drift_in_ten_seconds():
    path = Trajectory(shape="circle", size=0.02, speed=12)
    t = 1909 / path.drawing_frequency  # a whole number of turns, 9.995 s
    np.testing.assert_allclose(path.position(t), [0.01, 0], atol=1e-13)


def test_frequency_zero_is_a_factor_of_one():
    t = np.linspace(0, 1, 1001)
    np.testing.assert_array_equal(modulation(Tacton(), t), 1.0)
    np.testing.assert_allclose(
        modulation(Tacton(am_frequency=80), t), np.sin(2 * np.pi * 80 * t), atol=1e-15
    )


def test_equation_one_with_everything_on():
    t = np.linspace(0, 0.01, 4001)
    tacton = Tacton(
        amplitude=0.5, am_frequency=80, second_am_frequency=140,
        superposition=(0.25, 0.75), envelope_frequency=3,
    )  # fmt: skip
    mixed = 0.25 * np.sin(2 * np.pi * 80 * t) + 0.75 * np.sin(2 * np.pi * 140 * t)
    expected = 0.5 * np.sin(2 * np.pi * 40e3 * t) * mixed * np.sin(2 * np.pi * 3 * t)
    np.testing.assert_allclose(commanded(tacton, t), expected, atol=1e-15)


@pytest.mark.parametrize("weights", [*SUPERPOSITIONS, (0.1, 0.9)])
def test_weights_that_sum_to_one_are_accepted(weights):
    assert Tacton(superposition=weights).superposition == weights


@pytest.mark.parametrize(
    ("build", "said"),
    [
        (lambda: Tacton(amplitude=1.2), "120 % is outside 0..100 %"),
        (lambda: Tacton(am_frequency=-1), "am_frequency = -1"),
        (lambda: Tacton(am_frequency=float("nan")), "am_frequency = nan"),
        (lambda: Tacton(superposition=(0.5, 0.6)), "sum 1"),
        (lambda: Tacton(superposition=(1.5, -0.5)), "sum 1"),
        (lambda: Tacton(duration=0), "<= 30 s, the longest Tacton; give one above 0"),
        (lambda: Tacton(duration=32), "the longest Tacton; shorten it"),
        (lambda: Trajectory(size=0.061), "size = 61 mm is outside 0..60 mm"),
        (lambda: Trajectory(speed=float("inf")), "speed = inf"),
        (lambda: Trajectory(shape="circel"), "did you mean 'circle'"),
        (lambda: Trajectory(sweep="oneway"), "did you mean 'one_way'"),
    ],
)
def test_values_out_of_range_are_refused_with_limit_and_cure(build, said):
    with pytest.raises(ValueError, match=said):
        build()
