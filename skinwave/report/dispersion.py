"""Figures of dispersion curves: speeds and 1/e lengths over frequency, mode shapes over depth."""

from collections.abc import Mapping
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import FuncFormatter

from meshes.tetmesh import Floats
from simple_model.drawing import small
from simple_model.layers.dispersion import DispersionCurves, Mode
from skinwave.report.figures import REPORT, legend, written
from skinwave.report.palette import SERIES
from skinwave.report.styles import Style

FINE = 600  # frequencies of a drawn curve
PALE = 0.35  # opacity of a curve where its mode is evanescent
ROWS = 3  # of the names of lines above the panels
LETTER, GAP, LINE = 0.55, 0.7, 1.45  # width of their letters, between two, and of a row, over size
SHARE = 0.68  # of a figure's width for the curves, where the shapes are beside them
MOST_SHAPES = 4
LABELS = (
    "phase speed ω / |Re k|, m/s",
    "1/e length 1 / |Im k|, mm",
    "group speed dω / d Re k, m/s",
)


def colour(number: int) -> str:
    """Colour of a mode by its number in the curves, from 0."""
    return SERIES[number % len(SERIES)]


def dispersion_figure(
    curves: DispersionCurves,
    lines: Mapping[str, float],
    focus_speed: float,
    at: float,
    style: Style = REPORT,
) -> Figure:
    """Phase speed, 1/e length and group speed over frequency, and mode shapes at one frequency.

    Parameters
    ----------
    curves : DispersionCurves
    lines : names and frequencies in Hz of the lines of a load, the strongest first
    focus_speed : m/s, 0 of a focus at rest
    at : Hz, where the shapes are
    style : Style

    Returns
    -------
    Figure
    """
    thick = len(curves.depths) > 2 and not style.is_narrow
    with mpl.rc_context(style.rc):
        size = style.size(11.5 if thick else 8.5, 8.4)
        figure = Figure(figsize=size, layout="constrained")
        left: Figure | SubFigure = figure
        if thick:
            left, right = figure.subfigures(1, 2, squeeze=False, width_ratios=(SHARE, 1 - SHARE))[0]
            _shapes(right, curves, at)
        axes = left.subplots(3, 1, sharex=True, height_ratios=(1.25, 1, 1))
        _speeds(axes[0], curves, focus_speed)
        _decay(axes[1], curves)
        _group(axes[2], curves)
        for ax, label in zip(axes, LABELS, strict=True):
            ax.set_xlim(0, curves.frequencies[-1])
            ax.set_ylabel(label)
            for frequency in lines.values():
                ax.axvline(frequency, color="0.55", lw=0.9, ls=":", zorder=0)
            ax.grid(alpha=0.25)
        width = 72 * size[0] * (SHARE if thick else 1) - 8 * style.font  # points
        _name_lines(axes[0], lines, width)
        axes[-1].set_xlabel("frequency, Hz")
        _legend(figure, curves, focus_speed, 2 if style.is_narrow else 5)
    return figure


def _fine(mode: Mode) -> tuple[Floats, np.ndarray, np.ndarray]:
    """Frequencies (g,) in Hz, squared wavenumbers (g,) and whether the mode is a wave there."""
    fine = np.linspace(mode.frequencies[0], mode.frequencies[-1], FINE)
    nearest = np.abs(fine[:, None] - mode.frequencies).argmin(axis=1)
    return fine, mode.squared_at(fine), mode.is_wave[nearest] & (fine >= mode.cut_on)


def _drawn(ax: Axes, n: int, x: Floats, y: Floats, wave: np.ndarray) -> None:
    """A mode's curve, pale where it is evanescent."""
    ax.plot(x, y, color=colour(n), lw=1, alpha=PALE)
    ax.plot(x, np.where(wave, y, np.nan), color=colour(n), lw=2.2)


def _speeds(ax: Axes, curves: DispersionCurves, focus_speed: float) -> None:
    typical = [focus_speed]
    for n, mode in enumerate(curves.modes):
        fine, squared, wave = _fine(mode)
        with np.errstate(divide="ignore"):
            speed = 2 * np.pi * fine / np.abs(np.sqrt(squared).real)
        _drawn(ax, n, fine, speed, wave)
        typical += [float(np.median(speed[wave]))] if wave.any() else []
    if focus_speed:
        ax.axhline(focus_speed, color=mpl.rcParams["text.color"], lw=1.2, ls="--")
    ax.set_ylim(0, 1.8 * max(typical) or 1.0)


def _decay(ax: Axes, curves: DispersionCurves) -> None:
    largest = 10.0
    for n, mode in enumerate(curves.modes):
        fine, squared, wave = _fine(mode)
        with np.errstate(divide="ignore"):
            length = 1e3 / np.abs(np.sqrt(squared).imag)
        _drawn(ax, n, fine, length, wave)
        largest = max(largest, float(np.nanmax(np.where(wave, length, 0.0))))
    ax.set(yscale="log", ylim=(1, min(2 * largest, 3e3)))
    ax.yaxis.set_major_formatter(FuncFormatter(lambda value, place: f"{value:g}"))


def _group(ax: Axes, curves: DispersionCurves) -> None:
    drawn, typical = [], [1.0]
    for mode in curves.modes:
        fine, squared, wave = _fine(mode)
        slowness = np.gradient(np.sqrt(squared).real, 2 * np.pi * fine)
        with np.errstate(divide="ignore", invalid="ignore"):
            drawn.append(np.where(wave, np.abs(1 / slowness), np.nan))
        typical += [float(np.nanmedian(drawn[-1]))] if wave.any() else []
    top = 1.8 * max(typical)
    for n, speed in enumerate(drawn):
        ax.plot(fine, np.where(speed < top, speed, np.nan), color=colour(n), lw=2.2)
    ax.set_ylim(0, top)


def _name_lines(ax: Axes, lines: Mapping[str, float], width: float) -> None:
    """Names of lines above a panel of a width in points, the strongest that have room."""
    size, taken = small(), [list[tuple[float, float]]() for _ in range(ROWS)]
    for name, frequency in lines.items():
        half = size * (LETTER * len(name.replace("_", "")) + GAP) / 2
        middle = width * frequency / ax.get_xlim()[1]
        low, high = middle - half, middle + half
        free = [k for k, others in enumerate(taken) if all(high < a or b < low for a, b in others)]
        if not free or high > width + 2 * size:
            continue
        taken[free[0]].append((low, high))
        ax.annotate(
            written(name), (frequency, 1.0), (0, 2 + LINE * size * free[0]),
            xycoords=("data", "axes fraction"), textcoords="offset points", ha="center",
            va="bottom", fontsize=size,
        )  # fmt: skip


def _legend(figure: Figure, curves: DispersionCurves, focus_speed: float, columns: int) -> None:
    ink = mpl.rcParams["text.color"]
    entries: dict[str, dict[str, Any]] = {
        mode.name: {"color": colour(n), "lw": 2.2} for n, mode in enumerate(curves.modes)
    }
    entries["evanescent"] = {"color": ink, "lw": 1, "alpha": PALE}
    entries["lines of the load"] = {"color": "0.55", "lw": 0.9, "ls": ":"}
    if focus_speed:
        entries[f"focus, {focus_speed:g} m/s"] = {"color": ink, "lw": 1.2, "ls": "--"}
    legend(figure, entries, columns)


def _shapes(figure: SubFigure, curves: DispersionCurves, at: float) -> None:
    """Displacement over depth of the least evanescent modes, in phase with the surface."""
    axes = figure.subplots(2, 1, sharex=True, sharey=True)
    number = int(np.argmin(np.abs(curves.frequencies - at)))
    known = [n for n, mode in enumerate(curves.modes) if mode.kinds[number]]
    known.sort(key=lambda n: abs(curves.modes[n].wavenumbers[number].imag))
    for n in sorted(known[:MOST_SHAPES]):
        shape = curves.modes[n].shapes[number]
        turned = shape * np.exp(-1j * np.angle(shape[0, 1])) / np.abs(shape).max()
        pale = 1.0 if curves.modes[n].is_wave[number] else PALE
        for ax, part in zip(axes, (turned[:, 1].real, turned[:, 0].real), strict=True):
            ax.plot(part, 1e3 * curves.depths, color=colour(n), lw=2, alpha=pale)
    titles = (f"shapes at {curves.frequencies[number]:.0f} Hz: into the body", "along the surface")
    for ax, title in zip(axes, titles, strict=True):
        ax.set_title(title, fontsize="medium")
        ax.axvline(0, color="0.6", lw=0.8, zorder=0)
        ax.set(xlim=(-1.05, 1.05), xticks=(-1, 0, 1), ylim=(1e3 * curves.depths[-1], 0))
        ax.set_ylabel("depth, mm")
        ax.grid(alpha=0.25)
    axes[-1].set_xlabel("displacement over the largest of the mode")
