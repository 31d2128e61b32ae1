"""Projection of points to a level set."""

from collections.abc import Callable

import numpy as np

from meshes.tetmesh import Floats


def project_to_level_set(
    points: Floats,
    level_set: Callable[[Floats], Floats],
    gradient: Callable[[Floats], Floats],
    steps: int = 4,
) -> Floats:
    """Points moved onto a level set by Newton steps along its gradient.

    Parameters
    ----------
    points : (n, 3) float, metre, near the level set
    level_set, gradient : functions of points (n, 3) in metre: values (n,), slopes (n, 3)
    steps : Newton steps

    Returns
    -------
    (n, 3) float, metre
    """
    for _ in range(steps):
        slope = gradient(points)
        steepness = np.maximum(np.einsum("ni,ni->n", slope, slope), 1e-12)
        points = points - (level_set(points) / steepness)[:, None] * slope
    return points
