"""Delays that bring lines into step: maxima of the correlation of two sums of sinusoids."""

import numpy as np

from meshes.tetmesh import Floats

A_PERIOD = 8  # trial delays in a period of the highest line
NEWTON = 5  # steps
MOST_TRIALS = 2**21


def correlation(
    frequencies: Floats, products: np.ndarray, delays: Floats, order: int = 0
) -> Floats:
    """Correlation (d,) of lines at trial delays, Re sum (2 pi i f)^n s exp(2 pi i f d), or its
    derivative with respect to the delay.

    Parameters
    ----------
    frequencies : (f,) float, Hz
    products : (f,) complex s, sums of conj(model) times measured
    delays : (d,) float, s
    order : n, of the derivative
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
    top = top[height[top] > 0]
    if not len(top):
        top = np.array([int(np.argmax(height))])
    top = top[np.argsort(-height[top], kind="stable")[:1000]]
    delays = np.asarray(trial[top], np.float64)
    for _ in range(NEWTON):
        slope = correlation(frequencies, products, delays, 1)
        bend = correlation(frequencies, products, delays, 2)
        move = np.where(bend < 0, -slope / np.where(bend < 0, bend, -1.0), 0.0)
        delays = delays + np.clip(move, -step, step)
    return delays, correlation(frequencies, products, delays)


def best_delay(frequencies: Floats, products: np.ndarray, window: float) -> float:
    """Delay in s of the highest correlation, the least of those that are as high."""
    delays, heights = maxima(frequencies, products, window)
    alike = heights >= heights.max() - 1e-9 * np.abs(products).sum()
    return float(delays[alike][np.argmin(np.abs(delays[alike]))])
