"""A body in three dimensions, moving through the period of the whole pattern about its mean."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import fem
from meshes.tetmesh import Floats, Ints, boundary_facets
from simple_model import MovingPressure
from simple_model.load_spectrum import synthesise
from skinwave.models.speeds import seam, shown_part
from skinwave.scene import Body

SEEN = 0.1  # of the largest line: weaker ones need no frames of their own
CLOSED = 1e-4  # of a turn, by which phases may be off where the motion begins again
DRAWN = 0.06  # of the width: how far the largest motion is drawn
FOCUS_ROOM = 5.0  # mm about a focus in which the surface is looked for
DRAWN_POINTS = 121  # of each path
LIFTED = 0.5  # mm, by which marks are above the surface


@dataclass(frozen=True, kw_only=True, eq=False)
class Shape:
    """A surface at rest: `points` (n, 3) in metre, z upwards, and `triangles` (k, 3)."""

    points: Floats
    triangles: Ints


@dataclass(frozen=True, kw_only=True, eq=False)
class Moving:
    """A shape and its motion `frames` (t, n) in metre upwards, equally spaced through `period` s:
    of the whole pattern, or of as much of it as `MOST` frames resolve.

    `repeats` says whether the load is the same again after it.
    """

    shape: Shape
    frames: NDArray[np.float32]
    period: float
    repeats: bool


def slab_shape(body: Body, places: Floats) -> Shape:
    """A part of a slab whose surface is seen at `places` (side^2, 2) in metre, row after row; after
    these the lower ends of its sides, which rest.
    """
    side = round(len(places) ** 0.5)
    k = np.arange(side**2).reshape(side, side)
    a, b, c, d = (x.ravel() for x in (k[:-1, :-1], k[:-1, 1:], k[1:, 1:], k[1:, :-1]))
    rim = np.concatenate([k[0, :-1], k[:-1, -1], k[-1, :0:-1], k[:0:-1, 0]])
    after, low = np.roll(rim, -1), side**2 + np.arange(len(rim))
    depth = min(body.depth, float(np.ptp(places[:, 0])) / 4)  # of a half-space some
    points = np.column_stack([places, np.zeros(len(places))])
    triangles = [
        np.stack([a, b, c], 1), np.stack([a, c, d], 1),
        np.stack([rim, low, after], 1), np.stack([after, low, np.roll(low, -1)], 1),
    ]  # fmt: skip
    return Shape(
        points=np.vstack([points, points[rim] - [0.0, 0.0, depth]]), triangles=np.vstack(triangles)
    )


def skin_of(made: Any, body: Body) -> tuple[Shape, Ints]:
    """Visible surface of a meshed body, and the nodes (n,) of the mesh that are its points: the
    upper side of a sheet, the whole surface of others, without the absorbing layer.
    """
    mesh = made.mesh
    if body.of_kind.is_plate:
        facets = mesh.facets["top"]
    else:
        own = slice(None) if made.drag is None else made.drag == 0
        facets = boundary_facets(mesh.tets[own])
    flat = facets[:, [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]]].reshape(-1, 3)
    nodes, triangles = np.unique(flat, return_inverse=True)
    return Shape(points=mesh.points[nodes], triangles=triangles.reshape(-1, 3)), nodes


def moving_of(
    shape: Shape, pressure: MovingPressure, frequencies: Floats, upwards: fem.Complex
) -> Moving:
    """The motion of lines (f,) in Hz, of complex amplitudes (f, n) in metre upwards."""
    strength = np.abs(upwards).max(axis=1, initial=0.0)
    seen = frequencies[strength > SEEN * strength.max(initial=0.0)]
    span, count = shown_part(pressure, seen.max(initial=0.0))
    t = np.arange(count) * span / count
    return Moving(
        shape=shape, frames=synthesise(frequencies, upwards, t).astype(np.float32), period=span,
        repeats=seam(pressure.tacton, span) < CLOSED,
    )  # fmt: skip


def sent_shape(moving: Moving) -> dict[str, bytes]:
    """A shape as a page takes it: float32 in mm, and uint32."""
    shape = moving.shape
    return {
        "points": (1e3 * shape.points).astype("<f4").tobytes(),
        "triangles": shape.triangles.astype("<u4").tobytes(),
    }


def sent_motion(moving: Moving, pressure: MovingPressure) -> dict[str, Any]:
    """Motion as a page takes it: int8 of the largest, which is `drawn` mm; times in ms; the sides
    of paths (m, 2, 3) and the foci (t, foci, 3) as float32 in mm on the surface at rest.
    """
    points, path = moving.shape.points, pressure.tacton.trajectory
    largest = float(np.abs(moving.frames).max()) or 1.0
    drawn = DRAWN * 1e3 * float(np.ptp(points[:, 0]))
    t = np.arange(len(moving.frames)) * moving.period / len(moving.frames)
    f_d = path.drawing_frequency
    n = pressure.tacton.n_paths
    within = np.mod(n * f_d * t, 1.0) / n  # each of several foci stays on its own path
    at = [path.at_phase((within + phase) % 1) for phase in pressure.tacton.foci]
    # From one path's end to the next one's beginning there is no line.
    along = (np.arange(n)[:, None] + np.linspace(0, 1 - 1e-6, DRAWN_POINTS)) / n
    line = path.at_phase(along) if f_d else np.zeros((n, 0, 2))
    sides = np.stack([line[:, :-1], line[:, 1:]], axis=2).reshape(-1, 2)
    return {
        "frames": np.rint(127 / largest * moving.frames).astype(np.int8).tobytes(),
        "count": len(t), "period": 1e3 * moving.period, "drawn": drawn,
        "path": _on(points, sides).tobytes(),
        "foci": _on(points, np.stack(at, axis=1).reshape(-1, 2)).tobytes(),
        "ends": signed_ends(largest), "times": f"{drawn / (1e3 * largest):,.0f}",
        "repeats": moving.repeats,
    }  # fmt: skip


def signed_ends(largest: float) -> list[str]:
    """Labels of a colour bar at its left end, middle and right end, of motion up to `largest` metre
    about its mean.
    """
    value = f"{1e6 * largest:.3g} µm"
    return [f"{value} out of the body", "0", f"{value} into the body"]


def _on(points: Floats, places: Floats) -> Any:
    """Places (q, 2) in metre lifted a little above a surface, (q, 3) in mm."""
    from scipy.spatial import cKDTree

    if not len(places):
        return np.zeros((0, 3), "<f4")
    near = cKDTree(points[:, :2]).query_ball_point(places, FOCUS_ROOM / 1e3)
    high = [1e3 * points[k, 2].max() if k else 0.0 for k in near]
    return np.column_stack([1e3 * places, np.array(high) + LIFTED]).astype("<f4")
