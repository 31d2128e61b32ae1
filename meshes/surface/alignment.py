"""Alignment of a surface with the device: turned, centred, clipped."""

from collections.abc import Sequence

import numpy as np

from meshes.facets import Predicate, heights_over
from meshes.surface.repair import repaired
from meshes.surface.triangulation import Surface, compact, n_pieces, pieces
from meshes.tetmesh import MeshError
from meshes.typing import Floats

# The rows are the new x, y and z. Each is a turn about one axis.
TURNS = {
    "+z": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "-z": [[1, 0, 0], [0, -1, 0], [0, 0, -1]],
    "+y": [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
    "-y": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
    "+x": [[0, 0, -1], [0, 1, 0], [1, 0, 0]],
    "-x": [[0, 0, 1], [0, 1, 0], [-1, 0, 0]],
}
INSIDE, LEVEL = 3e-3, 1e-4  # m: where the origin may lie inside an outline, and off the top
OUTLINE_CELLS = 200  # along the longer side of the raster in which the outline is drawn


def turns(up: str) -> Floats:
    """The turn (3, 3) that takes an axis (+x, -x, ... -z) to +z; a MeshError if there is none."""
    if up not in TURNS:
        raise MeshError(f"up = '{up}' is no axis; use one of {', '.join(TURNS)}")
    return np.array(TURNS[up], np.float64)


def turned(surface: Surface, up: str) -> Surface:
    """The surface with its axis `up` (+x, -x, ... -z) turned to +z."""
    return Surface(points=surface.points @ turns(up).T, triangles=surface.triangles)


def aligned(surface: Surface) -> tuple[Surface, Floats]:
    """The surface moved so that its palm's middle is the origin, and by how much (3,), metre. The
    middle is that of the widest circle within the outline seen from above; the top there comes to z
    = 0.
    """
    x, y, _ = widest_place(surface)
    shift = -np.array([x, y, height_at(surface, x, y)])
    return Surface(points=surface.points + shift, triangles=surface.triangles), shift


def off_origin(surface: Surface) -> Floats:
    """By how much (3,), metre, a surface has to move for its top to be at the origin: not, if the
    origin is on its top, at least 3 mm inside its outline, or half the radius of the widest circle
    within it; otherwise as `aligned` moves it.
    """
    x, y, radius = widest_place(surface)
    low, cell, depth = _outline(surface)
    i, j = np.floor(-low / cell + 1).astype(int)
    known = 0 <= i < depth.shape[0] and 0 <= j < depth.shape[1]
    if known and depth[i, j] * cell >= min(INSIDE, radius / 2):
        x = y = 0.0
    height = height_at(surface, x, y)
    shift = -np.array([x, y, height if abs(height) > LEVEL else 0.0])
    return shift + 0.0


def widest_place(surface: Surface) -> tuple[float, float, float]:
    """The middle (x, y) of the widest circle within the outline seen from above, and its radius,
    metre.
    """
    low, cell, depth = _outline(surface)
    # Of many equal circles, as in a long bar, the one in the middle.
    best = np.argwhere(depth >= depth.max() - 0.5)
    best = best[np.argmin(((best - best.mean(axis=0)) ** 2).sum(axis=1))]
    x, y = low + (best - 0.5) * cell
    return float(x), float(y), float(depth.max() * cell)


def _outline(surface: Surface) -> tuple[Floats, float, Floats]:
    """A raster over the outline seen from above: its corner (2,) and cell in metre, and how many
    cells (i, j) each is inside the outline.
    """
    from scipy.ndimage import distance_transform_edt

    flat = surface.points[:, :2]
    low, cell = flat.min(axis=0), np.ptp(flat, axis=0).max() / OUTLINE_CELLS
    shape = np.ceil(np.ptp(flat, axis=0) / cell).astype(int) + 3
    inside = np.zeros(shape, bool)
    corners = flat[surface.triangles]
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    count = np.maximum(1, np.ceil(2 * sides / cell)).astype(int)
    for n in np.unique(count):
        i, j = np.indices((n + 1, n + 1)).reshape(2, -1)
        shares = np.column_stack([i, j, n - i - j])[i + j <= n] / n
        drawn = np.einsum("qa,eai->eqi", shares, corners[count == n]).reshape(-1, 2)
        inside[tuple(np.maximum((drawn - low) / cell + 1, 1).astype(int).T)] = True
    return low, float(cell), np.asarray(distance_transform_edt(inside))


def height_at(surface: Surface, x: float, y: float) -> float:
    """Greatest z in metre of the surface above a point of the plane, or a MeshError."""
    highest = heights_over(surface.points[surface.triangles], np.array([x, y])).max()
    if highest == -np.inf:
        place = f"({1e3 * x:.4g}, {1e3 * y:.4g}) mm"
        raise MeshError(f"the surface is not above {place}; choose another place")
    return float(highest)


def clipped(surface: Surface, box: Sequence[float]) -> tuple[Surface, list[str]]:
    """The closed part of a closed surface within a box, and sentences on what was cut; of several
    pieces the one with the origin below its top. `box` is the least and greatest x, least and
    greatest y, metre. A MeshError if the box does not contain the origin, or the cut cannot be
    closed.
    """
    left, right, front, back = box
    if not (left < 0 < right and front < 0 < back):
        raise MeshError(
            "the patch from ({:g}, {:g}) to ({:g}, {:g}) mm must have the middle of the palm, "
            "(0, 0), inside it".format(*(1e3 * v for v in (left, front, right, back)))
        )
    cut, cuts = cut_to(surface, box)
    assert cut  # has the origin below its top
    if not cuts:
        return surface, []
    said = [f"cut at {cuts} planes"]
    if (n := n_pieces(cut)) > 1:
        cut = _under_origin(cut)
        said.append(f"dropped {n - 1} pieces that are not joined to the palm within the patch")
    return cut, said


def cut_to(surface: Surface, box: Sequence[float]) -> tuple[Surface | None, int]:
    """Closed part of a closed surface within a box (metre, as for `clipped`), and how many sides of
    the box cut it; None if nothing is inside.
    """
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
    return repaired(np.asarray(body.points, np.float64), triangles)[0], cuts


def on_planes(box: Sequence[float], tolerance: float) -> Predicate:
    """A predicate of facets that lie on the sides of a box (metre), for `tag_boundary`."""

    def cut(centroids: Floats, normals: Floats) -> np.ndarray:
        found = np.zeros(len(centroids), bool)
        for axis, sign, place in zip((0, 0, 1, 1), (-1, 1, -1, 1), box, strict=True):
            near = np.abs(centroids[:, axis] - place) <= tolerance
            found |= near & (sign * normals[:, axis] > 0.9)
        return found

    return cut


def _under_origin(surface: Surface) -> Surface:
    """The piece with the highest triangle over the origin."""
    heights = heights_over(surface.points[surface.triangles], np.zeros(2))
    piece = pieces(surface)
    return compact(surface.points, surface.triangles[piece == piece[heights.argmax()]])
