"""Checks and repair of a closed surface before it is meshed.

Every refusal counts what is wrong and says where the first of it is, in millimetre.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from meshes.surface.self_intersection import self_intersections
from meshes.surface.triangulation import (
    Surface,
    areas_of,
    centred_corners,
    compact,
    n_pieces,
    pieces,
    volume,
)
from meshes.tetmesh import MeshError
from meshes.typing import Floats, Ints

MOST_OFF_PLANE = 0.1  # of its width: how far the edge of a hole that is capped may leave a plane
SAME_POINT = 1e-6  # of the diagonal: points nearer than this are one


def check(surface: Surface) -> None:
    """Check that a surface is one closed manifold, seen from outside, without self-intersection; a
    MeshError says how many edges, points or triangles are wrong, and where.
    """
    check_manifold(surface)
    if (n := n_pieces(surface)) > 1:
        raise MeshError(
            f"the surface is {n} separate pieces; keep the largest of them with --keep largest, "
            "or save one that lies inside another, as a bone does, as a file for --inner"
        )
    if not (enclosed := volume(surface)) > 1e-9 * surface.diagonal**3:
        raise MeshError(
            f"the surface encloses {enclosed:.3g} m3; give a closed one whose triangles are seen "
            "anticlockwise from outside"
        )
    check_crossings(surface)


def check_manifold(surface: Surface) -> None:
    """Check that two triangles meet at each edge and look the same way, and that those around each
    point are one fan.
    """
    pairs = _paired_edges(surface)
    against = pairs[_starts(surface)[pairs[:, 0]] == _starts(surface)[pairs[:, 1]]]
    if len(against):
        raise MeshError(
            f"the triangles at {len(against)} edges of the surface look opposite ways, first near "
            f"{_at(surface, against[0, 0])}; orient them, as `repaired` does"
        )
    _check_fans(surface, pairs)


def check_crossings(surface: Surface) -> None:
    """Check that no triangles cross or overlap."""
    crossing = self_intersections(surface)
    if len(crossing):
        raise MeshError(
            f"the surface crosses itself at {len(crossing)} pairs of triangles, first near "
            f"{in_mm(surface.points[surface.triangles[crossing[0, 0]]].mean(axis=0))}; "
            "separate or join the parts in the program that it comes from"
        )


def repaired(
    points: ArrayLike, triangles: ArrayLike, *, keep_largest: bool = False, cap: bool = False
) -> tuple[Surface, list[str]]:
    """Repair seams, doubles and wrong orientation of a surface.

    Points that coincide become one, triangles without three corners and second copies of triangles
    go, neighbours are made to look the same way and outwards.

    Parameters
    ----------
    points, triangles : (n, 3) float, metre, and (k, 3) int
    keep_largest : keep only the piece with the largest area
    cap : close holes whose edges lie in a plane, such as an open wrist

    Returns
    -------
    Surface, and sentences on what was done

    Raises a MeshError if it is open, has edges of more than two triangles, or has only one side; or
    a hole to be capped is not in a plane.
    """
    raw, said = Surface(points=points, triangles=triangles), []  # type: ignore[arg-type]
    number = first_of_same(raw.points)
    kept = number[raw.triangles]
    if (merged := len(number) - len(np.unique(number))) > 0:
        said.append(f"merged {merged:,} points that coincide with others, as along seams")
    a, b, c = kept.T
    real = (a != b) & (b != c) & (c != a)
    if not real.all():
        said.append(f"dropped {(~real).sum():,} triangles that are only a line or a point")
    kept = kept[real]
    _, first = np.unique(np.sort(kept, axis=1), axis=0, return_index=True)
    if len(first) < len(kept):
        said.append(f"dropped {len(kept) - len(first):,} second copies of triangles")
    surface = compact(raw.points, kept[np.sort(first)])
    if (unused := len(number) - merged - len(surface.points)) > 0:
        said.append(f"dropped {unused:,} points that no triangle uses")
    if keep_largest and (n := n_pieces(surface)) > 1:
        surface, share = _largest(surface)
        said.append(f"kept the largest of {n} pieces, {100 * share:.1f} % of the area")
    if cap:
        surface = _capped(surface, said)
    turned = _turned(surface)
    if turned.any():
        said.append(f"turned round {turned.sum():,} of {len(turned):,} triangles to look outwards")
        order = np.where(turned[:, None], [[0, 2, 1]], [[0, 1, 2]])
        along = np.take_along_axis(surface.triangles, order, axis=1)
        surface = Surface(points=surface.points, triangles=along)
    return surface, said


def _largest(surface: Surface) -> tuple[Surface, float]:
    """The piece with the largest area, and its share of all."""
    piece = pieces(surface)
    areas = np.bincount(piece, areas_of(surface))
    largest = int(areas.argmax())
    kept = compact(surface.points, surface.triangles[piece == largest])
    return kept, float(areas[largest] / areas.sum())


def _capped(surface: Surface, said: list[str]) -> Surface:
    """The surface with its holes closed, each by triangles between the points of its edge."""
    import pyvista
    from scipy import sparse

    sides = np.sort(surface.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    edges, count = np.unique(sides, axis=0, return_counts=True)
    ends = edges[count == 1]
    if not len(ends):
        said.append("found no hole to close")
        return surface
    n = len(surface.points)
    graph = sparse.coo_array((np.ones(len(ends), bool), tuple(ends.T)), shape=(n, n))
    label = sparse.csgraph.connected_components(graph, directed=False)[1]
    for hole in np.unique(label[ends]):
        rim = surface.points[np.flatnonzero(label == hole)]
        rim = rim - rim.mean(axis=0)
        widths = np.ptp(rim @ np.linalg.svd(rim, full_matrices=False)[2].T, axis=0)
        if widths[2] > MOST_OFF_PLANE * widths[0]:
            place = in_mm(surface.points[label == hole][0])
            raise MeshError(
                f"a hole of {1e3 * widths[0]:.0f} mm near {place} is {1e3 * widths[2]:.1f} mm out "
                "of a plane and cannot be capped; close it in the program that it comes from"
            )
        said.append(
            f"closed a hole of {len(rim)} edges, {1e3 * widths[0]:.0f} mm wide and "
            f"{1e3 * widths[2]:.1f} mm out of a plane"
        )
    faces = np.insert(surface.triangles, 0, 3, axis=1).ravel()
    closed = pyvista.PolyData(np.array(surface.points), faces=faces).fill_holes(np.inf)
    new = np.asarray(closed.faces).reshape(-1, 4)[:, 1:]
    return Surface(points=np.asarray(closed.points, np.float64), triangles=new)


def first_of_same(points: Floats) -> Ints:
    """The number (n,) of the first point that each of points (n, 3) coincides with."""
    from scipy import sparse
    from scipy.spatial import cKDTree

    n, diagonal = len(points), float(np.linalg.norm(np.ptp(points, axis=0)))
    near = cKDTree(points).query_pairs(SAME_POINT * diagonal, output_type="ndarray")
    graph = sparse.coo_array((np.ones(len(near), bool), tuple(near.T)), shape=(n, n))
    label = sparse.csgraph.connected_components(graph, directed=False)[1]
    _, first = np.unique(label, return_index=True)
    return np.asarray(first[label])


def _starts(surface: Surface) -> Ints:
    """The point (3 k,) at which each side of each triangle starts; side 3 t + j of triangle t."""
    return surface.triangles.ravel()


def _paired_edges(surface: Surface) -> Ints:
    """The two sides (m, 2) that meet at each edge; an error if anywhere there are not two."""
    sides = np.sort(surface.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    keys = sides[:, 0] * len(surface.points) + sides[:, 1]
    _, first, count = np.unique(keys, return_index=True, return_counts=True)
    if (open_edges := first[count == 1]).size:
        raise MeshError(
            f"the surface is open along {len(open_edges):,} of its {len(first):,} edges, first "
            f"near {_at(surface, open_edges[0])}; close those in a plane, such as a wrist, with "
            "--cap, and others in the program that it comes from"
        )
    if (crowded := first[count > 2]).size:
        raise MeshError(
            f"{len(crowded):,} edges of the surface have more than two triangles, first near "
            f"{_at(surface, crowded[0])}; keep its outer skin only"
        )
    return np.argsort(keys, kind="stable").reshape(-1, 2)


def _turned(surface: Surface) -> np.ndarray:
    """Mask (k,) of the triangles to turn round so that all of each piece face outwards."""
    from scipy import sparse

    pairs, n = _paired_edges(surface), len(surface.triangles)
    t, other = pairs.T // 3
    starts = _starts(surface)
    against = starts[pairs[:, 0]] == starts[pairs[:, 1]]
    # Each triangle twice, as it is and turned; those of neighbours that agree are connected.
    rows = np.concatenate([t, t + n])
    columns = np.concatenate([other + n * against, other + n * ~against])
    graph = sparse.coo_array((np.ones(len(rows), bool), (rows, columns)), shape=(2 * n, 2 * n))
    label = sparse.csgraph.connected_components(graph, directed=False)[1]
    if (one_sided := np.flatnonzero(label[:n] == label[n:])).size:
        raise MeshError(
            f"{len(one_sided):,} triangles belong to a surface with only one side, like a Moebius "
            "strip; give one that encloses a body"
        )
    turned = label[:n] > label[n:]
    a, b, c = centred_corners(surface)
    enclosed = np.einsum("ei,ei->e", np.cross(a, b), c) * np.where(turned, -1, 1)
    piece = pieces(surface)
    return turned ^ (np.bincount(piece, enclosed) < 0)[piece]


def _check_fans(surface: Surface, pairs: Ints) -> None:
    """Check that the triangles around each point are one fan."""
    from scipy import sparse

    n = surface.triangles.size
    ends = pairs - pairs % 3 + (pairs + 1) % 3
    rows, columns = pairs.ravel(), ends[:, ::-1].ravel()
    graph = sparse.coo_array((np.ones(len(rows), bool), (rows, columns)), shape=(n, n))
    fans, label = sparse.csgraph.connected_components(graph, directed=False)
    owner = np.empty(fans, np.int64)
    owner[label] = _starts(surface)
    used, count = np.unique(owner, return_counts=True)
    if (pinched := used[count > 1]).size:
        raise MeshError(
            f"parts of the surface touch at {len(pinched):,} single points, first at "
            f"{in_mm(surface.points[pinched[0]])}; separate them there"
        )


def _at(surface: Surface, side: int) -> str:
    """Position of a side of a triangle, as text."""
    triangle, corner = divmod(int(side), 3)
    ends = surface.triangles[triangle, [corner, (corner + 1) % 3]]
    return in_mm(surface.points[ends].mean(axis=0))


def in_mm(place: Floats) -> str:
    """A place (3,) in metre, as messages have it."""
    return "({:.4g}, {:.4g}, {:.4g}) mm".format(*(1e3 * place))
