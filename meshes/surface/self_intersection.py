"""Self-intersection of a triangulated surface.

Two triangles intersect if a side of one pierces the other, or if they overlap in one plane.
Candidates are triangles whose bounding boxes share a cell of a grid.
"""

import numpy as np

from meshes.surface.triangulation import Surface
from meshes.typing import Floats, Ints

ROUND_OFF = 1e-9  # of the size of both triangles: points nearer to a plane lie on it


def self_intersections(surface: Surface) -> Ints:
    """Return the pairs (m, 2) of triangles that touch elsewhere than at shared corners."""
    corners = surface.points[surface.triangles] - surface.points.mean(axis=0)
    pairs = _candidates(corners)
    pairs_at_once = 200_000  # pairs tested at once
    crossing = [
        chunk[_cross(corners, surface.triangles, chunk)]
        for chunk in np.array_split(pairs, max(1, len(pairs) // pairs_at_once))
    ]
    return np.vstack(crossing)


def _candidates(corners: Floats) -> Ints:
    """Pairs (m, 2) of triangles with overlapping boxes, each once."""
    low, high = corners.min(axis=1), corners.max(axis=1)
    cell = np.maximum(np.median((high - low).max(axis=1)) * 1.5, 1e-300)
    origin = low.min(axis=0)
    most_cells = 400_000  # entries of large triangles in the grid, before its cells grow
    while True:
        first = ((low - origin) / cell).astype(np.int64)
        span = ((high - origin) / cell).astype(np.int64) - first + 1
        if span.prod(axis=1).sum() <= 20 * len(corners) + most_cells:
            break
        cell *= 2
    count = span.prod(axis=1)
    owner = np.repeat(np.arange(len(corners)), count)
    place = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
    _, sy, sz = span[owner].T
    i, j, k = (first[owner] + np.column_stack([place // (sy * sz), place // sz % sy, place % sz])).T
    pairs = _same_cell((i * (j.max() + 1) + j) * (k.max() + 1) + k, owner)
    a, b = pairs.T
    near = (low[a] <= high[b]).all(axis=1) & (low[b] <= high[a]).all(axis=1)
    keys = np.unique(pairs[near] @ np.array([len(corners), 1]))
    return np.column_stack(np.divmod(keys, len(corners)))


def _same_cell(cells: Ints, owner: Ints) -> Ints:
    """Pairs (m, 2), lower number first, of owners listed in the same cell."""
    order = np.lexsort((owner, cells))
    cells, owner = cells[order], owner[order]
    end = np.searchsorted(cells, cells, side="right")
    after = end - np.arange(len(cells)) - 1
    first = np.repeat(np.arange(len(cells)), after)
    step = np.arange(len(first)) - np.repeat(np.cumsum(after) - after, after)
    return np.column_stack([owner[first], owner[first + 1 + step]])


def _cross(corners: Floats, triangles: Ints, pairs: Ints) -> np.ndarray:
    """Mask (m,) of the pairs that intersect."""
    p, q = corners[pairs[:, 0]], corners[pairs[:, 1]]
    shared = triangles[pairs[:, 0]][:, :, None] == triangles[pairs[:, 1]][:, None, :]
    common = shared.sum(axis=(1, 2))
    scale = np.maximum(np.ptp(p, axis=1).max(axis=1), np.ptp(q, axis=1).max(axis=1))
    p_to_q, q_to_p = _heights(p, q, scale), _heights(q, p, scale)
    flat = (p_to_q == 0).all(axis=1) & (q_to_p == 0).all(axis=1)
    crossing = np.zeros(len(pairs), bool)
    for j in range(3):
        k = (j + 1) % 3
        # A side that starts or ends at a shared corner touches the other triangle there.
        free_p = ~shared[:, [j, k]].any(axis=(1, 2))
        free_q = ~shared[:, :, [j, k]].any(axis=(1, 2))
        crossing |= free_p & _pierces(p[:, j], p[:, k], p_to_q[:, j], p_to_q[:, k], q, scale)
        crossing |= free_q & _pierces(q[:, j], q[:, k], q_to_p[:, j], q_to_p[:, k], p, scale)
    crossing &= common < 2
    flat_pairs = np.flatnonzero(flat)
    crossing[flat_pairs] = _overlap(p[flat_pairs], q[flat_pairs], scale[flat_pairs])
    return crossing


def _heights(p: Floats, q: Floats, scale: Floats) -> Floats:
    """Signed distance (m, 3) of the corners of p from the plane of q, with round-off set to 0."""
    normal = np.cross(q[:, 1] - q[:, 0], q[:, 2] - q[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    unit = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
    height = np.einsum("eaj,ej->ea", p - q[:, :1], unit)
    height[np.abs(height) <= ROUND_OFF * scale[:, None]] = 0.0
    return height


def _pierces(
    start: Floats, end: Floats, from_: Floats, to: Floats, triangle: Floats, scale: Floats
) -> np.ndarray:
    """Whether each side, whose ends are at given heights, passes through the triangle."""
    passes = from_ * to < 0
    share = np.divide(from_, from_ - to, out=np.zeros_like(from_), where=passes)
    at = start + share[:, None] * (end - start)
    inside = passes.copy()
    normal = np.cross(triangle[:, 1] - triangle[:, 0], triangle[:, 2] - triangle[:, 0])
    limit = -ROUND_OFF * scale * np.linalg.norm(normal, axis=1)
    for j in range(3):
        side = triangle[:, (j + 1) % 3] - triangle[:, j]
        turn = np.einsum("ei,ei->e", np.cross(side, at - triangle[:, j]), normal)
        inside &= turn >= limit * np.linalg.norm(side, axis=1)
    return inside


def _overlap(p: Floats, q: Floats, scale: Floats) -> np.ndarray:
    """Whether triangles in one plane overlap: no side of either one separates them."""
    normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    apart = np.linalg.norm(normal, axis=1) <= ROUND_OFF * scale**2  # degenerate ones do not overlap
    for one, other in ((p, q), (q, p)):
        for j in range(3):
            side = one[:, (j + 1) % 3] - one[:, j]
            across = np.cross(normal, side)
            across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-300)
            a = np.einsum("eaj,ej->ea", one, across)
            b = np.einsum("eaj,ej->ea", other, across)
            slack = ROUND_OFF * scale
            apart |= a.max(axis=1) <= b.min(axis=1) + slack
            apart |= b.max(axis=1) <= a.min(axis=1) + slack
    return ~apart
