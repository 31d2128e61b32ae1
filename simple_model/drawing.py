"""Axes, curves and small pages of records that show themselves.

matplotlib is imported where something is drawn, not before.
"""

from base64 import b64encode
from collections.abc import Callable, Iterable, Sequence
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np

from simple_model.typing import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NAMED = 8  # curves that a legend names, the outermost among them
PROBES = "probes at (x, y) in mm"  # title of their legend
ENTRY = 0.105  # inch for each point of the letters: width of an entry
DPI = 100  # of a small figure on a page
SMALLER, SMALLEST = 5 / 6, 8.0  # of letters beside those of axes; points, of any letter
CELL = "padding:0.1em 0.8em 0.1em 0;text-align:left;vertical-align:top"


def new_axes(ax: "Axes | None") -> "Axes":
    """The given axes, or those of a new figure of pyplot's."""
    if ax is not None:
        return ax
    import matplotlib.pyplot as plt

    return plt.subplots(layout="constrained")[1]


def small() -> float:
    """Size in points of letters that are smaller than those of axes, as far as these are large."""
    import matplotlib as mpl

    return max(SMALLER * float(mpl.rcParams["font.size"]), SMALLEST)


def place_name(place: Floats) -> str:
    """A place (2,) or (3,) in metre as text, its numbers in mm."""
    return f"({', '.join(f'{1e3 * x:.4g}' for x in place)})"


def curves(ax: "Axes", x: Floats, values: Floats, places: Floats, **style: Any) -> None:
    """Draw a curve of values (k, p) along x (k,) for each probe, at places (p, 2) in metre, from
    dark to bright, with a legend of at most `NAMED` of them.
    """
    import matplotlib as mpl

    count = values.shape[1]
    colours = mpl.colormaps["viridis"](np.linspace(0, 0.88, count))
    named = set(np.linspace(0, count - 1, min(count, NAMED)).round().astype(int).tolist())
    for k in range(count):
        label = place_name(places[k]) if k in named else None
        ax.plot(x, values[:, k], color=colours[k], label=label, **{"lw": 1.2, **style})
    inch = ax.get_window_extent().width / ax.figure.get_dpi()
    columns = max(1, min(len(named), int(inch / (ENTRY * mpl.rcParams["font.size"]))))
    ax.legend(
        loc="lower left", bbox_to_anchor=(0, 1), ncols=columns, frameon=False,
        title=PROBES, alignment="left", fontsize=small(), borderaxespad=0.2, columnspacing=1.0,
        handlelength=1.2,
    )  # fmt: skip
    ax.grid(alpha=0.25)


def picture(draw: Callable[["Figure"], object], width: float, height: float) -> bytes:
    """PNG file of a figure of a width and height in inch, which a function draws."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    buffer = BytesIO()
    with mpl.rc_context({"font.size": 8}):
        figure = Figure(figsize=(width, height), layout="constrained")
        draw(figure)
        figure.savefig(buffer, format="png", dpi=DPI)
    return buffer.getvalue()


def table(rows: Iterable[Sequence[str]], header: Sequence[str] = ()) -> str:
    """Rows as a table of HTML, every cell as text."""

    def line(cells: Sequence[str], kind: str) -> str:
        return "".join(f'<{kind} style="{CELL}">{escape(cell)}</{kind}>' for cell in cells)

    head = f"<tr>{line(header, 'th')}</tr>" if header else ""
    body = "".join(f"<tr>{line(row, 'td')}</tr>" for row in rows)
    return f"<table>{head}{body}</table>"


def page(title: str, image: bytes, tables: Iterable[str], warnings: Iterable[str] = ()) -> str:
    """Small page in HTML of a record: a figure in PNG, if any, tables in HTML, and warnings."""
    shown = b64encode(image).decode()
    figure = f'<img alt="{escape(title)}" src="data:image/png;base64,{shown}">' if image else ""
    said = "".join(f"<li>{escape(sentence)}</li>" for sentence in warnings)
    warned = f"<p><b>Warnings</b></p><ul>{said}</ul>" if said else ""
    return f"<div><p><b>{escape(title)}</b></p>{figure}{''.join(tables)}{warned}</div>"
