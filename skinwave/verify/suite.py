"""The suite of verification cases, running it, and its page."""

import json
import math
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from markupsafe import Markup

from skinwave.system.document import Details, Report
from skinwave.system.effort import Progress, versions
from skinwave.system.table import Table
from skinwave.verify import elements, exact, extremes, nonlinear, plates, statics, stepping, waves
from skinwave.verify.case import Case, Check, Result

MODULES = {
    "Elements": elements, "At rest": statics, "Plates and beams": plates, "Waves": waves,
    "Wavenumber integrals": exact, "Time, damping, units": stepping,
    "The load at its extremes": extremes, "Large deflection": nonlinear,
}  # fmt: skip
TOPICS = {
    topic: [found for found in vars(module).values() if isinstance(found, Case)]
    for topic, module in MODULES.items()
}
CASES = {found.name: found for cases in TOPICS.values() for found in cases}
SCOPE = (
    "Verification asks whether the equations are solved right. Most references are closed forms, "
    "series or integrals from the literature, computed without this program's solvers. Other cases "
    "compare two of its models, or one model with its own limits or in other units. Whether these "
    "are the right equations for a hand is another question: see skinwave verify --published. "
    "Errors are relative unless they are called absolute. A case passes if each of its errors is "
    "within its tolerance; the table shows the check nearest to its tolerance."
)
VALUES = ("value", "reference", "error", "tolerance", "")


def run_suite(
    cases: Iterable[Case], folder: Path, progress: Progress, *, debug: bool = False
) -> list[Result]:
    """Run cases, write verify.json after each and index.html at the end.

    An interrupt ends the run early; what is finished is written.
    """
    cases, results = list(cases), list[Result]()
    try:
        for k, each in enumerate(cases):
            progress(f"verify {each.name}", k / len(cases))
            results.append(each.run(debug))
            _write_json(folder / "verify.json", results, len(cases))
    except KeyboardInterrupt:
        if not results:
            raise
    page(results, len(cases)).write(folder)
    return results


def page(results: list[Result], planned: int) -> Report:
    """A summary of all cases, then each with its source, mesh and checks."""
    left_out = len(CASES) - planned
    verdict = [f"{plural(results)}."]
    if len(results) < planned:
        verdict.insert(0, f"Interrupted: {len(results)} of {planned} cases are finished.")
    if left_out > 0:
        verdict.append(f"{left_out} slower cases are left out (skinwave verify without --quick).")
    used = ", ".join(f"{name} {version}" for name, version in versions().items())
    spent = f"{sum(r.seconds for r in results):.0f} s with {used}."
    summary = Table(
        ["case", "check nearest to the tolerance", *VALUES, "s"],
        [[r.case.title, *_row(r.worst), r.seconds] for r in results],
    )
    topics = [
        Details(topic, [_shown(r) for r in results if r.case in cases])
        for topic, cases in TOPICS.items()
        if any(r.case in cases for r in results)
    ]
    return Report("Verification", [" ".join(verdict)], [summary, *topics, SCOPE, spent])


def summary(results: list[Result]) -> str:
    """A line per case, and how many passed."""
    width = max((len(r.case.name) for r in results), default=0)
    rows = [f"{'case':<{width}}  {'error':>8}  {'tolerance':>9}"]
    rows += [
        f"{r.case.name:<{width}}  {r.worst.error:>8.1e}  {r.worst.bar:>9.1e}  "
        f"{'passed' if r.passed else 'FAILED'}" + f"  {r.error}" * bool(r.error)
        for r in results
    ]
    return "\n".join([*rows, plural(results)])


def plural(results: list[Result]) -> str:
    """How many cases passed and failed."""
    failed = sum(not r.passed for r in results)
    return f"{len(results) - failed} passed, {failed} failed"


def _shown(result: Result) -> Details:
    """One case on the page, which unfolds."""
    found = result.case
    words = [found.note, f"It ended early: {result.error}" if result.error else ""]
    table = Table(["quantity", *VALUES], map(_row, result.checks))
    source = f"Source: {found.source}. Mesh: {found.mesh}."
    return Details(found.title, [source, table, *filter(None, words)])


def _row(check: Check) -> list[Any]:
    """Cells of a check."""
    what = f"{check.what}, {check.unit}" if check.unit else check.what
    word = "passed" if check.passed else "FAILED"
    verdict = Markup('<span class="{}">{}</span>').format("yes" if check.passed else "no", word)
    return [what, f"{check.value:.5g}", f"{check.reference:.5g}", f"{check.error:.2g}",
            f"{check.bar:.2g}", verdict]  # fmt: skip


def _write_json(path: Path, results: list[Result], planned: int) -> None:
    passed = sum(r.passed for r in results)
    record = {
        "passed": passed, "failed": len(results) - passed, "planned": planned,
        "seconds": round(sum(r.seconds for r in results), 1), "versions": versions(),
        "cases": [_record(r) for r in results],
    }  # fmt: skip
    path.write_text(json.dumps(record, indent=1), encoding="utf-8")


def _record(result: Result) -> dict[str, Any]:
    """A finished case as JSON; null where a number is not finite."""
    checks = [
        {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in row.items()}
        for row in ({**asdict(c), "passed": c.passed} for c in result.checks)
    ]
    about = ("name", "title", "source", "mesh", "note")
    return {name: getattr(result.case, name) for name in about} | {
        "passed": result.passed, "seconds": round(result.seconds, 2), "error": result.error,
        "checks": checks,
    }  # fmt: skip
