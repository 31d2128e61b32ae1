"""Errors and costs of plans: `stated` and `cost` on random scenes, `sheets` on those that stretch.

bench/README.md explains each table.
"""

import argparse
import contextlib
import os
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import count, islice
from typing import Any

import numpy as np

from bench import table, timed
from bench.agreement import TooSlow, limited, random_scene
from bench.costs import PAPER, circle
from simple_model import Statement
from skinwave.bodies.sizes import default_size
from skinwave.models import plate_modes
from skinwave.models.options import SolveOptions, sample_times
from skinwave.models.plate_modes import ACCURACY, STRETCHED, Run, sheet_motion
from skinwave.models.reduced import answer, reduce_scene
from skinwave.models.relative_change import relative_changes
from skinwave.planning.plan import plan
from skinwave.planning.refinement import about_its_rest
from skinwave.planning.simulate import compute, solve_as_planned
from skinwave.scene.file import from_table, loads
from skinwave.scene.scene import Scene
from skinwave.typing import Array, Floats

MOST = 1.1  # times the stated error
SLOWEST = 20.0  # s of CPU time of a plan or a reference: slower scenes are left out
REFERENCE = 1e-4  # relative error of the reduction of a reference
FINEST, MOST_CELLS = 0.7, 3000  # of a reference: size over the default size, and cells of that size
COARSER = (2.6, 2.0, 1.6, 1.3, 1.0, 0.8)
TOLERANCES = (0.03, 0.05, 0.10, 0.20)
MOST_MODES = 120, 170  # of references of sheets, in the shortest and in the longest steps
SHEETS = {
    "paper sheet, AM 140 Hz": circle(PAPER),
    "AM 71 Hz": circle(PAPER, am_frequency_hz=71, shape="point"),
    "twice the pressure": circle("[focus]\npeak_pressure_pa = 100\n" + PAPER),
    "loose sheet": circle("[body]\npreset = 'paper-sheet-loose'"),
    "A5 with tension, 0.3 s": circle(
        "[body]\npreset = 'a5-sheet'\nmounting = {tension_x_n_per_m = 49, tension_y_n_per_m = 15}",
        duration_s=0.3,
    ),
    "two foci with a rhythm, 0.4 s": circle(
        PAPER, duration_s=0.4, am_frequency_hz=0, foci=[0.0, 0.5],
        rhythm={"pulses_ms": [[100, 50], [40, 110]]},
    ),
}  # fmt: skip


def each_scene(
    number: int, seed: int, suits: Callable[[Scene], bool], call: Callable[[int, Scene, float], Any]
) -> list[Any]:
    """Return the values of a call for random scenes that suit, with their numbers and tolerances,
    without scenes that are refused or take too long.
    """

    def values() -> Iterator[Any]:
        for k in count():
            with contextlib.suppress(ValueError, TooSlow):
                scene = from_table(random_scene(k, seed))
                if suits(scene):
                    yield call(k, scene, TOLERANCES[k % len(TOLERANCES)])

    return [*islice(values(), number)]


def is_slab(scene: Scene) -> bool:
    """Return whether the body of a scene is a slab under a pressure."""
    return scene.body.kind == "slab" and scene.load.kind == "pressure"


def error(found: Array, expected: Array) -> float:
    """Return the relative error of waveforms (t, p) at the worst probe."""
    return float(relative_changes(found - expected, expected).max())


def stated_and_true(scene: Scene, tolerance: float, h: float | None = None) -> tuple[float, float]:
    """Return the stated and the true error of the mesh and the reduction of `fem`, with planned
    elements or size h in metres.
    """
    options = SolveOptions(tolerance=tolerance, model="fem", h=h, progress=limited(SLOWEST))
    chosen = plan(scene, options)
    assert chosen.prepared
    assert chosen.h
    planned_scene = replace(scene, body=chosen.body)
    planned = answer(chosen.prepared, planned_scene)
    finer = SolveOptions(h=chosen.h / 2, progress=limited(SLOWEST))
    fine = reduce_scene(planned_scene, finer, symmetry=chosen.symmetry, reduction=REFERENCE)
    better = answer(fine, planned_scene).values
    own = [part for part in chosen.statement.parts if part.name in ("mesh", "reduction")]
    true = error(*(about_its_rest(scene, each) for each in (planned.values, better)))
    return Statement(parts=tuple(own)).error, true


def stated(number: int, seed: int) -> None:
    """Print the stated and the true error of scenes with solid bodies."""

    def suits(scene: Scene) -> bool:
        body = scene.body
        return body.kind != "sheet" and np.isfinite(body.depth) and body.sides != "absorbing"

    def errors(k: int, scene: Scene, tolerance: float) -> tuple[float, float]:
        body, (found, true) = scene.body, stated_and_true(scene, tolerance)
        row(k, body.kind, len(body.layers), f"{body.base}, {body.sides}", f"{tolerance:.0%}",
            f"{found:.2%}", f"{true:.2%}", f"{true / found:.2f}")  # fmt: skip
        return found, true

    row = table("scene", "kind", "layers", "base, sides", "limit", "stated", "true", "ratio")
    found, true = np.transpose(each_scene(number, seed, suits, errors))
    low, middle, high = np.quantile(found / true, [0.1, 0.5, 0.9])
    print(f"{(true > MOST * found).sum()} of {number} fail; stated over true error {middle:.2f} "
          f"in the median, {low:.2f} to {high:.2f} in eight of ten")  # fmt: skip


def cheapest(scene: Scene, tolerance: float, reference: Array) -> tuple[str, float]:
    """Return the first of the candidates, by rising cost, within the tolerance, and its seconds."""
    h = default_size(scene.body)
    candidates = [("fem", {"h": h * ratio}) for ratio in COARSER]
    if scene.body.of_kind.is_layer:
        candidates[:0] = [("flat-body-harmonic", {}), ("flat-body", {})]
    for model, options in candidates:
        response, seconds = timed(compute, scene, model, **options)
        if error(response.values, reference) <= tolerance:
            return model + "".join(f", {1e3 * v:.1f} mm" for v in options.values()), seconds
    return "none", np.inf


def cost(number: int, seed: int) -> None:
    """Print the error and the time of planned responses, and of the cheapest candidate."""

    def verdicts(k: int, scene: Scene, tolerance: float) -> tuple[bool, bool, bool]:
        body, h = scene.body, FINEST * default_size(scene.body)
        far = replace(body, width=2 * body.width, height=2 * body.height)
        fine = replace(scene, body=far) if body.sides == "absorbing" else scene
        if fine.body.width * fine.body.height * body.depth > MOST_CELLS * h**3:
            raise ValueError("too large")
        reference = compute(fine, "fem", h=h, progress=limited(SLOWEST)).values
        chosen, planning = timed(plan, scene, SolveOptions(tolerance=tolerance))
        response, seconds = timed(solve_as_planned, scene, chosen)
        if chosen.prepared:  # the time of a reduction during planning counts for the response
            seconds, planning = seconds + chosen.seconds, planning - chosen.seconds
        wrong = error(response.values, reference)
        name, least = cheapest(scene, tolerance, reference)
        ratios = seconds / least, (seconds + planning) / least
        row(
            k,
            body.sides,
            f"{tolerance:.0%}",
            f"{wrong:.2%}",
            chosen.model,
            f"{seconds:.1f}",
            f"{planning:.1f}",
            name,
            f"{least:.1f}",
            *(f"{each:.1f}" for each in ratios),
        )
        return wrong <= tolerance, ratios[0] <= 5, ratios[1] <= 5

    row = table("scene", "sides", "limit", "error", "chosen", "s", "planning, s",
                "cheapest in tolerance", "s", "ratio", "with")  # fmt: skip
    counts = np.sum(each_scene(number, seed, is_slab, verdicts), axis=0)
    print(f"{counts[0]} of {number} within the tolerance; {counts[1]} at no more than five times "
          f"the cheapest, {counts[2]} with planning")  # fmt: skip


def sheets() -> None:
    """Print costs and errors of sheets that stretch."""
    row = table("scene", "lines", "one run", "plan", "response", "map", "stated", "true")
    tolerance = SolveOptions().tolerance
    for name, text in SHEETS.items():
        drawn = loads(text)
        times = sample_times(drawn)
        steps = len(times) - 1

        def added(count: int, steps: int, drawn: Scene = drawn, times: Floats = times) -> Floats:
            return plate_modes.stretching_in_run(drawn, times, Run(count=count, steps=steps))

        lines = timed(plate_modes.steady_lines, drawn)[1]
        planning = timed(plan, drawn, SolveOptions())[1]
        one = timed(added, ACCURACY.counts[0], steps - 1)[1]  # the plate is known from the plan
        answered = timed(compute, drawn, STRETCHED.name)[1]
        mapped = timed(sheet_motion, drawn, tolerance)[1]
        found = plate_modes.stretched(drawn, len(times), float(times[1]), tolerance, None)
        fine, coarse = (added(MOST_MODES[0], n * steps) for n in (4, 2))
        true = fine + (fine - coarse) / 3 + added(MOST_MODES[1], steps)
        true -= added(MOST_MODES[0], steps)
        wrong = float(relative_changes(found.values - true, found.linear + true).max())
        row(name, f"{lines:.1f} s", f"{one:.2f} s",
            *(f"{each / one:.1f}" for each in (planning, answered, mapped)),
            f"{found.error.error:.2%}", f"{wrong:.2%}")  # fmt: skip


if __name__ == "__main__":
    os.environ["SKINWAVE_CACHE"] = ""
    tables = {"stated": stated, "cost": cost, "sheets": sheets}
    parser = argparse.ArgumentParser(description=__doc__, prog="python -m bench.plans")
    parser.add_argument("table", choices=tables)
    parser.add_argument("number", type=int, nargs="?", default=20, help="number of random scenes")
    parser.add_argument("seed", type=int, nargs="?", default=0)
    given = parser.parse_args()
    tables[given.table](*([] if given.table == "sheets" else [given.number, given.seed]))
