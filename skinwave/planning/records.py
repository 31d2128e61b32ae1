"""Records of a plan: its choices, each with a reason, and what it leaves out."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from typing import Any

from skinwave.models.options import DEFAULT, SolveOptions
from skinwave.models.reduced import ReducedBody
from skinwave.scene.scene import Body
from skinwave.system.drawn import drawn


@dataclass(frozen=True, kw_only=True)
class PlanRow:
    """One decision of a plan, and its reason."""

    what: str
    value: str
    reason: str


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Plan of a simulation.

    `model`; the `body` that is modelled, and the axes of `symmetry` that it is halved across;
    element size `h` in metre (None without a mesh); the `highest` line in Hz that matters; the
    expected relative `error`; predicted `seconds` and bytes of `memory` of the first response;
    a reason for each; `warnings` where a request is not met; the reduced body, `prepared`, on the
    mesh that was found; and the `options` that it is for.
    """

    model: str
    body: Body
    symmetry: str = ""
    h: float | None = None
    highest: float = 0.0
    error: float = 0.0
    seconds: float = 0.1
    memory: float = 1e8
    rows: tuple[PlanRow, ...] = ()
    warnings: tuple[str, ...] = ()
    prepared: ReducedBody | None = field(default=None, repr=False)
    options: SolveOptions = field(default=DEFAULT, repr=False)

    def table(self) -> dict[str, Any]:
        """What JSON has of it: all but the reduced body and the options."""
        found = asdict(replace(self, prepared=None, options=DEFAULT))
        return {key: value for key, value in found.items() if key not in ("prepared", "options")}

    def __repr__(self) -> str:
        return drawn("notebook", "plan_line", self)

    def _repr_html_(self) -> str:
        return drawn("notebook", "plan_page", self)
