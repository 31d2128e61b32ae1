"""Page, tables and files of a fit."""

import json
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from simple_model import Effort
from simple_model.numbers import significant
from skinwave.measure.findings import cautions, probability, sentences, shown
from skinwave.measure.fit import Fit, notes
from skinwave.measure.fit_figures import (
    fitted_figure,
    profile_figure,
    residual_figure,
)
from skinwave.report.figures import png
from skinwave.scene.file import dumps
from skinwave.system.document import Part, Picture, Report, Section, preformatted
from skinwave.system.table import Column, Table

WORST = 20  # starts in the table
MOST_LEFT_OUT = 20  # lines in the table
EXPLAINED = (
    "An interval holds the true value in 95 of 100 measurements, if the model is the true one and "
    "what it leaves is noise: by the covariance at the solution, and by the profile of the "
    "likelihood, which need not be symmetric. Where the two differ take the latter."
)
FITTED = {
    "s": "Grey: measured; blue: fitted; red: what is left of it.",
    "Hz": "Lines of the load as measured, and as fitted.",
}
RESIDUALS = (
    "Left: what is left of the data over its standard error; 95 of 100 lie between the dashed "
    "lines if the errors are normal. Right: its autocorrelation, in the shaded band if it is white."
)
PROFILES = (
    "Dots: chi squared over its scale above its least, one parameter fixed and all others fitted. "
    "Dotted: the parabola of the covariance. The interval ends at the dashed line."
)
CORRELATIONS = "Correlations of the estimates: near 1 or -1, one can make up for the other."
STARTS = "Where the search began and ended, the best first: chi squared over that of the best."


def write(folder: Path, found: Fit) -> None:
    """index.html, scene.toml with the estimates, estimates.csv, fit.json, fit.npz and figures."""
    text = fitted_scene(found)
    (folder / "scene.toml").write_text(text, encoding="utf-8")
    (folder / "estimates.csv").write_bytes(estimate_table(found).to_csv())
    told = json.dumps(summary(found), indent=1, allow_nan=False)
    (folder / "fit.json").write_text(told, encoding="utf-8")
    np.savez(folder / "fit.npz", **_arrays(found))
    data = found.solution.problem.data
    parts: list[Part] = [
        _shown_estimates(found), EXPLAINED,
        Picture(png(fitted_figure(found)), FITTED[data.unit], "fitted"),
        Section("Residuals", [
            _whiteness(found), Picture(png(residual_figure(found)), RESIDUALS, "residuals"),
        ]),
    ]  # fmt: skip
    if data.left_out:
        parts.append(Section("Lines that are not fitted", [left_out_table(found)]))
    if found.profiles:
        drawn = Picture(png(profile_figure(found)), PROFILES, "profiles")
        parts.append(Section("Profiles of the likelihood", [drawn]))
    if len(found.estimates) > 1:
        parts.append(Section("Correlations", [CORRELATIONS, _correlations(found)]))
    parts += [
        Section("Starts", [STARTS, _starts(found)]),
        Section("The scene with the estimates", [preformatted(text)]),
    ]
    Report(
        f"{found.target.scene.name}: fitted to {found.measured.name or 'a measurement'}",
        verdict=sentences(found)[:2], parts=parts,
        efforts=[("", Effort(warnings=tuple(cautions(found))))],
    ).write(folder)  # fmt: skip


def fitted_scene(found: Fit) -> str:
    """The scene with the estimates and their spreads, and in comments what it cannot hold."""
    return "".join(["# fitted\n", *(f"# {each}\n" for each in notes(found)), dumps(found.scene)])


def _whiteness(found: Fit) -> str:
    """Sentence on whether the residuals are white."""
    test = found.whiteness
    if not isfinite(test.p):
        return "There are too few data along an axis for a test of whiteness."
    said = "nothing speaks against white residuals."
    if not test.is_white:
        factors = ", ".join(
            f"{each.key} by {significant(factor, 3)}"
            for each, factor in zip(found.estimates, found.widenings, strict=True)
            if each.is_resolved
        )
        said = (
            "they are not white. Intervals are those of a sandwich covariance, with the residuals' "
            "spectrum in place of independent errors (White 1980; of profiles Kent 1982), as far "
            f"as it widens them: {factors}."
        )
    return (
        f"By the test of Ljung and Box over {len(test.correlations)} lags, p "
        f"{probability(test.p)}: {said}"
    )


def left_out_table(found: Fit) -> Table:
    """The lines of the load that are not fitted, the strongest first."""
    left_out = found.solution.problem.data.left_out
    rows: list[tuple[Any, ...]] = [
        (line.name, line.frequency, 100 * line.share if line.share else "no more than noise",
         line.why)
        for line in left_out[:MOST_LEFT_OUT]
    ]  # fmt: skip
    if len(left_out) > MOST_LEFT_OUT:
        rows.append((f"{len(left_out) - MOST_LEFT_OUT} more", None, None, ""))
    return Table(("line", Column("frequency", unit="Hz", digits=4),
                  Column("of the measured power", unit="%", digits=2), "why"), rows)  # fmt: skip


def estimate_table(found: Fit) -> Table:
    """Estimates with their intervals, nan where there is none, as estimates.csv has them."""
    ends = {each.key: (each.low, each.high) for each in found.profiles}
    none = (np.nan, np.nan)
    free = found.solution.problem.parameters.free
    rows = [
        (each.key, each.value, each.low, each.high, *ends.get(each.key, none), each.is_resolved,
         each.at_limit, limits.low, limits.high)
        for each, limits in zip(found.estimates, free, strict=True)
    ]  # fmt: skip
    return Table((
        "parameter", "estimate", "low", "high", "profile_low", "profile_high", "resolved",
        "at_limit", "limit_low", "limit_high",
    ), rows, stored=8)  # fmt: skip


def _shown_estimates(found: Fit) -> Table:
    """The same for the page: each interval as a range, to two digits of its width."""
    rows = []
    for key, value, low, high, *ends, resolved, at_limit, least, most in estimate_table(found).rows:
        digits, *limits = shown(value, low, high) if resolved else (significant(value),)
        rows.append((
            key + ", at a limit" * at_limit, digits,
            " to ".join(limits) if resolved else "not resolved by the data",
            "{1} to {2}".format(*shown(value, *ends)) if isfinite(ends[0]) else None,
            f"{least:g} to {most:g}",
        ))  # fmt: skip
    return Table(("parameter", "estimate", "95 % interval", "by its profile", "limits"), rows)


def summary(found: Fit) -> dict[str, Any]:
    """All that is said of a fit, as JSON has it."""
    solution, data = found.solution, found.solution.problem.data
    keys = solution.problem.parameters.keys
    return {
        "model": found.target.model,
        "kind": data.kind,
        "converged": solution.converged,
        "values": found.values,
        "estimates": json.loads(estimate_table(found).to_json()),
        "unresolved": [list(each.keys) for each in found.unresolved],
        "chi_squared": solution.cost,
        "degrees_of_freedom": solution.dof,
        "misfit": found.misfit,
        "whiteness_p": _finite(found.whiteness.p),
        "widened": dict(zip(keys, found.widenings.tolist(), strict=True)),
        "left_out": [
            {"line": line.name, "frequency_hz": line.frequency, "why": line.why,
             "share": _finite(line.share)}
            for line in data.left_out
        ],
        "may_be_turned": solution.may_be_turned,
        "starts": len(solution.starts),
        "starts_that_reached_it": solution.reached,
        "predictions": solution.runs,
        "factorisations": found.target.reduced and found.target.reduced.effort.factorisations,
        "sentences": sentences(found),
        "warnings": cautions(found),
    }  # fmt: skip


def _finite(value: float) -> float | None:
    return value if isfinite(value) else None


def _correlations(found: Fit) -> Table:
    """Correlations of the estimates that are resolved."""
    keys = found.solution.problem.parameters.keys
    rows = ((key, *row) for key, row in zip(keys, found.correlations.tolist(), strict=True))
    return Table(("", *(Column(key, digits=2) for key in keys)), rows)


def _starts(found: Fit) -> Table:
    """Where the best starts began and ended."""
    solution, free = found.solution, found.solution.problem.parameters.free
    least = max(solution.starts[0].cost, 1e-300)
    rows = [
        (each.cost / least, each.converged,
         *(f"{significant(p.value(float(a)))} to {significant(p.value(float(b)), 4)}"
           for p, a, b in zip(free, each.begun, each.ended, strict=True)))
        for each in solution.starts[:WORST]
    ]  # fmt: skip
    keys = (f"{each.key}, start and end" for each in free)
    return Table((Column("chi squared", digits=5), "converged", *keys), rows)


def _arrays(found: Fit) -> dict[str, Any]:
    data, solution = found.solution.problem.data, found.solution
    arrays = {
        "axis": data.axis, "measured": data.values, "error": data.error,
        "fitted": found.predicted, "residual": solution.residual, "places_m": found.measured.places,
        "correlations": found.correlations, "labels": np.array(data.labels),
        "keys": np.array(solution.problem.parameters.keys),
    }  # fmt: skip
    for each in found.profiles:
        arrays[f"profile {each.key}"] = np.array([each.values, each.excess])
    return arrays
