"""Smoothing of tetrahedral meshes with fixed connectivity.

Each inner node moves to the mean of the centroids of its elements, weighted by their volume over
the target volume: the centroidal patches of Chen and Holst, Comput Methods Appl Mech Eng 200:967
(2011), doi 10.1016/j.cma.2010.11.007.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from meshes.tetmesh import TetMesh, boundary_facets, corner_volumes, interface_facets
from meshes.typing import Floats, Ints
from meshes.volume.quality import angles_between_faces, restore_bad

Sizing = Callable[[Floats], Floats]


def smooth(mesh: TetMesh, sizing: Sizing | None = None, *, good: float = 25.0) -> TetMesh:
    """Return a four-node mesh with moved inner nodes; no smallest angle of an element falls below
    the angle `good` in degrees, or gets smaller if it is below it.

    Nodes on the boundary and between regions stay. `sizing` maps points (n, 3) to target edge
    lengths (n,) in m; None for equal sizes.
    """
    points, tets = np.array(mesh.points), mesh.tets
    outer = np.zeros(len(points), bool)
    outer[boundary_facets(tets)] = outer[interface_facets(mesh)] = True
    for _ in range(12):
        moved = _means(points, tets, sizing)
        moved[outer] = points[outer]
        points = _without_losses(tets, points, points + 0.7 * (moved - points), good)
    for node in np.unique(tets[_least_angles(points, tets) < good]):
        if not outer[node]:
            _widen(points, tets[(tets == node).any(axis=1)], node)
    return replace(mesh, points=points)


def _widen(points: Floats, patch: Ints, node: int) -> None:
    """Move a node by trial to where the smallest angle of its elements is largest."""
    best = _least_angles(points, patch).min()
    length = np.linalg.norm(np.ptp(points[patch], axis=1), axis=1).mean()
    # Trial moves of a node of a sharp element: distances over the edges around it, and directions.
    trial_steps = np.array([0.2, 0.1, 0.05, 0.025] * 2)
    directions = np.array([d for d in np.ndindex(3, 3, 3) if d != (1, 1, 1)]) - 1.0
    for reach in length * trial_steps:
        for place in points[node] + reach * directions:
            before = points[node].copy()
            points[node] = place
            least = _least_angles(points, patch).min()
            if least > best and (corner_volumes(points, patch) > 0).all():
                best = least
            else:
                points[node] = before


def _least_angles(points: Floats, tets: Ints) -> Floats:
    return np.asarray(angles_between_faces(points, tets).min(axis=1))


def _means(points: Floats, tets: Ints, sizing: Sizing | None) -> Floats:
    """Weighted mean (n, 3) of the centroids of the tetrahedra at each node."""
    centroids, weight = points[tets].mean(axis=1), corner_volumes(points, tets)
    if sizing:
        weight = weight / sizing(centroids) ** 3
    nodes, weights = tets.ravel(), np.repeat(weight, 4)
    total = np.maximum(np.bincount(nodes, weights, len(points)), 1e-300)
    sums = [np.bincount(nodes, weights * np.repeat(x, 4), len(points)) for x in centroids.T]
    return np.column_stack(sums) / total[:, None]


def _without_losses(tets: Ints, points: Floats, moved: Floats, good: float) -> Floats:
    """Moved nodes, restored at elements whose angles get worse."""
    floor = np.minimum(_least_angles(points, tets), good)

    def gets_worse(at: Floats) -> np.ndarray:
        return np.asarray((_least_angles(at, tets) < floor) | (corner_volumes(at, tets) <= 0))

    return restore_bad(points, moved, tets, gets_worse)[0]
