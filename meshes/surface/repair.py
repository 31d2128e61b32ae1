"""Checks and repair of a closed surface before it is meshed.

Errors state how many edges, points or triangles are wrong, and where the first of them is.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from meshes.surface.self_intersection import self_intersections
from meshes.surface.triangulation import (
    Surface,
    areas_of,
    centred_corners,
    compact,
    connected_components,
    n_pieces,
    pieces,
    volume,
)
from meshes.tetmesh import MeshError
from meshes.typing import Floats, Ints


def check(surface: Surface) -> None:
    """Refuse a surface that is not one closed outward-facing manifold without intersections."""
    check_manifold(surface)
    if (n := n_pieces(surface)) > 1:
        raise MeshError(
            f"the surface consists of {n} separate pieces; keep only the largest with --keep "
            "largest, or save a piece inside another, such as a bone, as its own file and give "
            "it with --inner"
        )
    if not (enclosed := volume(surface)) > 1e-9 * surface.diagonal**3:
        raise MeshError(
            f"the surface encloses {enclosed:.3g} m3; give a closed surface whose triangles are "
            "listed anticlockwise as seen from outside"
        )
    check_crossings(surface)


def check_manifold(surface: Surface) -> None:
    """Refuse open edges, edges of more than two triangles, inconsistent orientation, and points
    where parts only touch.
    """
    pairs, starts = _paired_edges(surface), surface.triangles.ravel()
    against = pairs[starts[pairs[:, 0]] == starts[pairs[:, 1]]]
    if len(against):
        raise MeshError(
            f"the triangles at {len(against)} edges of the surface are oriented in opposite "
            f"directions, first near {_at(surface, against[0, 0])}; orient them consistently, "
            "for example with `meshes.repair`"
        )
    _check_fans(surface, pairs)


def check_crossings(surface: Surface) -> None:
    """Refuse a surface whose triangles cross or overlap."""
    crossing = self_intersections(surface)
    if len(crossing):
        raise MeshError(
            f"the surface intersects itself at {len(crossing)} pairs of triangles, first near "
            f"{in_mm(surface.points[surface.triangles[crossing[0, 0]]].mean(axis=0))}; separate "
            "or join these parts in the program that made it"
        )


def repair(
    points: ArrayLike,
    triangles: ArrayLike,
    *,
    keep_largest: bool = False,
    cap: bool = False,
    seam: float = 20e-6,
) -> tuple[Surface, list[str]]:
    """Repair seams, duplicates and orientation of a surface.

    Coinciding points are merged, and points on open edges that are close to each other. Triangles
    without three different corners, and duplicates, are removed. The rest is oriented outwards.

    Parameters
    ----------
    points, triangles : (n, 3) float, m, and (k, 3) int
    keep_largest : keep only the piece with the largest area
    cap : close holes whose edges lie in a plane, such as an open wrist
    seam : float, m, largest distance of points on open edges that are welded, and at most a quarter
        of the median length of these edges

    Returns
    -------
    Surface, and a sentence on each change

    Raises a MeshError if the surface is open, has edges with more than two triangles or only one
    side, or if a hole to be capped is not plane.

    >>> from meshes import block, boundary_facets
    >>> box = block((0.02, 0.02, 0.02), 0.02, order=1)
    >>> surface, notes = repair(box.points, boundary_facets(box.tets)[:, ::-1])
    >>> notes
    ['reversed 32 of 32 triangles to face outwards']
    """
    raw = Surface(points=points, triangles=triangles)  # type: ignore[arg-type]
    notes: list[str] = []
    number = first_coincident(raw.points)
    corners = number[raw.triangles]
    if (merged := len(number) - len(np.unique(number))) > 0:
        notes.append(f"merged {merged:,} points that coincide with others, as along seams")
    ends, welded = _open_edges(corners), np.arange(len(number))
    if len(rim := np.unique(ends)):
        lengths = np.linalg.norm(raw.points[ends[:, 1]] - raw.points[ends[:, 0]], axis=1)
        near = min(seam, float(np.median(lengths)) / 4)
        welded[rim] = rim[first_coincident(raw.points[rim], near)]
    if moved := int((welded != np.arange(len(number))).sum()):
        widest = np.linalg.norm(raw.points[welded] - raw.points, axis=1).max()
        notes.append(f"welded {moved:,} points along seams up to {1e6 * widest:.2g} um wide")
    corners = welded[corners]
    a, b, c = corners.T
    proper = (a != b) & (b != c) & (c != a)
    if not proper.all():
        notes.append(f"dropped {(~proper).sum():,} triangles without three different corners")
    corners = corners[proper]
    _, first = np.unique(np.sort(corners, axis=1), axis=0, return_index=True)
    if len(first) < len(corners):
        notes.append(f"dropped {len(corners) - len(first):,} duplicate triangles")
    surface = compact(raw.points, corners[np.sort(first)])
    if (unused := len(number) - merged - moved - len(surface.points)) > 0:
        notes.append(f"dropped {unused:,} unused points")
    if keep_largest and (n := n_pieces(surface)) > 1:
        piece = pieces(surface)
        areas = np.bincount(piece, areas_of(surface))
        surface = compact(surface.points, surface.triangles[piece == areas.argmax()])
        share = 100 * areas.max() / areas.sum()
        notes.append(f"kept the largest of {n} pieces, {share:.1f} % of the area")
    if cap:
        surface = _with_caps(surface, notes)
    inverted = _inward_triangles(surface)
    if inverted.any():
        notes.append(f"reversed {inverted.sum():,} of {len(inverted):,} triangles to face outwards")
        order = np.where(inverted[:, None], [[0, 2, 1]], [[0, 1, 2]])
        outwards = np.take_along_axis(surface.triangles, order, axis=1)
        surface = replace(surface, triangles=outwards)
    return surface, notes


def _with_caps(surface: Surface, notes: list[str]) -> Surface:
    """Close holes by triangles between the points of their edges."""
    import pyvista

    ends = _open_edges(surface.triangles)
    if not len(ends):
        notes.append("no hole to close")
        return surface
    label = connected_components(len(surface.points), ends)
    most_off_plane = 0.1  # of the width of a hole: how far its edge may leave a plane to be capped
    for hole in np.unique(label[ends]):
        rim = surface.points[np.flatnonzero(label == hole)]
        rim = rim - rim.mean(axis=0)
        widths = np.ptp(rim @ np.linalg.svd(rim, full_matrices=False)[2].T, axis=0)
        if widths[2] > most_off_plane * widths[0]:
            place = in_mm(surface.points[label == hole][0])
            raise MeshError(
                f"a hole {1e3 * widths[0]:.0f} mm wide near {place} cannot be capped, because its "
                f"edge leaves a plane by {1e3 * widths[2]:.1f} mm; close it in the program that "
                "made the surface"
            )
        notes.append(
            f"closed a hole of {len(rim)} edges, {1e3 * widths[0]:.0f} mm wide, whose edge leaves "
            f"a plane by {1e3 * widths[2]:.1f} mm"
        )
    faces = np.insert(surface.triangles, 0, 3, axis=1).ravel()
    closed = pyvista.PolyData(np.array(surface.points), faces=faces).fill_holes(np.inf)
    new = np.asarray(closed.faces).reshape(-1, 4)[:, 1:]
    return Surface(points=np.asarray(closed.points, np.float64), triangles=new)


def first_coincident(points: Floats, distance: float | None = None) -> Ints:
    """Return for each point (n, 3) the number (n,) of the first point at the same place, or within
    a distance of it.
    """
    from scipy.spatial import cKDTree

    same_point = 1e-6  # of the diagonal: points nearer to each other than this are merged
    same = same_point * float(np.linalg.norm(np.ptp(points, axis=0)))
    near = cKDTree(points).query_pairs(distance or same, output_type="ndarray")
    label = connected_components(len(points), near)
    _, first = np.unique(label, return_index=True)
    return np.asarray(first[label])


def _edges(triangles: Ints) -> Ints:
    """Points (3 k, 2) at the ends of each side of triangles (k, 3); side 3 t + j is side j of
    triangle t.
    """
    return triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)


def _open_edges(triangles: Ints) -> Ints:
    """Points (m, 2) at the ends of edges of one triangle only."""
    edges, count = np.unique(np.sort(_edges(triangles), axis=1), axis=0, return_counts=True)
    return edges[count == 1]


def _gap(points: Floats, ends: Ints, samples: int = 9) -> tuple[float, float]:
    """Median distance between open edges (m, 2): in m, and over their length; inf for one edge."""
    from scipy.spatial import cKDTree

    a, b = points[ends].swapaxes(0, 1)
    places = a[:, None] + np.linspace(0, 1, samples)[:, None] * (b - a)[:, None]
    tree, middles = cKDTree(places.reshape(-1, 3)), places[:, samples // 2]
    away, place = tree.query(middles, k=samples + 1)
    own = place // samples == np.arange(len(ends))[:, None]
    away = np.where(own, np.inf, away).min(axis=1)
    return float(np.median(away)), float(np.median(away / np.linalg.norm(b - a, axis=1)))


def _paired_edges(surface: Surface) -> Ints:
    """The two sides (m, 2) at each edge. Refuses edges with one or with more than two triangles."""
    sides = np.sort(_edges(surface.triangles), axis=1)
    keys = sides[:, 0] * len(surface.points) + sides[:, 1]
    _, first, count = np.unique(keys, return_index=True, return_counts=True)
    seam = 0.3  # of the length of open edges: sides of a seam are closer to each other
    if (open_edges := first[count == 1]).size:
        cure = "close plane holes, such as a wrist, with --cap, and other holes in the program"
        width, share = _gap(surface.points, sides[open_edges])
        if share < seam:
            cure = (
                f"this is a seam about {1e6 * width:.3g} um wide, so merge its sides in the program"
            )
        raise MeshError(
            f"the surface is open along {len(open_edges):,} of its {len(first):,} edges, first "
            f"near {_at(surface, open_edges[0])}; {cure} that made it"
        )
    if (crowded := first[count > 2]).size:
        raise MeshError(
            f"{len(crowded):,} edges have more than two triangles, first near "
            f"{_at(surface, crowded[0])}; keep the outer skin"
        )
    return np.argsort(keys, kind="stable").reshape(-1, 2)


def _inward_triangles(surface: Surface) -> np.ndarray:
    """Mask (k,) of the triangles to reverse so that every piece faces outwards."""
    pairs, n = _paired_edges(surface), len(surface.triangles)
    t, other = pairs.T // 3
    starts = surface.triangles.ravel()
    against = starts[pairs[:, 0]] == starts[pairs[:, 1]]
    # Each triangle is listed twice, as given and reversed. Neighbours that agree are linked.
    links = [(t, other + n * against), (t + n, other + n * ~against)]
    label = connected_components(2 * n, np.hstack(links).T)
    if (one_sided := np.flatnonzero(label[:n] == label[n:])).size:
        raise MeshError(
            f"{len(one_sided):,} triangles belong to a surface with only one side, like a "
            "Moebius strip; give a surface that encloses a body"
        )
    inverted = label[:n] > label[n:]
    a, b, c = centred_corners(surface)
    enclosed = np.einsum("ei,ei->e", np.cross(a, b), c) * np.where(inverted, -1, 1)
    piece = pieces(surface)
    return inverted ^ (np.bincount(piece, enclosed) < 0)[piece]


def _check_fans(surface: Surface, pairs: Ints) -> None:
    """Refuse points at which several fans of triangles touch."""
    ends = pairs - pairs % 3 + (pairs + 1) % 3
    links = np.column_stack([pairs.ravel(), ends[:, ::-1].ravel()])
    label = connected_components(surface.triangles.size, links)
    owner = np.empty(label.max() + 1, np.int64)
    owner[label] = surface.triangles.ravel()
    used, count = np.unique(owner, return_counts=True)
    if (pinched := used[count > 1]).size:
        raise MeshError(
            f"parts of the surface touch at {len(pinched):,} single points, first at "
            f"{in_mm(surface.points[pinched[0]])}; separate them there"
        )


def _at(surface: Surface, side: int) -> str:
    """Position of the middle of a side, as text."""
    triangle, corner = divmod(int(side), 3)
    ends = surface.triangles[triangle, [corner, (corner + 1) % 3]]
    return in_mm(surface.points[ends].mean(axis=0))


def in_mm(place: Floats) -> str:
    """Return a position (3,) in m as text in mm."""
    return "({:.4g}, {:.4g}, {:.4g}) mm".format(*(1e3 * place))
