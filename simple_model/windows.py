"""Window functions for spectral lines.

`scipy.signal` has them too, but it imports `scipy.stats`, and every command would wait for it.
"""

import numpy as np

from simple_model.choices import choose
from simple_model.typing import Floats

# Weights of cosines (Harris 1978, doi:10.1109/PROC.1978.10837).
COSINES = {
    "boxcar": (1.0,),
    "hann": (0.5, 0.5),
    "blackmanharris": (0.35875, 0.48829, 0.14128, 0.01168),
}


def cosines(name: str, n: int) -> Floats:
    """Periodic window (n,) by its name in `COSINES`."""
    choose("window", name, COSINES)
    if n < 2:
        return np.ones(n)
    turn = np.linspace(-np.pi, np.pi, n + 1)[:n]
    window = np.zeros(n)
    for k, weight in enumerate(COSINES[name]):
        window += weight * np.cos(k * turn)
    return window
