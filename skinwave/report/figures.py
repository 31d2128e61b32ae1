"""Drawing helpers that all figures share (matplotlib): styles, files, legends, names of lines."""

import re
import warnings
from collections.abc import Callable, Mapping
from functools import wraps
from io import BytesIO
from typing import Any, ParamSpec

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from simple_model.drawing import small
from skinwave.report.palette import label
from skinwave.report.styles import STYLES, TEXT, Style, is_narrow
from skinwave.results.run import Run

P = ParamSpec("P")
REPORT = STYLES["report"]
LINE_STYLE: dict[str, Any] = {"color": "0.6", "lw": 0.8, "ls": ":", "zorder": 0}


def png(figure: Figure, dpi: int = 110) -> bytes:
    """Return a figure as a PNG file."""
    return figure_file(figure, "png", dpi)


def figure_file(figure: Figure, kind: str, dpi: int = 110) -> bytes:
    """Return a figure as a "png", "svg" or "pdf" file, with text as text."""
    buffer, figure.dpi = BytesIO(), dpi
    with warnings.catch_warnings(), mpl.rc_context(TEXT):
        warnings.filterwarnings("ignore", "Glyph")  # letters that the font lacks become boxes
        if engine := figure.get_layout_engine():  # lay out once for all kinds
            engine.execute(figure)
            figure.set_layout_engine(None)
        figure.savefig(buffer, format=kind, dpi=dpi)
    return buffer.getvalue()


def with_style(draw: Callable[P, Figure]) -> Callable[P, Figure]:
    """Decorate a drawing function so that it uses the `Style` among its arguments, or `REPORT`."""

    @wraps(draw)
    def drawing(*args: P.args, **kwargs: P.kwargs) -> Figure:
        given = [each for each in (*args, *kwargs.values()) if isinstance(each, Style)]
        with mpl.rc_context([*given, REPORT][0].rc):
            return draw(*args, **kwargs)

    return drawing


def panels(count: int, style: Style, width: float) -> tuple[Figure, list[Axes]]:
    """Return a figure and axes of `count` maps in mm: in a row, or in a column if it is narrow.

    `width` is that of a map with its colour bar, in inches, for letters of 10 points.
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
    figure: Figure, entries: Mapping[str, Mapping[str, Any]], columns: int = 0, **options: Any
) -> int:
    """Add a legend of labels and line properties to a figure and return its number of rows.

    By default it is below the figure, in one row, or in one column if the figure is narrow.
    """
    handles = [Line2D([], [], **entry) for entry in entries.values()]
    names = [re.sub(r"(?<![\w$])-(?=\d)", "\u2212", name) for name in entries]
    columns = columns or (1 if is_narrow(figure.get_figwidth()) else max(len(entries), 1))
    usual: dict[str, Any] = {"loc": "outside lower center", "fontsize": small(), "frameon": False}
    if "loc" not in options:
        usual |= {"handlelength": 1.5, "columnspacing": 1.2}
    figure.legend(handles, names, ncols=columns, **(usual | options))
    return -(-len(entries) // columns)


def run_label(run: Run) -> str:
    """Return the names of a body and of the model of its response."""
    alone = run.body in ("none", run.model)
    return label(run.column) if alone else f"{label(run.body)} ({run.model})"


def line_symbol(name: str) -> str:
    """Return a line's name as a formula of matplotlib."""
    return "$" + re.sub(r"f_([A-Za-z0-9]+)", r"f_{\1}", name) + "$"


def name_size(least_subscript: float = 7.0) -> float:
    """Return the font size in points of names of lines, whose subscripts are 0.7 times as large."""
    return max(small(), least_subscript / 0.7)


def rows_height(rows: int) -> float:
    """Return the height in points of rows of names of lines above a panel."""
    return 1.45 * rows * name_size()


def name_lines(ax: Axes, lines: Mapping[str, float], width: float, rows: int = 1) -> None:
    """Write names of lines above a panel that is `width` points wide, in a few rows.

    `lines` are frequencies in Hz by name. The first lines that have room are named and marked.
    """
    size, occupied = name_size(), [list[tuple[float, float]]() for _ in range(rows)]
    to_axes = ax.transScale + ax.transLimits
    for name, frequency in lines.items():
        subscripts = sum(map(len, re.findall(r"_(\w+)", name)))
        signs = len(re.findall(r"[-+]", name))  # which have a space on both sides
        letters = len(name.replace("_", "")) - 0.3 * subscripts + signs
        half = size * (0.55 * letters + 0.5) / 2  # a letter of 0.55 sizes, and a gap
        middle = width * to_axes.transform((frequency, 1.0))[0]
        low, high = middle - half, middle + half
        is_free = [all(high < a or b < low for a, b in others) for others in occupied]
        row = is_free.index(True) if any(is_free) else None
        if row is None or not (0 <= middle <= width and high <= width + 2 * size):
            continue
        occupied[row].append((low, high))
        ax.axvline(frequency, **LINE_STYLE)
        ax.annotate(
            line_symbol(name), (frequency, 1.0), (0, 2 + rows_height(row)),
            xycoords=("data", "axes fraction"), textcoords="offset points", ha="center",
            va="bottom", fontsize=size,
        )  # fmt: skip
