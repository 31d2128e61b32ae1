"""The period of the whole pattern: what is played and shown without a jump."""

import numpy as np
import pytest

from simple_model import (
    MovingPressure,
    Rhythm,
    Signal,
    Tacton,
    Trajectory,
    evenly,
    joined,
    pattern_period,
)


def circle(f_d):
    return Trajectory(shape="circle", size=0.02, speed=0.02 * np.pi * f_d)


BOTH = {"second_am_frequency": 101.0, "superposition": (0.5, 0.5)}
PULSES = Rhythm(pulses=((0.05, 0.03),))
SHARED = joined([Trajectory(shape="circle", size=0.02), Trajectory(shape="point")], 185.0)


@pytest.mark.parametrize(
    ("tacton", "expected"),
    [
        ({"am_frequency": 140}, 1 / 140),
        ({"am_frequency": 140, "superposition": (0.0, 1.0)}, 1.0),  # not heard: nothing varies
        ({"am_frequency": 100, **BOTH}, 1.0),
        ({"am_frequency": 140, "envelope_frequency": 7}, 1 / 7),
        ({"am_frequency": 140, "trajectory": circle(200)}, 1 / 20),
        ({"am_frequency": 150, "trajectory": circle(200), "foci": evenly(2)}, 1 / 50),
        ({"trajectory": circle(200), "foci": evenly(4)}, 1 / 800),
        ({"trajectory": circle(200), "foci": (0.0, 0.3)}, 1 / 200),
        ({"trajectory": SHARED, "foci": evenly(2)}, 1 / 185),
        ({"am_frequency": 140, "rhythm": PULSES}, 0.4),
        ({"am_frequency": 140, "signal": Signal(rate=100, samples=(0.0, 1.0, 0.5))}, 0.15),
        ({"am_frequency": 0.5}, 1.0),
        ({}, 1.0),
    ],
)
def test_it_is_the_shortest_after_which_all_repeats(tacton, expected):
    made = Tacton(**tacton)
    found = pattern_period(made)
    assert found == pytest.approx(expected, rel=1e-9)
    if found < 0.99 * made.duration:
        load, t = MovingPressure(tacton=made), np.linspace(0, 0.2, 333) + 1.7e-5
        again = load([[0.006, 0.002]], t + found)
        np.testing.assert_allclose(load([[0.006, 0.002]], t), again, atol=1e-6)


def test_incommensurate_frequencies_nearly_return_after_their_slowest_beat():
    found = pattern_period(Tacton(am_frequency=140, trajectory=circle(190.98593171027443)))
    assert found == pytest.approx(11 / 140, rel=1e-3)
    assert found * 190.98593171027443 == pytest.approx(15, abs=0.01)
    beating = {"am_frequency": 100, "superposition": (0.5, 0.5), "second_am_frequency": 100.7313}
    # 10 ms brings both back within 1 % and would not show the beat.
    assert pattern_period(Tacton(**beating, duration=5)) == pytest.approx(1 / 0.7313, rel=0.01)
    # The Tacton ends before the beat does.
    assert pattern_period(Tacton(am_frequency=100, **BOTH, duration=0.3)) > 0.297
    # A beat that does not turn by 1 % within the Tacton is not seen in it.
    near = Tacton(am_frequency=200, trajectory=circle(200.001))
    assert pattern_period(near) == pytest.approx(1 / 200, rel=1e-4)


def test_it_never_exceeds_the_duration():
    rng = np.random.default_rng(0)
    for am, second, f_d, duration in zip(*rng.uniform(1, 400, (3, 40)), rng.random(40) + 1e-3,
                                         strict=True):  # fmt: skip
        tacton = Tacton(am_frequency=am, second_am_frequency=second, superposition=(0.5, 0.5),
                        trajectory=circle(f_d), duration=duration)  # fmt: skip
        assert 0 < pattern_period(tacton) <= duration
