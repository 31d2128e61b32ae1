"""Figures of a fit: fitted against measured, residuals, likelihood profiles."""

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from simple_model.typing import Floats
from skinwave.measure.fit import Fit
from skinwave.measure.intervals import Profile
from skinwave.report.figures import REPORT
from skinwave.report.palette import BLUE, ORANGE
from skinwave.report.styles import Style

MEASURED, FITTED, LEFT = "#222222", BLUE, ORANGE
MOST = 4  # places that are drawn
SHOWN = 0.05  # s of waveforms
FAINTEST = 1e-5  # of the largest amplitude, down to which lines are drawn
ACROSS = 3  # profiles in a row


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
        ax.plot(t, per_unit * data.values[part, p], color=MEASURED, lw=2.4, alpha=0.35,
                label="measured")  # fmt: skip
        ax.plot(t, per_unit * fitted[part, p], color=FITTED, lw=1.1, label="fitted")
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
            color=MEASURED, alpha=0.5, lw=1, label="measured, ± 2 standard errors",
        )  # fmt: skip
        column[0].plot(data.axis, per_unit * np.abs(fitted[:, p]), "x", color=FITTED, ms=6,
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
    ax.axhline(0, color=FITTED, lw=1)
    ax.errorbar(f[known], phase[known], spread[known], fmt="o", ms=4, color=MEASURED, alpha=0.5,
                lw=1)  # fmt: skip


def _amplitudes(values: Floats, complex_ones: bool) -> np.ndarray:
    if not complex_ones:
        return values
    real, imaginary = np.hsplit(values, 2)
    return np.asarray(real + 1j * imaginary)


def _strongest(values: Floats) -> list[int]:
    """The places that moved most, in their order."""
    power = (np.abs(values) ** 2).sum(axis=0)
    return sorted(np.argsort(-power, kind="stable")[:MOST].tolist())


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
                  color=MEASURED, alpha=0.4)  # fmt: skip
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
    ax.bar(np.arange(1, len(each) + 1), each, color=MEASURED, alpha=0.6)
    ax.axhspan(-band, band, color=FITTED, alpha=0.2)
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
    ax.plot(x, profile.level * (away[inside] / half) ** 2, color=MEASURED, lw=1, ls=":",
            label="by the covariance")  # fmt: skip
    near = profile.excess <= 2 * profile.level
    ax.plot(profile.values[near], profile.excess[near], "o", color=FITTED, ms=5, label="profile")
    ax.axhline(profile.level, color=LEFT, lw=0.8, ls="--", label="95 %")
    ax.ticklabel_format(useOffset=False)
    ax.xaxis.set_major_locator(mpl.ticker.MaxNLocator(3))
    ax.set_xlabel(profile.key)
    ax.grid(alpha=0.25)
