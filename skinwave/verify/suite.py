"""Suite of verification cases, and its page."""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from markupsafe import Markup

from skinwave.system.document import Details, Report
from skinwave.system.effort import Progress, versions
from skinwave.system.table import Table
from skinwave.verify import elements, exact, extremes, nonlinear, plates, statics, stepping, waves
from skinwave.verify.case import Case, Check, Result

TOPICS = {
    topic: [each for each in vars(module).values() if isinstance(each, Case)]
    for topic, module in {
        "Elements": elements, "At rest": statics, "Plates and beams": plates, "Waves": waves,
        "Wavenumber integrals": exact, "Time, damping, units": stepping,
        "Extreme loads": extremes, "Large deflection": nonlinear,
    }.items()
}  # fmt: skip
CASES = {each.name: each for cases in TOPICS.values() for each in cases}
VALUES = ("value", "reference", "error", "tolerance", "result")


def run_suite(
    cases: Iterable[Case], folder: Path, progress: Progress, *, debug: bool = False
) -> list[Result]:
    """Run cases, and write verify.json after each and index.html at the end.

    An interrupt ends the run early and keeps the finished cases.
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
    """Return a page with a summary, then each case with its source, mesh and checks."""
    omitted = len(CASES) - planned
    verdict = [f"{count_text(results)}."]
    if len(results) < planned:
        verdict.insert(0, f"Interrupted after {len(results)} of {planned} cases.")
    if omitted > 0:
        verdict.append(f"{omitted} slow cases are omitted (run skinwave verify without --quick).")
    used = ", ".join(f"{name} {version}" for name, version in versions().items())
    spent = f"{sum(r.seconds for r in results):.0f} s with {used}."
    summary = Table(
        ["case", "check nearest to the tolerance", *VALUES, "time, s"],
        [[r.case.title, *_row(r.worst), r.seconds] for r in results],
    )
    topics = [
        Details(topic, [_details(r) for r in results if r.case in cases])
        for topic, cases in TOPICS.items()
        if any(r.case in cases for r in results)
    ]
    scope = (
        "Verification checks that the equations are solved correctly. Most references are closed "
        "forms, series or integrals from the literature, computed without this program's solvers. "
        "Other cases compare two of its models, or one model with its own limits or in other "
        "units. skinwave verify --published checks whether they are the right equations for a "
        "hand. Errors are relative unless marked as absolute. A case passes if each error is "
        "within its tolerance. The table shows the check nearest to its tolerance."
    )
    return Report(
        "Verification", [" ".join(verdict)], [summary, *topics, scope, spent],
        failures=failures_of(results),
    )  # fmt: skip


def failures_of(results: Iterable[Result]) -> dict[str, str]:
    """Return what is wrong with each failed case by its name."""
    return {
        r.case.name: r.error or f"{r.worst.what}: error {r.worst.error:.1e} of {r.worst.bar:.1e}"
        for r in results if not r.passed
    }  # fmt: skip


def summary(results: list[Result]) -> str:
    """Return a line per case, and the counts of passed and failed cases."""
    width = max((len(r.case.name) for r in results), default=0)
    rows = [f"{'case':<{width}}  {'error':>8}  {'tolerance':>9}"]
    rows += [
        f"{r.case.name:<{width}}  {r.worst.error:>8.1e}  {r.worst.bar:>9.1e}  "
        f"{'passed' if r.passed else 'FAILED'}" + f"  {r.error}" * bool(r.error)
        for r in results
    ]
    return "\n".join([*rows, count_text(results)])


def count_text(results: list[Result]) -> str:
    """Return the counts of passed and failed cases."""
    failed = sum(not r.passed for r in results)
    return f"{len(results) - failed} passed, {failed} failed"


def _details(result: Result) -> Details:
    each = result.case
    notes = [each.note, f"The case ended with an error: {result.error}" if result.error else ""]
    table = Table(["quantity", *VALUES], map(_row, result.checks))
    source = f"Source: {each.source}. Mesh: {each.mesh}."
    return Details(each.title, [source, table, *filter(None, notes)])


def _row(check: Check) -> list[Any]:
    """Return the cells of a check."""
    what = f"{check.what}, {check.unit}" if check.unit else check.what
    outcome = ("yes", "passed") if check.passed else ("no", "FAILED")
    verdict = Markup('<span class="{}">{}</span>').format(*outcome)
    return [what, f"{check.value:.5g}", f"{check.reference:.5g}", f"{check.error:.2g}",
            f"{check.bar:.2g}", verdict]  # fmt: skip


def _write_json(path: Path, results: list[Result], planned: int) -> None:
    """Write finished cases, with null for numbers that are not finite."""
    names = ("what", "value", "reference", "error", "bar", "unit", "passed")
    cases = [
        {name: getattr(r.case, name) for name in ("name", "title", "source", "mesh", "note")}
        | {"passed": r.passed, "seconds": round(r.seconds, 2), "error": r.error}
        | {"checks": Table(names, ([getattr(c, n) for n in names] for c in r.checks)).records()}
        for r in results
    ]
    passed = sum(r.passed for r in results)
    record = {
        "passed": passed, "failed": len(results) - passed, "planned": planned,
        "seconds": round(sum(r.seconds for r in results), 1), "versions": versions(),
        "cases": cases,
    }  # fmt: skip
    path.write_text(json.dumps(record, indent=1), encoding="utf-8")
