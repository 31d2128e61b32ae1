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
    """Points (n, 3) near a level set, moved onto it by Newton steps along its gradient."""
    for _ in range(steps):
        slope = gradient(points)
        steepness = np.maximum(np.einsum("ni,ni->n", slope, slope), 1e-12)
        points = points - (level_set(points) / steepness)[:, None] * slope
    return points
