"""Tetrahedra made more even without changing which nodes they join.

Each inner node goes to the mean of the centroids of its elements, weighted by how large they are
compared to what is asked for: the centroidal patches of Chen and Holst, Comput Methods Appl Mech
Eng 200:967 (2011), doi 10.1016/j.cma.2010.11.007.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from meshes.quality import angles_between_faces
from meshes.tetmesh import Floats, Ints, TetMesh, boundary_facets, corner_volumes

STEPS, SHARE = 12, 0.7  # of the way that a node goes in each
GOOD = 25.0  # degrees: smaller angles may not shrink, larger ones not below it


def smoothed(mesh: TetMesh, sizing: Callable[[Floats], Floats] | None = None) -> TetMesh:
    """The 4-node mesh with its inner nodes moved; no least angle below 25 degrees gets less.

    Parameters
    ----------
    sizing : function of points (n, 3) in metre to edge lengths (n,) asked for; None if equal.
    """
    points, tets = np.array(mesh.points), mesh.tets
    inner = np.ones(len(points), bool)
    inner[boundary_facets(tets)] = False
    for _ in range(STEPS):
        moved = np.where(inner[:, None], _means(points, tets, sizing), points)
        points = _no_worse(tets, points, points + SHARE * (moved - points))
    return replace(mesh, points=points)


def _means(points: Floats, tets: Ints, sizing: Callable[[Floats], Floats] | None) -> Floats:
    """Weighted mean (n, 3) of the centroids of the elements at each node."""
    centroids, weight = points[tets].mean(axis=1), corner_volumes(points, tets)
    if sizing:
        weight = weight / sizing(centroids) ** 3
    nodes, weights = tets.ravel(), np.repeat(weight, 4)
    total = np.bincount(nodes, weights, len(points))
    return np.column_stack(
        [
            np.bincount(nodes, weights * np.repeat(centroids[:, axis], 4), len(points)) / total
            for axis in range(3)
        ]
    )


def _no_worse(tets: Ints, points: Floats, moved: Floats) -> Floats:
    """Moved nodes go back at elements that lose by it."""
    floor = np.minimum(angles_between_faces(points, tets).min(axis=1), GOOD)
    while True:
        worse = angles_between_faces(moved, tets).min(axis=1) < floor
        worse |= corner_volumes(moved, tets) <= 0
        nodes = np.unique(tets[worse])
        nodes = nodes[(moved[nodes] != points[nodes]).any(axis=1)]
        if not len(nodes):
            return moved
        moved[nodes] = points[nodes]
