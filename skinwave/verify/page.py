"""The page and the table that show finished cases."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from skinwave.report.figures import png
from skinwave.report.palette import SPARE
from skinwave.system import document
from skinwave.system.document import Markup
from skinwave.system.effort import versions
from skinwave.verify.case import Check, Entry, Plot, Result

HEADER = ("value", "reference", "error", "tolerance")
COLOURS = ("#0072B2", "#D55E00", *SPARE, "#000000")
SCOPE = (
    "Verification asks whether the equations are solved right. Most references are closed forms, "
    "series or integrals from the literature, computed without this program's solvers. Other cases "
    "compare two of its models (finite elements with wavenumber integrals, an absorbing layer with "
    "a wider slab, a sheet in modes with all of its dofs, a nonlinear with a linear sheet), or one "
    "model with its own limits or in other units; the cases on flat-body check the wavenumber "
    "integrals. Whether these are the right equations for a hand is another question, which only "
    "measurements on hands can decide. Errors are relative unless they are called absolute. A case "
    "passes if each of its errors is within its tolerance; the summary shows the one nearest to "
    "its tolerance."
)


def page(results: list[Result], planned: Sequence[Entry], left_out: int) -> str:
    """index.html: a summary of all cases, then each with its source, mesh, checks and plot."""
    failed = sum(not r.case.passed for r in results)
    state = f"{len(results) - failed} passed, {failed} failed"
    if len(results) < len(planned):
        state = f"Interrupted: {len(results)} of {len(planned)} cases are finished. {state}"
    if left_out:
        state += f"; {left_out} slower cases are left out (skinwave verify without --quick)"
    named = ", ".join(f"{name} {version}" for name, version in versions().items())
    spent = sum(r.seconds for r in results)
    topics = dict.fromkeys(r.entry.topic for r in results)
    return document.page(
        "Verification",
        document.paragraph(f"{state}. {spent:.0f} s with {named}."),
        document.paragraph(SCOPE),
        _summary(results),
        *(
            document.section(topic, *(_shown(r) for r in results if r.entry.topic == topic))
            for topic in topics
        ),
    )


def summary_table(results: list[Result]) -> str:
    """A line per case, and how many passed."""
    width = max(len(r.case.title) for r in results)
    rows = [f"{'case':<{width}}  {'value':>10}  {'reference':>10}  {'error':>8}  {'tolerance':>9}"]
    for r in results:
        c = r.case.worst
        numbers = f"{c.value:>10.4g}  {c.reference:>10.4g}  {c.error:>8.1e}  {c.bar:>9.1e}"
        rows.append(f"{r.case.title:<{width}}  {numbers}  {_word(r.case.passed)}")
    failed = sum(not r.case.passed for r in results)
    return "\n".join([*rows, f"{len(results) - failed} passed, {failed} failed"])


def _summary(results: list[Result]) -> str:
    link = Markup('<a href="#{}">{}</a><br><small>{}</small>').format
    rows = [
        [link(r.entry.name, r.case.title, _quantity(r.case.worst)), *_numbers(r.case.worst),
         _passed(r.case.passed), f"{r.seconds:.1f}"]
        for r in results
    ]  # fmt: skip
    return document.table(["case, and its check nearest to the tolerance", *HEADER, "", "s"], rows)


def _shown(result: Result) -> str:
    """One case on the page."""
    case, heading = result.case, Markup('<h3 id="{}">{} {}</h3>')
    rows = [[_quantity(c), *_numbers(c), _passed(c.passed)] for c in case.checks]
    parts = [
        heading.format(result.entry.name, case.title, _passed(case.passed)),
        Markup("<p><small>Source: {}.<br>Mesh: {}.</small></p>").format(case.source, case.mesh),
        document.table(["quantity", *HEADER, ""], rows),
    ]
    if case.said:
        parts.append(Markup("<p>It says: <code>{}</code></p>").format(case.said))
    if case.note:
        parts.append(document.paragraph(case.note))
    if case.plot:
        parts.append(document.picture(png(_figure(case.plot), 90), case.title))
    return Markup("\n").join(parts)


def _figure(plot: Plot) -> Figure:
    figure = Figure(figsize=(8.6, 3.4), layout="constrained")
    ax = figure.subplots()
    measured = [name for name in plot.lines if name not in plot.drawn]
    joined = "-" if plot.log or not plot.drawn else ""
    for k, name in enumerate(measured):
        style: dict[str, Any] = {"marker": "os^vD"[k % 5], "color": COLOURS[k % len(COLOURS)]}
        ax.plot(*plot.lines[name], ms=4, lw=1, ls=joined, label=name, **style)
    for k, name in enumerate(plot.drawn):
        style = {"color": ("0.2", "0.6")[k % 2], "ls": "--" if plot.log else "-"}
        ax.plot(*plot.lines[name], lw=1, label=name, zorder=1, **style)
    if plot.log:
        ax.set_xscale("log")
        ax.set_yscale("log")
        _tick_at(ax, plot, measured)
    ax.set(xlabel=plot.x, ylabel=plot.y)
    ax.grid(alpha=0.25)
    figure.legend(fontsize=8, frameon=False, loc="outside right upper")
    return figure


def _tick_at(ax: Axes, plot: Plot, names: list[str]) -> None:
    """Few measured places are the ticks themselves."""
    places = np.unique(np.concatenate([np.asarray(plot.lines[name][0]) for name in names]))
    if len(places) <= 7:
        ax.set_xticks(places, [f"{place:.3g}" for place in places])
        ax.xaxis.set_minor_locator(NullLocator())


def _quantity(check: Check) -> str:
    return f"{check.what}, {check.unit}" if check.unit else check.what


def _numbers(check: Check) -> list[str]:
    """Value, reference, error and tolerance; a yes-or-no check has no tolerance."""
    if check.bar == 0 and check.reference == 1:
        return ["yes" if check.passed else "no", "yes", "", ""]
    error = f"{check.error:.2g}" if math.isfinite(check.error) else "not a number"
    return [f"{check.value:.5g}", f"{check.reference:.5g}", error, f"{check.bar:.2g}"]


def _word(passed: bool) -> str:
    return "passed" if passed else "FAILED"


def _passed(passed: bool) -> str:
    return Markup('<span class="{}">{}</span>').format("yes" if passed else "no", _word(passed))
