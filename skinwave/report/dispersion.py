"""Figures of dispersion curves: speeds and 1/e lengths over frequency, mode shapes over depth."""

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import FuncFormatter

from simple_model.layers.dispersion import DispersionCurves
from skinwave.report.figures import LINE_STYLE, REPORT, legend, name_lines, with_style
from skinwave.report.palette import SERIES
from skinwave.report.styles import Style

PALE = 0.35  # opacity of evanescent modes


def mode_colour(number: int) -> str:
    """Return the colour of the mode with this index."""
    return SERIES[number % len(SERIES)]


@with_style
def dispersion_figure(
    curves: DispersionCurves, lines: Mapping[str, float], focus_speed: float, at: float,
    style: Style = REPORT,
) -> Figure:  # fmt: skip
    """Draw phase speed, 1/e length and group speed over frequency, and mode shapes at `at` Hz.

    `lines` are frequencies in Hz by name, the strongest first. `focus_speed` is in m/s, 0 for a
    focus at rest.
    """
    thick = len(curves.depths) > 2 and not style.is_narrow
    size = style.size(11.5 if thick else 8.5, 8.4)
    figure = Figure(figsize=size, layout="constrained")
    left: Figure | SubFigure = figure
    share = 0.68 if thick else 1.0  # of the width for the curves; the shapes have the rest
    if thick:
        left, right = figure.subfigures(1, 2, squeeze=False, width_ratios=(share, 1 - share))[0]
        _shapes(right, curves, at)
    axes = left.subplots(3, 1, sharex=True, height_ratios=(1.25, 1, 1))
    _draw_curves(axes, curves, focus_speed)
    labels = (
        "phase speed ω / |Re k|, m/s",
        "1/e length 1 / |Im k|, mm",
        "group speed dω / d Re k, m/s",
    )
    for ax, label in zip(axes, labels, strict=True):
        ax.set_xlim(0, curves.frequencies[-1])
        ax.set_ylabel(label)
        for frequency in lines.values():
            ax.axvline(frequency, **LINE_STYLE)
        ax.grid(alpha=0.25)
    name_lines(axes[0], lines, 72 * size[0] * share - 8 * style.font, rows=3)
    axes[-1].set_xlabel("frequency, Hz")
    ink = mpl.rcParams["text.color"]
    entries: dict[str, dict[str, Any]] = {
        mode.name: {"color": mode_colour(n), "lw": 2.2} for n, mode in enumerate(curves.modes)
    } | {"evanescent": {"color": ink, "lw": 1, "alpha": PALE}, "lines of the load": LINE_STYLE}
    if focus_speed:
        entries[f"focus, {focus_speed:g} m/s"] = {"color": ink, "lw": 1.2, "ls": "--"}
    legend(figure, entries, 2 if style.is_narrow else 5)
    return figure


def _draw_curves(axes: Sequence[Axes], curves: DispersionCurves, focus_speed: float) -> None:
    """Draw speed, length and group speed of each mode; evanescent parts are pale."""
    speeds, groups, longest = [focus_speed], [1.0], 10.0
    drawn = []
    for n, mode in enumerate(curves.modes):
        fine = np.linspace(mode.frequencies[0], mode.frequencies[-1], 600)
        nearest = np.abs(fine[:, None] - mode.frequencies).argmin(axis=1)
        wave = mode.is_wave[nearest] & (fine >= mode.cut_on)
        wavenumber = np.sqrt(mode.squared_at(fine))
        slowness = np.gradient(wavenumber.real, 2 * np.pi * fine)
        with np.errstate(divide="ignore", invalid="ignore"):
            speed = 2 * np.pi * fine / np.abs(wavenumber.real)
            length = 1e3 / np.abs(wavenumber.imag)
            drawn.append((fine, np.where(wave, np.abs(1 / slowness), np.nan)))
        for ax, y in zip(axes, (speed, length), strict=False):
            ax.plot(fine, y, color=mode_colour(n), lw=1, alpha=PALE)
            ax.plot(fine, np.where(wave, y, np.nan), color=mode_colour(n), lw=2.2)
        if wave.any():
            speeds.append(float(np.median(speed[wave])))
            groups.append(float(np.nanmedian(drawn[-1][1])))
            longest = max(longest, float(np.nanmax(length[wave])))
    top = 1.8 * max(groups)
    for n, (fine, group) in enumerate(drawn):
        axes[2].plot(fine, np.where(group < top, group, np.nan), color=mode_colour(n), lw=2.2)
    if focus_speed:
        axes[0].axhline(focus_speed, color=mpl.rcParams["text.color"], lw=1.2, ls="--")
    axes[0].set_ylim(0, 1.8 * max(speeds) or 1.0)
    axes[1].set(yscale="log", ylim=(1, min(2 * longest, 3e3)))
    axes[1].yaxis.set_major_formatter(FuncFormatter(lambda value, place: f"{value:g}"))
    axes[2].set_ylim(0, top)


def _shapes(figure: SubFigure, curves: DispersionCurves, at: float) -> None:
    """Draw the displacement of the least evanescent modes over depth, in phase with the surface."""
    axes = figure.subplots(2, 1, sharex=True, sharey=True)
    number = int(np.argmin(np.abs(curves.frequencies - at)))
    known = [n for n, mode in enumerate(curves.modes) if mode.kinds[number]]
    known.sort(key=lambda n: abs(curves.modes[n].wavenumbers[number].imag))
    for n in sorted(known[:4]):
        shape = curves.modes[n].shapes[number]
        turned = shape * np.exp(-1j * np.angle(shape[0, 1])) / np.abs(shape).max()
        pale = 1.0 if curves.modes[n].is_wave[number] else PALE
        for ax, part in zip(axes, (turned[:, 1].real, turned[:, 0].real), strict=True):
            ax.plot(part, 1e3 * curves.depths, color=mode_colour(n), lw=2, alpha=pale)
    titles = (f"shapes at {curves.frequencies[number]:.0f} Hz: into the body", "along the surface")
    for ax, title in zip(axes, titles, strict=True):
        ax.set_title(title, fontsize="medium")
        ax.axvline(0, color="0.6", lw=0.8, zorder=0)
        ax.set(xlim=(-1.05, 1.05), xticks=(-1, 0, 1), ylim=(1e3 * curves.depths[-1], 0))
        ax.set_ylabel("depth, mm")
        ax.grid(alpha=0.25)
    axes[-1].set_xlabel("displacement over the largest of the mode")
