"""Window functions for spectral lines.

`scipy.signal` has them too, but brings all of `scipy.stats`, and every command would wait for it.
"""

import numpy as np
from scipy.special import i0

from simple_model.typing import Floats

# Weights of cosines (Harris 1978, doi:10.1109/PROC.1978.10837).
COSINES = {"hann": (0.5, 0.5), "blackmanharris": (0.35875, 0.48829, 0.14128, 0.01168)}


def cosines(name: str, n: int) -> Floats:
    """A periodic window (n,) of so many cosines."""
    if n < 2:
        return np.ones(n)
    turn = np.linspace(-np.pi, np.pi, n + 1)[:n]
    window = np.zeros(n)
    for k, weight in enumerate(COSINES[name]):
        window += weight * np.cos(k * turn)
    return window


def kaiser(n: int, beta: float) -> Floats:
    """A symmetric Kaiser window (n,) (Kaiser & Schafer 1980, eq. 1)."""
    if n < 2:
        return np.ones(n)
    half = (n - 1) / 2
    return np.asarray(i0(beta * np.sqrt(1 - ((np.arange(n) - half) / half) ** 2)) / i0(beta))


def named(name: str, n: int) -> Floats:
    """A periodic window (n,) of any name that `scipy.signal.get_window` knows."""
    if name in COSINES:
        return cosines(name, n)
    from scipy.signal import get_window

    return np.asarray(get_window(name, n))
