"""The suite of verification cases, and running it."""

import json
import math
import time
from collections.abc import Iterable
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from skinwave.effort import Progress, versions
from skinwave.verify import (
    air,
    elements,
    exact,
    extremes,
    nonlinear,
    plates,
    relaxing,
    sides,
    statics,
    stepping,
    waves,
)
from skinwave.verify import manufactured as fields
from skinwave.verify.case import Case, Check, Entry, Result
from skinwave.verify.page import page


def suite() -> tuple[Entry, ...]:
    """Every case, in the order of the page."""
    return (
        *_elements(), *_statics(), *_plates(), *_waves(), *_exact(), *_stepping(), *_extremes(),
        *_nonlinear(),
    )  # fmt: skip


def _elements() -> Iterable[Entry]:
    topic = "Elements"
    yield Entry(name="patch", topic=topic, run=elements.patch)
    yield Entry(name="patch-quadratic", topic=topic, run=elements.quadratic_patch)
    yield Entry(name="slivers", topic=topic, run=elements.slivers)
    yield Entry(name="inverted", topic=topic, run=elements.inverted)
    yield Entry(name="incompressible", topic=topic, run=elements.incompressible)
    topic, free = "Convergence", fields.divergence_free
    run = fields.manufactured
    quick = partial(run, "divergence-free", 0.3, free, (4, 8, 12), (3, 2), 0.1, (1e-3, 2e-2))
    yield Entry(name="divergence-free-0.3", topic=topic, run=quick)
    for name, field, cells, nus, ceilings in (
        ("divergence-free", free, (6, 10, 14), (0.49, 0.4999), ((5e-4, 1e-2),) * 2),
        ("balanced", fields.balanced, (6, 10, 14), (0.4999,), ((5e-4, 1e-2),)),
        # Its pressure is lam times its divergence, and errors are as much larger.
        ("dilating", fields.dilating, (8, 12, 16), (0.3, 0.49, 0.4999),
         ((5e-4, 1e-2), (2e-3, 0.03), (0.2, 3.0))),
    ):  # fmt: skip
        for nu, ceiling in zip(nus, ceilings, strict=True):
            case = partial(run, name, nu, field, cells, (3, 2), 0.1, ceiling)
            yield Entry(name=f"{name}-{nu:g}", topic=topic, run=case, slow=True)
    yield Entry(name="no-locking", topic=topic, run=fields.no_locking, slow=True)


def _statics() -> Iterable[Entry]:
    topic = "At rest"
    yield Entry(name="disc", topic=topic, run=statics.disc_on_half_space, slow=True)
    for nu in (0.49, 0.4999):
        case = partial(statics.focus_at_rest_on_half_space, nu)
        yield Entry(name=f"focus-at-rest-{nu:g}", topic=topic, run=case, slow=True)
    yield Entry(name="poisson-ratios", topic=topic, run=statics.focus_at_rest_on_a_layer)
    yield Entry(name="stiffness-contrast", topic=topic, run=statics.column_of_two_layers)


def _plates() -> Iterable[Entry]:
    topic = "Plates and beams"
    yield Entry(name="clamped-sheet", topic=topic, run=plates.clamped_sheet)
    yield Entry(name="thin-sheets", topic=topic, run=plates.thin_sheets)
    yield Entry(name="in-plane-shear", topic=topic, run=plates.in_plane_shear)
    for name, plate in (("steel", plates.STEEL), ("soft", plates.SOFT)):
        case = partial(plates.navier_convergence, plate)
        yield Entry(name=f"navier-convergence-{name}", topic=topic, run=case)
        case = partial(plates.navier_plate, plate)
        yield Entry(name=f"navier-{name}", topic=topic, run=case, slow=True)
    for ratio in (0.25, 0.5):
        case = partial(plates.force_crossing_a_beam, ratio)
        yield Entry(name=f"moving-force-{ratio:g}", topic=topic, run=case)
    yield Entry(name="circling-on-plate", topic=topic, run=plates.force_circling_on_a_plate)
    yield Entry(name="air-operator", topic=topic, run=air.gaussian_and_lambs_shape)
    yield Entry(name="disc-in-air", topic=topic, run=air.lambs_disc)
    yield Entry(name="focus-in-air", topic=topic, run=air.focus_on_a_sheet_in_air, slow=True)


def _waves() -> Iterable[Entry]:
    topic = "Waves"
    for hz, nu in ((80, 0.4999), (140, 0.4999), (210, 0.4999), (140, 0.49), (210, 0.49)):
        case = partial(waves.steady_focus, hz, nu)
        yield Entry(name=f"steady-focus-{hz}-{nu:g}", topic=topic, run=case, slow=True)
    yield Entry(name="lamb", topic=topic, run=waves.lamb, slow=True)
    yield Entry(name="rayleigh", topic=topic, run=waves.rayleigh_speed)
    yield Entry(name="plate-waves", topic=topic, run=waves.plate_waves)
    yield Entry(name="absorbed-pulse", topic=topic, run=waves.absorbed_pulse)
    yield Entry(name="oblique-sh", topic=topic, run=waves.oblique_shear)
    yield Entry(name="oblique-p-sv", topic=topic, run=waves.oblique_in_plane)
    yield Entry(name="absorbing-layer", topic=topic, run=sides.layer_around_a_slab)


def _exact() -> Iterable[Entry]:
    topic = "Wavenumber integrals"
    yield Entry(name="exact-half-space", topic=topic, run=exact.exact_half_space)
    yield Entry(name="exact-sheet", topic=topic, run=exact.exact_sheet)
    yield Entry(name="exact-slab", topic=topic, run=exact.exact_slab)
    yield Entry(name="exact-circles", topic=topic, run=exact.exact_circles)
    yield Entry(name="circling-on-skin", topic=topic, run=exact.circling_on_skin)
    yield Entry(name="relaxing-half-space", topic=topic, run=relaxing.half_space_that_relaxes)
    run = relaxing.circling_on_skin_that_relaxes
    yield Entry(name="circling-on-relaxing-skin", topic=topic, run=run)
    yield Entry(name="circling-on-paper", topic=topic, run=exact.circling_on_paper, slow=True)


def _stepping() -> Iterable[Entry]:
    topic = "Time, damping, units"
    yield Entry(name="order-in-time", topic=topic, run=stepping.order_in_time)
    yield Entry(name="numerical-damping", topic=topic, run=stepping.numerical_damping)
    yield Entry(name="energy", topic=topic, run=stepping.energy_kept)
    yield Entry(name="extreme-steps", topic=topic, run=stepping.extreme_steps)
    yield Entry(name="kelvin-voigt", topic=topic, run=stepping.columns)
    yield Entry(name="relaxing-column", topic=topic, run=relaxing.column_that_relaxes)
    yield Entry(name="relaxing-spring", topic=topic, run=relaxing.oscillator_that_relaxes)
    yield Entry(name="units", topic=topic, run=stepping.units)


def _extremes() -> Iterable[Entry]:
    topic = "The load at its extremes"
    yield Entry(name="focus-speeds", topic=topic, run=extremes.focus_speeds)
    yield Entry(name="modulation-frequencies", topic=topic, run=extremes.modulation_frequencies)
    yield Entry(name="narrow-focus", topic=topic, run=extremes.narrow_focus)
    yield Entry(name="degenerate-paths", topic=topic, run=extremes.degenerate_paths)
    yield Entry(name="durations", topic=topic, run=extremes.durations)
    yield Entry(name="sampling", topic=topic, run=extremes.sampling)


def _nonlinear() -> Iterable[Entry]:
    topic = "Large deflection"
    yield Entry(name="elastica", topic=topic, run=nonlinear.elastica)
    yield Entry(name="clamped-disc", topic=topic, run=nonlinear.clamped_disc)
    yield Entry(name="rigid-rotation", topic=topic, run=nonlinear.rigid_rotation)
    yield Entry(name="tangent", topic=topic, run=nonlinear.tangent)
    yield Entry(name="linear-limit", topic=topic, run=nonlinear.linear_limit)
    yield Entry(name="free-energy", topic=topic, run=nonlinear.free_energy)
    yield Entry(name="too-much", topic=topic, run=nonlinear.too_much)
    yield Entry(name="amplitude", topic=topic, run=nonlinear.amplitude_test)
    yield Entry(name="modes-or-all", topic=topic, run=nonlinear.reduced_against_full, slow=True)


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
        check = Check(what="ran to its end", value=0.0, reference=1.0, error=1.0, bar=0.0)
        return Case(
            title=f"{entry.name} broke off", source="", mesh="", checks=(check,), said=str(error)
        )


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
