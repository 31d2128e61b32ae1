"""Noise floor of periodograms: a running median, which a few lines do not raise."""

from itertools import pairwise

import numpy as np
from scipy.special import fdtrc, gammaincinv, gammaln

from simple_model.trajectory import Floats

SHARE = 0.25  # of its frequency: the half-width of the band of the median,
FEWEST, WIDEST = 10, 400  # bins, at least and at most
CORRELATED = 1 + 2 * (4 / 9 + 1 / 36)  # bins of a Hann window that stand for one


def floor_of(density: Floats, runs: int) -> Floats:
    """Noise floor (f, p) of densities (f, p) that are means of so many repetitions.

    A parabola through medians of half octaves in logarithms is taken out before, so that noise that
    falls with frequency has no bias at the ends.
    """
    positive = np.maximum(density, np.finfo(float).tiny)
    level = _trend(positive)
    flat = positive / level
    knots = _knots(len(density))
    widths = _half_width(knots)
    medians = np.array(
        [np.median(flat[max(k - h, 1) : k + h + 1], axis=0)
         for k, h in zip(knots, widths, strict=True)]
    )  # fmt: skip
    bins = np.arange(len(density))
    local = np.column_stack([np.interp(bins, knots, column) for column in medians.T])
    floor: Floats = level * local / _median_over_mean(runs)
    return floor


def tail(ratio: Floats, runs: int, bins: int) -> Floats:
    """Probability (f, p) that noise alone exceeds such ratios (f, p) of density to floor."""
    k = np.arange(bins)
    h = _half_width(k)
    counted = (np.minimum(k + h, bins - 1) - np.maximum(k - h, 1) + 1) / CORRELATED
    freedom = 8 * counted * _median_density(runs) ** 2
    found: Floats = fdtrc(2.0 * runs, freedom[:, None], ratio)
    return found


def _half_width(k: np.ndarray) -> np.ndarray:
    return np.clip(SHARE * k, FEWEST, WIDEST).astype(int)


def _knots(bins: int) -> np.ndarray:
    """Bins where medians are taken, a quarter of a band apart."""
    found, k = [1], 1
    while k < bins - 1:
        k = min(k + max(int(_half_width(np.array(k))) // 2, 1), bins - 1)
        found.append(k)
    return np.array(found)


def _trend(density: Floats) -> Floats:
    """Parabola in log frequency through the logarithm of medians of half octaves (f, p)."""
    bins = len(density)
    edges = np.unique(np.geomspace(2, bins, max(int(2 * np.log2(bins)), 4)).astype(int))
    centres, heights, counts = [], [], []
    for low, high in pairwise(edges):
        centres.append(np.log((low + high - 1) / 2))
        heights.append(np.log(np.median(density[low:high], axis=0)))
        counts.append(high - low)
    x, weight = np.array(centres), np.sqrt(counts)[:, None]
    basis = np.vander(x, min(3, len(x)), increasing=True)
    found = np.linalg.lstsq(basis * weight, np.array(heights) * weight, rcond=None)[0]
    k = np.log(np.maximum(np.arange(bins), 2.0))
    level: Floats = np.exp(np.vander(k, basis.shape[1], increasing=True) @ found)
    return level


def _median_over_mean(runs: int) -> float:
    """Median over mean of the gamma distribution of a mean of so many periodograms."""
    return float(gammaincinv(runs, 0.5)) / runs


def _median_density(runs: int) -> float:
    """Median times the probability density there of the same; the variance of the median of m is
    1 over 4 m times its square, relative to it, and that of chi-square over nu 2/nu.
    """
    median = float(gammaincinv(runs, 0.5))
    return median * float(np.exp((runs - 1) * np.log(median) - median - gammaln(runs)))
