"""Page, tables and files of a fit."""

import json
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from simple_model import Effort
from skinwave.measure.findings import cautions, probability, sentences, shown
from skinwave.measure.fit import Fit
from skinwave.measure.fit_figures import (
    correlation_figure,
    fitted_figure,
    profile_figure,
    residual_figure,
)
from skinwave.measure.fitted import notes
from skinwave.measure.identify import Estimate
from skinwave.measure.measured_lines import LeftOut
from skinwave.measure.starts import Start
from skinwave.report.figures import png
from skinwave.scene.file import dumps
from skinwave.system import document
from skinwave.system.numbers import significant
from skinwave.system.plain_text import csv_table

COLUMNS = (
    "parameter", "estimate", "low", "high", "profile_low", "profile_high", "posterior_low",
    "posterior_high", "resolved", "at_limit", "limit_low", "limit_high",
)  # fmt: skip
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


def write(folder: Path, found: Fit) -> None:
    """index.html, scene.toml with the estimates, estimates.csv, fit.json, fit.npz and figures."""
    (folder / "estimates.csv").write_bytes(csv_table(COLUMNS, rows(found)))
    (folder / "scene.toml").write_text(fitted_scene(found), encoding="utf-8")
    text = json.dumps(summary(found), indent=1, allow_nan=False)
    (folder / "fit.json").write_text(text, encoding="utf-8")
    np.savez(folder / "fit.npz", **_arrays(found))

    def picture(name: str, figure: Figure, caption: str) -> str:
        drawn = png(figure)
        (folder / f"{name}.png").write_bytes(drawn)
        return document.picture(drawn, caption, name)

    data = found.solution.problem.data
    parts = [
        document.warnings_banner([("", Effort(warnings=tuple(cautions(found))))]),
        *map(document.paragraph, sentences(found)[:2]),
        document.table(*estimate_table(found)),
        document.paragraph(EXPLAINED),
        picture("fitted", fitted_figure(found), FITTED[data.unit]),
        document.section(
            "Residuals", document.paragraph(whiteness_sentence(found)),
            picture("residuals", residual_figure(found), RESIDUALS),
        ),
    ]  # fmt: skip
    if data.left_out:
        parts.append(document.section(
            "Lines that are not fitted", document.table(*left_out_table(found))
        ))  # fmt: skip
    if found.profiles:
        parts.append(document.section(
            "Profiles of the likelihood",
            picture("profiles", profile_figure(found), PROFILES),
        ))  # fmt: skip
    if len(found.estimates) > 1:
        parts.append(document.section(
            "Correlations",
            picture("correlations", correlation_figure(found), CORRELATIONS),
        ))  # fmt: skip
    parts += [
        document.section("Starts", document.paragraph(STARTS), document.table(*_starts(found))),
        document.section(
            "The scene with the estimates", document.preformatted(fitted_scene(found))
        ),
    ]  # fmt: skip
    title = f"{found.target.scene.name}: fitted to {found.measured.name or 'a measurement'}"
    (folder / "index.html").write_text(document.page(title, *parts), encoding="utf-8")


PROFILES = (
    "Dots: chi squared over its scale above its least, one parameter fixed and all others fitted. "
    "Dotted: the parabola of the covariance. The interval ends at the dashed line."
)
CORRELATIONS = "Correlations of the estimates: near 1 or -1, one can make up for the other."
STARTS = "Where the search began and ended, the best first: chi squared over that of the best."


def fitted_scene(found: Fit) -> str:
    """The scene with the estimates and their spreads, and in comments what it cannot hold."""
    said = notes(found.solution, found.estimates, found.correlations)
    return "".join(["# fitted\n", *(f"# {each}\n" for each in said), dumps(found.scene)])


def whiteness_sentence(found: Fit) -> str:
    """Whether the residuals are white."""
    test = found.whiteness
    if not isfinite(test.p):
        return "There are too few data along an axis for a test of whiteness."
    said = "nothing speaks against white residuals." if test.is_white else (
        "they are not white. Intervals are those of a sandwich covariance, with the residuals' "
        "spectrum in place of independent errors (White 1980; of profiles Kent "
        "1982), as far as it widens them: " + ", ".join(
            f"{each.key} by {significant(factor, 3)}"
            for each, factor in zip(found.estimates, found.widenings, strict=True)
            if each.is_resolved
        ) + "."
    )  # fmt: skip
    return (
        f"By the test of Ljung and Box over {len(test.correlations)} lags, p "
        f"{probability(test.p)}: {said}"
    )


def left_out_table(found: Fit) -> tuple[list[str], list[list[str]]]:
    """Header and rows of the lines of the load that are not fitted, the strongest first."""
    left_out = found.solution.problem.data.left_out
    rows = [
        [line.name, f"{line.frequency:.1f}", _share(line), line.why]
        for line in left_out[:MOST_LEFT_OUT]
    ]  # fmt: skip
    if len(left_out) > MOST_LEFT_OUT:
        rows.append([f"{len(left_out) - MOST_LEFT_OUT} more", "", "", ""])
    return ["line", "frequency, Hz", "of the measured power, %", "why"], rows


def _share(line: LeftOut) -> str:
    if not isfinite(line.share):
        return "not resolved"
    return significant(100 * line.share, 2) if line.share else "no more than noise"


def estimate_table(found: Fit) -> tuple[list[str], list[list[str]]]:
    """Header and rows of the estimates."""
    header = ["parameter", "estimate", "95 % interval", "by its profile", "limits"]
    sampled = found.posterior is not None
    return header + ["by samples"] * sampled, [
        _row(found, k, each) for k, each in enumerate(found.estimates)
    ]


def _row(found: Fit, k: int, each: Estimate) -> list[str]:
    limits = found.solution.problem.parameters.free[k]
    profile = next((one for one in found.profiles if one.key == each.key), None)
    value, low, high = shown(each.value, each.low, each.high) if each.is_resolved else (
        significant(each.value), "", ""
    )  # fmt: skip
    interval = f"{low} to {high}" if each.is_resolved else "not resolved by the data"
    row = [
        each.key + ", at a limit" * each.at_limit, value, interval,
        "{1} to {2}".format(*shown(each.value, profile.low, profile.high)) if profile else "-",
        f"{limits.low:g} to {limits.high:g}",
    ]  # fmt: skip
    if found.posterior is not None:
        ends = shown(each.value, *found.posterior.intervals[k])
        row.append(f"{ends[1]} to {ends[2]}")
    return row


def rows(found: Fit) -> list[list[object]]:
    """Rows of estimates.csv."""
    return [
        [
            each.key, f"{each.value:.8g}", *map(_text, (each.low, each.high)),
            *map(_text, _profile_ends(found, each.key)), *map(_text, _sampled_ends(found, k)),
            str(each.is_resolved).lower(), str(each.at_limit).lower(), f"{free.low:g}",
            f"{free.high:g}",
        ]
        for k, (each, free) in enumerate(
            zip(found.estimates, found.solution.problem.parameters.free, strict=True)
        )
    ]  # fmt: skip


def _text(value: float) -> str:
    return f"{value:.8g}" if isfinite(value) else ""


def _profile_ends(found: Fit, key: str) -> tuple[float, float]:
    return next(((p.low, p.high) for p in found.profiles if p.key == key), (np.nan, np.nan))


def _sampled_ends(found: Fit, k: int) -> tuple[float, float]:
    if found.posterior is None:
        return np.nan, np.nan
    low, high = found.posterior.intervals[k]
    return float(low), float(high)


def summary(found: Fit) -> dict[str, Any]:
    """All that is said of a fit, as JSON has it."""
    solution = found.solution
    return {
        "model": found.target.model,
        "kind": solution.problem.data.kind,
        "converged": solution.converged,
        "values": found.values,
        "estimates": [dict(zip(COLUMNS, row, strict=True)) for row in rows(found)],
        "unresolved": [list(each.keys) for each in found.unresolved],
        "chi_squared": solution.cost,
        "degrees_of_freedom": solution.dof,
        "misfit": found.misfit,
        "whiteness_p": found.whiteness.p if isfinite(found.whiteness.p) else None,
        "widened": dict(
            zip(solution.problem.parameters.keys, found.widenings.tolist(), strict=True)
        ),
        "posterior_autocorrelation_times": found.posterior and found.posterior.lengths,
        "left_out": [
            {
                "line": line.name,
                "frequency_hz": line.frequency,
                "why": line.why,
                "share": line.share if isfinite(line.share) else None,
            }
            for line in solution.problem.data.left_out
        ],
        "may_be_turned": solution.may_be_turned,
        "starts": len(solution.starts),
        "starts_that_reached_it": solution.reached,
        "predictions": solution.runs,
        "factorisations": found.target.reduced and found.target.reduced.effort.factorisations,
        "sentences": sentences(found),
        "warnings": cautions(found),
    }


def _starts(found: Fit) -> tuple[list[str], list[list[str]]]:
    solution = found.solution
    keys = solution.problem.parameters.keys
    least = max(solution.starts[0].cost, 1e-300)
    header = ["chi squared", "converged", *(f"{key}, start and end" for key in keys)]
    return header, [_start(found, each, least) for each in solution.starts[:WORST]]


def _start(found: Fit, each: Start, least: float) -> list[str]:
    free = found.solution.problem.parameters.free
    moved = [
        f"{significant(p.value(float(a)))} to {significant(p.value(float(b)), 4)}"
        for p, a, b in zip(free, each.begun, each.ended, strict=True)
    ]
    return [significant(each.cost / least, 5), "yes" if each.converged else "no", *moved]


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
    if found.posterior is not None:
        arrays["samples"] = found.posterior.samples
    return arrays
