"""The suite of verification cases, and running it."""

import json
import math
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from skinwave.system.effort import Progress, versions
from skinwave.verify import (
    air,
    elements,
    exact,
    extremes,
    fingertip,
    nonlinear,
    plates,
    relaxing,
    sides,
    statics,
    stepping,
    waves,
)
from skinwave.verify import manufactured as fields
from skinwave.verify.case import Case, Entry, Result, yes
from skinwave.verify.page import page

# Poisson's ratio, cells along half a side, and fields with the largest errors in L2 and H1. The
# pressure of the dilating one is lam times its divergence, and errors are as much larger.
FREE, DILATING = fields.divergence_free, fields.dilating
FIELDS = {
    "divergence-free-0.3": (0.3, (2, 4, 7), {"divergence-free": (FREE, (1e-3, 2e-2))}),
    "dilating-0.3": (0.3, (3, 5, 8), {"dilating": (DILATING, (5e-4, 1e-2))}),
    "fields-0.49": (
        0.49, (3, 5, 9),
        {"divergence-free": (FREE, (5e-4, 1e-2)), "dilating": (DILATING, (2e-3, 0.03))},
    ),
    "fields-0.4999": (
        0.4999, (3, 5, 9),
        {
            "divergence-free": (FREE, (5e-4, 1e-2)),
            "balanced": (fields.balanced, (5e-4, 1e-2)),
            "dilating": (DILATING, (0.2, 3.0)),
        },
    ),
}  # fmt: skip
STEADY = ((80, 0.4999), (140, 0.4999), (210, 0.49))  # Hz, nu
TOPICS: Mapping[str, Mapping[str, Callable[[], Case]]] = {
    "Elements": {
        "patch": elements.patch,
        "patch-quadratic": elements.quadratic_patch,
        "slivers": elements.slivers,
        "inverted": elements.inverted,
        "incompressible": elements.incompressible,
    },
    "Convergence": {
        **{name: partial(fields.manufactured, *given) for name, given in FIELDS.items()},
        "no-locking": fields.no_locking,
    },
    "At rest": {
        "disc": statics.disc_on_half_space,
        "focus-at-rest-0.4999": partial(statics.focus_at_rest_on_half_space, 0.4999),
        "poisson-ratios": statics.focus_at_rest_on_a_layer,
        "stiffness-contrast": statics.column_of_two_layers,
        "fingertip-with-bone": fingertip.beside_another_code,
    },
    "Plates and beams": {
        "clamped-sheet": plates.clamped_sheet,
        "thin-sheets": plates.thin_sheets,
        "in-plane-shear": plates.in_plane_shear,
        "navier-convergence-steel": partial(plates.navier_convergence, plates.STEEL),
        "navier-steel": partial(plates.navier_plate, plates.STEEL),
        "navier-convergence-soft": partial(plates.navier_convergence, plates.SOFT),
        "navier-soft": partial(plates.navier_plate, plates.SOFT),
        "moving-force-0.25": partial(plates.force_crossing_a_beam, 0.25),
        "moving-force-0.5": partial(plates.force_crossing_a_beam, 0.5),
        "circling-on-plate": plates.force_circling_on_a_plate,
        "air-operator": air.gaussian_and_lambs_shape,
        "disc-in-air": air.lambs_disc,
        "focus-in-air": air.focus_on_a_sheet_in_air,
    },
    "Waves": {
        **{f"steady-focus-{hz}-{nu:g}": partial(waves.steady_focus, hz, nu) for hz, nu in STEADY},
        "lamb": waves.lamb,
        "rayleigh": waves.rayleigh_speed,
        "plate-waves": waves.plate_waves,
        "absorbed-pulse": waves.absorbed_pulse,
        "oblique-sh": waves.oblique_shear,
        "oblique-p-sv": waves.oblique_in_plane,
        "absorbing-layer": sides.layer_around_a_slab,
    },
    "Wavenumber integrals": {
        "exact-half-space": exact.exact_half_space,
        "exact-sheet": exact.exact_sheet,
        "exact-slab": exact.exact_slab,
        "exact-circles": exact.exact_circles,
        "circling-on-skin": exact.circling_on_skin,
        "relaxing-half-space": relaxing.half_space_that_relaxes,
        "circling-on-relaxing-skin": relaxing.circling_on_skin_that_relaxes,
        "circling-on-paper": exact.circling_on_paper,
    },
    "Time, damping, units": {
        "order-in-time": stepping.order_in_time,
        "numerical-damping": stepping.numerical_damping,
        "energy": stepping.energy_kept,
        "extreme-steps": stepping.extreme_steps,
        "kelvin-voigt": stepping.columns,
        "relaxing-column": relaxing.column_that_relaxes,
        "relaxing-spring": relaxing.oscillator_that_relaxes,
        "units": stepping.units,
    },
    "The load at its extremes": {
        "focus-speeds": extremes.focus_speeds,
        "modulation-frequencies": extremes.modulation_frequencies,
        "narrow-focus": extremes.narrow_focus,
        "degenerate-paths": extremes.degenerate_paths,
        "durations": extremes.durations,
        "sampling": extremes.sampling,
    },
    "Large deflection": {
        "elastica": nonlinear.elastica,
        "clamped-disc": nonlinear.clamped_disc,
        "rigid-rotation": nonlinear.rigid_rotation,
        "tangent": nonlinear.tangent,
        "linear-limit": nonlinear.linear_limit,
        "free-energy": nonlinear.free_energy,
        "too-much": nonlinear.too_much,
        "amplitude": nonlinear.amplitude_test,
        "modes-or-all": nonlinear.reduced_against_full,
    },
}
SLOW = (
    "disc", "focus-at-rest-0.4999", "focus-in-air", "lamb",
    *(f"steady-focus-{hz}-{nu:g}" for hz, nu in STEADY), "circling-on-relaxing-skin",
)  # fmt: skip


QUICK = ("patch", "in-plane-shear", "moving-force-0.5", "thin-sheets")  # a second or two in all


def quick_cases(progress: Progress) -> list[dict[str, Any]]:
    """Run a few quick cases: title, source, verdict and worst check of each, as a report keeps."""
    progress("verify", 0.0)
    cases = [entry.run() for entry in suite() if entry.name in QUICK]
    return [
        {"title": case.title, "source": case.source, "passed": case.passed, **asdict(case.worst)}
        for case in cases
    ]


def suite() -> tuple[Entry, ...]:
    """Every case, in the order of the page."""
    return tuple(
        Entry(name=name, topic=topic, run=run, slow=name in SLOW)
        for topic, cases in TOPICS.items()
        for name, run in cases.items()
    )


def run_suite(
    entries: Iterable[Entry],
    folder: Path,
    progress: Progress,
    *,
    left_out: int = 0,
    debug: bool = False,
) -> list[Result]:
    """Run cases, leaving verify.json after each and index.html at the end.

    An interrupt ends the running early; what is finished is still written. `left_out` says how
    many cases were not asked for.
    """
    entries, results = list(entries), []
    try:
        for k, entry in enumerate(entries):
            progress(f"verify {entry.name}", k / len(entries))
            started = time.perf_counter()
            case = entry.run() if debug else _guarded(entry)
            seconds = time.perf_counter() - started
            results.append(Result(entry=entry, case=case, seconds=seconds))
            _write_json(folder / "verify.json", results, len(entries))
    except KeyboardInterrupt:
        if not results:
            raise
    progress("draw", 1.0)
    (folder / "index.html").write_text(page(results, entries, left_out), encoding="utf-8")
    return results


def _guarded(entry: Entry) -> Case:
    """The case; one that raises an error is one that failed."""
    try:
        return entry.run()
    except (ValueError, ArithmeticError, MemoryError) as error:
        title, checks = f"{entry.name} broke off", (yes("ran to its end", False),)
        return Case(title=title, source="", mesh="", checks=checks, said=str(error))


def _write_json(path: Path, results: list[Result], planned: int) -> None:
    passed = sum(r.case.passed for r in results)
    record = {
        "passed": passed,
        "failed": len(results) - passed,
        "planned": planned,
        "seconds": round(sum(r.seconds for r in results), 1),
        "versions": versions(),
        "cases": [_record(r) for r in results],
    }
    path.write_text(json.dumps(record, indent=1), encoding="utf-8")


def _record(result: Result) -> dict[str, Any]:
    case = result.case
    fields = {name: getattr(case, name) for name in ("title", "source", "mesh", "note", "said")}
    checks = [
        {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in row.items()}
        for row in ({**asdict(c), "passed": c.passed} for c in case.checks)
    ]
    spent = round(result.seconds, 2)
    name = {"name": result.entry.name, "passed": case.passed, "seconds": spent}
    return {**name, **fields, "checks": checks}
