"""Noise floor of periodograms: a running median, which a few lines do not raise."""

from itertools import pairwise

import numpy as np
from scipy.ndimage import median_filter
from scipy.special import fdtrc, gammaincinv, gammaln

from skinwave.typing import Floats

FEWEST_BINS = 10  # bins of the band of the median
CORRELATED = 1 + 2 * (0.28 + 0.016)  # bins under a Hann window per independent bin of a median


def noise_floor(density: Floats, runs: int, kept: Floats | None = None) -> Floats:
    """Return the noise floor (f, p) of densities (f, p), means of `runs` repetitions.

    `kept` (f,) is the share of noise that remains in each bin after lines were fitted and removed.
    A parabola through medians of half octaves in logarithms is divided out first, so that noise
    that falls with frequency has no bias at the ends.
    """
    count = len(density)
    kept = np.ones(count) if kept is None else kept
    bins, knots = _noise_bins(kept), _knots(count)
    round_off = 1e-40  # of the largest density
    least = round_off * density.max(initial=0.0) + np.finfo(float).tiny
    positive = np.maximum(density[bins] / kept[bins, None], least)
    level = _trend(bins, positive, count)
    flat = positive / level[bins]
    medians = np.array([np.median(flat[low:high], axis=0) for low, high in _bands(knots, bins)])
    local = np.column_stack([np.interp(np.arange(count), knots, x) for x in medians.T])
    floor: Floats = level * local * runs / float(gammaincinv(runs, 0.5))
    return floor


def freedom(runs: int, kept: Floats) -> Floats:
    """Return the degrees of freedom (f,) of a floor, from the variance of a median."""
    bins, knots = _noise_bins(kept), _knots(len(kept))
    counts = [kept[bins[low:high]].sum() for low, high in _bands(knots, bins)]
    each: Floats = np.interp(np.arange(len(kept)), knots, counts)
    return np.maximum(8 * each / CORRELATED * _median_density(runs) ** 2, 2.0)


def false_alarm(ratio: Floats, runs: int, bins: int) -> Floats:
    """Return the probability (f, p) that noise exceeds ratios (f, p) of density to floor."""
    k = np.arange(bins)
    h = _half_width(k)
    counts = (np.minimum(k + h, bins - 1) - np.maximum(k - h, 1) + 1) / CORRELATED
    degrees = 8 * counts * _median_density(runs) ** 2
    probability: Floats = fdtrc(2.0 * runs, degrees[:, None], ratio)
    return probability


def _noise_bins(kept: Floats) -> np.ndarray:
    """Return the bins with enough remaining noise: at least half of those around any bin."""
    least_kept = 0.5  # share of the noise that a bin next to lines must have left
    least = np.minimum(least_kept, median_filter(kept, 2 * FEWEST_BINS + 1))
    return 1 + np.flatnonzero((kept[1:] >= least[1:]) & (kept[1:] > 0))


def _bands(knots: np.ndarray, bins: np.ndarray) -> np.ndarray:
    """Return ranges (k, 2) of bins around knots, the last plus one, at least `FEWEST_BINS` bins."""
    h = _half_width(knots)
    low, high = (np.searchsorted(bins, edge) for edge in (knots - h, knots + h + 1))
    missing = np.maximum(FEWEST_BINS - (high - low), 0)
    return np.column_stack([np.maximum(low - missing, 0), np.minimum(high + missing, len(bins))])


def _half_width(k: np.ndarray) -> np.ndarray:
    half_band, widest = 0.25, 400  # half-width of the band over the frequency; bins
    return np.clip(half_band * k, FEWEST_BINS, widest).astype(int)


def _knots(bins: int) -> np.ndarray:
    """Return the bins at which medians are computed, a quarter of a band apart."""
    knots = [1]
    while knots[-1] < bins - 1:
        step = max(int(_half_width(np.array(knots[-1]))) // 2, 1)
        knots.append(min(knots[-1] + step, bins - 1))
    return np.array(knots)


def _trend(bins: np.ndarray, density: Floats, count: int) -> Floats:
    """Return a parabola (count, p) in log frequency through log medians of half octaves."""
    edges = np.unique(np.geomspace(2, count, max(int(2 * np.log2(count)), 4)).astype(int))
    bands = [band for band in pairwise(np.searchsorted(bins, edges).tolist()) if band[1] > band[0]]
    x = np.array([np.log(bins[low:high].mean()) for low, high in bands])
    y = np.array([np.log(np.median(density[low:high], axis=0)) for low, high in bands])
    weight = np.sqrt([[min(high - low, FEWEST_BINS)] for low, high in bands])
    basis = np.vander(x, min(3, len(x)), increasing=True)
    coefficients = np.linalg.lstsq(basis * weight, y * weight, rcond=None)[0]
    k = np.log(np.maximum(np.arange(count), 2.0))
    level: Floats = np.exp(np.vander(k, basis.shape[1], increasing=True) @ coefficients)
    return level


def _median_density(runs: int) -> float:
    """Return the median of the gamma distribution of `runs` periodograms times its density there.

    The relative variance of the median of m values is 1 over 4 m times its square; that of
    chi-square over nu is 2 / nu.
    """
    median = float(gammaincinv(runs, 0.5))
    return median * float(np.exp((runs - 1) * np.log(median) - median - gammaln(runs)))
