"""Triangulated surfaces. Triangles are listed anticlockwise as seen from outside."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from meshes.tetmesh import MeshError, check_finite, check_node_numbers, whole_numbers
from meshes.typing import Floats, Ints


@dataclass(frozen=True, kw_only=True, eq=False)
class Surface:
    """Triangulated surface.

    Parameters
    ----------
    points : (n, 3) float, m
    triangles : (k, 3) int, point numbers from 0

    Raises a MeshError if shapes or point numbers do not fit, if there is no triangle, or if a point
    is not finite.
    """

    points: Floats
    triangles: Ints

    def __post_init__(self) -> None:
        points = np.array(self.points, np.float64)
        triangles = whole_numbers("triangles", self.triangles)
        for name, array in (("points", points), ("triangles", triangles)):
            if array.ndim != 2 or array.shape[1] != 3 or not len(array):
                raise MeshError(f"{name} have shape {array.shape}; give (n, 3) numbers, n > 0")
        check_finite(points)
        check_node_numbers("point numbers of triangles", triangles, points)
        for name, array in (("points", points), ("triangles", triangles)):
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    @property
    def diagonal(self) -> float:
        """Diagonal of the bounding box, m."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))


def volume(surface: Surface) -> float:
    """Return the enclosed volume in m3, negative if the triangles are inverted."""
    a, b, c = centred_corners(surface)
    return float(np.einsum("ei,ei->", np.cross(a, b), c)) / 6


def areas_of(surface: Surface) -> Floats:
    """Return the area (k,) in m2 of each triangle."""
    a, b, c = centred_corners(surface)
    return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)


def thinnest(surface: Surface) -> float:
    """Return twice the volume over the area, m: the thickness of a plate."""
    return 2 * abs(volume(surface)) / float(areas_of(surface).sum())


def compact(points: Floats, triangles: Ints) -> Surface:
    """Return the surface of these triangles, without unused points."""
    used, numbers = np.unique(triangles, return_inverse=True)
    return Surface(points=points[used], triangles=numbers.reshape(-1, 3))


def connected_components(n: int, pairs: Ints) -> Ints:
    """Label (n,) of the connected component of each of n items, linked in pairs (m, 2)."""
    from scipy import sparse

    graph = sparse.coo_array((np.ones(len(pairs), bool), tuple(pairs.T)), shape=(n, n))
    label: Ints = sparse.csgraph.connected_components(graph, directed=False)[1]
    return label


def pieces(surface: Surface) -> Ints:
    """Return the index (k,) of the connected piece that each triangle belongs to."""
    edges = surface.triangles[:, [0, 1, 1, 2]].reshape(-1, 2)
    label = connected_components(len(surface.points), edges)
    return np.unique(label[surface.triangles[:, 0]], return_inverse=True)[1]


def n_pieces(surface: Surface) -> int:
    """Return the number of connected pieces."""
    return int(pieces(surface).max()) + 1


def centred_corners(surface: Surface) -> tuple[Floats, Floats, Floats]:
    """Return the corners about the centre, so that products of lengths keep their digits."""
    points = surface.points - surface.points.mean(axis=0)
    a, b, c = surface.triangles.T
    return points[a], points[b], points[c]
