"""The square grid on which packs hold the motion of bounded bodies."""

import numpy as np

from meshes.tetmesh import Floats

STEP, SIDE = 3e-3, 37  # m between places, and places along a side


def grid_line() -> Floats:
    """Coordinates (SIDE,) in metre of the grid along each side."""
    return np.asarray(STEP * (np.arange(SIDE) - (SIDE - 1) / 2))


def smoothed(fields: Floats, width: float) -> Floats:
    """Forces (m, SIDE^2) of a focal spot of 1 Pa at each place of the grid, from fields of motion.

    Parameters
    ----------
    fields : (m, SIDE^2) float, motion into the body
    width : metre, standard deviation of the spot

    Returns
    -------
    (m, SIDE^2) float: a sum over the places, which for smooth fields is the integral
    """
    away = np.subtract.outer(grid_line(), grid_line())
    spot = STEP * np.exp(-(away**2) / (2 * width**2))
    return np.asarray(spot @ fields.reshape(-1, SIDE, SIDE) @ spot).reshape(len(fields), -1)
