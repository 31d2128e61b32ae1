"""Supports of a body: its sides, the elastic bed below it, and the mounting of a sheet."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fem.boundary import Support
from fem.load_and_probe import facet_points
from meshes import TetMesh
from simple_model.choices import check_numbers, check_range, choose
from skinwave.typing import Bools, Ints

EDGES = {"left": (0, -1), "right": (0, 1), "front": (1, -1), "back": (1, 1)}  # axis, end
CONDITIONS = ("clamped", "absorbing", "free")  # of a side
DEFAULT_SIDE = "absorbing"


@dataclass(frozen=True, kw_only=True)
class Sides:
    """Condition of each side: left (smallest x), right, front (smallest y) and back.

    Each is "clamped", "absorbing" or "free"; others raise a ValueError. An empty text stands for
    the default, or for a side that the body does not have.
    """

    left: str = ""
    right: str = ""
    front: str = ""
    back: str = ""

    def __post_init__(self) -> None:
        for condition in self.by_name.values():
            choose("side", condition, CONDITIONS)

    def __str__(self) -> str:
        return ", ".join(f"{condition} {name}" for name, condition in self.by_name.items())

    @property
    def by_name(self) -> dict[str, str]:
        """Conditions by the names of sides."""
        return {name: condition for name, condition in vars(self).items() if condition}

    @property
    def symmetry(self) -> str:
        """Axes, out of "xy", across whose middle planes the sides are mirror images."""
        return "x" * (self.left == self.right) + "y" * (self.front == self.back)


def complete_sides(sides: str | Sides, known: Sequence[str], kind: str) -> str | Sides:
    """Return the sides of a body with defaults for missing ones, as one word if all are equal.

    `known` are the names of the sides of its kind; others raise a ValueError.
    """
    if isinstance(sides, str):
        choose("side", sides, CONDITIONS)
        return sides
    if unknown := [name for name in sides.by_name if name not in known]:
        cure = f"its sides are {' and '.join(known)}"
        if not known:
            cure = "its sides have one common condition, and a sheet has edges in its mounting"
        raise ValueError(f"a {kind} has no separate side '{unknown[0]}'; {cure}")
    complete = dict.fromkeys(known, DEFAULT_SIDE) | sides.by_name
    alike = set(complete.values())
    return alike.pop() if len(alike) == 1 else Sides(**complete)


def check_base(base: str, stiffness: float, *, depth: float, is_plate: bool) -> None:
    """Refuse an unknown base, and an elastic one without its stiffness in N/m3."""
    choose("base", base, (*CONDITIONS, "elastic"))
    if base != "elastic":
        if stiffness:
            raise ValueError(
                f'base_stiffness = {stiffness:g} N/m3 needs base = "elastic", not {base}; remove '
                "one"
            )
        return
    if not (np.isfinite(stiffness) and stiffness > 0):
        raise ValueError(
            f"base_stiffness = {stiffness:g} N/m3 of an elastic base must be finite and above 0; "
            "give base_stiffness_n_per_m3"
        )
    if is_plate or not np.isfinite(depth):
        refused = "a sheet" if is_plate else "a half-space"
        raise ValueError(
            f'an elastic base needs a solid of finite depth, not {refused}; use base = "free"'
        )


def with_springs(support: Support | None, mesh: TetMesh, facets: Ints, stiffness: float) -> Support:
    """Return a support with further springs in all directions, of a stiffness in N/m3."""
    k = np.full(len(facet_points(mesh, facets)), stiffness)
    springs = Support(facets=facets, stiffness=k, absorbed=np.zeros_like(k))
    if support is None:
        return springs
    pairs = {name: (own, vars(springs)[name]) for name, own in vars(support).items()}
    return Support(**{name: np.concatenate(pair) for name, pair in pairs.items()})


@dataclass(frozen=True, kw_only=True)
class Mounting:
    """Supports and pretension of a sheet whose sides are clamped.

    Parameters
    ----------
    edges : names of the supported edges: left, right, front, back
    support : "clamped", or "simply" for edges that may turn
    clips : (x, y) in m, middles of clips, squares along the sides in which nothing moves
    clip_radius : float, m, half a side of these squares
    tension_x, tension_y : float, N/m, uniform, 0 or above
    curl_x, curl_y : float, m, height of the middle above the edges, between left and right and
        between front and back; the sheet is an unstressed parabola
    edge_loss : loss factor by the edges, of each mode at its own frequency
    frame_width : float, m, of a frame around all edges, which open air flows around

    Raises a ValueError if a value is unknown or out of range, or the sheet is unconstrained.
    """

    edges: tuple[str, ...] = tuple(EDGES)
    support: str = "clamped"
    clips: tuple[tuple[float, float], ...] = ()
    clip_radius: float = 5e-3
    tension_x: float = 0.0
    tension_y: float = 0.0
    curl_x: float = 0.0
    curl_y: float = 0.0
    edge_loss: float = 0.0
    frame_width: float = 0.025

    def __post_init__(self) -> None:
        for edge in self.edges:
            choose("edge", edge, EDGES)
        object.__setattr__(self, "edges", tuple(edge for edge in EDGES if edge in self.edges))
        supports = ("clamped", "simply")
        choose("support", self.support, supports)
        numbers = ("tension_x", "tension_y", "clip_radius", "edge_loss", "frame_width")
        check_numbers("a sheet", self, *numbers, least="0 or above")
        if not (self.edges or self.clips):
            raise ValueError(
                "the sheet is unconstrained without edges and clips_mm; give one of them"
            )
        if self.support == "simply" and len(self.edges) == 1 and not self.clips:
            raise ValueError(
                f"a sheet that is simply supported only at its {self.edges[0]} edge turns about "
                "it; clamp that edge, or hold another"
            )

    @property
    def is_frame(self) -> bool:
        """Whether all edges are supported, without clips."""
        return self.edges == tuple(EDGES) and not self.clips

    @property
    def is_stretched(self) -> bool:
        """Whether it has a tension."""
        return self.tension_x > 0 or self.tension_y > 0

    @property
    def is_curled(self) -> bool:
        """Whether it is curved at rest."""
        return bool(self.curl_x or self.curl_y)

    @property
    def mean_tension(self) -> float:
        """Mean of the tensions along x and y, N/m."""
        return (self.tension_x + self.tension_y) / 2

    @property
    def symmetry(self) -> str:
        """Axes, out of "xy", across whose middle planes the supports are mirror images."""
        return "".join(name for axis, name in enumerate("xy") if self._is_mirrored(axis))

    def _is_mirrored(self, axis: int) -> bool:
        ends = [edge for edge in self.edges if EDGES[edge][0] == axis]
        there = {tuple(round(c, 9) for c in clip) for clip in self.clips}
        mirror = {tuple(-c if a == axis else c for a, c in enumerate(clip)) for clip in there}
        return len(ends) != 1 and there == mirror

    @property
    def words(self) -> str:
        """Supports and tension in a few words."""
        how = "clamped" if self.support == "clamped" else "simply supported"
        plural = "s" if len(self.edges) > 1 else ""
        held = [f"{how} at its {' and '.join(self.edges)} edge{plural}"] if self.edges else []
        if self.is_frame:
            held = [f"{how} all around"]
        if self.clips:
            held.append(f"held by {len(self.clips)} clips of {2e3 * self.clip_radius:g} mm")
        if self.is_stretched:
            held.append(f"stretched by {self.tension_x:g} and {self.tension_y:g} N/m along x and y")
        if self.is_curled:
            held.append(f"curled by {1e3 * self.curl_x:g} and {1e3 * self.curl_y:g} mm along them")
        if self.edge_loss:
            held.append(f"with a loss factor of {self.edge_loss:g} by its edges")
        return " and ".join(held)


FRAME = Mounting()


def check_extent(mounting: Mounting, width: float, height: float) -> None:
    """Refuse clips outside a sheet of a width and height in m, a curl that is not shallow, and a
    frame that is wider than both the sheet and the default frame.
    """
    steepest = 0.05  # rise over side of a curled sheet: slopes of 0.2 at its edges
    for name, side in (("curl_x", width), ("curl_y", height)):
        most = 1e3 * steepest * side
        cure = ", the limits of a shallow shell; reduce it"
        check_range(name, 1e3 * getattr(mounting, name), -most, most, " mm", cure)
    if (wide := mounting.frame_width) > max(width, height, FRAME.frame_width):
        raise ValueError(
            f"frame_width_mm = {1e3 * wide:g} is wider than the sheet; reduce it, or use "
            'air = "baffle" for a wall'
        )
    for x, y in mounting.clips:
        if not (abs(x) <= width / 2 and abs(y) <= height / 2):
            raise ValueError(
                f"the clip at ({1e3 * x:g}, {1e3 * y:g}) mm lies outside the sheet. Move it "
                f"inside x = ±{500 * width:g} mm, y = ±{500 * height:g} mm"
            )


def clip_lines(mounting: Mounting, axis: int, size: float) -> list[float]:
    """Return grid lines in m along an axis of a sheet: the sides of its clips, and lines near them.

    The curvature is unbounded at the corners of clips.
    """
    reach = mounting.clip_radius
    sides = [clip[axis] + turn * reach for clip in mounting.clips for turn in (-1, 1) if reach]
    placed: list[float] = []
    for part in (0.0, 0.1, 0.25, 0.5):  # distance from the sides, over the radius of a clip
        gap = (part / 2 or 0.01) * reach  # to other lines
        lines = {side + turn * part * reach for side in sides for turn in (-1, 1)}
        placed += [
            at for at in sorted(lines, key=abs)
            if abs(at) < size / 2 - gap and all(abs(at - other) > gap for other in placed)
        ]  # fmt: skip
    return sorted(placed)


def supported_components(mounting: Mounting, mesh: TetMesh) -> Bools:
    """Return the components (n, 3) of nodes that supports fix, for a flat sheet or its symmetric
    part.

    Clamped sections neither move along the sheet nor turn. Their deflection is fixed only in the
    middle plane: bending changes the thickness by Poisson's effect, so that fixed faces would
    stiffen the sheet in proportion to the thickness of its mesh. A simple support fixes the
    deflection of an edge and the motion along it, but the motion across it only in the middle
    plane, so that the section may turn.
    """
    points = mesh.points
    low, high = points.min(axis=0), points.max(axis=0)
    high[:2] = np.maximum(high[:2], -low[:2])
    near = 1e-9 * float(np.ptp(points, axis=0).max())
    middle = np.abs(2 * points[:, 2] - low[2] - high[2]) < near
    held, clamped = np.zeros(points.shape, bool), np.zeros(len(points), bool)
    for edge in mounting.edges:
        axis, end = EDGES[edge]
        at = np.abs(points[:, axis] - end * high[axis]) < near
        if mounting.support == "simply":
            held[at, 2] = held[at, 1 - axis] = True
            held[at & middle] = True
        else:
            clamped |= at
    for clip in mounting.clips:
        there = [abs(c) if low[axis] > -near else c for axis, c in enumerate(clip)]
        clamped |= _clip_nodes(mesh, there, mounting.clip_radius)
    held[clamped, :2] = True
    held[clamped & middle, 2] = True
    return held


def _clip_nodes(mesh: TetMesh, clip: Sequence[float], radius: float, fewest: int = 3) -> Bools:
    """Nodes (n,) in a clip: those in its square, and in the `fewest` nearest columns, between which
    the sheet cannot turn.
    """
    away = np.abs(mesh.points[:, :2] - clip).max(axis=1)
    top = np.unique(mesh.facets["top"])
    reach = np.partition(away[top], fewest - 1)[fewest - 1]
    return away <= 1.01 * max(radius, reach)
