"""Drive laws of a device that does not do what it is told: more than two lines of AM.

Scene files that name them are read where `SKINWAVE_EXTENSIONS` has the name of `registered_laws`.
"""

import numpy as np

from simple_model import DriveLaw
from simple_model.typing import Floats

COMPRESSION = 0.25  # of the pressure at small drive over that at full drive, less 1


def _clipped(amplitude: Floats | float, modulation: Floats, depth: float) -> Floats:
    """[A max(0, 1 + 2 m M)/(1 + 2 m)]^2: sound pressure modulated beyond its full depth, and off
    where it would change its sign.
    """
    return (amplitude * np.maximum(1 + 2 * depth * modulation, 0) / (1 + 2 * depth)) ** 2


def _compressed(amplitude: Floats | float, modulation: Floats, depth: float) -> Floats:
    """(1 + c) x/(1 + c x) of x = [A (1 + m M)/(1 + m)]^2: as acoustic saturation does, full drive
    yields less than in proportion.
    """
    x = (amplitude * (1 + depth * modulation) / (1 + depth)) ** 2
    return np.asarray((1 + COMPRESSION) * x / (1 + COMPRESSION * x))


CLIPPED = DriveLaw(name="clipped", pressure=_clipped, words="modulated beyond full depth")
COMPRESSED = DriveLaw(name="compressed", pressure=_compressed, words="usual AM, saturating")
LAWS = {law.name: law for law in (CLIPPED, COMPRESSED)}
