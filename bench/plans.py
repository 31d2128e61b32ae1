"""Errors and costs of plans: `python -m bench.plans stated|cost [N] [SEED]` on random scenes, and
`python -m bench.plans sheets` on sheets that stretch.

`stated`: the error of the mesh that the plan of `fem` states, on scenes of `bench.agreement` with
solid bodies without absorbing sides, and the true error, by elements of half the size on the
planned body. A scene fails if its true error is more than 1.1 times the stated one. Scenes that
take minutes are left out.

`cost`: the error of the planned response against fine elements (0.7 of the default size, absorbing
sides twice as far away), and its time over that of the cheapest candidate within the tolerance,
which is not known beforehand, without and with the time of planning.

`sheets`: the time of the lines of the load; the times of the rest of a plan, of the response and of
its map, over that of one run with the fewest modes in the longest steps; and the error of steps and
modes, stated and true. The reference has 170 modes. It extrapolates from steps of a half and a
quarter of the longest with 120 modes.
"""

import os
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import count

import numpy as np

from bench.agreement import TooSlow, limited, table
from fem import Material
from simple_model import MovingPressure, Response, Statement, Tacton, Trajectory
from simple_model.layers.material import from_young
from skinwave.bodies.sizes import default_size
from skinwave.models import plate_modes
from skinwave.models.options import SolveOptions, sample_times
from skinwave.models.plate_modes import ACCURACY, STRETCHED, Run, sheet_motion
from skinwave.models.reduced import answer, reduce_scene
from skinwave.models.relative_change import relative_changes
from skinwave.planning.plan import plan
from skinwave.planning.refinement import about_its_rest
from skinwave.planning.simulate import compute
from skinwave.scene.file import from_table, loads
from skinwave.scene.scene import Body, Scene
from skinwave.typing import Floats

MOST = 1.1  # times the stated error
SLOWEST = 20.0  # s of CPU time of a plan or a reference: slower scenes are left out
REFERENCE = 1e-4  # relative error of the reduction of a reference
FINEST = 0.7  # of the default element size
COARSER = (2.6, 2.0, 1.6, 1.3, 1.0, 0.8)
TOLERANCES = (0.03, 0.05, 0.10, 0.20)
SCENES = 20
MOST_MODES = 120, 170  # of references of sheets, in the shortest and in the longest steps
AM = "am_frequency_hz = 140\nduration_s = 0.5"
CIRCLE = "shape = 'circle'\nsize_mm = 20\nspeed_m_per_s = 12"
SHEETS = {  # Tacton and body
    "paper sheet, AM 140 Hz": (f"{AM}\n{CIRCLE}", "preset = 'paper-sheet'"),
    "AM 71 Hz": ("am_frequency_hz = 71\nduration_s = 0.5", "preset = 'paper-sheet'"),
    "twice the pressure": (
        f"{AM}\n{CIRCLE}\n[focus]\npeak_pressure_pa = 100",
        "preset = 'paper-sheet'",
    ),
    "loose sheet": (f"{AM}\n{CIRCLE}", "preset = 'paper-sheet-loose'"),
    "A5 with tension, 0.3 s": (
        f"am_frequency_hz = 140\nduration_s = 0.3\n{CIRCLE}",
        "preset = 'a5-sheet'\n[body.mounting]\ntension_x_n_per_m = 49\ntension_y_n_per_m = 15",
    ),
    "two foci with a rhythm, 0.4 s": (
        f"duration_s = 0.4\n{CIRCLE}\nfoci = [0.0, 0.5]\n[tacton.rhythm]\n"
        "pulses_ms = [[100, 50], [40, 110]]",
        "preset = 'paper-sheet'",
    ),
}  # fmt: skip


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
    stated, true = (about_its_rest(scene, each) for each in (planned.values, better))
    own = [part for part in chosen.statement.parts if part.name in ("mesh", "reduction")]
    error = Statement(parts=tuple(own)).error
    return error, float(relative_changes(true - stated, true).max())


def check_stated_errors(number: int, seed: int) -> int:
    """Print a table of scenes with solid bodies, and return how many fail."""
    done = failed = 0
    ratios: list[float] = []
    print("scene, kind, layers, base and sides | tolerance | stated | true | true over stated")
    for k in count():
        if done == number:
            break
        tolerance = TOLERANCES[k % 3]
        try:
            scene = from_table(table(k, seed))
            body = scene.body
            if body.kind == "sheet" or np.isinf(body.depth) or body.sides == "absorbing":
                raise ValueError("no elements, or too many")
            error, true = stated_and_true(scene, tolerance)
        except (ValueError, TooSlow):  # refused, or too large
            continue
        ratios.append(error / true)
        done += 1
        failed += true > MOST * error
        row = (100 * tolerance, 100 * error, 100 * true, true / error)
        print(k, body.kind, len(body.layers), body.base, body.sides,
              "| {:g} % | {:.2f} % | {:.2f} % | {:.2f}".format(*row), flush=True)  # fmt: skip
    low, middle, high = np.quantile(ratios, [0.1, 0.5, 0.9])
    print(f"{failed} of {number} fail; stated over true error {middle:.2f} in the median, "
          f"{low:.2f} to {high:.2f} in eight of ten")  # fmt: skip
    return failed


def scene(seed: int) -> tuple[Scene, float]:
    """Return a random scene and a tolerance."""
    pick = np.random.default_rng(seed)
    shape = pick.choice(["point", "line", "circle", "square"])
    size = float(pick.uniform(6e-3, 20e-3))
    path = Trajectory(shape=str(shape), size=size, speed=float(pick.uniform(4, 14)))
    am = float(pick.choice([0.0, pick.uniform(60, 240)]))
    tacton = Tacton(am_frequency=am if shape != "point" else max(am, 80.0), duration=0.3,
                    trajectory=path)  # fmt: skip
    if pick.random() < 0.4:
        side = float(pick.uniform(0.06, 0.12))
        paper = from_young(density=800, young=float(pick.uniform(2e9, 6e9)), poisson=0.3,
                           loss_factor=float(pick.uniform(0.02, 0.08)))  # fmt: skip
        body = Body(
            kind="sheet", material=paper, width=side, height=side, depth=1e-4,
            base="free", sides="clamped",
        )  # fmt: skip
    else:
        skin = Material(
            density=1000, shear_modulus=float(pick.uniform(8e3, 50e3)), poisson=0.499,
            viscosity=float(pick.uniform(3, 10)),
        )  # fmt: skip
        body = Body(
            kind="slab", material=skin, width=0.05, height=0.05,
            depth=float(pick.uniform(8e-3, 15e-3)),
            sides=str(pick.choice(["absorbing", "clamped", "free"])),
        )  # fmt: skip
    probes = tuple((float(x), 0.0) for x in (0.0, 0.005, 0.010))
    pressure = MovingPressure(tacton=tacton)
    drawn = Scene(name=f"random {seed}", pressure=pressure, body=body, probes=probes)
    return drawn, float(pick.choice(TOLERANCES))


def error(candidate: Response, reference: Response) -> float:
    """Return the relative waveform error at the worst probe; a point kernel is scaled to fit."""
    u, v = candidate.displacement, reference.displacement
    if not candidate.record.of_body:
        u = u * (u * v).sum() / (u * u).sum()
    return float((np.linalg.norm(u - v, axis=0) / np.linalg.norm(v, axis=0)).max())


def planned_response(scene: Scene, tolerance: float) -> tuple[str, Response, float, float]:
    """Return the planned model, its response, and the seconds of the response and of planning.

    The time of a reduction during planning counts for the response.
    """
    started = time.perf_counter()
    chosen = plan(scene, SolveOptions(tolerance=tolerance))
    planning, started = time.perf_counter() - started, time.perf_counter()
    if chosen.prepared:
        response, prepared = answer(chosen.prepared, scene), chosen.seconds
    else:
        planned = replace(scene, body=chosen.body)
        response, prepared = compute(planned, chosen.model, h=chosen.h), 0.0
    seconds = time.perf_counter() - started + prepared
    return chosen.model, response, seconds, planning - prepared


def assess(seed: int) -> tuple[bool, bool, bool]:
    """Print a row; return whether the planned response is within the tolerance, and whether its
    time is at most five times that of the cheapest, without and with planning.
    """
    drawn, tolerance = scene(seed)
    body, h = drawn.body, default_size(drawn.body)
    far = drawn
    if body.sides == "absorbing":
        far = replace(drawn, body=replace(body, width=2 * body.width, height=2 * body.height))
    reference = compute(far, "fem", h=FINEST * h)
    model, planned, seconds, planning = planned_response(drawn, tolerance)
    planned_error = error(planned, reference)
    good = []
    candidates = [("point-kernel", {}), *(("fem", {"h": h * ratio}) for ratio in COARSER)]
    if body.of_kind.is_layer:
        candidates[1:1] = [("flat-body-harmonic", {}), ("flat-body", {})]
    for other, model_options in candidates:
        started = time.perf_counter()
        response, cost = compute(drawn, other, **model_options), time.perf_counter() - started
        if error(response, reference) <= tolerance:
            good.append((cost, other, model_options))
            break  # by rising cost: the first within the tolerance is the cheapest
    cost, best, model_options = min(good, default=(np.inf, "none", {}))
    name = best + "".join(f" {1e3 * v:.1f} mm" for v in model_options.values())
    shape, am = drawn.tacton.trajectory.shape, drawn.tacton.am_frequency
    print(
        f"{seed:>3} {body.kind:<6}{body.sides:<10} {shape:<7}{am:5.0f} Hz"
        f" {100 * tolerance:5.0f} % {100 * planned_error:7.2f} %  {model:<18}{seconds:6.1f} s"
        f"{planning:6.1f} s  {name:<18}{cost:6.1f} s {seconds / cost:6.1f}"
        f" {(seconds + planning) / cost:6.1f}",
        flush=True,
    )
    return planned_error <= tolerance, seconds <= 5 * cost, seconds + planning <= 5 * cost


def cost(number: int, first: int) -> None:
    """Print a table of random scenes."""
    print("    body             path       f_AM  limit   error   chosen                   planning"
          "  cheapest in tolerance    ratio   with")  # fmt: skip
    counts = np.array([assess(first + k) for k in range(number)]).sum(axis=0)
    print(f"{counts[0]} of {number} within the tolerance; {counts[1]} at no more than five times "
          f"the cheapest, {counts[2]} with planning")  # fmt: skip


def seconds_of(call: Callable[..., object], *arguments: object) -> float:
    """Return the time of a call in seconds."""
    started = time.perf_counter()
    call(*arguments)
    return time.perf_counter() - started


def _added(drawn: Scene, count: int, steps: int) -> Floats:
    """Return what stretching adds to a response (t, p), with modes and steps as in `Run`."""
    run = Run(count=count, steps=steps)
    return plate_modes.stretching_in_run(drawn, sample_times(drawn), run)


def assess_sheets() -> None:
    """Print a table of sheets that stretch."""
    print(f"{'scene':<31}  lines  one run   plan  response  map   stated    true")
    for name, (tacton, body) in SHEETS.items():
        drawn = loads(f"[tacton]\n{tacton}\n[body]\n{body}")
        times = sample_times(drawn)
        steps = len(times) - 1
        added = partial(_added, drawn)
        lines = seconds_of(plate_modes.steady_lines, drawn)
        planning = seconds_of(plan, drawn, SolveOptions())
        one = seconds_of(added, ACCURACY.counts[0], steps - 1)  # the plate is known from the plan
        answered = seconds_of(compute, drawn, STRETCHED.name)
        mapped = seconds_of(sheet_motion, drawn, SolveOptions().tolerance)
        found = plate_modes.solve_stretching(
            drawn, len(times), float(times[1]), SolveOptions().tolerance, None
        )
        fine, coarse = (added(MOST_MODES[0], n * steps) for n in (4, 2))
        true = fine + (fine - coarse) / 3 + added(MOST_MODES[1], steps)
        true -= added(MOST_MODES[0], steps)
        wrong = float(relative_changes(found.values - true, found.linear + true).max())
        print(
            f"{name:<31}{lines:5.1f} s{one:7.2f} s{planning / one:7.1f}{answered / one:9.1f}"
            f"{mapped / one:6.1f}{100 * found.error.error:7.2f} %{100 * wrong:6.2f} %",
            flush=True,
        )


if __name__ == "__main__":
    os.environ["SKINWAVE_CACHE"] = ""
    if sys.argv[1] == "sheets":
        assess_sheets()
        sys.exit()
    table_name, *numbers = sys.argv[1:]
    number, seed = (*map(int, numbers), *(SCENES, 0)[len(numbers) :])
    {"stated": check_stated_errors, "cost": cost}[table_name](number, seed)
