"""The one mesh record, and the few questions that are asked of it.

Local numbering is VTK's: corners 0 1 2 3, then the mid-side nodes of the edges
01 12 02 03 13 23. Facets are numbered corners first, mid-side nodes after, and
are seen anticlockwise from outside the body.
"""

import logging
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int_]

log = logging.getLogger(__name__)

EDGES = np.array([[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]])
FACES = np.array([[1, 2, 3, 5, 9, 8], [0, 3, 2, 7, 9, 6], [0, 1, 3, 4, 8, 7], [0, 2, 1, 6, 5, 4]])
# Exchanging corners 2 and 3 turns a tetrahedron inside out; the mid-side nodes follow.
MIRRORED = np.array([0, 1, 3, 2, 4, 8, 7, 6, 5, 9])
# A tetrahedron flatter than this (volume over longest edge cubed) has no usable shape.
FLATTEST = 1e-9


class MeshError(ValueError):
    """A mesh that no element can be built on."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TetMesh:
    """Tetrahedra with named sets of boundary facets.

    Parameters
    ----------
    points : (n, 3) float, metre
    tets : (m, 4) or (m, 10) int, node numbers in VTK order. Tetrahedra with negative
        volume are turned round; how many is logged.
    region : (m,) int, which material each tetrahedron is made of; all 0 if not given.
    facets : name -> (k, 3) or (k, 6) int, boundary facets seen from outside.

    Raises
    ------
    MeshError
        If shapes or node numbers do not fit, a point is not finite, or a tetrahedron is flat.
    """

    points: Floats
    tets: Ints
    region: Ints = field(default_factory=lambda: np.zeros(0, np.int64))
    facets: Mapping[str, Ints] = field(default_factory=dict)

    def __post_init__(self) -> None:
        points = np.array(self.points, np.float64)
        tets = np.array(self.tets, np.int64)
        _check(points, tets)
        tets = _oriented(points, tets)
        region = np.array(self.region, np.int64) if len(self.region) else np.zeros(len(tets), int)
        if region.shape != (len(tets),):
            raise MeshError(
                f"region has shape {region.shape} for {len(tets)} tetrahedra; give one per element"
            )
        facets = {name: np.array(nodes, np.int64) for name, nodes in self.facets.items()}
        for array in (points, tets, region, *facets.values()):
            array.setflags(write=False)
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "tets", tets)
        object.__setattr__(self, "region", region)
        object.__setattr__(self, "facets", MappingProxyType(facets))

    @property
    def order(self) -> int:
        """Polynomial order of the elements: 1 or 2."""
        return 1 if self.tets.shape[1] == 4 else 2

    @property
    def n_dofs(self) -> int:
        """Three displacement components per node."""
        return 3 * len(self.points)


def corner_volumes(points: Floats, tets: Ints) -> Floats:
    """Signed volume (m,) in cubic metre of the straight tetrahedra through the corners."""
    a, b, c, d = (points[tets[:, i]] for i in range(4))
    return np.einsum("ei,ei->e", np.cross(b - a, c - a), d - a) / 6


def boundary_facets(tets: Ints) -> Ints:
    """Facets (k, 3 or 6) that belong to one tetrahedron only, seen from outside."""
    width = 3 if tets.shape[1] == 4 else 6
    facets = tets[:, FACES[:, :width]].reshape(-1, width)
    low, middle, high = np.sort(facets[:, :3], axis=1).T
    n = tets.max() + 1
    order = np.lexsort((high, low * n + middle))
    key = np.stack([low, middle, high], axis=1)[order]
    same = (key[1:] == key[:-1]).all(axis=1)
    alone = ~np.append(same, False) & ~np.append(False, same)
    return facets[np.sort(order[alone])]


def facet_set(mesh: TetMesh, facets: str | Ints) -> Ints:
    """Facets (k, 3 or 6) of a named set, or the given ones.

    Raises
    ------
    MeshError
        If the mesh has no set of that name.
    """
    if not isinstance(facets, str):
        return np.asarray(facets, np.int64)
    if facets not in mesh.facets:
        known = ", ".join(sorted(mesh.facets)) or "none"
        raise MeshError(f"the mesh has no facet set '{facets}'; it has: {known}")
    return mesh.facets[facets]


def quadratic(mesh: TetMesh) -> TetMesh:
    """The same straight-sided body with 10-node tetrahedra."""
    if mesh.order == 2:
        return mesh
    n = len(mesh.points)
    pairs = np.sort(mesh.tets[:, EDGES], axis=2)
    keys, middle = np.unique(pairs[..., 0] * n + pairs[..., 1], return_inverse=True)
    midpoints = (mesh.points[keys // n] + mesh.points[keys % n]) / 2

    def middle_of(a: Ints, b: Ints) -> Ints:
        return n + np.searchsorted(keys, np.minimum(a, b) * n + np.maximum(a, b))

    def with_middles(facet: Ints) -> Ints:
        a, b, c = facet.T
        return np.column_stack([facet, middle_of(a, b), middle_of(b, c), middle_of(c, a)])

    return replace(
        mesh,
        points=np.vstack([mesh.points, midpoints]),
        tets=np.hstack([mesh.tets, n + middle.reshape(-1, 6)]),
        facets={name: with_middles(facet) for name, facet in mesh.facets.items()},
    )


def half(mesh: TetMesh, axis: str) -> TetMesh:
    """The part of a mesh where x (or y, z) is positive; its cut is the facet set `mirror_x`.

    Raises
    ------
    MeshError
        If tetrahedra cross the plane.
    """
    coordinate = mesh.points[:, "xyz".index(axis)]
    away = np.where(np.abs(coordinate) < 1e-9 * np.abs(coordinate).max(), 0.0, coordinate)
    side = np.sign(away[mesh.tets[:, :4]])
    if ((side.min(axis=1) < 0) & (side.max(axis=1) > 0)).any():
        raise MeshError(f"tetrahedra cross the plane {axis} = 0; mesh an even number of cells")
    inside = side.max(axis=1) > 0
    kept, tets = np.unique(mesh.tets[inside], return_inverse=True)
    number = np.full(len(mesh.points), -1)
    number[kept] = np.arange(len(kept))
    tets = tets.reshape(-1, mesh.tets.shape[1])
    facets = {
        name: number[nodes[(away[nodes].max(axis=1) > 0) & (away[nodes].min(axis=1) >= 0)]]
        for name, nodes in mesh.facets.items()
    }
    outer = boundary_facets(tets)
    cut = outer[(away[kept][outer] == 0).all(axis=1)]
    return TetMesh(
        points=mesh.points[kept],
        tets=tets,
        region=mesh.region[inside],
        facets=facets | {f"mirror_{axis}": cut},
    )


def _check(points: Floats, tets: Ints) -> None:
    if points.ndim != 2 or points.shape[1] != 3:
        raise MeshError(f"points have shape {points.shape}; give (n, 3) coordinates in metre")
    if tets.ndim != 2 or tets.shape[1] not in (4, 10) or not len(tets):
        raise MeshError(f"tets have shape {tets.shape}; give (m, 4) or (m, 10) node numbers, m > 0")
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(bad):
        raise MeshError(f"{len(bad)} points are not finite, first {bad[0]}; repair the mesh")
    if tets.min() < 0 or tets.max() >= len(points):
        raise MeshError(
            f"node numbers run from {tets.min()} to {tets.max()}, but there are "
            f"{len(points)} points; number them from 0"
        )


def _oriented(points: Floats, tets: Ints) -> Ints:
    volume = corner_volumes(points, tets)
    corners = points[tets[:, EDGES]]
    longest = np.linalg.norm(corners[:, :, 1] - corners[:, :, 0], axis=2).max(axis=1)
    flat = np.flatnonzero(np.abs(volume) <= FLATTEST * longest**3)
    if len(flat):
        worst = flat[np.argmin(np.abs(volume[flat]) / longest[flat] ** 3)]
        raise MeshError(
            f"{len(flat)} tetrahedra are flat, the worst is {worst} with volume "
            f"{volume[worst]:.3g} m3; remesh or remove them"
        )
    inside_out = volume < 0
    if inside_out.any():
        log.info("turned round %d tetrahedra of %d", inside_out.sum(), len(tets))
        tets[inside_out] = tets[inside_out][:, MIRRORED[: tets.shape[1]]]
    return tets
