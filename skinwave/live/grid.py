"""The square grid on which packs hold the motion of bounded bodies."""

import numpy as np

from meshes.tetmesh import Floats

STEP, SIDE = 3e-3, 37  # m between places, and places along a side


def grid_line() -> Floats:
    """Coordinates (SIDE,) in metre of the grid along each side."""
    return np.asarray(STEP * (np.arange(SIDE) - (SIDE - 1) / 2))
