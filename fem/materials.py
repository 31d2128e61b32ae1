"""Rayleigh damping that stands in for a constant loss factor in time, and the materials of all
models.
"""

from math import pi, sqrt

import numpy as np

from simple_model.material import PRESETS, Material, from_young

__all__ = ["PRESETS", "Material", "from_young", "rayleigh_damping"]


def rayleigh_damping(loss_factor: float, band: tuple[float, float]) -> tuple[float, float]:
    """Coefficients (a, b) of the damping a M + b K that stand in for a constant loss factor.

    Viscous damping a M + b K has the loss factor a/w + b w; over the band (Hz) its largest and
    smallest values lie equally far above and below the given one (least maximum deviation).
    """
    low, high = 2 * pi * np.array(band)
    middle, spread = sqrt(low * high), sqrt(high / low)
    # a/w + b w is least, 2 b middle, at the middle, and largest, b middle (r + 1/r), at both ends.
    b = 2 * loss_factor / middle / (2 + spread + 1 / spread)
    return b * middle**2, b
