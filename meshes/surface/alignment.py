"""Alignment of a surface with the device: rotation, centring and clipping."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from meshes.facets import heights_over
from meshes.surface.repair import repair
from meshes.surface.triangulation import Surface, compact, n_pieces, pieces
from meshes.tetmesh import MeshError
from meshes.typing import Bools, Floats

ROTATIONS = {  # each about one axis; the rows are the new x, y and z
    "+z": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "-z": [[1, 0, 0], [0, -1, 0], [0, 0, -1]],
    "+y": [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
    "-y": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
    "+x": [[0, 0, -1], [0, 1, 0], [1, 0, 0]],
    "-x": [[0, 0, 1], [0, 1, 0], [-1, 0, 0]],
}


def rotation_to_z(up: str) -> Floats:
    """Return the rotation (3, 3) that takes an axis (+x, -x, ... -z) to +z."""
    if up not in ROTATIONS:
        raise MeshError(f"up = '{up}' is not an axis; use one of {', '.join(ROTATIONS)}")
    return np.array(ROTATIONS[up], np.float64)


def align(surface: Surface) -> tuple[Surface, Floats]:
    """Move the top above the widest circle to the origin; return surface and shift (3,) in m."""
    x, y, _ = widest_circle(surface)
    shift = -np.array([x, y, height_at(surface, x, y)])
    return replace(surface, points=surface.points + shift), shift


def shift_to_origin(surface: Surface) -> Floats:
    """Return the shift (3,) in m that brings the top of a surface to the origin.

    It is 0 if the origin already lies on the top and inside the outline, by 3 mm or by half the
    radius of the widest circle; otherwise it is that of `align`.
    """
    x, y, radius = widest_circle(surface)
    low, cell, depth = _outline(surface)
    i, j = np.floor(-low / cell + 1).astype(int)
    in_raster = 0 <= i < depth.shape[0] and 0 <= j < depth.shape[1]
    inside, level = 3e-3, 1e-4  # m: least distance from the outline, largest height off the top
    if in_raster and depth[i, j] * cell >= min(inside, radius / 2):
        x = y = 0.0
    height = height_at(surface, x, y)
    shift = -np.array([x, y, height if abs(height) > level else 0.0])
    return shift + 0.0


def widest_circle(surface: Surface) -> tuple[float, float, float]:
    """Return the centre x, y and radius, m, of the widest circle in the outline from above."""
    low, cell, depth = _outline(surface)
    # A long bar has many equal circles: take the one in the middle.
    best = np.argwhere(depth >= depth.max() - 0.5)
    best = best[np.argmin(((best - best.mean(axis=0)) ** 2).sum(axis=1))]
    x, y = low + (best - 0.5) * cell
    return float(x), float(y), float(depth.max() * cell)


def _outline(surface: Surface) -> tuple[Floats, float, Floats]:
    """Raster of the outline: corner (2,) and cell in m, distance (i, j) in cells from outside."""
    from scipy.ndimage import distance_transform_edt

    flat = surface.points[:, :2]
    outline_cells = 200  # along the longer side of the raster of the outline
    low, cell = flat.min(axis=0), np.ptp(flat, axis=0).max() / outline_cells
    shape = np.ceil(np.ptp(flat, axis=0) / cell).astype(int) + 3
    inside = np.zeros(shape, bool)
    corners = flat[surface.triangles]
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    count = np.maximum(1, np.ceil(2 * sides / cell)).astype(int)
    for n in np.unique(count):
        i, j = np.indices((n + 1, n + 1)).reshape(2, -1)
        shares = np.column_stack([i, j, n - i - j])[i + j <= n] / n
        places = np.einsum("qa,eai->eqi", shares, corners[count == n]).reshape(-1, 2)
        inside[tuple(np.maximum((places - low) / cell + 1, 1).astype(int).T)] = True
    return low, float(cell), np.asarray(distance_transform_edt(inside))


def height_at(surface: Surface, x: float, y: float) -> float:
    """Return the largest z in m of the surface above a point of the plane."""
    highest = heights_over(surface.points[surface.triangles], np.array([x, y])).max()
    if highest == -np.inf:
        place = f"({1e3 * x:.4g}, {1e3 * y:.4g}) mm"
        raise MeshError(f"the surface does not cover {place}; choose another place")
    return float(highest)


def clip_to_box(surface: Surface, box: Sequence[float]) -> tuple[Surface, list[str]]:
    """Return the closed part of a closed surface within a box, and sentences on the cuts.

    `box` is the smallest and largest x, then y, in m. If several pieces remain, the one below the
    origin is kept.
    """
    left, right, front, back = box
    if not (left < 0 < right and front < 0 < back):
        raise MeshError(
            "the patch from ({:g}, {:g}) to ({:g}, {:g}) mm does not contain the middle of the "
            "palm, (0, 0); enlarge it".format(*(1e3 * v for v in (left, front, right, back)))
        )
    cut, cuts = cut_to_box(surface, box)
    assert cut  # it has the origin below its top
    if not cuts:
        return surface, []
    notes = [f"cut at {cuts} planes"]
    if (n := n_pieces(cut)) > 1:
        heights = heights_over(cut.points[cut.triangles], np.zeros(2))
        piece = pieces(cut)
        cut = compact(cut.points, cut.triangles[piece == piece[heights.argmax()]])
        notes.append(f"dropped {n - 1} pieces that are not connected to the palm within the patch")
    return cut, notes


def cut_to_box(surface: Surface, box: Sequence[float]) -> tuple[Surface | None, int]:
    """Return the closed part of a surface in a box, or None, and how many sides cut it."""
    import pyvista

    faces = np.column_stack([np.full(len(surface.triangles), 3), surface.triangles])
    body, cuts = pyvista.PolyData(np.array(surface.points), faces=faces.ravel()), 0
    for axis, sign, place in zip((0, 0, 1, 1), (1, -1, 1, -1), box, strict=True):
        along = sign * (np.asarray(body.points)[:, axis] - place)
        if along.max() <= 0:
            return None, cuts
        if along.min() < 0:
            normal, origin = np.zeros(3), np.zeros(3)
            normal[axis], origin[axis] = sign, place
            body = body.clip_closed_surface(normal=normal, origin=origin).triangulate()
            cuts += 1
    if not cuts:
        return surface, 0
    triangles = np.asarray(body.faces).reshape(-1, 4)[:, 1:]
    return repair(np.asarray(body.points, np.float64), triangles)[0], cuts


def on_planes(box: Sequence[float], tolerance: float, centroids: Floats, normals: Floats) -> Bools:
    """Return a mask (k,) of the facets within a tolerance in m of the sides of a box, given their
    centroids and normals (k, 3).
    """
    selected = np.zeros(len(centroids), bool)
    for axis, sign, place in zip((0, 0, 1, 1), (-1, 1, -1, 1), box, strict=True):
        near = np.abs(centroids[:, axis] - place) <= tolerance
        selected |= near & (sign * normals[:, axis] > 0.9)
    return selected
