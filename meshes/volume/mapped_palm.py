"""Palm as a mapped structured mesh: a grid of boxes wrapped into its rounded outline and rim.

It needs no mesher and is the same in every run. Concentric rectangles in plan, and in the section
of the rim, become rectangles whose corners get rounder outwards. Boundary nodes then move onto the
level set, which adds the relief, and inner nodes follow by transfinite interpolation (Gordon and
Hall, Int J Numer Methods Eng 7:461, 1973).
"""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations

import numpy as np

from meshes.facets import tag_boundary, visible_from_above
from meshes.shapes.palm import Palm, gradient, level_set, rise
from meshes.shapes.structured import check_cell_count
from meshes.tetmesh import MeshError, TetMesh, corner_volumes, quadratic
from meshes.typing import Bools, Floats, Ints
from meshes.volume.curving import curve_boundary
from meshes.volume.quality import angles_between_faces
from meshes.volume.tetrahedralise import SHARPEST


def mapped_palm(palm: Palm, x: Floats, y: Floats, z: Floats) -> TetMesh:
    """Return ten-node tetrahedra of a palm whose boundary nodes lie on its level set.

    Parameters
    ----------
    x, y, z : (n,) float, m, increasing grid lines of the box around the palm without its relief:
        from -breadth/2 to breadth/2, -length/2 to length/2 and -thickness to 0

    Returns
    -------
    TetMesh with the facet sets `surface`, `top` (visible from above), `wrist`, `fingers` and `back`

    Raises a MeshError if there are too many cells or the relief is too steep.
    """
    cells = (len(x) - 1, len(y) - 1, len(z) - 1)
    tets = kuhn_tets(cells)
    box = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1)
    points = _onto_level_set(palm, _wrap(palm, box)).reshape(-1, 3)
    inverted = corner_volumes(points, tets).min() <= 0
    sharpest = 0.0 if inverted else float(angles_between_faces(points, tets).min())
    off = np.abs(level_set(palm, points[_on_boundary(cells).ravel()])).max()
    farthest = 1e-3  # of the thickness: largest distance of a boundary node from the level set
    if sharpest < SHARPEST or off > farthest * palm.thickness:
        raise MeshError(
            "this palm cannot be meshed, because its relief is too steep: the smallest angle "
            f"between faces is {sharpest:.2g} degrees, and the surface is missed by "
            f"{1e3 * off:.2g} mm; reduce thenar_height_mm, hypothenar_height_mm, pad_height_mm or "
            "cup_depth_mm, or use a mesh from a file"
        )
    mesh = quadratic(TetMesh(points=points, tets=tets))
    mesh = curve_boundary(mesh, lambda p: level_set(palm, p), lambda p: gradient(palm, p))
    return tag_boundary(
        mesh,
        rest="back",
        top=visible_from_above(mesh),
        wrist=lambda centroids, normals: normals[:, 1] < -(0.5**0.5),
        fingers=lambda centroids, normals: normals[:, 1] > 0.5**0.5,
    )


def kuhn_tets(cells: tuple[int, int, int]) -> Ints:
    """Return tetrahedra (6 n, 4) of a grid of cells whose nodes are numbered with the last axis
    fastest.

    Diagonals run outwards from the middle of the grid (Kuhn triangulation of each octant), so that
    no tetrahedron has two boundary facets.
    """
    check_cell_count(cells)
    places = np.stack(np.meshgrid(*map(np.arange, cells), indexing="ij"), axis=-1).reshape(-1, 3)
    outwards = np.where(places >= np.array(cells) // 2, 1, -1)
    strides = np.array([(cells[1] + 1) * (cells[2] + 1), cells[2] + 1, 1])
    inner = (places + (outwards < 0)) @ strides
    steps = outwards * strides
    tets = []
    for order in permutations(range(3)):
        b, c, d = inner + np.cumsum(steps[:, order], axis=1).T
        is_odd = outwards.prod(axis=1) * np.linalg.det(np.eye(3)[list(order)]) < 0
        tets.append(np.column_stack([inner, b, np.where(is_odd, d, c), np.where(is_odd, c, d)]))
    return np.vstack(tets)


def _wrap(palm: Palm, box: Floats) -> Floats:
    """Points (..., 3) of the box mapped to a palm without mounds, bent to its cup."""
    half = np.array([palm.breadth, palm.length]) / 2
    across, middle = palm.thickness / 2, box[..., 2] + palm.thickness / 2
    # Concentric rectangle through each point: 0 in the middle, 1 at the outline.
    level = np.abs(box[..., :2] / half).max(axis=-1)
    rim = 2.0  # width of the zone whose boxes follow the rim, over half the thickness
    width = min(half.min(), rim * across)
    beyond = width - (1 - level) * half.min()  # the inner edge of the rim
    inner, height = _round_corners(np.maximum(beyond, 0), middle, (width, across), palm.edge_radius)
    in_rim = beyond > 0
    moved = np.where(in_rim, 1 - (width - inner) / half.min(), level)
    height = np.where(in_rim, height, middle)
    plan = box[..., :2] * (moved / np.maximum(level, 1e-300))[..., None]
    plan = np.stack(_round_corners(plan[..., 0], plan[..., 1], half, palm.corner_radius), axis=-1)
    return np.concatenate([plan, (height - across + rise(palm, plan))[..., None]], axis=-1)


def _round_corners(
    x: Floats, y: Floats, half: tuple[float, float] | Floats, radius: float
) -> tuple[Floats, Floats]:
    """Points of a rectangle mapped to one with round corners. In each concentric rectangle of
    relative size t, the sides and the quarter circles, of t^2 times the radius, are divided evenly.
    """
    a, b = half
    level = np.maximum(np.maximum(np.abs(x) / a, np.abs(y) / b), 1e-300)
    on_x = np.abs(x) / a >= np.abs(y) / b  # on a side of constant x
    inwards = 2.0  # power of the distance from the middle with which corner radii grow outwards
    r = radius * level**inwards
    side = level * np.where(on_x, b, a)
    straight = side - r
    way = np.abs(np.where(on_x, y, x)) / side * (straight + np.pi / 4 * r)
    angle = np.maximum(way - straight, 0) / np.maximum(r, 1e-300)
    out = level * np.where(on_x, a, b) - r * (1 - np.cos(angle))
    along = np.where(way <= straight, way, straight + r * np.sin(angle))
    return (np.copysign(np.where(on_x, out, along), x), np.copysign(np.where(on_x, along, out), y))


def _onto_level_set(palm: Palm, grid: Floats) -> Floats:
    """Grid (i, j, k, 3) with its boundary nodes on the level set; inner nodes follow."""
    outer = _on_boundary(tuple(n - 1 for n in grid.shape[:3]))
    moved = np.zeros_like(grid)
    # Along the normals of the mounds, nodes would gather in the dips between them.
    smooth = replace(palm, thenar_height=0.0, hypothenar_height=0.0, pad_height=0.0)
    points, normals = grid[outer], gradient(smooth, grid[outer])
    least_cosine = 0.3  # between the normals of a palm with and without mounds
    steps = 8  # of Newton's method, enough for mounds as high as the palm is thick
    for _ in range(steps):
        steepness = np.einsum("ni,ni->n", gradient(palm, points), normals)
        step = level_set(palm, points) / np.maximum(steepness, least_cosine)
        points = points - step[:, None] * normals
    moved[outer] = points - grid[outer]
    return grid + _transfinite(moved)


def _on_boundary(cells: tuple[int, ...]) -> Bools:
    outer = np.ones([n + 1 for n in cells], bool)
    outer[1:-1, 1:-1, 1:-1] = False
    return outer


def _transfinite(values: Floats) -> Floats:
    """Transfinite interpolation of values (i, j, k, ...) from the six sides of a grid."""
    rest = values
    for axis in range(3):
        rest = rest - _between_ends(rest, axis)
    return values - rest


def _between_ends(values: Floats, axis: int) -> Floats:
    """Linear interpolation along an axis between its ends."""
    n = values.shape[axis]
    share = np.linspace(0, 1, n).reshape([n if a == axis else 1 for a in range(values.ndim)])
    first, last = (np.take(values, [end], axis=axis) for end in (0, n - 1))
    return np.asarray((1 - share) * first + share * last)
