"""Structured meshes: triangulated rectangles, discs and planes extruded to prisms of three
tetrahedra.

The loaded surface is the plane z = 0, with the body below it and the origin in its middle. The
nodes of each triangle are ordered by the parity of their grid position. Neighbouring prisms then
split their common side along the same diagonal, and the mesh has the mirror symmetries of its grid.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import prod

import numpy as np
from numpy.typing import ArrayLike

from meshes.facets import tag_boundary
from meshes.tetmesh import MeshError, TetMesh, boundary_facets, corner_volumes, facet_set, quadratic
from meshes.typing import Floats, Ints

Lines = tuple[Floats, Floats, Floats]  # m, increasing, along x, y and z


@dataclass(frozen=True, kw_only=True)
class Grading:
    """Growth of cell sizes away from the focus.

    Parameters
    ----------
    radius : float, m, half width of the square of fine cells
    growth : float, size ratio of neighbouring cells outside the square and downwards
    coarsest : float, m, largest cell

    Raises a MeshError if a value is out of range.
    """

    radius: float
    growth: float = 1.3
    coarsest: float = np.inf

    def __post_init__(self) -> None:
        if not (self.radius >= 0 and 1 <= self.growth < np.inf and self.coarsest > 0):
            raise MeshError(f"{self} needs radius >= 0, growth >= 1 and coarsest > 0")


def sheet(
    width: float,
    height: float,
    thickness: float,
    h: float,
    *,
    layers: int = 1,
    order: int = 2,
    planes: Sequence[Sequence[float]] = ((), ()),
) -> TetMesh:
    """Return a flat sheet whose edges are the facet set `clamped`.

    Parameters
    ----------
    width, height, thickness : float, m, along x, y and z
    h : float, m, largest side of a cell in the plane
    layers : int, elements through the thickness
    order : 1 or 2, four- or ten-node tetrahedra
    planes : places in m along x and along y where grid lines must lie

    Raises a MeshError if a length is not above 0 or there are too many cells.

    >>> sheet(0.1, 0.08, 1e-3, 0.01)
    <TetMesh: 1,071 nodes, 480 tetrahedra of 10 nodes, 1 regions; facets back, ...>
    """
    x, y = (
        with_planes(_cells(size, h), wanted)
        for size, wanted in zip((width, height), planes, strict=True)
    )
    mesh = extrude(x, y, np.linspace(-thickness, 0.0, layers + 1), order=order)
    return replace(mesh, facets={**mesh.facets, "clamped": mesh.facets["sides"]})


def block(
    lengths: tuple[float, float, float], h: float, *, grading: Grading | None = None, order: int = 2
) -> TetMesh:
    """Return a rectangular block with its base as `clamped` and its sides as `absorbing` facets.

    Parameters
    ----------
    lengths : three floats, m, along x, y and z
    h : float, m, largest side of a cell, under the focus if graded
    grading : growth of cells away from the focus; None for equal cells
    order : 1 or 2, four- or ten-node tetrahedra

    Raises a MeshError if a length is not above 0 or there are too many cells.

    >>> mesh = block((0.04, 0.04, 0.01), 0.005)
    >>> len(mesh.tets), sorted(mesh.facets)[:3]
    (768, ['absorbing', 'back', 'bottom'])
    """
    x_length, y_length, depth = lengths
    if grading is None:
        lines = _cells(x_length, h), _cells(y_length, h), _cells(depth, h, least=1) - depth / 2
    else:
        lines = (
            mirror_line(graded_axis(x_length / 2, h, grading)),
            mirror_line(graded_axis(y_length / 2, h, grading)),
            -graded_axis(depth, h, replace(grading, radius=0))[::-1],
        )
    mesh = extrude(*lines, order=order)
    roles = {"clamped": mesh.facets["bottom"], "absorbing": mesh.facets["sides"]}
    return replace(mesh, facets={**mesh.facets, **roles})


def middle_plane(mesh: TetMesh) -> Ints:
    """Return the triangles (k, 6) in the middle plane of an extruded sheet, in order of its top.

    Raises a MeshError if no nodes lie in this plane.
    """
    top = facet_set(mesh, "top")
    low, high = mesh.points[:, 2].min(), mesh.points[:, 2].max()
    layer = np.flatnonzero(np.abs(mesh.points[:, 2] - (low + high) / 2) < 1e-9 * (high - low))
    above = np.unique(top)
    by_place = [nodes[np.lexsort(mesh.points[nodes, :2].T)] for nodes in (layer, above)]
    if len(layer) != len(above) or (np.diff(mesh.points[by_place, :2], axis=0) != 0).any():
        raise MeshError("the mesh has no nodes in its middle plane; extrude it with order 2")
    below = np.zeros(len(mesh.points), np.int64)
    below[by_place[1]] = by_place[0]
    return below[top]


def disc(diameter: float, thickness: float, h: float, planes: Iterable[float] = ()) -> TetMesh:
    """Return ten-node tetrahedra of a cylinder below z = 0 on rings of triangles; h is the largest
    edge along a radius and downwards, and `planes` are depths, in m, where element layers end.
    """
    for name, length in (("diameter", diameter), ("thickness", thickness), ("h", h)):
        if not 0 < length < np.inf:
            raise MeshError(f"{name} = {length} m of a disc must be finite and above 0")
    rings, layers = (max(2, round_up(length / h)) for length in (diameter / 2, thickness))
    down = with_planes(np.linspace(0.0, thickness, layers + 1), planes)
    check_cell_count((2 * rings, 2 * rings, len(down) - 1), order=2)
    plane, triangles = _rings(rings)
    mesh = extrude_plane(plane * diameter / 2, triangles, -down[::-1])
    return tag_boundary(
        mesh,
        bottom=lambda centroids, normals: normals[:, 2] < -0.9,
        sides=lambda centroids, normals: np.abs(normals[:, 2]) < 0.1,
    )


def _rings(rings: int) -> tuple[Floats, Ints]:
    """Points (n, 2) of a unit disc, 8 k on ring k, and triangles (8 r^2, 3)."""
    sectors = 8  # of a disc: no element crosses x = 0 or y = 0
    start = np.cumsum([0, 1, *(sectors * np.arange(1, rings))])
    points, triangles = [np.zeros((1, 2))], []
    for k in range(1, rings + 1):
        angle = 2 * np.pi * np.arange(sectors * k) / (sectors * k)
        points.append(k / rings * np.column_stack([np.cos(angle), np.sin(angle)]))
        sector, i = np.divmod(np.arange(sectors * k), k)
        outer = start[k] + np.arange(sectors * k)
        following = start[k] + np.arange(1, sectors * k + 1) % (sectors * k)
        around = max(1, sectors * (k - 1))
        inner = start[k - 1] + (sector * (k - 1) + i) % around
        triangles.append(np.column_stack([outer, following, inner]))
        between = i < k - 1
        beside = start[k - 1] + (sector * (k - 1) + i + 1) % around
        triangles.append(np.column_stack([inner, following, beside])[between])
    return np.vstack(points), np.vstack(triangles)


def graded_axis(length: float, h: float, grading: Grading) -> Floats:
    """Return grid lines (n,) in m from 0 to a length: equal cells of size h, then growing ones.

    >>> graded_axis(0.05, 0.01, Grading(radius=0.02, growth=2.0)).tolist()
    [0.0, 0.01, 0.02, 0.05]
    """
    _check_lengths(length, h)
    fine = min(grading.radius, length)
    check_cell_count((fine / h, 1, 1))
    cells = [fine / n] * n if (n := round_up(fine / h)) else []
    rest, size, reached = length - fine, h, 0.0
    tail: list[float] = []
    while rest > 1e-9 * length and reached < rest:
        size = min(size * grading.growth if tail or cells else size, grading.coarsest)
        tail.append(size)
        reached += size
        check_cell_count((len(cells) + len(tail), 1, 1))
    if tail:
        # Drop the last cell if it is mostly beyond the end, and scale the growing ones.
        tail = tail[:-1] if len(tail) > 1 and reached - rest > tail[-1] / 2 else tail
        cells += list(np.array(tail) * (rest / sum(tail)))
    return np.concatenate([[0.0], np.cumsum(cells)])


def with_planes(line: Floats, planes: Iterable[float]) -> Floats:
    """Return grid lines with additional ones at given places, without lines too close to these."""
    places = np.array(sorted(planes))
    inner = line[1:-1]
    closest = 0.4  # of a cell: a plane replaces grid lines nearer than this
    if len(places) and len(inner):
        cell = np.minimum(np.diff(line)[:-1], np.diff(line)[1:])
        inner = inner[np.abs(inner[:, None] - places).min(axis=1) > closest * cell]
    return np.unique(np.concatenate([line[:1], inner, places, line[-1:]]))


def extrude(x: ArrayLike, y: ArrayLike, z: ArrayLike, *, order: int = 2) -> TetMesh:
    """Return tetrahedra on grid lines along x, y and z, in m.

    Diagonals alternate between cells. A grid of mirrored lines and an even number of cells has the
    mirror symmetries of the rectangle.

    Parameters
    ----------
    x, y, z : increasing, m
    order : 1 or 2, four- or ten-node tetrahedra

    Returns
    -------
    TetMesh with the facet sets `top`, `bottom`, `sides`, `left` and `right` (smallest and largest
    x), `front` and `back` (smallest and largest y)

    Raises a MeshError if grid lines do not increase or there are too many cells.

    >>> extrude([0, 1, 2], [0, 1], [-1, 0], order=1)
    <TetMesh: 12 nodes, 12 tetrahedra of 4 nodes, 1 regions; facets back, ...>
    """
    lines = [np.asarray(line, np.float64) for line in (x, y, z)]
    for name, line in zip("xyz", lines, strict=True):
        if line.ndim != 1 or len(line) < 2 or not (np.diff(line) > 0).all():
            raise MeshError(f"grid lines along {name} must be two or more increasing numbers")
    if order not in (1, 2):
        raise MeshError(f"order = {order} is not supported; use 1 or 2")
    check_cell_count((len(line) - 1 for line in lines), order)
    triangles = _rectangle_triangles(*lines[:2])
    yy, xx = np.meshgrid(lines[1], lines[0], indexing="ij")
    points, tets = _layers(np.column_stack([xx.ravel(), yy.ravel()]), triangles, lines[2])
    mesh = TetMesh(points=points, tets=tets, facets=_sides(points, boundary_facets(tets)))
    return quadratic(mesh) if order == 2 else mesh


def extrude_plane(
    plane: ArrayLike, triangles: ArrayLike, z: ArrayLike, *, order: int = 2
) -> TetMesh:
    """Return tetrahedra on any triangulated plane, with the facet set `top`.

    Parameters
    ----------
    plane : (n, 2) float, m
    triangles : (k, 3) int, nodes of the plane
    z : increasing heights of the layers, m
    order : 1 or 2, four- or ten-node tetrahedra
    """
    ranked = np.sort(np.asarray(triangles), axis=1)  # the same order everywhere: neighbours conform
    points, tets = _layers(np.asarray(plane), ranked, np.asarray(z))
    facets = boundary_facets(tets)
    top = facets[(points[facets, 2] == points[:, 2].max()).all(axis=1)]
    mesh = TetMesh(points=points, tets=tets, facets={"top": top})
    return quadratic(mesh) if order == 2 else mesh


def _layers(plane: Floats, triangles: Ints, z: Floats) -> tuple[Floats, Ints]:
    """Points and tetrahedra of a triangulated plane (n, 2) repeated at heights z."""
    n = len(plane)
    tets = np.vstack([_prism_tets(triangles + low * n, n) for low, _ in pairwise(range(len(z)))])
    points = np.column_stack([np.tile(plane, (len(z), 1)), np.repeat(z, n)])
    inverted = corner_volumes(points, tets) < 0
    tets[inverted, 2:] = tets[inverted, :1:-1]
    return points, tets


def _rectangle_triangles(x: Floats, y: Floats) -> Ints:
    """Two triangles per cell with alternating diagonals and nodes ordered by parity."""
    nx, ny = len(x) - 1, len(y) - 1
    # Parity counts from the origin, so that whole and half meshes have the same elements there. All
    # corners of a cell differ in rank. Its diagonal joins the first to the last, so that the six
    # tetrahedra of a cell share their longest edge.
    at_x, at_y = np.argmin(np.abs(x)), np.argmin(np.abs(y))
    j, i = np.divmod(np.arange(nx * ny), nx)
    a, b = j * (nx + 1) + i, j * (nx + 1) + i + 1
    d, c = a + nx + 1, b + nx + 1
    even = ((i - at_x + j - at_y) % 2 == 0)[:, None]
    first = np.where(even, np.column_stack([a, b, c]), np.column_stack([a, b, d]))
    second = np.where(even, np.column_stack([a, c, d]), np.column_stack([b, c, d]))
    triangles = np.vstack([first, second])
    row, column = np.divmod(triangles, nx + 1)
    rank = np.argsort(2 * ((column - at_x) % 2) + (row - at_y) % 2, axis=1)
    return np.take_along_axis(triangles, rank, axis=1)


def _prism_tets(triangles: Ints, per_layer: int) -> Ints:
    a0, a1, a2 = triangles.T
    b0, b1, b2 = triangles.T + per_layer
    prisms = ([a0, a1, a2, b2], [a0, a1, b2, b1], [a0, b1, b2, b0])
    return np.vstack([np.column_stack(nodes) for nodes in prisms])


def _sides(points: Floats, facets: Ints) -> dict[str, Ints]:
    """Facet sets of a box by the plane in which each facet lies."""
    corners = points[facets]
    low, high = points.min(axis=0), points.max(axis=0)
    names = (("left", "right"), ("front", "back"), ("bottom", "top"))
    sets = {
        name: facets[(corners[..., axis] == end[axis]).all(axis=1)]
        for axis, pair in enumerate(names) for name, end in zip(pair, (low, high), strict=True)
    }  # fmt: skip
    return sets | {"sides": np.vstack([sets[name] for pair in names[:2] for name in pair])}


def _cells(length: float, h: float, *, least: int = 2) -> Floats:
    """Equal cells no larger than h about the origin, in multiples of `least`."""
    _check_lengths(length, h)
    check_cell_count((length / h, 1, 1))
    return np.linspace(-length / 2, length / 2, least * max(1, round_up(length / (least * h))) + 1)


def check_cell_count(cells: Iterable[float], order: int = 2, most: int = 3_000_000) -> None:
    """Refuse numbers of cells along the three axes that give more than `most` degrees of freedom,
    by default as many as a workstation can factorise.
    """
    unknowns = 3.0 * prod(order * n + 1 for n in cells)
    if not unknowns <= most:
        raise MeshError(
            f"{unknowns:.2g} or more degrees of freedom exceed the limit of {most:,}; "
            "use larger elements or a smaller body"
        )


def _check_lengths(length: float, h: float) -> None:
    if not (0 < length < np.inf and 0 < h < np.inf):
        raise MeshError(f"length {length} m and h {h} m must be finite and above 0")


def round_up(ratio: float) -> int:
    """Return the ceiling, ignoring round-off just above a whole number."""
    return int(np.ceil(ratio - 1e-9))


def mirror_line(half: Floats) -> Floats:
    """Return a symmetric line (2 n - 1,) from its half (n,) that begins at 0."""
    return np.concatenate([-half[:0:-1], half])
