"""Noise floor of periodograms: a running median, which a few lines do not raise."""

from itertools import pairwise

import numpy as np
from scipy.ndimage import median_filter
from scipy.special import fdtrc, gammaincinv, gammaln

from skinwave.typing import Floats

SHARE = 0.25  # of its frequency: the half-width of the band of the median,
FEWEST, WIDEST = 10, 400  # bins, at least and at most
ROUND_OFF = 1e-40  # of the largest density
LEAST_KEPT = 0.5  # share of the noise that a bin beside lines must have to tell the floor
CORRELATED = 1 + 2 * (0.28 + 0.016)  # bins of a Hann window that stand for one in a median


def floor_of(density: Floats, runs: int, kept: Floats | None = None) -> Floats:
    """Noise floor (f, p) of densities (f, p) that are means of so many repetitions, of which bins
    have kept a share (f,) where lines were fitted and taken out.

    A parabola through medians of half octaves in logarithms is taken out before, so that noise that
    falls with frequency has no bias at the ends.
    """
    kept = np.ones(len(density)) if kept is None else kept
    bins = _telling(kept)
    least = ROUND_OFF * density.max(initial=0.0) + np.finfo(float).tiny
    positive = np.maximum(density[bins] / kept[bins, None], least)
    level = _trend(bins, positive, len(density))
    flat = positive / level[bins]
    knots = _knots(len(density))
    medians = np.array([np.median(flat[low:high], axis=0) for low, high in _bands(knots, bins)])
    local = np.column_stack(
        [np.interp(np.arange(len(density)), knots, column) for column in medians.T]
    )
    floor: Floats = level * local / _median_over_mean(runs)
    return floor


def freedom(runs: int, kept: Floats) -> Floats:
    """Degrees of freedom (f,) of a floor, by the variance of the median of independent bins."""
    bins, knots = _telling(kept), _knots(len(kept))
    counted = [kept[bins[low:high]].sum() for low, high in _bands(knots, bins)]
    found: Floats = np.interp(np.arange(len(kept)), knots, counted)
    return np.maximum(8 * found / CORRELATED * _median_density(runs) ** 2, 2.0)


def _telling(kept: Floats) -> np.ndarray:
    """Bins with enough of the noise, of which there are at least half of those about any."""
    least = np.minimum(LEAST_KEPT, median_filter(kept, 2 * FEWEST + 1))
    return 1 + np.flatnonzero((kept[1:] >= least[1:]) & (kept[1:] > 0))


def _bands(knots: np.ndarray, bins: np.ndarray) -> np.ndarray:
    """First and last plus one (k, 2) of the bins about each knot, `FEWEST` or more on both sides
    together.
    """
    h = _half_width(knots)
    low, high = (np.searchsorted(bins, edge) for edge in (knots - h, knots + h + 1))
    lacking = np.maximum(FEWEST - (high - low), 0)
    return np.column_stack([np.maximum(low - lacking, 0), np.minimum(high + lacking, len(bins))])


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


def _trend(bins: np.ndarray, density: Floats, count: int) -> Floats:
    """Parabola in log frequency (count, p) through the logarithm of medians of half octaves of
    densities (b, p) at bins (b,).
    """
    edges = np.unique(np.geomspace(2, count, max(int(2 * np.log2(count)), 4)).astype(int))
    centres, heights, counts = [], [], []
    for low, high in pairwise(np.searchsorted(bins, edges).tolist()):
        if high > low:
            centres.append(np.log(bins[low:high].mean()))
            heights.append(np.log(np.median(density[low:high], axis=0)))
            counts.append(high - low)
    x, weight = np.array(centres), np.sqrt(np.minimum(counts, FEWEST))[:, None]
    basis = np.vander(x, min(3, len(x)), increasing=True)
    found = np.linalg.lstsq(basis * weight, np.array(heights) * weight, rcond=None)[0]
    k = np.log(np.maximum(np.arange(count), 2.0))
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
