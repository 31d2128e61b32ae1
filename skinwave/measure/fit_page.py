"""Page, figures, tables and files of a fit."""

import json
from math import isfinite
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from simple_model import Effort
from simple_model.numbers import significant
from skinwave.measure.findings import cautions, notes, probability, sentences, shown
from skinwave.measure.fit import Fit
from skinwave.report.figures import REPORT, png
from skinwave.report.palette import BLUE, ORANGE
from skinwave.report.spectra import lines_figure
from skinwave.report.styles import Style
from skinwave.scene.file import dumps
from skinwave.system.document import Details, Part, Picture, Report, Section, preformatted
from skinwave.system.table import Column, Table
from skinwave.typing import Floats

INK, OF_FIT, LEFT = "#222222", BLUE, ORANGE
MOST_DRAWN = 4  # places that are drawn
SHOWN = 0.05  # s of waveforms
NORMAL_95 = 1.96
EXPLAINED = (
    "An interval holds the true value in 95 of 100 measurements, if the model is the true one and "
    "the residuals are noise."
)
OF_WAVEFORMS = "Grey: measured; blue: fitted; orange: measured less fitted."
OF_LINES = (
    "The strongest lines of the load as measured and as fitted, at the places that moved most. "
    "Filled where they differ by more than 95 % of the noise."
)
RESIDUALS = (
    "The residuals over their standard error; 95 of 100 lie between the dashed lines if the errors "
    "are normal."
)
OF_LAGS = " Right: their autocorrelation, in the shaded band if they are white."
CORRELATIONS = "Correlations of the estimates: near 1 or -1, one can make up for the other."


def write(folder: Path, found: Fit) -> None:
    """Write index.html, scene.toml with the estimates, estimates.csv, fit.json, fit.npz and
    figures.
    """
    text, table, data = fitted_scene(found), estimate_table(found), found.solution.problem.data
    (folder / "scene.toml").write_text(text, encoding="utf-8")
    (folder / "estimates.csv").write_bytes(table.to_csv())
    summed_up = json.dumps(summary(found), indent=1, allow_nan=False)
    (folder / "fit.json").write_text(summed_up, encoding="utf-8")
    np.savez(
        folder / "fit.npz", axis=data.axis, measured=data.values, error=data.error,
        fitted=found.predicted, residual=found.solution.residual, places_m=found.measured.places,
        correlations=found.intervals.correlations,
        keys=np.array(found.solution.problem.parameters.keys),
    )  # fmt: skip
    keys = found.solution.problem.parameters.keys
    rows = ((key, *row) for key, row in zip(keys, found.intervals.correlations.tolist(),
                                            strict=True))  # fmt: skip
    correlations = Table(("", *(Column(key, digits=2) for key in keys)), rows)
    caption = OF_WAVEFORMS if data.is_in_time else OF_LINES
    about = RESIDUALS + OF_LAGS * bool(len(found.intervals.whiteness.correlations))
    method, estimates = sentences(found)[:2], sentences(found)[2:]
    parts: list[Part] = [
        _shown_estimates(found), EXPLAINED,
        Picture(png(fitted_figure(found)), caption, "fitted"),
        Section("Residuals", [
            _whiteness(found), Picture(png(residual_figure(found)), about, "residuals"),
        ]),
        *[Section("Correlations", [CORRELATIONS, correlations])] * (len(keys) > 1),
        Details("The scene with the estimates", [preformatted(text)]),
    ]  # fmt: skip
    Report(
        f"{found.target.scene.name}: fitted to {found.measured.name or 'a measurement'}",
        verdict=[" ".join(said) for said in (estimates, method) if said], parts=parts,
        efforts=[("", Effort(warnings=tuple(cautions(found))))],
    ).write(folder)  # fmt: skip


def fitted_scene(found: Fit) -> str:
    """The scene with the estimates and their spreads, and in comments what it cannot hold."""
    return "".join(["# fitted\n", *(f"# {each}\n" for each in notes(found)), dumps(found.scene)])


def _whiteness(found: Fit) -> str:
    """Sentence on whether the residuals are white."""
    test = found.intervals.whiteness
    if not isfinite(test.p):
        return "There are too few data along an axis for a test of whiteness."
    said = "nothing speaks against white residuals"
    if not test.is_white:
        said = "they are not white, and a sandwich covariance widens the intervals (White 1980)"
    return f"By the test of Ljung and Box, p {probability(test.p)}: {said}."


def estimate_table(found: Fit) -> Table:
    """Estimates with their intervals, nan where there is none."""
    return Table((
        "parameter", "estimate", "low", "high", "resolved", "at_limit", "limit_low", "limit_high",
    ), (
        (each.key, each.value, each.low, each.high, each.is_resolved, each.at_limit, limits.low,
         limits.high)
        for each, limits in zip(
            found.estimates, found.solution.problem.parameters.free, strict=True
        )
    ), stored=8)  # fmt: skip


def _shown_estimates(found: Fit) -> Table:
    """The same for the page: each interval as a range, to two digits of its width."""
    rows = []
    free = found.solution.problem.parameters.free
    for each, limits in zip(found.estimates, free, strict=True):
        value, interval = significant(each.value), "not resolved by the data"
        if each.is_resolved:
            value, low, high = shown(each)
            interval = f"{low} to {high}"
        rows.append((each.key + ", at a limit" * each.at_limit, value, interval,
                     f"{significant(limits.low)} to {significant(limits.high)}"))  # fmt: skip
    return Table(("parameter", "estimate", "95 % interval", "limits"), rows)


def summary(found: Fit) -> dict[str, Any]:
    """What is said of a fit, as JSON has it."""
    solution, data = found.solution, found.solution.problem.data
    keys = solution.problem.parameters.keys
    return {
        "model": found.target.model,
        "kind": data.kind,
        "converged": solution.converged,
        "values": found.values,
        "estimates": json.loads(estimate_table(found).to_json()),
        "unresolved": [list(keys) for keys in found.intervals.unresolved],
        "chi_squared": solution.cost,
        "degrees_of_freedom": solution.dof,
        "misfit": found.misfit,
        "whiteness_p": _finite(found.intervals.whiteness.p),
        "widened": dict(zip(keys, found.intervals.widenings.tolist(), strict=True)),
        "left_out": [
            {"line": line.name, "frequency_hz": line.frequency, "share": _finite(line.share)}
            for line in data.left_out
        ],
        "may_be_turned": solution.may_be_turned,
        "starts": len(solution.starts),
        "starts_that_reached_it": solution.reached,
        "factorisations": found.target.reduced and found.target.reduced.effort.factorisations,
        "sentences": sentences(found),
        "warnings": cautions(found),
    }  # fmt: skip


def _finite(value: float) -> float | None:
    return value if isfinite(value) else None


def fitted_figure(found: Fit, style: Style = REPORT) -> Figure:
    """Fitted against measured at the places that moved most."""
    if found.solution.problem.data.is_in_time:
        with mpl.rc_context(style.rc):
            return _waveforms(found, style)
    data, count = found.solution.problem.data, len(found.measured.places)
    measured, fitted = (_amplitudes(x, count) for x in (data.values, found.predicted))
    at, error = _strongest(measured), data.error[:, :count]
    differs = np.abs(measured - fitted) > NORMAL_95 * error
    return lines_figure(
        dict(zip(data.lines, data.axis.tolist(), strict=True)), found.measured.places[at],
        measured[:, at], error[:, at], {"fitted": fitted[:, at]}, {"fitted": differs[:, at]},
        found.measured.record, style=style,
    )  # fmt: skip


def _waveforms(found: Fit, style: Style) -> Figure:
    """Of steady waveforms their end, of others their beginning."""
    data, record = found.solution.problem.data, found.measured.record
    places = _strongest(data.values)
    n = int(np.searchsorted(data.axis, data.axis[0] + SHOWN)) + 1
    part = slice(max(len(data.axis) - n, 0), None) if data.lines else slice(n)
    t, fitted = 1e3 * data.axis[part], found.predicted
    figure = Figure(figsize=style.size(10.5, 1.9 * len(places) + 0.9), layout="constrained")
    axes = figure.subplots(len(places), 1, sharex=True, squeeze=False)[:, 0]
    for ax, p in zip(axes, places, strict=True):
        for values, name, colour, width in (
            (data.values, "measured", "#bbbbbb", 2.4), (fitted, "fitted", OF_FIT, 1.1),
            (data.values - fitted, "measured less fitted", LEFT, 0.8),
        ):  # fmt: skip
            ax.plot(t, record.per_unit * values[part, p], color=colour, lw=width, label=name)
        ax.set_title(found.measured.place_name(p), loc="left", fontsize="medium")
        ax.set_ylabel(record.shown)
        ax.grid(alpha=0.25)
    axes[-1].set_xlabel("time, ms")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper right", ncols=3)
    return figure


def _amplitudes(values: Floats, places: int) -> np.ndarray:
    """Complex amplitudes (f, p), or moduli if there are only these."""
    if values.shape[1] == places:
        return values
    return np.asarray(values[:, :places] + 1j * values[:, places:])


def _strongest(values: np.ndarray) -> list[int]:
    """The places that moved most, in their order."""
    power = (np.abs(values) ** 2).sum(axis=0)
    return sorted(np.argsort(-power, kind="stable")[:MOST_DRAWN].tolist())


def residual_figure(found: Fit, style: Style = REPORT) -> Figure:
    """Weighted residuals along their axis, and their autocorrelation if it is known."""
    data, solution = found.solution.problem.data, found.solution
    residual = solution.residual / np.sqrt(solution.scale)
    scale, label = (1e3, "time, ms") if data.is_in_time else (1.0, "frequency, Hz")
    each, band = found.intervals.whiteness.correlations, 2 / np.sqrt(residual.size)
    with mpl.rc_context(style.rc):
        figure = Figure(figsize=style.size(10.5, 3.2), layout="constrained")
        widths = (2, 1)[: 1 + bool(len(each))]
        left, *others = figure.subplots(1, len(widths), width_ratios=widths, squeeze=False)[0]
        thin = slice(None, None, max(1, len(residual) // 2000))
        left.plot(scale * data.axis[thin], residual[thin], ".", ms=2 if data.is_in_time else 5,
                  color=INK, alpha=0.4)  # fmt: skip
        for y in (-2, 2):
            left.axhline(y, color=LEFT, lw=0.8, ls="--")
        left.set_xlabel(label)
        left.set_ylabel("residual, standard errors")
        for right in others:
            right.bar(np.arange(1, len(each) + 1), each, color=INK, alpha=0.6)
            right.axhspan(-band, band, color=OF_FIT, alpha=0.2)
            right.set_xlabel("lag, samples" if data.is_in_time else "lag, lines")
            right.set_ylabel("autocorrelation")
    return figure
