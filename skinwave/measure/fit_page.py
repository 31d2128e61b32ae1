"""Page, figures, tables and files of a fit."""

import json
from math import isfinite
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from simple_model import Effort
from simple_model.numbers import significant
from simple_model.typing import Floats
from skinwave.measure.findings import cautions, probability, sentences, shown
from skinwave.measure.fit import Fit, notes
from skinwave.measure.intervals import Profile
from skinwave.report.figures import REPORT, png
from skinwave.report.palette import BLUE, ORANGE
from skinwave.report.styles import Style
from skinwave.scene.file import dumps
from skinwave.system.document import Part, Picture, Report, Section, preformatted
from skinwave.system.table import Column, Table

WORST = 20  # starts in the table
MOST_LEFT_OUT = 20  # lines in the table
INK, OF_FIT, LEFT = "#222222", BLUE, ORANGE
MOST_DRAWN = 4  # places that are drawn
SHOWN = 0.05  # s of waveforms
FAINTEST = 1e-5  # of the largest amplitude, down to which lines are drawn
ACROSS = 3  # profiles in a row
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


def fitted_figure(found: Fit, style: Style = REPORT) -> Figure:
    """Fitted against measured, and the difference, at the places that moved most."""
    with mpl.rc_context(style.rc):
        if found.solution.problem.data.unit == "s":
            return _waveforms(found, style)
        return _lines(found, style)


def _waveforms(found: Fit, style: Style) -> Figure:
    data, per_unit = found.solution.problem.data, found.measured.record.per_unit
    places = _strongest(data.values)
    part = slice(*_window(data.axis, data.lines))
    t, fitted = 1e3 * data.axis[part], found.predicted
    figure = Figure(figsize=style.size(10.5, 1.9 * len(places) + 0.9), layout="constrained")
    axes = figure.subplots(len(places), 1, sharex=True, squeeze=False)[:, 0]
    for ax, p in zip(axes, places, strict=True):
        ax.plot(t, per_unit * data.values[part, p], color=INK, lw=2.4, alpha=0.35,
                label="measured")  # fmt: skip
        ax.plot(t, per_unit * fitted[part, p], color=OF_FIT, lw=1.1, label="fitted")
        ax.plot(t, per_unit * (data.values - fitted)[part, p], color=LEFT, lw=0.8,
                label="measured less fitted")  # fmt: skip
        ax.set_title(data.labels[p], loc="left", fontsize="medium")
        ax.set_ylabel(found.measured.record.shown)
        ax.grid(alpha=0.25)
    axes[-1].set_xlabel("time, ms")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper right", ncols=3)
    return figure


def _window(axis: Floats, lines: tuple[str, ...]) -> tuple[int, int]:
    """Samples that are drawn: of steady waveforms the last, of others the first."""
    n = int(np.searchsorted(axis, axis[0] + SHOWN)) + 1
    return (max(len(axis) - n, 0), len(axis)) if lines else (0, n)


def _lines(found: Fit, style: Style) -> Figure:
    data, per_unit = found.solution.problem.data, found.measured.record.per_unit
    complex_ones = len(data.labels) > len(found.measured.places)
    measured, fitted = (_amplitudes(x, complex_ones) for x in (data.values, found.predicted))
    error = per_unit * data.error[:, : measured.shape[1]]
    places = _strongest(np.abs(measured))
    rows = 2 if complex_ones else 1
    size = style.size(max(5.0, 2.9 * len(places) + 0.6), 2.6 * rows + 0.6)
    figure = Figure(figsize=size, layout="constrained")
    axes = figure.subplots(rows, len(places), sharex=True, sharey="row", squeeze=False)
    for column, p in zip(axes.T, places, strict=True):
        column[0].errorbar(
            data.axis, per_unit * np.abs(measured[:, p]), 2 * error[:, p], fmt="o", ms=4,
            color=INK, alpha=0.5, lw=1, label="measured, ± 2 standard errors",
        )  # fmt: skip
        column[0].plot(data.axis, per_unit * np.abs(fitted[:, p]), "x", color=OF_FIT, ms=6,
                       label="fitted")  # fmt: skip
        column[0].set_yscale("log")
        column[0].set_title(found.measured.place_name(p), fontsize="medium")
        if complex_ones:
            _phases(column[1], data.axis, measured[:, p], fitted[:, p], error[:, p] / per_unit)
        column[-1].set_xlabel("frequency, Hz")
        for ax in column:
            ax.grid(alpha=0.25)
    largest = per_unit * float(np.abs(measured).max())
    axes[0, 0].set_ylim(FAINTEST * largest, 3 * largest)
    axes[0, 0].set_ylabel(f"amplitude, {found.measured.record.shown}")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper right", ncols=2)
    if complex_ones:
        axes[1, 0].set_ylabel("phase, measured\nless fitted, degrees")
        axes[1, 0].set_ylim(-45, 45)
    return figure


def _phases(ax: Axes, f: Floats, measured: Floats, fitted: Floats, error: Floats) -> None:
    """Phase of the measured lines against the fitted ones, where it is known to 30 degrees."""
    known = np.abs(measured) > 2 * error
    phase = np.degrees(np.angle(measured / fitted))
    spread = np.degrees(2 * error / np.maximum(np.abs(measured), 1e-300))
    ax.axhline(0, color=OF_FIT, lw=1)
    ax.errorbar(f[known], phase[known], spread[known], fmt="o", ms=4, color=INK, alpha=0.5,
                lw=1)  # fmt: skip


def _amplitudes(values: Floats, complex_ones: bool) -> np.ndarray:
    if not complex_ones:
        return values
    real, imaginary = np.hsplit(values, 2)
    return np.asarray(real + 1j * imaginary)


def _strongest(values: Floats) -> list[int]:
    """The places that moved most, in their order."""
    power = (np.abs(values) ** 2).sum(axis=0)
    return sorted(np.argsort(-power, kind="stable")[:MOST_DRAWN].tolist())


def residual_figure(found: Fit, style: Style = REPORT) -> Figure:
    """Weighted residuals along their axis, and their autocorrelation."""
    data, solution = found.solution.problem.data, found.solution
    residual = solution.residual / np.sqrt(solution.scale)
    scale, label = (1e3, "time, ms") if data.unit == "s" else (1.0, "frequency, Hz")
    with mpl.rc_context(style.rc):
        figure = Figure(figsize=style.size(10.5, 3.2), layout="constrained")
        left, right = figure.subplots(1, 2, width_ratios=(2, 1))
        thin = slice(None, None, max(1, len(residual) // 2000))
        left.plot(scale * data.axis[thin], residual[thin], ".", ms=2 if data.unit == "s" else 5,
                  color=INK, alpha=0.4)  # fmt: skip
        for y in (-2, 2):
            left.axhline(y, color=LEFT, lw=0.8, ls="--")
        left.set_xlabel(label)
        left.set_ylabel("residual, standard errors")
        _autocorrelation(right, found)
    return figure


def _autocorrelation(ax: Axes, found: Fit) -> None:
    each = found.whiteness.correlations
    n, series = found.solution.residual.shape
    band = 2 / np.sqrt(n * series)
    ax.bar(np.arange(1, len(each) + 1), each, color=INK, alpha=0.6)
    ax.axhspan(-band, band, color=OF_FIT, alpha=0.2)
    limit = 1.3 * max(2 * band, float(np.abs(each).max(initial=0.0)))
    ax.set_ylim(-limit, limit)
    ax.set_xlabel("lag, samples" if found.solution.problem.data.unit == "s" else "lag, lines")
    ax.set_ylabel("autocorrelation")


def profile_figure(found: Fit, style: Style = REPORT) -> Figure:
    """Profiles of the likelihood, with the parabolas of the covariance."""
    rows = -(-len(found.profiles) // ACROSS)
    across = min(len(found.profiles), ACROSS)
    with mpl.rc_context(style.rc):
        figure = Figure(figsize=style.size(3.5 * across, 2.7 * rows + 0.4), layout="constrained")
        axes = figure.subplots(rows, across, squeeze=False).ravel()
        for ax in axes[len(found.profiles) :]:
            ax.set_visible(False)
        for ax, each in zip(axes, found.profiles, strict=False):
            _profile(ax, found, each)
        for ax in axes[::ACROSS]:
            ax.set_ylabel("chi squared over its scale,\nabove the least")
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper right", ncols=3)
    return figure


def _profile(ax: Axes, found: Fit, profile: Profile) -> None:
    estimate = next(each for each in found.estimates if each.key == profile.key)
    free = next(
        each for each in found.solution.problem.parameters.free if each.key == profile.key
    )  # fmt: skip
    middle = free.place(estimate.value)
    half = max(free.place(estimate.high) - middle, middle - free.place(estimate.low))
    away = np.linspace(-1.3, 1.3, 41) * half
    inside = (middle + away >= 0) & (middle + away <= 1)
    x = [free.value(float(u)) for u in middle + away[inside]]
    ax.plot(x, profile.level * (away[inside] / half) ** 2, color=INK, lw=1, ls=":",
            label="by the covariance")  # fmt: skip
    near = profile.excess <= 2 * profile.level
    ax.plot(profile.values[near], profile.excess[near], "o", color=OF_FIT, ms=5, label="profile")
    ax.axhline(profile.level, color=LEFT, lw=0.8, ls="--", label="95 %")
    ax.ticklabel_format(useOffset=False)
    ax.xaxis.set_major_locator(mpl.ticker.MaxNLocator(3))
    ax.set_xlabel(profile.key)
    ax.grid(alpha=0.25)
