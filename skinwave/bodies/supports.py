"""How a body is supported: its sides one by one, the elastic bed below it, and a sheet by its
edges, its clips, the tension in its plane, and its curl.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from math import isfinite

import numpy as np

from fem.boundary import Support
from fem.load_and_probe import facet_points
from meshes import TetMesh
from simple_model.choices import choose
from skinwave.typing import Bools, Ints

EDGES = {"left": (0, -1), "right": (0, 1), "front": (1, -1), "back": (1, 1)}  # axis, and its end
SUPPORTS = ("clamped", "simply")
STEEPEST = 0.05  # rise over side of a curled sheet: slopes of 0.2 at its edges
FEWEST = 3  # columns of nodes in a clip: fewer let the sheet turn about it
BESIDE = (0.1, 0.25, 0.5)  # of a clip's radius from its sides: lines of a mesh
NEARLY = 0.01  # of a clip's radius: a side of it so near an edge of the sheet is there
CONDITIONS = ("clamped", "absorbing", "free")  # of a side
BASES = (*CONDITIONS, "elastic")
USUAL = "absorbing"  # of a side that is not named


@dataclass(frozen=True, kw_only=True)
class Sides:
    """Condition of each side: left (least x), right, front (least y) and back; "" where it is not
    given, or a body has none.

    Raises
    ------
    ValueError
        If a condition is unknown.
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
        each = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: condition for name, condition in each.items() if condition}

    @property
    def symmetry(self) -> str:
        """The axes, of "xy", across whose middle planes the sides are their own mirror image."""
        ends = {axis: [n for n, (k, _) in EDGES.items() if k == axis] for axis in (0, 1)}
        return "".join(
            "xy"[axis]
            for axis, (low, high) in ends.items()
            if getattr(self, low) == getattr(self, high)
        )


def complete(sides: str | Sides, known: Sequence[str], kind: str) -> str | Sides:
    """Sides of a body, those that are not given as usual; one word if all are alike. `known` are
    the names of the sides that its kind has. Raises a ValueError for others.
    """
    if isinstance(sides, str):
        choose("sides", sides, CONDITIONS)
        return sides
    given = sides.by_name
    if beyond := [name for name in given if name not in known]:
        has = (
            f"its sides are {' and '.join(known)}"
            if known
            else ("whose sides are all alike; a sheet has edges in its mounting")
        )
        raise ValueError(f"a {kind} has no side '{beyond[0]}' of its own, {has}; leave it out")
    found = dict.fromkeys(known, USUAL) | given
    alike = set(found.values())
    return alike.pop() if len(alike) == 1 else Sides(**found)


def check_base(base: str, stiffness: float, *, depth: float, is_plate: bool) -> None:
    """Refuse a base that is unknown, and an elastic one without its stiffness in N/m3."""
    choose("base", base, BASES)
    if base != "elastic":
        if stiffness:
            raise ValueError(
                f"base_stiffness = {stiffness:g} N/m3 is that of an elastic base, and this one is "
                f'{base}; take base = "elastic", or leave it out'
            )
        return
    if not (np.isfinite(stiffness) and stiffness > 0):
        raise ValueError(
            f"base_stiffness = {stiffness:g} N/m3 of an elastic base must be a finite number "
            "above 0; give base_stiffness_n_per_m3, force per area and displacement"
        )
    if is_plate or not np.isfinite(depth):
        what = "a sheet, whose elements are thicker than it is" if is_plate else "a half-space"
        raise ValueError(
            f'an elastic base is below a solid of finite depth, not {what}; take base = "free"'
        )


def bed(mesh: TetMesh, facets: Ints, stiffness: float) -> Support:
    """Winkler foundation: springs in all directions, of a stiffness in N/m3."""
    k = np.full(len(facet_points(mesh, facets)), stiffness)
    return Support(facets=facets, stiffness=k, absorbed=np.zeros_like(k))


def together(first: Support | None, second: Support) -> Support:
    """Both supports of a mesh."""
    if first is None:
        return second
    return replace(
        first,
        facets=np.vstack([first.facets, second.facets]),
        stiffness=np.concatenate([first.stiffness, second.stiffness]),
        absorbed=np.concatenate([first.absorbed, second.absorbed]),
    )


@dataclass(frozen=True, kw_only=True)
class Mounting:
    """Support and pretension of a sheet whose sides are clamped.

    Parameters
    ----------
    edges : names of the `EDGES` that are held; in any order
    support : "clamped", or "simply": held edges may turn
    clips : (x, y) in metre, middles of clips, squares along the sides in which nothing moves
    clip_radius : float, metre, half a side of these squares
    tension_x, tension_y : float, N/m, uniform, 0 or above
    curl_x, curl_y : float, metre, how much higher than its edges the sheet is in the middle between
        left and right, and between front and back, as a parabola; it is unstressed

    Raises
    ------
    ValueError
        If a value is unknown, not finite or out of range, or the sheet is unconstrained.
    """

    edges: tuple[str, ...] = tuple(EDGES)
    support: str = "clamped"
    clips: tuple[tuple[float, float], ...] = ()
    clip_radius: float = 5e-3
    tension_x: float = 0.0
    tension_y: float = 0.0
    curl_x: float = 0.0
    curl_y: float = 0.0

    def __post_init__(self) -> None:
        for edge in self.edges:
            choose("edge", edge, EDGES)
        object.__setattr__(self, "edges", tuple(edge for edge in EDGES if edge in self.edges))
        choose("support", self.support, SUPPORTS)
        for name, unit in (("tension_x", "N/m"), ("tension_y", "N/m"), ("clip_radius", "m")):
            value = getattr(self, name)
            if not (isfinite(value) and value >= 0):
                raise ValueError(f"{name} = {value} {unit} must be a finite number, 0 or above")
        if not (self.edges or self.clips):
            raise ValueError(
                "edges = [] without clips_mm leaves the sheet unconstrained; name an edge or a clip"
            )
        if self.support == "simply" and len(self.edges) == 1 and not self.clips:
            raise ValueError(
                f"a sheet that is simply supported at its {self.edges[0]} edge alone turns about "
                "it; clamp that edge, or hold another"
            )

    @property
    def is_frame(self) -> bool:
        """Whether all of its edges are held, and nothing else."""
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
        """The axes, of "xy", across whose middle planes the supports are their own mirror image."""
        return "".join(name for name, axis in (("x", 0), ("y", 1)) if self._is_mirrored(axis))

    def _is_mirrored(self, axis: int) -> bool:
        ends = [edge for edge in self.edges if EDGES[edge][0] == axis]
        there = {tuple(round(c, 9) for c in clip) for clip in self.clips}
        back = {tuple(-c if a == axis else c for a, c in enumerate(clip)) for clip in there}
        return len(ends) != 1 and there == back

    @property
    def words(self) -> str:
        """Supports and tension in a few words."""
        how = "clamped" if self.support == "clamped" else "simply supported"
        held = [] if not self.edges else [f"{how} at its {_listed(self.edges)}"]
        if self.is_frame:
            held = [f"{how} all around"]
        if self.clips:
            held.append(f"held by {len(self.clips)} clips of {2e3 * self.clip_radius:g} mm")
        if self.is_stretched:
            held.append(f"stretched by {self.tension_x:g} and {self.tension_y:g} N/m along x and y")
        if self.is_curled:
            held.append(f"curled by {1e3 * self.curl_x:g} and {1e3 * self.curl_y:g} mm along them")
        return " and ".join(held)


def _listed(edges: Sequence[str]) -> str:
    return f"{' and '.join(edges)} edge{'s' * (len(edges) > 1)}"


FRAME = Mounting()


def check_extent(mounting: Mounting, width: float, height: float) -> None:
    """Refuse clips off a sheet of a width and height in metre, and a curl that is not shallow."""
    for name, side in (("curl_x", width), ("curl_y", height)):
        if not abs(curl := getattr(mounting, name)) <= STEEPEST * side:
            raise ValueError(
                f"{name} = {1e3 * curl:g} mm on a side of {1e3 * side:g} mm is beyond "
                f"{1e3 * STEEPEST * side:g} mm, the limit of a shallow shell; flatten it"
            )
    for x, y in mounting.clips:
        if not (abs(x) <= width / 2 and abs(y) <= height / 2):
            raise ValueError(
                f"the clip at ({1e3 * x:g}, {1e3 * y:g}) mm is off the sheet, which ends at "
                f"{500 * width:g} and {500 * height:g} mm; move it inside"
            )


def clip_lines(mounting: Mounting, axis: int, size: float) -> list[float]:
    """Places in metre, ascending, along an axis of a sheet of a size: of the sides of its clips,
    and of lines beside them, as the curvature has no bound at their corners.
    """
    reach = mounting.clip_radius
    sides = [clip[axis] + turn * reach for clip in mounting.clips for turn in (-1, 1) if reach]
    found: list[float] = []
    for part in (0.0, *BESIDE):
        gap = (part / 2 or NEARLY) * reach
        lines = {side + turn * part * reach for side in sides for turn in (-1, 1)}
        found += [
            at for at in sorted(lines, key=abs)
            if abs(at) < size / 2 - gap and all(abs(at - other) > gap for other in found)
        ]  # fmt: skip
    return sorted(found)


def held(mounting: Mounting, mesh: TetMesh) -> Bools:
    """Components (n, 3) of the nodes that supports hold, of a flat sheet or the part of it that
    symmetry leaves.

    Clamped sections neither move along the sheet nor turn. Their deflection is held in the middle
    plane alone: bending changes the thickness, by Poisson's effect, and held faces would make the
    sheet stiffer in proportion to its thickness, which is larger in elements. A simple support
    holds an edge's deflection, and its motion along the edge; that across the edge in the middle
    plane alone, so that the section may turn.
    """
    points = mesh.points
    low, high = points.min(axis=0), points.max(axis=0)
    high[:2] = np.maximum(high[:2], -low[:2])
    near = 1e-9 * float(np.ptp(points, axis=0).max())
    middle = np.abs(2 * points[:, 2] - low[2] - high[2]) < near
    found = np.zeros(points.shape, bool)
    for edge in mounting.edges:
        axis, end = EDGES[edge]
        at = np.abs(points[:, axis] - end * high[axis]) < near
        if mounting.support == "simply":
            found[at, 2] = found[at, 1 - axis] = True
            found[at & middle] = True
        else:
            found[at, :2] = True
            found[at & middle, 2] = True
    for clip in mounting.clips:
        there = [abs(c) if low[axis] > -near else c for axis, c in enumerate(clip)]
        at = _clipped(mesh, there, mounting.clip_radius)
        found[at, :2] = True
        found[at & middle, 2] = True
    return found


def _clipped(mesh: TetMesh, clip: Sequence[float], radius: float) -> Bools:
    """Nodes (n,) in a clip: in its square, and in the `FEWEST` nearest columns."""
    away = np.abs(mesh.points[:, :2] - clip).max(axis=1)
    top = np.unique(mesh.facets["top"])
    reach = np.partition(away[top], FEWEST - 1)[FEWEST - 1]
    return away <= max(radius, reach) * (1 + NEARLY)
