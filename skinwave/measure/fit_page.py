"""Page, figures, tables and files of a fit."""

import json
import re
from math import isfinite
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from simple_model import Effort
from simple_model.numbers import if_finite, significant
from skinwave.measure.findings import cautions, notes, probability, round_to_interval, sentences
from skinwave.measure.fit import Fit
from skinwave.measure.intervals import Estimate
from skinwave.measure.measurement import strongest
from skinwave.report.column_labels import axis_label
from skinwave.report.figures import REPORT, png
from skinwave.report.palette import BLUE, ORANGE
from skinwave.report.spectra import lines_figure
from skinwave.scene.file import dumps
from skinwave.system.document import (
    Details,
    Part,
    Picture,
    Report,
    Section,
    contents,
    preformat,
)
from skinwave.system.table import Column, Table
from skinwave.typing import Floats


def write(folder: Path, result: Fit) -> None:
    """Write index.html, the fitted scene.toml, estimates.csv, fit.json, fit.npz and figures."""
    text, data = fitted_scene(result), result.solution.problem.data
    keys, correlations = result.solution.problem.parameters.keys, result.intervals.correlations
    (folder / "scene.toml").write_text(text, encoding="utf-8")
    (folder / "estimates.csv").write_bytes(estimate_table(result).to_csv())
    content = json.dumps(summary(result), indent=1, allow_nan=False)
    (folder / "fit.json").write_text(content, encoding="utf-8")
    np.savez(
        folder / "fit.npz", axis=data.axis, measured=data.values, error=data.error,
        fitted=result.prediction, residual=result.solution.residual, correlations=correlations,
        places_m=result.measured.places, keys=np.array(keys),
    )  # fmt: skip
    about_residuals = (
        "Residuals over their standard error. For normal errors, 95 % lie between the dashed lines."
    )
    about_lags = " Right: their autocorrelation; white residuals lie in the shaded band."
    about = about_residuals + about_lags * bool(len(result.intervals.whiteness.correlations))
    about_waveforms = "Grey: measured; blue: fitted; orange: measured minus fitted."
    about_lines = (
        "The strongest lines of the load, measured and fitted, at the places with the largest "
        "motion. Filled markers: the difference exceeds 95 % of the noise."
    )
    caption = about_waveforms if data.is_in_time else about_lines
    model, starts, residual, *_ = sentences(result)
    estimates = [_estimate_text(e) for e in result.estimates if e.is_resolved and not e.at_limit]
    about_intervals = (
        "A 95 % interval contains the true value in 95 of 100 measurements, if the model is "
        "correct and the residuals are noise. A misfit beyond the noise widens it, as a "
        "systematic error."
    )
    parts: list[Part] = [
        _interval_table(result), f"{model} {starts} {about_intervals}",
        Picture(png(fitted_figure(result)), caption, "fitted"),
        Section("Residuals", [
            _whiteness(result), Picture(png(residual_figure(result)), about, "residuals"),
        ]),
    ]  # fmt: skip
    about_correlations = (
        "Correlations of the estimates. Near ±1, one parameter can compensate the other."
    )
    if len(keys) > 1:
        rows = ((key, *row) for key, row in zip(keys, correlations.tolist(), strict=True))
        table = Table(("", *(Column(key, digits=2) for key in keys)), rows)
        parts.append(Section("Correlations", [about_correlations, table]))
    parts.append(Details("The scene with the estimates", [preformat(text)]))
    Report(
        f"{result.target.scene.name} fitted to {result.measured.name or 'a measurement'}",
        verdict=[" ".join([*estimates, residual])], parts=[*parts[:1], contents(parts), *parts[1:]],
        efforts=[("", Effort(warnings=tuple(cautions(result))))],
        failures=result.solution.failures,
    ).write(folder)  # fmt: skip


def fitted_scene(result: Fit) -> str:
    """Return the scene file with estimates and spreads, and comments on what it cannot store."""
    return "".join(["# fitted\n", *(f"# {note}\n" for note in notes(result)), dumps(result.scene)])


def _estimate_text(each: Estimate) -> str:
    name, _, unit = re.sub("[${}]", "", axis_label(each.key).replace(".", " ")).partition(", ")
    value, low, high = round_to_interval(each)
    unit = f" {unit}" * bool(unit)
    return f"{name.capitalize()} {value}{unit} (95 % interval {low} to {high}{unit})."


def _whiteness(result: Fit) -> str:
    test = result.intervals.whiteness
    if not isfinite(test.p):
        return "The data are too few for a test of whiteness."
    text = f"Ljung-Box test: p {probability(test.p)}"
    if test.is_white:
        return f"{text}. The residuals may be white noise."
    widened = ", so the intervals are widened (White 1980)" * result.intervals.is_described
    return f"{text}. The residuals are not white{widened}."


def estimate_table(result: Fit) -> Table:
    """Return the estimates with their intervals, nan for unresolved ones."""
    free = result.solution.problem.parameters.free
    return Table((
        "parameter", "estimate", "low", "high", "resolved", "at_limit", "limit_low", "limit_high",
    ), (
        (each.key, each.value, each.low, each.high, each.is_resolved, each.at_limit, limits.low,
         limits.high)
        for each, limits in zip(result.estimates, free, strict=True)
    ), stored=8)  # fmt: skip


def _interval_table(result: Fit) -> Table:
    """Return the same for the page, with intervals to two digits of their width."""
    rows = []
    free = result.solution.problem.parameters.free
    for each, limits in zip(result.estimates, free, strict=True):
        value = significant(each.value)
        interval = "not resolved by the data" if result.intervals.is_described else "-"
        if each.is_resolved:
            value, low, high = round_to_interval(each)
            interval = f"{low} to {high}"
        rows.append((each.key + ", at a limit" * each.at_limit, value, interval,
                     f"{significant(limits.low)} to {significant(limits.high)}"))  # fmt: skip
    return Table(("parameter", "estimate", "95 % interval", "limits"), rows)


def summary(result: Fit) -> dict[str, Any]:
    """Return the fit for JSON."""
    solution, data = result.solution, result.solution.problem.data
    keys = solution.problem.parameters.keys
    return {
        "model": result.target.model,
        "kind": data.kind,
        "converged": solution.converged,
        "values": result.values,
        "estimates": estimate_table(result).records(),
        "unresolved": [list(keys) for keys in result.intervals.unresolved],
        "chi_squared": solution.cost,
        "degrees_of_freedom": solution.dof,
        "misfit": result.intervals.misfit,
        "misfit_beyond_noise": result.intervals.unexplained,
        "whiteness_p": if_finite(result.intervals.whiteness.p),
        "widened": dict(zip(keys, result.intervals.widenings.tolist(), strict=True)),
        "left_out": [
            {"line": line.name, "frequency_hz": line.frequency, "share": if_finite(line.share)}
            for line in data.left_out
        ],
        "may_be_turned": solution.may_be_flipped,
        "starts": len(solution.starts),
        "starts_that_reached_it": solution.agreeing_starts,
        "factorisations": result.target.reduced and result.target.reduced.effort.factorisations,
        "sentences": sentences(result),
        "warnings": cautions(result),
    }  # fmt: skip


@mpl.rc_context(REPORT.rc)
def fitted_figure(result: Fit) -> Figure:
    """Return fitted and measured data at the places with the largest motion."""
    data, count = result.solution.problem.data, len(result.measured.places)
    if data.is_in_time:
        return _waveforms(result)
    measured, fitted = (_amplitudes(x, count) for x in (data.values, result.prediction))
    at, error = _largest(measured), data.error[:, :count]
    normal_95 = 1.96
    differs = np.abs(measured - fitted) > normal_95 * error
    return lines_figure(
        dict(zip(data.lines, data.axis.tolist(), strict=True)), result.measured.places[at],
        measured[:, at], error[:, at], {"fitted": fitted[:, at]}, {"fitted": differs[:, at]},
        result.measured.record,
    )  # fmt: skip


def _waveforms(result: Fit) -> Figure:
    """Return the end of steady waveforms, or the start of waveforms from rest."""
    data, record = result.solution.problem.data, result.measured.record
    places, fitted = _largest(data.values), result.prediction
    drawn_time = 0.05  # s of waveforms
    n = int(np.searchsorted(data.axis, data.axis[0] + drawn_time)) + 1
    part = slice(max(len(data.axis) - n, 0), None) if data.lines else slice(n)
    t = 1e3 * data.axis[part]
    figure = Figure(figsize=REPORT.size(10.5, 1.5 * len(places) + 0.9), layout="constrained")
    axes = figure.subplots(len(places), 1, sharex=True, squeeze=False)[:, 0]
    for ax, p in zip(axes, places.tolist(), strict=True):
        for values, name, colour, width in (
            (data.values, "measured", "#bbbbbb", 2.4), (fitted, "fitted", BLUE, 1.1),
            (data.values - fitted, "measured minus fitted", ORANGE, 0.8),
        ):  # fmt: skip
            ax.plot(t, record.per_unit * values[part, p], color=colour, lw=width, label=name)
        ax.set_title(result.measured.place_name(p), loc="left", fontsize="medium")
        ax.set_ylabel(record.shown)
        ax.grid(alpha=0.25)
    axes[-1].set_xlabel("time, ms")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper right", ncols=3)
    return figure


def _amplitudes(values: Floats, places: int) -> np.ndarray:
    """Return complex amplitudes (f, p), or moduli if the data are moduli."""
    if values.shape[1] == places:
        return values
    return np.asarray(values[:, :places] + 1j * values[:, places:])


def _largest(values: np.ndarray) -> np.ndarray:
    most_drawn = 4  # places
    return strongest((np.abs(values) ** 2).sum(axis=0), most_drawn)


@mpl.rc_context(REPORT.rc)
def residual_figure(result: Fit) -> Figure:
    """Draw weighted residuals over their axis and, if known, their autocorrelation."""
    data, solution = result.solution.problem.data, result.solution
    residual = solution.residual / np.sqrt(solution.scale)
    scale, label = (1e3, "time, ms") if data.is_in_time else (1.0, "frequency, Hz")
    each, band = result.intervals.whiteness.correlations, 2 / np.sqrt(residual.size)
    figure = Figure(figsize=REPORT.size(10.5, 3.2), layout="constrained")
    widths = (2, 1)[: 1 + bool(len(each))]
    left, *others = figure.subplots(1, len(widths), width_ratios=widths, squeeze=False)[0]
    thin = slice(None, None, max(1, len(residual) // 2000))
    ink = "#222222"
    left.plot(scale * data.axis[thin], residual[thin], ".", ms=2 if data.is_in_time else 5,
              color=ink, alpha=0.4)  # fmt: skip
    for y in (-2, 2):
        left.axhline(y, color=ORANGE, lw=0.8, ls="--")
    left.set(xlabel=label, ylabel="residual, standard errors")
    for right in others:
        right.bar(np.arange(1, len(each) + 1), each, color=ink, alpha=0.6)
        right.axhspan(-band, band, color=BLUE, alpha=0.2)
        right.set_xlabel("lag, samples" if data.is_in_time else "lag, lines")
        right.set_ylabel("autocorrelation")
    return figure
