"""Goal-oriented sizes against the graded elements of a hand: `python -m bench.goal_hand [DRAWS]`.

The hand of `examples/hand` under AM 140 Hz on a circle of 20 mm for 0.25 s, five probes on a line
from its middle. The error is that of the waveforms beside the reference: of the worst probe, and
the mean over the probes. The mesher differs from run to run, so each mesh is made DRAWS times, two
if not given. A goal-oriented reference beside the graded one bounds their own errors.
"""

import sys
from collections.abc import Callable, Sequence
from itertools import product
from pathlib import Path

import numpy as np

from meshes.tetmesh import Floats
from simple_model import MovingPressure, Tacton, Trajectory
from skinwave.bodies import Body
from skinwave.bodies.discretised import Discretise
from skinwave.models.prepared import Prepared, answer, prepare
from skinwave.planning.goal_oriented import strongest
from skinwave.planning.goal_sizes import family_of_sizes
from skinwave.planning.refinement import CONTROLLER
from skinwave.scene import Scene

HAND = Path(__file__).parent.parent / "examples/hand/generic-hand-right.glb"
TACTON = Tacton(
    am_frequency=140, duration=0.25, trajectory=Trajectory(shape="circle", size=0.02, speed=12)
)
SCENE = Scene(
    pressure=MovingPressure(tacton=TACTON),
    body=Body(kind="mesh", file=str(HAND), up="-x"),
    probes=((0.0, 0.0), (5e-3, 0.0), (1e-2, 0.0), (1.5e-2, 0.0), (2e-2, 0.0)),
)
SIZES = (8, 6.2, 4.7)  # mm, of graded elements about the middle
RATIOS = (0.7, 0.5, 0.35)  # of predicted errors, over that of the coarse mesh
REFERENCE, LEAST = 2.7, 0.1  # mm, and such a ratio
APART = 1e-6  # relative, of sizes that are meshed anew
AIMS = (0.02, 0.015)  # mean errors


def reduced(h: float, draw: int, discretise: Discretise | None = None) -> Prepared:
    """Hand with elements of a size in mm, or discretised otherwise."""
    h *= 1e-3 * (1 + APART * draw)
    return prepare(SCENE.body, SCENE.probe_points, h=h, discretise=discretise)


def waveforms(prepared: Prepared) -> Floats:
    """Displacement (t, p) of the probes."""
    return answer(prepared, SCENE).displacement


def errors(found: Floats, exact: Floats) -> Floats:
    """Relative errors (p,) of waveforms (t, p)."""
    return np.linalg.norm(found - exact, axis=0) / np.linalg.norm(exact, axis=0)


def words(error: Floats) -> str:
    """Errors (p,) of the worst probe and in the mean."""
    return f"worst {100 * error.max():5.2f} %  mean {100 * error.mean():5.2f} %"


def goal_meshes() -> Callable[[float, int], Prepared]:
    """The hand on a goal-oriented mesh of a predicted ratio of errors, in several draws."""
    family = family_of_sizes(SCENE, SCENE.body, "", 0.05, "auto")
    coarse = reduced(1e3 * family.size, 0)
    known = family.estimated(*strongest(SCENE, coarse), coarse.effort.dofs)
    print(f"coarse: {coarse.effort.dofs:,} dofs, estimate {100 * known.error:.2f} %")

    def of(ratio: float, draw: int) -> Prepared:
        mesh = known.finer(ratio, family.coarse, np.inf)
        equal = family.size * ratio ** (1 / CONTROLLER.order)
        return reduced(1e3 * equal, draw, mesh.discretise)

    return of


def enough(rows: list[tuple[int, float]], aim: float) -> float:
    """Dofs at an error, by a straight line through the logarithms."""
    dofs, error = np.log(np.array(rows)).T
    slope, start = np.polyfit(error, dofs, 1)
    return float(np.exp(start + slope * np.log(aim)))


def main(draws: int) -> None:
    """Errors of all meshes, and the dofs that both rules take for a mean error."""
    goal = goal_meshes()
    exact = waveforms(reduced(REFERENCE, 0))
    rules: dict[str, tuple[Sequence[float], Callable[[float, int], Prepared]]] = {
        "graded": (SIZES, reduced), "goal-oriented": (RATIOS, goal),
    }  # fmt: skip
    found: dict[str, list[tuple[int, float]]] = {}
    for name, (steps, made) in rules.items():
        found[name] = []
        for step, draw in product(steps, range(draws)):
            prepared = made(step, draw)
            each = errors(waveforms(prepared), exact)
            found[name].append((prepared.effort.dofs, float(each.mean())))
            print(f"{name:14}{step:5} {prepared.effort.dofs:8,} dofs  {words(each)}", flush=True)
    for aim in AIMS:
        graded, oriented = (enough(rows, aim) for rows in found.values())
        print(f"mean error of {100 * aim:g} %: {graded:,.0f} and {oriented:,.0f} dofs, "
              f"{oriented / graded:.2f}")  # fmt: skip
    other = goal(LEAST, 0)
    each = errors(waveforms(other), exact)
    print(f"goal-oriented reference of {other.effort.dofs:,} dofs: {words(each)}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 2)
