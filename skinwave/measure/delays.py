"""Delays that bring signals into step: places measured one after the other by the reference that
was recorded with each, and lines by maxima of the correlation of two sums of sinusoids.
"""

import numpy as np
from scipy.special import fdtrc

from simple_model.windows import cosines
from skinwave.typing import Floats

A_PERIOD = 8  # trial delays in a period of the highest line
NEWTON = 5  # steps
MOST_TRIALS = 2**21
JITTER = 1e-3  # chance below which repetitions are out of step
LEAST_LEFT = 0.5  # of the samples, after what is not common to all places is cut off
ALIKE = 0.8  # correlation of references that are of one signal
WHOLE = 0.01  # samples: smaller fractions of a delay are round-off
ONE_AFTER_ANOTHER = (
    "no reference was recorded with each place: they are taken as simultaneous, and phases between "
    "places are wrong unless one trigger started all"
)


def correlation(
    frequencies: Floats, products: np.ndarray, delays: Floats, order: int = 0
) -> Floats:
    """Correlation (d,) of lines at frequencies (f,) at trial delays (d,), or its n-th derivative,
    Re sum (2 pi i f)^n s exp(2 pi i f d); s (f,) are sums of conj(model) times measured.
    """
    s = 2j * np.pi * frequencies
    turned = np.exp(np.multiply.outer(np.atleast_1d(delays), s))
    return np.asarray((turned @ (s**order * products)).real)


def maxima(frequencies: Floats, products: np.ndarray, window: float) -> tuple[Floats, Floats]:
    """Local maxima of the correlation: delays (k,) in s, up to half a window, and heights (k,).

    Sampled `A_PERIOD` times a period of the highest line, then by Newton's method.
    """
    highest = float(frequencies.max(initial=0.0))
    if not (highest > 0 and window > 0 and np.abs(products).sum() > 0):
        return np.zeros(1), correlation(frequencies, products, np.zeros(1))
    n = int(min(np.ceil(A_PERIOD * highest * window), MOST_TRIALS)) | 1
    step = window / max(n - 1, 1)
    trial = (np.arange(-1, n + 1) - (n - 1) / 2) * step
    height = np.concatenate([correlation(frequencies, products, part)
                             for part in np.array_split(trial, 1 + n // 4096)])  # fmt: skip
    top = 1 + np.flatnonzero((height[1:-1] >= height[:-2]) & (height[1:-1] > height[2:]))
    top = top[height[top] > 0] if (height[top] > 0).any() else np.array([int(np.argmax(height))])
    chosen = top[np.argsort(-height[top], kind="stable")[:1000]]
    delays = _by_newton(frequencies, products, np.asarray(trial[chosen], np.float64), step)
    return delays, correlation(frequencies, products, delays)


def _by_newton(frequencies: Floats, products: np.ndarray, delays: Floats, step: float) -> Floats:
    """Maxima of the correlation next to delays (k,)."""
    for _ in range(NEWTON):
        slope, bend = (correlation(frequencies, products, delays, n) for n in (1, 2))
        move = np.where(bend < 0, -slope / np.where(bend < 0, bend, -1.0), 0.0)
        delays = delays + np.clip(move, -step, step)
    return delays


def in_step(each: np.ndarray, frequencies: Floats) -> tuple[np.ndarray, Floats]:
    """Two or more repetitions (r, f, p) shifted onto their mean where they are out of step, and by
    how much (r,) in s, of the mean zero.

    Delays are those of least squares over all lines and places, within a period of the lowest line.
    They are taken where an F test of what they leave against what there was is significant for as
    many independent delays as there were to choose from.
    """
    r = len(each)
    if not frequencies.size:
        return each, np.zeros(r)
    period = 1 / float(frequencies.min())
    spread = _squares(each).mean(axis=1, keepdims=True)  # of lines, over places
    weights = 1 / np.where(spread > 0, spread, 1)
    reference, shifts = each[0], np.zeros(r)
    for _ in range(3):
        products = (weights * reference.conj() * each).sum(axis=2)
        shifts = np.array([_best_delay(frequencies, s, period) for s in products])
        shifted = each * _turned(frequencies, shifts)
        reference = shifted.mean(axis=0)
        left = _squares(shifted).mean(axis=1, keepdims=True)
        weights = 1 / np.where(left > 0, left, 1)
    shifts = shifts - shifts.mean()
    shifted = each * _turned(frequencies, shifts)
    before, after = ((weights * _squares(x)).sum() for x in (each, shifted))
    if not after > 0:
        return each, np.zeros(r)
    freedom = max(2 * each[0].size * (r - 1) - (r - 1), 1)
    gained = (before - after) / (r - 1) / (after / freedom)
    chance = fdtrc(r - 1, freedom, max(gained, 0.0))
    choices = 2 * period * float(frequencies.max())
    power = float((weights * np.abs(shifted) ** 2).sum())
    in_common = 1 - float(after) / power if power > 0 else 0.0
    # Of noise alone delays can be found that bring it into step in part.
    if chance * choices ** (r - 1) < JITTER and in_common > (1 + 1 / r) / 2:
        return shifted, shifts
    return each, np.zeros(r)


def _best_delay(frequencies: Floats, products: np.ndarray, window: float) -> float:
    """Delay in s of the highest correlation, the least of those that are as high."""
    delays, heights = maxima(frequencies, products, window)
    alike = heights >= heights.max() - 1e-9 * np.abs(products).sum()
    return float(delays[alike][np.argmin(np.abs(delays[alike]))])


def _turned(frequencies: Floats, shifts: Floats) -> np.ndarray:
    return np.exp(2j * np.pi * np.multiply.outer(shifts, frequencies))[:, :, None]


def _squares(each: np.ndarray) -> Floats:
    """Sum (f, p) of squared deviations from the mean."""
    return np.asarray((np.abs(each - each.mean(axis=0)) ** 2).sum(axis=0))


def aligned(values: Floats, references: Floats) -> tuple[Floats, Floats, str]:
    """Values (r, t, p) from where the reference (r, t, p) of each begins, that reference, and a
    sentence. Of references that are not alike there is none, and values are as they were.
    """
    lags = _lags(references)
    count = values.shape[1]
    begin = lags - lags.min()
    left = count - int(np.ceil(begin.max()))
    if left < LEAST_LEFT * count:
        return values, np.empty(0), (
            f"places are not aligned in time: their references lie {begin.max():.0f} samples apart"
        )  # fmt: skip
    moved, drives = _shifted(values, begin, left), _shifted(references, begin, left)
    centred = drives - drives.mean(axis=1, keepdims=True)
    centred /= np.linalg.norm(centred, axis=1, keepdims=True) + np.finfo(float).tiny
    alike = np.einsum("t,rtp->rp", centred[0, :, 0], centred)
    if alike.min() < ALIKE:
        return values, np.empty(0), (
            f"places are not aligned in time: their references differ, with a correlation of "
            f"{alike.min():.2g}; phases between places are unknown"
        )  # fmt: skip
    said = f"places aligned in time by their references, by up to {np.ptp(lags):.4g} samples"
    return moved, drives[0, :, 0], said


def _lags(references: Floats) -> Floats:
    """Delay (r, p) in samples of each reference (r, t, p) behind the first: where the
    cross-correlation is largest, and a fraction of a sample by what then overlaps.
    """
    from scipy.signal import correlate  # which takes long to import

    centred = references - references.mean(axis=1, keepdims=True)
    n = centred.shape[1]
    first = centred[0, :, 0]
    found = np.zeros((centred.shape[0], centred.shape[2]))
    for r, p in np.ndindex(*found.shape):
        one = centred[r, :, p]
        lag = int(np.argmax(correlate(one, first, method="fft"))) - (n - 1)
        fraction = _fraction(
            first[max(-lag, 0) : n - max(lag, 0)], one[max(lag, 0) :][: n - abs(lag)]
        )
        found[r, p] = lag + (fraction if WHOLE < abs(fraction) < 1 else 0.0)
    return found


def _fraction(first: Floats, other: Floats) -> float:
    """Delay in samples of a signal behind another that it nearly overlaps."""
    window = cosines("hann", len(first))
    cross = np.fft.rfft(window * other) * np.fft.rfft(window * first).conj()
    cycles = np.asarray(np.fft.rfftfreq(len(first)), np.float64)
    return float(_by_newton(cycles, cross, np.zeros(1), 1.0)[0])


def _shifted(values: Floats, begin: Floats, left: int) -> Floats:
    """Values (r, m, p) from `begin` (r, p) on, between samples by cubic splines."""
    from scipy.interpolate import CubicSpline  # only where it is needed: it takes a while

    found = np.empty((values.shape[0], left, values.shape[2]))
    for r, p in np.ndindex(*begin.shape):
        whole = int(begin[r, p])
        at = begin[r, p] + np.arange(left)
        found[r, :, p] = (
            values[r, whole : whole + left, p] if whole == begin[r, p]
            else CubicSpline(np.arange(values.shape[1]), values[r, :, p])(at)
        )  # fmt: skip
    return found
