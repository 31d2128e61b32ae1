"""Time and memory that commands take for a scene, before they are run: about, on two cores.

Where a plan has reduced a body, its time is the measure; otherwise that of a slab on two cores is.
"""

from dataclasses import dataclass
from math import isfinite

from skinwave.bodies.sizes import default_size
from skinwave.models import named
from skinwave.models.advice import takes
from skinwave.models.plate_modes import FROM_REST
from skinwave.planning.records import Plan, PlanRow
from skinwave.scene.scene import Scene

DOFS_IN_A_CUBE = 24  # of ten-node tetrahedra, in a cube with their size as its side
KNOWN_DOFS, KNOWN_SECONDS, KNOWN_MEMORY = 64_000, 9.0, 0.8 * 2**30  # of one reduction
BASE_MEMORY = 0.3 * 2**30  # of a process
GROWTH, MEMORY_GROWTH = 1.4, 1.2  # exponents of dofs
PAGE, PICTURES = 8.0, 20.0  # s of the figures of a comparison, and of a report
LARGER = 1.5  # times the default size: elements of pictures, for a fifth of the time
COARSER = 1.15  # times the time of a body, with the coarser one that it is compared with


@dataclass(frozen=True, kw_only=True)
class Cost:
    """Cost of a `command`: `seconds`, and bytes of `memory`."""

    command: str
    seconds: float
    memory: float


def costs(scene: Scene, required: Plan) -> tuple[Cost, ...]:
    """Cost of `run`, `compare` and `report` for a scene with its plan.

    Parameters
    ----------
    scene : Scene
    required : Plan

    Returns
    -------
    Cost of each
    """
    run = Cost(command="run", seconds=required.seconds, memory=required.memory + BASE_MEMORY)
    if not scene.body.of_kind.discretise:
        return (run,)
    whole = _reduction(scene, required, 1.0) if named(required.model).is_reduced else run
    seen = run
    if isfinite(scene.body.depth) and not takes(FROM_REST, scene):
        seen = _reduction(scene, required, LARGER)
    return (
        run,
        Cost(
            command="compare", seconds=COARSER * whole.seconds + PAGE,
            memory=max(whole.memory, run.memory),
        ),
        Cost(
            command="report", seconds=run.seconds + seen.seconds + PICTURES,
            memory=max(seen.memory, run.memory) + BASE_MEMORY,
        ),
    )  # fmt: skip


def rows(scene: Scene, required: Plan) -> list[PlanRow]:
    """Row of a plan for each cost."""
    return [
        PlanRow(
            what=f"cost of {each.command}",
            value=f"about {max(each.seconds, 1):.0f} s, {each.memory / 2**30:.1f} GiB",
            reason="estimated; of report without films" if each.command == "report"
            else "estimated",
        )
        for each in costs(scene, required)
    ]  # fmt: skip


def _reduction(scene: Scene, required: Plan, larger: float) -> Cost:
    """Cost of reducing a whole body of elements so many times larger than by default."""
    body = scene.body
    size = larger * default_size(body)
    dofs = DOFS_IN_A_CUBE * body.width * body.height * body.depth / size**3
    known, seconds, memory = KNOWN_DOFS, KNOWN_SECONDS, KNOWN_MEMORY
    if (
        required.prepared
        and required.h
        and "factorise and reduce" in required.prepared.effort.seconds
    ):
        effort = required.prepared.effort
        known, seconds = effort.dofs, sum(effort.seconds.values())
        whole = 2 ** len(required.symmetry) * effort.dofs
        dofs = whole * (required.h / size) ** 3
    ratio = dofs / known
    return Cost(
        command="", seconds=seconds * ratio**GROWTH,
        memory=memory * (dofs / KNOWN_DOFS) ** MEMORY_GROWTH + BASE_MEMORY,
    )  # fmt: skip
