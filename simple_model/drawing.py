"""Axes, curves and small HTML pages for records that draw themselves.

matplotlib is imported only where something is drawn.
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


def new_axes(ax: "Axes | None") -> "Axes":
    """Return the given axes, or those of a new pyplot figure."""
    if ax is not None:
        return ax
    import matplotlib.pyplot as plt

    return plt.subplots(layout="constrained")[1]


def small() -> float:
    """Font size in points of text smaller than the labels of axes."""
    import matplotlib as mpl

    return max(5 / 6 * float(mpl.rcParams["font.size"]), 8.0)


def place_name(place: Floats) -> str:
    """Format a place (2,) or (3,) in m as text, in mm."""
    return f"({', '.join(f'{1e3 * x:.4g}' for x in place)})"


def curves(
    ax: "Axes", x: Floats, values: Floats, places: Floats, *, most_named: int = 8, **style: Any
) -> None:
    """Draw values (k, p) over x (k,), one curve for each probe at places (p, 2) in m, from dark to
    bright. The legend names `most_named` of them, the outermost among them.
    """
    import matplotlib as mpl

    count = values.shape[1]
    colours = mpl.colormaps["viridis"](np.linspace(0, 0.88, count))
    named = set(np.linspace(0, count - 1, min(count, most_named)).round().astype(int).tolist())
    for k in range(count):
        label = place_name(places[k]) if k in named else None
        ax.plot(x, values[:, k], color=colours[k], label=label, **{"lw": 1.2, **style})
    inch = ax.get_window_extent().width / ax.figure.get_dpi()
    entry = 0.105 * mpl.rcParams["font.size"]  # inch
    columns = max(1, min(len(named), int(inch / entry)))
    ax.legend(
        loc="lower left", bbox_to_anchor=(0, 1), ncols=columns, frameon=False,
        title="probes at (x, y) in mm", alignment="left", fontsize=small(), borderaxespad=0.2,
        columnspacing=1.0, handlelength=1.2,
    )  # fmt: skip
    ax.grid(alpha=0.25)


def picture(draw: Callable[["Figure"], object], width: float, height: float) -> bytes:
    """Return the PNG file of a figure that a function draws; width and height in inches."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    buffer = BytesIO()
    with mpl.rc_context({"font.size": 8}):
        figure = Figure(figsize=(width, height), layout="constrained")
        draw(figure)
        figure.savefig(buffer, format="png", dpi=100)
    return buffer.getvalue()


def table(rows: Iterable[Sequence[str]], header: Sequence[str] = ()) -> str:
    """Format rows as an HTML table, every cell as text."""
    style = "padding:0.1em 0.8em 0.1em 0;text-align:left;vertical-align:top"

    def line(cells: Sequence[str], kind: str) -> str:
        return "".join(f'<{kind} style="{style}">{escape(cell)}</{kind}>' for cell in cells)

    head = f"<tr>{line(header, 'th')}</tr>" if header else ""
    body = "".join(f"<tr>{line(row, 'td')}</tr>" for row in rows)
    return f"<table>{head}{body}</table>"


def page(title: str, image: bytes, tables: Iterable[str], warnings: Iterable[str] = ()) -> str:
    """Format a record as a small HTML page: a PNG figure, if any, HTML tables, and warnings."""
    data = b64encode(image).decode()
    figure = f'<img alt="{escape(title)}" src="data:image/png;base64,{data}">' if image else ""
    items = "".join(f"<li>{escape(sentence)}</li>" for sentence in warnings)
    warned = f"<p><b>Warnings</b></p><ul>{items}</ul>" if items else ""
    return f"<div><p><b>{escape(title)}</b></p>{figure}{''.join(tables)}{warned}</div>"
