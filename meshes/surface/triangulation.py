"""Triangulated surfaces. Triangles are seen anticlockwise from outside."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from meshes.tetmesh import FURTHEST, MeshError
from meshes.typing import Floats, Ints


@dataclass(frozen=True, kw_only=True, eq=False)
class Surface:
    """Triangles in space.

    Parameters
    ----------
    points : (n, 3) float, metre
    triangles : (k, 3) int, point numbers from 0

    Raises a MeshError if shapes or point numbers do not fit, there is no triangle, or a point is
    not finite.
    """

    points: Floats
    triangles: Ints

    def __post_init__(self) -> None:
        points = _array("points", self.points, "coordinates in metre").astype(np.float64)
        triangles = _array("triangles", self.triangles, "point numbers")
        if triangles.dtype.kind not in "iu":
            raise MeshError(
                f"triangles must be whole numbers, not {triangles.dtype}; number points from 0"
            )
        bad = np.flatnonzero(~(np.abs(points) < FURTHEST).all(axis=1))
        if len(bad):
            raise MeshError(
                f"{len(bad)} of {len(points)} points are not finite, first point {bad[0]}; "
                "repair the file it comes from"
            )
        if triangles.min() < 0 or triangles.max() >= len(points):
            raise MeshError(
                f"point numbers of triangles run from {triangles.min()} to {triangles.max()}, "
                f"but there are {len(points)} points; number them from 0"
            )
        for name, array in (("points", points), ("triangles", triangles.astype(np.int64))):
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    @property
    def diagonal(self) -> float:
        """Diagonal of the bounding box, metre."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))


def volume(surface: Surface) -> float:
    """Enclosed volume in cubic metre; negative if the triangles are seen from inside."""
    a, b, c = centred_corners(surface)
    return float(np.einsum("ei,ei->", np.cross(a, b), c)) / 6


def areas_of(surface: Surface) -> Floats:
    """Area (k,) in square metre of each triangle."""
    a, b, c = centred_corners(surface)
    return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)


def area(surface: Surface) -> float:
    """Area in square metre."""
    return float(areas_of(surface).sum())


def thinnest(surface: Surface) -> float:
    """Twice volume over area, metre: the thickness of a plate, a third of a cube's side."""
    return 2 * abs(volume(surface)) / area(surface)


def compact(points: Floats, triangles: Ints) -> Surface:
    """The surface of these triangles with the points that they use."""
    used, numbers = np.unique(triangles, return_inverse=True)
    return Surface(points=points[used], triangles=numbers.reshape(-1, 3))


def pieces(surface: Surface) -> Ints:
    """Index (k,) of the connected piece that each triangle belongs to."""
    from scipy import sparse

    ends = surface.triangles[:, [0, 1, 1, 2]].reshape(-1, 2).T
    n = len(surface.points)
    graph = sparse.coo_array((np.ones(ends.shape[1], bool), tuple(ends)), shape=(n, n))
    label = sparse.csgraph.connected_components(graph, directed=False)[1]
    return np.unique(label[surface.triangles[:, 0]], return_inverse=True)[1]


def n_pieces(surface: Surface) -> int:
    """Number of connected pieces of the surface."""
    return int(pieces(surface).max()) + 1


def _array(name: str, values: ArrayLike, meaning: str) -> np.ndarray:
    try:
        array = np.array(values)
    except (TypeError, ValueError) as error:
        raise MeshError(f"{name} are no array ({error}); give (n, 3) {meaning}") from None
    if array.ndim != 2 or array.shape[1] != 3 or not len(array) or array.dtype.kind not in "biuf":
        raise MeshError(
            f"{name} of the surface have shape {array.shape} and type {array.dtype}; give (n, 3) "
            f"{meaning}, n > 0"
        )
    return array


def centred_corners(surface: Surface) -> tuple[Floats, Floats, Floats]:
    """Corners about the middle of the surface, so that products of lengths lose no digits."""
    points = surface.points - surface.points.mean(axis=0)
    a, b, c = surface.triangles.T
    return points[a], points[b], points[c]
