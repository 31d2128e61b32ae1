"""Tetrahedral meshes with regions and facet sets.

Nodes are numbered as in VTK: corners 0 1 2 3, then the mid-side nodes of the edges 01 12 02 03 13
23. Facets list their corners first, then their mid-side nodes, anticlockwise as seen from outside.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from meshes.typing import Bools, Floats, Ints

if TYPE_CHECKING:
    import pyvista as pv


log = logging.getLogger(__name__)

EDGES = np.array([[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]])
FACES = np.array([[1, 2, 3, 5, 9, 8], [0, 3, 2, 7, 9, 6], [0, 1, 3, 4, 8, 7], [0, 2, 1, 6, 5, 4]])


class MeshError(ValueError):
    """Raised for a mesh, surface or file from which no elements can be built."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TetMesh:
    """Tetrahedra with regions and named sets of boundary facets.

    Parameters
    ----------
    points : (n, 3) float, m
    tets : (m, 4) or (m, 10) int, node numbers in VTK order; inverted tetrahedra are reordered
    region : (m,) int, region number of each tetrahedron; 0 by default
    region_names : region number -> name
    facets : name -> (k, 3) or (k, 6) int, boundary facets as seen from outside
    unmoved : (n, 3) float, m, points before nodes were moved; their edges group the elements

    Raises a MeshError if shapes or node numbers do not fit, if a point is not finite or is further
    away than 1e50 m, or if a tetrahedron is flat.

    >>> from meshes import block
    >>> mesh = block((0.04, 0.03, 0.01), 0.01)
    >>> mesh.n_dofs, mesh.order, mesh.facets["top"].shape
    (729, 2, (32, 6))
    """

    points: Floats
    tets: Ints
    region: Ints = field(default_factory=lambda: np.zeros(0, np.int64))
    facets: Mapping[str, Ints] = field(default_factory=dict)
    region_names: Mapping[int, str] = field(default_factory=dict)
    unmoved: Floats | None = None

    def __post_init__(self) -> None:
        points = np.array(self.points, np.float64)
        tets = whole_numbers("tets", self.tets)
        _check(points, tets)
        tets = _orient(points, tets)
        region = whole_numbers("region", self.region)
        region = region if region.size else np.zeros(len(tets), np.int64)
        if region.shape != (len(tets),) or region.min() < 0:
            raise MeshError(
                f"region has shape {region.shape}; give one number, 0 or above, per tetrahedron"
            )
        facets = {name: _facets(name, nodes, points, tets) for name, nodes in self.facets.items()}
        for array in (points, tets, region, *facets.values()):
            array.setflags(write=False)
        values = {
            "points": points, "tets": tets, "region": region, "facets": MappingProxyType(facets),
            "region_names": MappingProxyType(dict(self.region_names)),
        }  # fmt: skip
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        sets = f"; facets {', '.join(sorted(self.facets))}" if self.facets else ""
        return (
            f"<TetMesh: {len(self.points):,} nodes, {len(self.tets):,} tetrahedra of "
            f"{self.tets.shape[1]} nodes, {len(np.unique(self.region))} regions{sets}>"
        )

    @property
    def order(self) -> int:
        """Polynomial order of the elements: 1 or 2."""
        return 1 if self.tets.shape[1] == 4 else 2

    @property
    def n_dofs(self) -> int:
        """Number of degrees of freedom, three displacement components per node."""
        return 3 * len(self.points)

    def to_pyvista(self) -> pv.UnstructuredGrid:
        """Return the mesh as a pyvista grid, in m.

        Regions are cell data. Each facet set that is not empty is field data, such as "facets:top".
        """
        import pyvista as pv

        nodes = self.tets.shape[1]
        cells = np.insert(self.tets, 0, nodes, axis=1).ravel()
        vtk_kinds, vtk_sets = {4: 10, 10: 24}, "facets:"  # cell types by node count
        kinds = np.full(len(self.tets), vtk_kinds[nodes], np.uint8)
        grid = pv.UnstructuredGrid(cells, kinds, self.points.copy())
        grid.cell_data["region"] = self.region.copy()
        for name, facets in self.facets.items():
            if len(facets):  # VTK has no empty arrays
                grid.field_data[vtk_sets + name] = facets.copy()
        return grid


def corner_volumes(points: Floats, tets: Ints) -> Floats:
    """Return the signed volume (m,) in m3 of the straight-edged tetrahedra."""
    a, b, c, d = (points[tets[:, i]] for i in range(4))
    return np.einsum("ei,ei->e", np.cross(b - a, c - a), d - a) / 6


def boundary_facets(tets: Ints) -> Ints:
    """Return the facets (k, 3 or 6) that belong to one tetrahedron only, as seen from outside."""
    width = 3 if tets.shape[1] == 4 else 6
    return tets[:, FACES[:, :width]][neighbours(tets) < 0]


def neighbours(tets: Ints) -> Ints:
    """Return the tetrahedron (m, 4) beyond each of the `FACES`, -1 at the boundary."""
    low, middle, high = np.sort(tets[:, FACES[:, :3]].reshape(-1, 3), axis=1).T
    edge = low * (tets.max() + 1) + middle
    order = np.lexsort((high, edge))
    same = (np.diff(edge[order]) == 0) & (np.diff(high[order]) == 0)
    one, other = order[:-1][same], order[1:][same]
    beyond = np.full(len(order), -1)
    beyond[one], beyond[other] = other // 4, one // 4
    return beyond.reshape(-1, 4)


def interface_facets(mesh: TetMesh) -> Ints:
    """Return the facets (k, 3 or 6) between regions, each once, seen from the higher region."""
    width = 3 if mesh.order == 1 else 6
    beyond = neighbours(mesh.tets)
    lower = (beyond >= 0) & (mesh.region[beyond] < mesh.region[:, None])
    return mesh.tets[:, FACES[:, :width]][lower]


def facet_set(mesh: TetMesh, facets: str | Ints) -> Ints:
    """Return the facets (k, 3 or 6) of a set by its name, or the given ones; raise a MeshError if
    the name is unknown or they do not fit.
    """
    if not isinstance(facets, str):
        return _facets("given", facets, mesh.points, mesh.tets)
    if facets not in mesh.facets:
        known = ", ".join(sorted(mesh.facets)) or "none"
        raise MeshError(f"the mesh has no facet set '{facets}'; it has: {known}")
    return mesh.facets[facets]


def quadratic(mesh: TetMesh) -> TetMesh:
    """Return the same straight-sided mesh with ten-node tetrahedra.

    >>> from meshes import block
    >>> quadratic(block((0.02, 0.02, 0.01), 0.01, order=1)).tets.shape
    (24, 10)
    """
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
    """Return the part of a mesh at positive x, y or z, with its cut in the facet set `mirror_x`.

    Raises a MeshError if tetrahedra cross the cut, or none lies on this side.
    """
    if axis not in ("x", "y", "z"):
        raise MeshError(f"axis '{axis}' is unknown; use x, y or z")
    coordinate = mesh.points[:, "xyz".index(axis)]
    away = np.where(np.abs(coordinate) < 1e-9 * np.abs(coordinate).max(), 0.0, coordinate)
    side = np.sign(away[mesh.tets[:, :4]])
    if ((side.min(axis=1) < 0) & (side.max(axis=1) > 0)).any():
        raise MeshError(
            f"tetrahedra cross the plane {axis} = 0; use an even number of cells along {axis}"
        )
    inside = side.max(axis=1) > 0
    if not inside.any():
        raise MeshError(f"no tetrahedron lies at positive {axis}; move the mesh")
    kept, nodes = part(mesh, inside)
    outer = boundary_facets(kept.tets)
    cut = outer[(away[nodes][outer] == 0).all(axis=1)]
    return replace(kept, facets={**kept.facets, f"mirror_{axis}": cut})


def part(mesh: TetMesh, inside: Bools) -> tuple[TetMesh, Ints]:
    """Return the mesh of some tetrahedra, a mask (m,), and the original numbers (k,) of nodes."""
    nodes, tets = np.unique(mesh.tets[inside], return_inverse=True)
    tets = tets.reshape(-1, mesh.tets.shape[1])
    number = np.full(len(mesh.points), -1)
    number[nodes] = np.arange(len(nodes))
    outer = facet_keys(boundary_facets(tets), len(nodes))

    def remaining(facets: Ints) -> Ints:
        kept = number[facets]
        kept = kept[(kept >= 0).all(axis=1)]
        return kept[np.isin(facet_keys(kept, len(nodes)), outer)]

    facets = {name: remaining(each) for name, each in mesh.facets.items()}
    piece = replace(
        mesh, points=mesh.points[nodes], tets=tets, region=mesh.region[inside], facets=facets,
        unmoved=None if mesh.unmoved is None else mesh.unmoved[nodes],
    )  # fmt: skip
    return piece, nodes


def facet_keys(facets: Ints, n: int) -> Ints:
    """Return a number (k,) for each facet that does not depend on the order of its corners."""
    low, middle, high = np.sort(facets[:, :3], axis=1).T
    return (low * n + middle) * n + high


def whole_numbers(name: str, values: ArrayLike) -> Ints:
    """Return whole numbers as a new array."""
    given = np.array(values)
    if given.size and given.dtype.kind not in "biu":
        raise MeshError(f"{name} has type {given.dtype}; give whole numbers, counted from 0")
    return given.astype(np.int64)


def _facets(name: str, nodes: ArrayLike, points: Floats, tets: Ints) -> Ints:
    facets, width = whole_numbers(f"facets '{name}'", nodes), 3 if tets.shape[1] == 4 else 6
    if not facets.size:
        return facets.reshape(0, width)
    if facets.ndim != 2 or facets.shape[1] != width:
        raise MeshError(
            f"facets '{name}' have shape {facets.shape}; give (k, {width}) node numbers for "
            f"{tets.shape[1]}-node tetrahedra"
        )
    check_node_numbers(f"node numbers of facets '{name}'", facets, points)
    return facets


def _check(points: Floats, tets: Ints) -> None:
    if points.ndim != 2 or points.shape[1] != 3:
        raise MeshError(f"points have shape {points.shape}; give (n, 3) coordinates in m")
    if tets.ndim != 2 or tets.shape[1] not in (4, 10) or not len(tets):
        raise MeshError(f"tets have shape {tets.shape}; give (m, 4) or (m, 10) node numbers, m > 0")
    check_finite(points)
    check_node_numbers("node numbers", tets, points)


def check_finite(points: Floats) -> None:
    """Refuse points (n, 3) that are not finite, or whose products would overflow."""
    furthest = 1e50  # m: beyond it, products of lengths overflow
    bad = np.flatnonzero(~(np.abs(points) <= furthest).all(axis=1))
    if len(bad):
        raise MeshError(
            f"{len(bad):,} points are not finite, first point {bad[0]}; repair the file"
        )


def check_node_numbers(what: str, nodes: Ints, points: Floats) -> None:
    """Refuse numbers that do not belong to any of the points (n, 3)."""
    if nodes.min() < 0 or nodes.max() >= len(points):
        raise MeshError(
            f"{what} run from {nodes.min()} to {nodes.max()} for {len(points)} points; number the "
            "points from 0"
        )


def _orient(points: Floats, tets: Ints) -> Ints:
    volume = corner_volumes(points, tets)
    corners = points[tets[:, EDGES]]
    longest = np.linalg.norm(corners[:, :, 1] - corners[:, :, 0], axis=2).max(axis=1)
    flattest = 1e-9  # volume over longest edge cubed: flatter tetrahedra have no usable shape
    flat = np.flatnonzero(np.abs(volume) <= flattest * longest**3)
    if len(flat):
        worst = flat[np.argmin(np.abs(volume[flat]) / np.maximum(longest[flat] ** 3, 1e-300))]
        raise MeshError(
            f"{len(flat):,} tetrahedra are flat, the worst is number {worst} with a volume of "
            f"{volume[worst]:.3g} m3; remesh the body or remove them"
        )
    inside_out = volume < 0
    # Swapping corners 2 and 3 inverts a tetrahedron; the mid-side nodes follow.
    mirrored = np.array([0, 1, 3, 2, 4, 8, 7, 6, 5, 9])
    if inside_out.any():
        log.info("reordered %d inverted tetrahedra of %d", inside_out.sum(), len(tets))
        tets[inside_out] = tets[inside_out][:, mirrored[: tets.shape[1]]]
    return tets
