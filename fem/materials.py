"""Rayleigh damping that stands in for a constant loss factor in time, and the materials of all
models.
"""

from collections.abc import Callable
from math import pi, sqrt

import numpy as np

from simple_model.material import PRESETS, Floats, Material, from_young

__all__ = ["PRESETS", "Material", "from_young", "rayleigh_damping"]


def rayleigh_damping(
    loss_factor: float,
    band: tuple[float, float],
    share: Callable[[Floats], Floats] | None = None,
) -> tuple[float, float]:
    """Rayleigh damping a M + b K that stands in for a constant loss factor in time.

    Viscous damping a M + b K has the loss factor a/w + b w; over the band its largest and smallest
    values lie equally far above and below the given one (least maximum deviation). Tension has no
    loss: K is then the elastic part alone, and a/w + b w share stands in for the loss factor times
    that part's share of the stiffness.

    Parameters
    ----------
    loss_factor : float
    band : (low, high) Hz
    share : angular frequencies (f,) in rad/s -> elastic share (f,) of a mode's stiffness, or None
        for 1

    Returns
    -------
    a in 1/s, and b in s
    """
    low, high = 2 * pi * np.array(band)
    if share is not None:
        return _of_share(loss_factor, np.geomspace(low, high, 64), share)
    middle, spread = sqrt(low * high), sqrt(high / low)
    # a/w + b w is least, 2 b middle, at the middle, and largest, b middle (r + 1/r), at both ends.
    b = 2 * loss_factor / middle / (2 + spread + 1 / spread)
    return b * middle**2, b


def _of_share(
    loss_factor: float, w: Floats, share: Callable[[Floats], Floats]
) -> tuple[float, float]:
    """The pair of least maximum deviation from a loss factor at w (f,), by linear programming."""
    from scipy.optimize import linprog  # which takes long to import

    one = np.column_stack([1 / w / share(w) * w[0], w / w[-1]])  # of a/w0 and of b w1
    bounds = np.vstack([np.column_stack([sign * one, -np.ones(len(w))]) for sign in (1, -1)])
    limits = np.repeat([1.0, -1.0], len(w))
    a, b, _ = linprog([0, 0, 1], A_ub=bounds, b_ub=limits).x
    return float(loss_factor * a * w[0]), float(loss_factor * b / w[-1])
