"""How a body is supported: its sides one by one, and the elastic bed below it."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from fem.boundary import Support
from fem.load_and_probe import facet_points
from meshes import TetMesh
from meshes.tetmesh import Ints
from simple_model.choices import choose
from skinwave.bodies.mounting import EDGES

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
