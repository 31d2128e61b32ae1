"""Generalised winding number of closed surfaces, and surfaces inside others."""

from collections.abc import Mapping

import numpy as np

from meshes.surface.repair import in_mm
from meshes.surface.self_intersection import self_intersections
from meshes.surface.triangulation import Surface
from meshes.tetmesh import MeshError
from meshes.typing import Floats


def winding_number(surface: Surface, points: Floats) -> Floats:
    """Return the winding number (n,) of a closed surface about points (n, 3): 1 inside, 0 outside.

    Sum of solid angles (van Oosterom and Strackee, IEEE Trans Biomed Eng 30:125 (1983)) over 4 pi.
    """
    low, high = surface.points.min(axis=0), surface.points.max(axis=0)
    near = np.flatnonzero(((points >= low) & (points <= high)).all(axis=1))
    winding = np.zeros(len(points))
    corners = surface.points[surface.triangles]
    chunk = 2_000_000  # pairs of points and triangles computed at once
    for some in np.array_split(near, max(1, len(near) * len(corners) // chunk)):
        winding[some] = _solid_angles(corners, points[some]) / (4 * np.pi)
    return winding


def _solid_angles(corners: Floats, points: Floats) -> Floats:
    """Sum (n,) of the solid angles of triangles (k, 3, 3) at points (n, 3)."""
    a, b, c = (corners[:, i] - points[:, None] for i in range(3))
    la, lb, lc = (np.sqrt(np.einsum("pki,pki->pk", x, x)) for x in (a, b, c))
    ab, bc, ca = (np.einsum("pki,pki->pk", x, y) for x, y in ((a, b), (b, c), (c, a)))
    volume = np.einsum("pki,pki->pk", np.cross(a, b), c)
    return np.asarray(
        2 * np.arctan2(volume, la * lb * lc + ab * lc + bc * la + ca * lb).sum(axis=1)
    )


def join(surfaces: list[Surface]) -> Surface:
    """Return one surface with the triangles of several."""
    first = np.cumsum([0, *(len(each.points) for each in surfaces)])
    triangles = [each.triangles + n for each, n in zip(surfaces, first, strict=False)]
    return Surface(
        points=np.vstack([each.points for each in surfaces]), triangles=np.vstack(triangles)
    )


def check_inside(outer: Surface, inner: Mapping[str, Surface]) -> None:
    """Refuse closed inner surfaces that lie outside the outer one, or cross it or each other."""
    surfaces = {"the body": outer, **inner}
    whole = join(list(surfaces.values()))
    owner = np.repeat(np.arange(len(surfaces)), [len(s.triangles) for s in surfaces.values()])
    pairs = self_intersections(whole)
    if len(pairs):
        one, other = (list(surfaces)[owner[k]] for k in pairs[0])
        place = in_mm(whole.points[whole.triangles[pairs[0, 0]]].mean(axis=0))
        raise MeshError(
            f"the surfaces of {one} and {other} cross at {len(pairs)} pairs of triangles, first "
            f"near {place}; make the inner one smaller, or move it inside"
        )
    for name, surface in inner.items():
        if not winding_number(outer, surface.points[:1])[0] > 0.5:
            raise MeshError(
                f"{name} lies outside the body, with its middle at "
                f"{in_mm(surface.points.mean(axis=0))}; give both files in the same coordinates "
                "and unit"
            )
