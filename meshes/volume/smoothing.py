"""Smoothing of tetrahedral meshes without change of their connectivity.

Each inner node goes to the mean of the centroids of its elements, weighted by how large they are
compared to what is asked for: the centroidal patches of Chen and Holst, Comput Methods Appl Mech
Eng 200:967 (2011), doi 10.1016/j.cma.2010.11.007.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from meshes.tetmesh import TetMesh, boundary_facets, corner_volumes, interface_facets
from meshes.typing import Floats, Ints
from meshes.volume.quality import angles_between_faces, moved_back

Sizing = Callable[[Floats], Floats]

STEPS, SHARE = 12, 0.7  # of the way that a node goes in each
# Where else a node of a sharp element is tried: how far, of the edges around, and which way.
TRIED = np.array([0.2, 0.1, 0.05, 0.025] * 2)
DIRECTIONS = np.array([d for d in np.ndindex(3, 3, 3) if d != (1, 1, 1)]) - 1.0
GOOD = 25.0  # degrees: smaller angles may not shrink, larger ones not below it


def smoothed(mesh: TetMesh, sizing: Sizing | None = None) -> TetMesh:
    """Smoothed four-node mesh: its inner nodes are moved so that no least angle below 25 degrees
    gets less; nodes of its boundary and between its regions stay. `sizing` is a function of points
    (n, 3) in metre to edge lengths (n,) asked for; None if equal.
    """
    points, tets = np.array(mesh.points), mesh.tets
    outer = np.zeros(len(points), bool)
    outer[boundary_facets(tets)] = outer[interface_facets(mesh)] = True
    for _ in range(STEPS):
        moved = _means(points, tets, sizing)
        moved[outer] = points[outer]
        points = _no_worse(tets, points, points + SHARE * (moved - points))
    for node in np.unique(tets[_least_angles(points, tets) < GOOD]):
        if not outer[node]:
            _widen(points, tets[(tets == node).any(axis=1)], node)
    return replace(mesh, points=points)


def _widen(points: Floats, patch: Ints, node: int) -> None:
    """Move a node to where the least angle of the elements at it is largest, by trial."""
    best = _least_angles(points, patch).min()
    length = np.linalg.norm(np.ptp(points[patch], axis=1), axis=1).mean()
    for reach in length * TRIED:
        for place in points[node] + reach * DIRECTIONS:
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
    """Weighted mean (n, 3) of the centroids of the tetrahedra at each node, by their volumes over
    those that are asked for.
    """
    centroids, weight = points[tets].mean(axis=1), corner_volumes(points, tets)
    if sizing:
        weight = weight / sizing(centroids) ** 3
    nodes, weights = tets.ravel(), np.repeat(weight, 4)
    total = np.maximum(np.bincount(nodes, weights, len(points)), 1e-300)
    sums = [np.bincount(nodes, weights * np.repeat(x, 4), len(points)) for x in centroids.T]
    return np.column_stack(sums) / total[:, None]


def _no_worse(tets: Ints, points: Floats, moved: Floats) -> Floats:
    """Moved nodes go back at elements that lose by it."""
    floor = np.minimum(_least_angles(points, tets), GOOD)

    def lose(at: Floats) -> np.ndarray:
        return np.asarray((_least_angles(at, tets) < floor) | (corner_volumes(at, tets) <= 0))

    return moved_back(points, moved, tets, lose)[0]
