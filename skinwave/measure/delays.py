"""Delays between signals. Places measured in turn are aligned by their references, lines by maxima
of the correlation of two sums of sinusoids.
"""

import numpy as np
from scipy.special import fdtrc

from simple_model.spectra import cosines
from skinwave.typing import Floats


def correlation(
    frequencies: Floats, products: np.ndarray, delays: Floats, order: int = 0
) -> Floats:  # fmt: skip
    """Return the correlation Re sum s exp(2 pi i f d) at delays (d,) in s, or its n-th derivative.

    The products s (f,) are sums of conj(model) * measured, at frequencies (f,) in Hz.
    """
    s = 2j * np.pi * frequencies
    turned = np.exp(np.multiply.outer(np.atleast_1d(delays), s))
    return np.asarray((turned @ (s**order * products)).real)


def maxima(frequencies: Floats, products: np.ndarray, window: float) -> tuple[Floats, Floats]:
    """Return delays (k,) and heights (k,) of the maxima of the correlation within half a window."""
    highest = float(frequencies.max(initial=0.0))
    if not (highest > 0 and window > 0 and np.abs(products).sum() > 0):
        return np.zeros(1), correlation(frequencies, products, np.zeros(1))
    trials_per_period = 8  # of the highest line
    most_trials = 2**21
    n = int(min(np.ceil(trials_per_period * highest * window), most_trials)) | 1
    step = window / max(n - 1, 1)
    trials = (np.arange(-1, n + 1) - (n - 1) / 2) * step
    blocks = np.array_split(trials, 1 + n // 4096)
    height = np.concatenate([correlation(frequencies, products, block) for block in blocks])
    top = 1 + np.flatnonzero((height[1:-1] >= height[:-2]) & (height[1:-1] > height[2:]))
    top = top[height[top] > 0] if (height[top] > 0).any() else np.array([int(np.argmax(height))])
    chosen = top[np.argsort(-height[top], kind="stable")[:1000]]
    delays = _refine(frequencies, products, np.asarray(trials[chosen], np.float64), step)
    return delays, correlation(frequencies, products, delays)


def _refine(frequencies: Floats, products: np.ndarray, delays: Floats, step: float) -> Floats:
    """Return the maxima of the correlation next to delays (k,), by Newton's method."""
    for _ in range(5):
        slope, bend = (correlation(frequencies, products, delays, n) for n in (1, 2))
        move = np.where(bend < 0, -slope / np.where(bend < 0, bend, -1.0), 0.0)
        delays = delays + np.clip(move, -step, step)
    return delays


def in_step(each: np.ndarray, frequencies: Floats) -> tuple[np.ndarray, Floats]:
    """Return repetitions (r, f, p) shifted onto their mean, and their delays (r,) in s.

    Delays are the least squares over all lines and places, within a period of the lowest line.
    Repetitions are shifted only if an F test of the residual with and without shifts is significant
    for the number of independent delays that were tried; otherwise delays are 0.
    """
    r = len(each)
    unshifted = each, np.zeros(r)
    if not frequencies.size:
        return unshifted
    period = 1 / float(frequencies.min())
    weights, reference, shifts = _weights(each), each[0], np.zeros(r)
    for _ in range(3):
        products = (weights * reference.conj() * each).sum(axis=2)
        shifts = np.array([_best_delay(frequencies, s, period) for s in products])
        shifted = each * _turn(frequencies, shifts)
        reference, weights = shifted.mean(axis=0), _weights(shifted)
    shifts = shifts - shifts.mean()
    shifted = each * _turn(frequencies, shifts)
    before, after = ((weights * _squares(x)).sum() for x in (each, shifted))
    if not after > 0:
        return unshifted
    freedom = max(2 * each[0].size * (r - 1) - (r - 1), 1)
    ratio = (before - after) / (r - 1) / (after / freedom)
    chance = fdtrc(r - 1, freedom, max(ratio, 0.0))
    choices = 2 * period * float(frequencies.max())
    power = float((weights * np.abs(shifted) ** 2).sum())
    in_common = 1 - float(after) / power if power > 0 else 0.0
    out_of_step = 1e-3  # p-value below which repetitions are shifted
    # Delays align even noise in part.
    if chance * choices ** (r - 1) < out_of_step and in_common > (1 + 1 / r) / 2:
        return shifted, shifts
    return unshifted


def _weights(each: np.ndarray) -> Floats:
    """Return weights (f, 1) of lines by their variance over repetitions and places."""
    spread = _squares(each).mean(axis=1, keepdims=True)
    return 1 / np.where(spread > 0, spread, 1)


def _best_delay(frequencies: Floats, products: np.ndarray, window: float) -> float:
    """Return the delay in s of the highest correlation, the smallest if there are several."""
    delays, heights = maxima(frequencies, products, window)
    alike = heights >= heights.max() - 1e-9 * np.abs(products).sum()
    return float(delays[alike][np.argmin(np.abs(delays[alike]))])


def _turn(frequencies: Floats, shifts: Floats) -> np.ndarray:
    return np.exp(2j * np.pi * np.multiply.outer(shifts, frequencies))[:, :, None]


def _squares(each: np.ndarray) -> Floats:
    return np.asarray((np.abs(each - each.mean(axis=0)) ** 2).sum(axis=0))


def align_by_references(values: Floats, references: Floats) -> tuple[Floats, Floats, str]:
    """Return values (r, t, p) aligned by references (r, t, p), the common one, and a remark."""
    lags, count = _lags(references), values.shape[1]
    begin = lags - lags.min()
    left = count - int(np.ceil(begin.max()))
    least_overlap = 0.5  # of the samples
    if left < least_overlap * count:
        return values, np.empty(0), (
            f"places are not aligned in time: their references are {begin.max():.0f} samples apart"
        )  # fmt: skip
    moved, drives = _shift(values, begin, left), _shift(references, begin, left)
    centred = drives - drives.mean(axis=1, keepdims=True)
    centred /= np.linalg.norm(centred, axis=1, keepdims=True) + np.finfo(float).tiny
    alike = np.einsum("t,rtp->rp", centred[0, :, 0], centred).min()
    least_correlation = 0.8  # of references of one signal
    if alike < least_correlation:
        return values, np.empty(0), (
            f"places are not aligned in time: their references have a correlation of {alike:.2g}; "
            "phases between places are unknown"
        )  # fmt: skip
    remark = f"places are aligned in time by their references, by up to {np.ptp(lags):.4g} samples"
    return moved, drives[0, :, 0], remark


def _lags(references: Floats) -> Floats:
    """Return delays (r, p) in samples of references (r, t, p) relative to the first."""
    from scipy.signal import correlate  # slow to import

    centred = references - references.mean(axis=1, keepdims=True)
    n, first = centred.shape[1], centred[0, :, 0]
    lags = np.zeros((centred.shape[0], centred.shape[2]))
    least_fraction = 0.01  # samples; smaller fractions of a delay are round-off
    for r, p in np.ndindex(*lags.shape):
        one = centred[r, :, p]
        lag = int(np.argmax(correlate(one, first, method="fft"))) - (n - 1)
        a, b = first[max(-lag, 0) : n - max(lag, 0)], one[max(lag, 0) :][: n - abs(lag)]
        window = cosines("hann", len(a))
        cross = np.fft.rfft(window * b) * np.fft.rfft(window * a).conj()
        cycles = np.asarray(np.fft.rfftfreq(len(a)), np.float64)
        fraction = float(_refine(cycles, cross, np.zeros(1), 1.0)[0])
        lags[r, p] = lag + (fraction if least_fraction < abs(fraction) < 1 else 0.0)
    return lags


def _shift(values: Floats, begin: Floats, left: int) -> Floats:
    """Return values (r, m, p) from `begin` (r, p) on, between samples by cubic splines."""
    from scipy.interpolate import CubicSpline  # slow to import

    shifted = np.empty((values.shape[0], left, values.shape[2]))
    for r, p in np.ndindex(*begin.shape):
        first, row = int(begin[r, p]), values[r, :, p]
        if first == begin[r, p]:
            shifted[r, :, p] = row[first : first + left]
        else:
            at = begin[r, p] + np.arange(left)
            shifted[r, :, p] = CubicSpline(np.arange(len(row)), row)(at)
    return shifted
