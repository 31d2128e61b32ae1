"""Plan of a simulation, with the reason for each decision."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from typing import Any

from simple_model import Statement
from skinwave.models.options import DEFAULT, SolveOptions
from skinwave.models.reduced import ReducedBody
from skinwave.scene.scene import Body
from skinwave.system.drawing import call_report


@dataclass(frozen=True, kw_only=True)
class PlanRow:
    """One decision of a plan, its value, and its reason."""

    what: str
    value: str
    reason: str


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Plan of a simulation, as `skinwave.plan` returns it.

    Attributes
    ----------
    model : str, name of the model
    body : Body, the modelled part of the scene's body
    symmetry : str, axes out of "xy" across which the body is halved
    h : float or None, element size in m; None without a mesh
    highest : float, highest relevant line of the load in Hz
    statement : Statement, the parts of the expected error
    seconds, memory : float or None, cost of the first response in s of one core and in bytes,
        without plan, maps and page: predicted, or measured for a body that the plan reduced; None
        if unknown
    rows : tuple of PlanRow, the decisions with their reasons
    cautions : tuple of str, warnings apart from those of the expected error
    prepared : ReducedBody or None, the body reduced on the planned mesh
    options : SolveOptions, the request

    Examples
    --------
    >>> import skinwave
    >>> plan = skinwave.plan(skinwave.loads("[body]\\nkind = 'none'"))
    >>> plan.model
    'point-kernel'
    >>> plan.rows[0].reason
    'the scene has no body that moves'
    """

    model: str
    body: Body
    symmetry: str = ""
    h: float | None = None
    highest: float = 0.0
    statement: Statement = field(default_factory=Statement)
    seconds: float | None = None
    memory: float | None = None
    rows: tuple[PlanRow, ...] = ()
    cautions: tuple[str, ...] = ()
    prepared: ReducedBody | None = field(default=None, repr=False)
    options: SolveOptions = field(default=DEFAULT, repr=False)

    @property
    def error(self) -> float:
        """Expected relative error; inf if unknown."""
        return self.statement.error

    @property
    def warnings(self) -> tuple[str, ...]:
        """A sentence for each part of the request that is not met."""
        return (*self.statement.warnings, *self.cautions)

    def table(self) -> dict[str, Any]:
        """Return the plan as values for JSON, without the reduced body and the options."""
        values = asdict(replace(self, prepared=None, options=DEFAULT))
        for name in ("prepared", "options", "statement", "cautions"):
            del values[name]
        return values | self.statement.summary() | {"warnings": self.warnings}

    def __repr__(self) -> str:
        return call_report("notebook", "plan_line", self)

    def _repr_html_(self) -> str:
        return call_report("notebook", "plan_page", self)
