"""Errors and costs of plans: `stated` and `cost` on random scenes, `sheets` on those that stretch.

bench/README.md explains each table.
"""

import argparse
import contextlib
import os
from collections.abc import Iterator
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
FINEST = 0.7  # of the default element size
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


def random_layer(seed: int) -> tuple[Scene, float]:
    """Return a random scene with a slab or a sheet that hardly stretches, and a tolerance."""
    pick = np.random.default_rng(seed)
    shape = str(pick.choice(["point", "line", "circle", "square"]))
    size, speed = pick.uniform(6, 20), pick.uniform(4, 14)
    am = pick.choice([0.0, pick.uniform(60, 240)])
    body: dict[str, Any]
    if pick.random() < 0.4:
        side, young, loss = (pick.uniform(*ends) for ends in ((60, 120), (2e9, 6e9), (0.02, 0.08)))
        body = {"kind": "sheet", "size_x_mm": side, "size_y_mm": side, "thickness_mm": 0.1}
        material = {"density_kg_m3": 800, "young_modulus_pa": young, "poisson": 0.3,
                    "loss_factor": loss}  # fmt: skip
    else:
        shear, viscosity, depth = (pick.uniform(*ends) for ends in ((8e3, 50e3), (3, 10), (8, 15)))
        body = {"kind": "slab", "size_x_mm": 50, "size_y_mm": 50, "thickness_mm": depth,
                "sides": str(pick.choice(["absorbing", "clamped", "free"]))}  # fmt: skip
        material = {"density_kg_m3": 1000, "shear_modulus_pa": shear, "poisson": 0.499,
                    "viscosity_pa_s": viscosity}  # fmt: skip
    tacton = {"shape": shape, "size_mm": size, "speed_m_per_s": speed, "duration_s": 0.3,
              "am_frequency_hz": am if shape != "point" else max(am, 80.0)}  # fmt: skip
    probes, focus = {"points_mm": [[0, 0], [5, 0], [10, 0]]}, {"peak_pressure_pa": 0.01}
    keys = {"name": f"random {seed}", "tacton": tacton, "body": body | {"material": material}}
    return from_table(keys | {"focus": focus, "probes": probes}), float(pick.choice(TOLERANCES))


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

    def pairs() -> Iterator[tuple[float, float]]:
        for k in count():
            with contextlib.suppress(ValueError, TooSlow):  # refused, or too large
                scene, tolerance = from_table(random_scene(k, seed)), TOLERANCES[k % 3]
                body = scene.body
                if body.kind == "sheet" or np.isinf(body.depth) or body.sides == "absorbing":
                    continue
                found, true = stated_and_true(scene, tolerance)
                errors = (f"{each:.2%}" for each in (tolerance, found, true))
                sides = f"{body.base}, {body.sides}"
                row(k, body.kind, len(body.layers), sides, *errors, f"{true / found:.2f}")
                yield found, true

    row = table("scene", "kind", "layers", "base, sides", "limit", "stated", "true", "ratio")
    found, true = np.transpose([*islice(pairs(), number)])
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


def cost(number: int, first: int) -> None:
    """Print the error and the time of planned responses, and of the cheapest candidate."""
    row = table("body", "path", "f_AM, Hz", "limit", "error", "chosen", "s", "planning, s",
                "cheapest in tolerance", "s", "ratio", "with")  # fmt: skip
    counts = np.zeros(3, int)
    for seed in range(first, first + number):
        scene, tolerance = random_layer(seed)
        body, tacton = scene.body, scene.tacton
        scale = 2 if body.sides == "absorbing" else 1
        far = replace(body, width=scale * body.width, height=scale * body.height)
        fine = replace(scene, body=far)
        reference = compute(fine, "fem", h=FINEST * default_size(body)).values
        chosen, planning = timed(plan, scene, SolveOptions(tolerance=tolerance))
        response, seconds = timed(solve_as_planned, scene, chosen)
        if chosen.prepared:  # the time of a reduction during planning counts for the response
            seconds, planning = seconds + chosen.seconds, planning - chosen.seconds
        wrong = error(response.values, reference)
        name, least = cheapest(scene, tolerance, reference)
        ratios = seconds / least, (seconds + planning) / least
        row(f"{body.kind}, {body.sides}", tacton.trajectory.shape, f"{tacton.am_frequency:.0f}",
            f"{tolerance:.0%}", f"{wrong:.2%}", chosen.model, f"{seconds:.1f}", f"{planning:.1f}",
            name, f"{least:.1f}", *(f"{each:.1f}" for each in ratios))  # fmt: skip
        counts += [wrong <= tolerance, *(each <= 5 for each in ratios)]
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
