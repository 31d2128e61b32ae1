"""Figures of dispersion curves: speeds and 1/e lengths over frequency, mode shapes over depth."""

from collections.abc import Mapping, Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter

from meshes.tetmesh import Floats
from simple_model.drawing import small
from simple_model.layers.dispersion import DispersionCurves, Mode
from skinwave.report.figures import REPORT
from skinwave.report.levels import written
from skinwave.report.palette import SERIES
from skinwave.report.styles import Style

FINE = 600  # frequencies of a drawn curve
PALE = 0.35  # opacity of a curve where its mode is evanescent
ROWS = 3  # of the names of lines above the panels, two in a narrow figure
LETTER, GAP, LINE = 0.55, 0.7, 1.45  # width of their letters, between two, and of a row, over size
HANDLE, WRITTEN = 3.7, 0.52  # widths in the legend, over its size: beside a label, of its letters
SHARE = 0.68  # of a figure's width for the curves, where the shapes are beside them
WIDE, TIGHT = 5.6, 2.8  # inch: narrower figures in print have one column, and titles in two rows
TALL = {True: 6.8, False: 4.9}  # inch, height of such a figure of a body with a depth, without
MOST_SHAPES = 4
LABELS = (
    ("phase speed", "ω / |Re k|, m/s"), ("1/e length", "1 / |Im k|, mm"),
    ("group speed", "dω / d Re k, m/s"),
)  # fmt: skip


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
    between = "\n" if style.columns else " "  # letters of print are large beside its figures
    with mpl.rc_context(style.rc):
        figure, left, right, width = _parts(style, thick=len(curves.depths) > 2)
        axes = left.subplots(3, 1, sharex=True, height_ratios=(1.25, 1, 1))
        _speeds(axes[0], curves, focus_speed)
        _decay(axes[1], curves)
        _group(axes[2], curves)
        for ax, words in zip(axes, LABELS, strict=True):
            ax.set_xlim(0, curves.frequencies[-1])
            ax.set_ylabel(between.join(words))
            for frequency in lines.values():
                ax.axvline(frequency, color="0.55", lw=0.9, ls=":", zorder=0)
            ax.grid(alpha=0.25)
        _name_lines(axes[0], lines, width, ROWS - _is_narrow(style))
        axes[-1].set_xlabel("frequency, Hz")
        _legend(figure, curves, focus_speed)
        if right is not None:
            _shapes(right, curves, at, style)
    return figure


def _is_narrow(style: Style) -> bool:
    """Whether the shapes have room below the curves only."""
    return style.columns is not None and max(style.columns) < WIDE


def _parts(
    style: Style, *, thick: bool
) -> tuple[Figure, Figure | SubFigure, SubFigure | None, float]:
    """A figure, its parts for curves and, of a body with a depth, for shapes; and the width in
    points of the panels of the curves.
    """
    size = style.size(11.5 if thick else 8.5, 9.2 if style.columns else 8.4)
    narrow = _is_narrow(style)
    figure = Figure(figsize=(size[0], TALL[thick]) if narrow else size, layout="constrained")
    beside = 8 * style.font  # labels of the axis
    if not thick:
        return figure, figure, None, 72 * size[0] - beside
    if narrow:
        above, below = figure.subfigures(2, 1, squeeze=False, height_ratios=(2.1, 1))[:, 0]
        return figure, above, below, 72 * size[0] - beside
    left, right = figure.subfigures(1, 2, squeeze=False, width_ratios=(SHARE, 1 - SHARE))[0]
    return figure, left, right, 72 * SHARE * size[0] - beside


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


def _name_lines(ax: Axes, lines: Mapping[str, float], width: float, rows: int) -> None:
    """Names of lines above a panel of a width in points, the strongest that have room in rows."""
    size, taken = small(), [list[tuple[float, float]]() for _ in range(rows)]
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


def _legend(figure: Figure, curves: DispersionCurves, focus_speed: float) -> None:
    ink = mpl.rcParams["text.color"]
    handles = [Line2D([], [], color=colour(n), lw=2.2) for n in range(len(curves.modes))]
    labels = [mode.name for mode in curves.modes]
    handles.append(Line2D([], [], color=ink, lw=1, alpha=PALE))
    labels.append("evanescent")
    handles.append(Line2D([], [], color="0.55", lw=0.9, ls=":"))
    labels.append("lines of the load")
    if focus_speed:
        handles.append(Line2D([], [], color=ink, lw=1.2, ls="--"))
        labels.append(f"focus, {focus_speed:g} m/s")
    figure.legend(handles, labels, loc="outside lower center", fontsize=small(), handlelength=1.5,
                  columnspacing=1.0, ncols=_columns(labels, figure.get_figwidth()))  # fmt: skip


def _columns(labels: Sequence[str], width: float) -> int:
    """Columns of a legend of small letters that a figure of a width in inch has room for."""

    def needed(count: int) -> float:
        longest = (max(map(len, part)) for part in np.array_split(labels, count))
        return small() / 72 * sum(HANDLE + WRITTEN * letters for letters in longest)

    counts = range(min(len(labels), 5), 1, -1)
    return next((count for count in counts if needed(count) < width), 1)


def _shapes(figure: SubFigure, curves: DispersionCurves, at: float, style: Style) -> None:
    """Displacement over depth of the least evanescent modes, in phase with the surface."""
    narrow = _is_narrow(style)
    axes = figure.subplots(*(1, 2) if narrow else (2, 1), sharex=True, sharey=True)
    number = int(np.argmin(np.abs(curves.frequencies - at)))
    known = [n for n, mode in enumerate(curves.modes) if mode.kinds[number]]
    known.sort(key=lambda n: abs(curves.modes[n].wavenumbers[number].imag))
    for n in sorted(known[:MOST_SHAPES]):
        shape = curves.modes[n].shapes[number]
        turned = shape * np.exp(-1j * np.angle(shape[0, 1])) / np.abs(shape).max()
        pale = 1.0 if curves.modes[n].is_wave[number] else PALE
        for axis, part in ((0, turned[:, 1].real), (1, turned[:, 0].real)):
            axes[axis].plot(part, 1e3 * curves.depths, color=colour(n), lw=2, alpha=pale)
    said = f"shapes at {curves.frequencies[number]:.0f} Hz"
    between = "\n" if style.columns and (not narrow or max(style.columns) < TIGHT) else " "
    titles = (f"into{between}the body", f"along{between}the surface")
    if narrow:
        figure.suptitle(said)
        figure.supxlabel(f"displacement over the{between}largest of the mode", fontsize="medium")
    else:
        titles = (f"{said}:{between}into the body", "along the surface")
        axes[-1].set_xlabel(f"displacement over the{between}largest of the mode")
    for ax, title in zip(axes, titles, strict=True):
        ax.set_title(title, fontsize="medium")
        ax.axvline(0, color="0.6", lw=0.8, zorder=0)
        ax.set(xlim=(-1.05, 1.05), xticks=(-1, 0, 1), ylim=(1e3 * curves.depths[-1], 0))
        ax.grid(alpha=0.25)
    for ax in axes[:1] if narrow else axes:
        ax.set_ylabel("depth, mm")
