"""Intervals of fits to data whose errors are not independent."""

import numpy as np
import pytest
from scipy.signal import lfilter

from skinwave.measure.intervals import estimates, profiles, widening, widenings
from skinwave.measure.observed import Data
from skinwave.measure.parameters import parse
from skinwave.measure.search import Problem, solve

N = 400
SHAPE = 1 + np.sin(2 * np.pi * np.arange(N) / 150)


def quiet(phase, fraction):
    pass


def coloured(rng, rho, shape=(N, 1)):
    """AR(1) noise (n, s) of variance 1, in its steady state."""
    white = rng.standard_normal((shape[0] + 200, *shape[1:]))
    return np.sqrt(1 - rho**2) * lfilter([1], [1, -rho], white, axis=0)[200:]


def fitted(values):
    """A fit of gain and offset of a slow wave, by least squares in three predictions."""
    shape = np.column_stack([SHAPE, np.ones(N)])
    data = Data(
        kind="waveforms", words="", axis=np.arange(N) / 1e3, unit="s", labels=("one",),
        values=values, error=np.full((N, 1), 0.1), is_known=True,
        predict=lambda v: (shape @ [v["gain"], v["offset_x_mm"]])[:, None],
    )  # fmt: skip
    vary = parse(["gain=0.2:5", "offset_x_mm=-1:1"])
    return solve(Problem(parameters=vary, data=data, linear=("gain",)), 1, 0, quiet)


def test_widening_of_a_mean_is_that_of_effective_samples():
    """Of long AR(1) noise (1 + rho) / (1 - rho) in variance (Bayley and Hammersley)."""
    rng = np.random.default_rng(0)
    for rho in (0.3, 0.6):
        noise = coloured(rng, rho, (20_000, 2))
        (factor,) = widening(noise, np.ones((1, 20_000, 2)))
        assert factor == pytest.approx(np.sqrt((1 + rho) / (1 - rho)), rel=0.08)


def test_intervals_of_white_residuals_stay_as_they_are():
    rng = np.random.default_rng(2)
    found = fitted(1.3 * SHAPE[:, None] + 0.1 * rng.standard_normal((N, 1)))
    assert widenings(found).tolist() == [1.0, 1.0]


def test_intervals_under_coloured_noise_hold_the_truth():
    """95 % of 100 draws; by independent errors it is 60 %."""
    rng, inside, by_profile = np.random.default_rng(3), [], []
    for draw in range(100):
        found = fitted(1.3 * SHAPE[:, None] + 0.1 * coloured(rng, 0.8))
        truth = {"gain": 1.3, "offset_x_mm": 0.0}
        inside += [each.low <= truth[each.key] <= each.high for each in estimates(found)]
        if draw < 20:
            by_profile += [p.low <= 1.3 <= p.high for p in profiles(found, quiet)[:1]]
    assert 0.86 <= np.mean(inside) <= 0.99
    assert np.mean(by_profile) >= 0.8
