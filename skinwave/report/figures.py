"""Figures for print and page (matplotlib): waveforms, spectra and spread, models overlaid."""

import re
import warnings
from collections.abc import Callable, Mapping
from functools import wraps
from io import BytesIO
from typing import Any, ParamSpec

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from simple_model import spectrum
from simple_model.drawing import small
from skinwave.report.palette import colour, drawn_as, inked, label
from skinwave.report.styles import NARROW, SHOWN, STYLES, TEXT, Style
from skinwave.results.run import Run
from skinwave.typing import Floats

P = ParamSpec("P")
REPORT = STYLES["report"]
# Titles of the columns of a Tacton's figure.
WHOLE = (
    "waveform about its mean, over the model's largest",
    "spectrum, dB re the model's largest line",
)
WRAPPED = ("waveform about its mean,\nover the largest", "spectrum, dB re\nlargest line")
NAME, GAP = 0.45, 0.3  # of a letter of a line's name, and between two names, over their size
LAID_OUT = 1.2  # width of a panel with the margins of a figure, over that before
IN_A_ROW = 3  # entries of a legend, at most
LETTER, HANDLE = 0.07, 0.5  # inch: of a letter of a legend, and of a handle with its space
FLOOR = -80.0  # dB
HIGHEST = 650.0  # Hz shown
SETTLE = 0.25  # of the response, before which it is not looked at


def png(figure: Figure, dpi: int = 110) -> bytes:
    """The figure as a PNG file in memory."""
    return drawn(figure, "png", dpi)


def drawn(figure: Figure, kind: str, dpi: int = 110) -> bytes:
    """The figure as a file in memory: "png", "svg" or "pdf", whose text stays text."""
    buffer = BytesIO()
    figure.dpi = dpi
    with warnings.catch_warnings(), mpl.rc_context(TEXT):
        # A name in letters that the font lacks is shown as boxes.
        warnings.filterwarnings("ignore", "Glyph")
        if engine := figure.get_layout_engine():  # once, and not anew for each kind of file
            engine.execute(figure)
            figure.set_layout_engine(None)
        figure.savefig(buffer, format=kind, dpi=dpi)
    return buffer.getvalue()


def styled(draw: Callable[P, Figure]) -> Callable[P, Figure]:
    """A function that draws a figure by the settings of the `Style` among its arguments, or of
    those of a report.
    """

    @wraps(draw)
    def drawing(*args: P.args, **kwargs: P.kwargs) -> Figure:
        given = [each for each in (*args, *kwargs.values()) if isinstance(each, Style)]
        with mpl.rc_context([*given, REPORT][0].rc):
            return draw(*args, **kwargs)

    return drawing


@styled
def tacton_figure(title: str, runs: list[Run], style: Style = REPORT) -> Figure:
    """Waveform and spectrum at each probe, all models overlaid."""
    probes, narrow = runs[0].response.probes, style.is_narrow
    size = style.size(10.5, 1.25 * len(probes) + 1.3)
    figure = Figure(figsize=(size[0], 0.75 * len(probes) + 1.6) if narrow else size)
    axes = figure.subplots(len(probes), 2, sharex="col", sharey="col", squeeze=False)
    for p, (x, y) in enumerate(probes):
        _waveforms(axes[p, 0], runs, p)
        _spectra(axes[p, 1], runs, p, named=p == 0 and not narrow)
        axes[p, 0].set_ylabel(f"({1e3 * x:g}, {1e3 * y:g}) mm", fontweight="bold")
    said = WRAPPED if narrow else WHOLE
    axes[0, 0].set_title(f"{title}\n{said[0]}", fontsize="medium", parse_math=False)
    axes[0, 1].set_title(said[1], fontsize="medium")
    axes[-1, 0].set_xlabel("time, ms")
    axes[-1, 1].set_xlabel("frequency, Hz")
    rows = _legend(figure, runs)
    # Fixed margins: a computed layout takes twice as long.
    inch = style.zoom / figure.get_figheight()
    left, right, between, top = (0.2, 0.97, 0.32, 0.75) if narrow else (0.08, 0.99, 0.14, 0.6)
    figure.subplots_adjust(
        left, 0.55 * inch, right, 1 - (top + 0.2 * rows) * inch, wspace=between, hspace=0.13
    )
    if narrow:
        axes[0, 1].set_yticks(np.arange(FLOOR, 1, 40))
    return figure


def panels(count: int, style: Style, width: float) -> tuple[Figure, list[Axes]]:
    """A figure and axes of so many maps in mm side by side, below each other in a narrow figure;
    `width` inch of each with its colour bar, at letters of 10 points.
    """
    size = style.size(width * count, 0.85 * width + 0.4 + 0.1 * count)
    if style.is_narrow:
        size = size[0], 0.8 * size[0] * count + 0.6
    figure = Figure(figsize=size, layout="compressed")
    shape = (count, 1) if style.is_narrow else (1, count)
    axes = figure.subplots(*shape, sharex=True, sharey=True, squeeze=False).ravel()
    for ax in axes[-1:] if style.is_narrow else axes:
        ax.set_xlabel("x, mm")
    for ax in axes if style.is_narrow else axes[:1]:
        ax.set_ylabel("y, mm")
    return figure, list(axes)


def legend(
    figure: Figure, entries: Mapping[str, Mapping[str, Any]], columns: int = 0, **placed: Any
) -> int:
    """A legend below a figure, or where it is `placed`, of labels and the properties of their
    lines; in one row, or below each other in a narrow figure, if no number of columns is given. The
    number of its rows.
    """
    handles = [Line2D([], [], **entry) for entry in entries.values()]
    columns = columns or (1 if figure.get_figwidth() < NARROW else max(len(entries), 1))
    usual: dict[str, Any] = {"loc": "outside lower center", "fontsize": small(), "frameon": False}
    if "loc" not in placed:
        usual |= {"handlelength": 1.5, "columnspacing": 1.2}
    figure.legend(handles, list(entries), ncols=columns, **(usual | placed))
    return -(-len(entries) // columns)


def answered(run: Run) -> str:
    """The name of a body and of the model of its response."""
    alone = run.body in ("none", run.model)
    return label(run.column) if alone else f"{label(run.body)} ({run.model})"


def _legend(figure: Figure, runs: list[Run]) -> int:
    """One entry a model above the figure, with what 1 on the waveform axis stands for; the number
    of rows.
    """
    entries: dict[str, dict[str, Any]] = {}
    for run in runs:
        scale = run.response.record.text(_largest(run, runs))
        entries[f"{answered(run)}, 1 = {scale}"] = {**drawn_as(run.column), "lw": 2}
    if kinds := dict.fromkeys(peak.kind for run in runs for peak in run.unnamed):
        entries[f"open: {', '.join(kinds)}"] = {
            "color": "0.3", "marker": "^", "mfc": "none", "ls": ""
        }  # fmt: skip
    columns = len(entries) if len(entries) <= IN_A_ROW else -(-len(entries) // 2)
    room = int(figure.get_figwidth() / (LETTER * max(map(len, entries)) + HANDLE))
    columns = 1 if figure.get_figwidth() < NARROW else max(1, min(columns, room))
    return legend(figure, entries, columns, loc="upper center", fontsize=None)


def _shown(run: Run, runs: list[Run]) -> slice:
    """The part that is shown: the last that all have, whose records may begin at other times."""
    times = run.response.times
    end = min(float(other.response.times[-1]) for other in runs)
    if end - SHOWN < times[0]:
        end = max(float(times[0]) + SHOWN, end)
    last = int(np.searchsorted(times, end + 0.5 * (times[1] - times[0])))
    return slice(max(0, last - 1 - round(SHOWN / (times[1] - times[0]))), last)


def _largest(run: Run, runs: list[Run]) -> float:
    """Largest excursion about the mean at any probe in the part that is shown."""
    return float(np.abs(_centred(run, runs)).max()) or 1.0


def _centred(run: Run, runs: list[Run]) -> Floats:
    """Motion (t, p) in the part that is shown, about its mean after the start."""
    motion = run.response.values
    return motion[_shown(run, runs)] - motion[int(SETTLE * len(motion)) :].mean(axis=0)


def _waveforms(ax: Axes, runs: list[Run], p: int) -> None:
    for run in runs:
        centred = _centred(run, runs)[:, p] / _largest(run, runs)
        times = 1e3 * run.response.times[_shown(run, runs)]
        ax.plot(times, centred, color=inked(run.column), lw=_width(run), zorder=_depth(run))
    ax.margins(x=0)
    ax.xaxis.set_major_locator(MaxNLocator(4, prune="both"))
    ax.set_ylim(-1.1, 1.1)
    ax.grid(alpha=0.25)


def _spectra(ax: Axes, runs: list[Run], p: int, *, named: bool) -> None:
    for run in runs:
        f, amplitude = spectrum(run.response, "blackmanharris")
        moving = f > 8.0  # the mean and its leakage are no vibration
        top = max(float(amplitude[moving].max()), np.finfo(float).tiny)
        level = 20 * np.log10(np.maximum(amplitude[moving, p] / top, 1e-12))
        style = {**drawn_as(run.column), "zorder": _depth(run)}
        ax.plot(f[moving], level, lw=_width(run) - 0.3, alpha=0.6, **(style | {"marker": ""}))
        lines = [(f, run.table.amplitudes[name][p]) for name, f in run.listed.items()]
        peaks = [(peak.frequency, peak.amplitudes[p]) for peak in run.unnamed]
        for found, mfc in ((lines, colour(run.column)), (peaks, "none")):
            at, size = np.array(found).reshape(-1, 2).T  # a constant pressure has none
            height = 20 * np.log10(np.maximum(size / top, 1e-12))
            seen = height > FLOOR
            ax.plot(at[seen], height[seen], ls="", ms=4, mfc=mfc, **style)
    ax.set_xlim(0, HIGHEST)
    ax.set_ylim(FLOOR, 14)
    ax.set_yticks(np.arange(FLOOR, 1, 20))
    ax.grid(alpha=0.25)
    if named:
        _name_lines(ax, runs[0].frequencies)


def _name_lines(ax: Axes, frequencies: Mapping[str, float]) -> None:
    """Names of the lines that claims are about, as far as they have room."""
    points, marked = small(), list[tuple[float, float]]()  # places and half widths, Hz
    share = LAID_OUT * ax.get_position().width
    panel = 72 * share * ax.figure.get_figwidth()  # type: ignore[union-attr]
    for name in ("f_AM", "2f_AM", "f_d", "2f_d", "3f_d"):
        frequency = frequencies.get(name, HIGHEST)
        half = (NAME * len(name) + GAP) * points / panel * HIGHEST / 2
        if frequency < HIGHEST and not any(abs(frequency - f) < half + w for f, w in marked):
            marked.append((frequency, half))
            ax.axvline(frequency, color="0.6", lw=0.8, ls=":", zorder=0)
            box = {"fc": mpl.rcParams["axes.facecolor"], "ec": "none", "pad": 0.5}
            ax.text(frequency, 12, written(name), ha="center", va="top", fontsize=points, bbox=box)


def written(name: str) -> str:
    """A line's name as it is written in formulas."""
    name = re.sub(r"f_([A-Za-z0-9]+)", r"f_{\1}", name)
    return f"${name}$"


def _width(run: Run) -> float:
    return 1.0 if run.body == "none" else 1.4


def _depth(run: Run) -> int:
    return 4 if run.body == "none" else 3
