"""Colours, markers and names of bodies and models, the same in every picture.

Colours are Okabe and Ito's, distinguishable with every kind of colour vision.
"""

from typing import Any

import matplotlib as mpl

from skinwave.models.point_kernel import PUBLISHED, SAME_LOAD

BLUE, ORANGE = "#0072B2", "#D55E00"
SPARE = ("#009E73", "#CC79A7", "#E69F00", "#56B4E9")
SERIES = (BLUE, ORANGE, *SPARE)  # of other curves
COLOURS = {
    **{model.name: model.colour for model in (SAME_LOAD, PUBLISHED)},
    "paper-sheet": ORANGE,
    "skin-slab": BLUE,
    "palm": SPARE[0],
    "measured": "#CC79A7",
}
SIGNED, SEQUENTIAL = "RdBu_r", "cividis"  # colour maps of quantities with and without a sign


def colour(column: str) -> str:
    """Return the colour of a `Run.column`."""
    return COLOURS.get(column) or SPARE[sum(map(ord, column)) % len(SPARE)]


def ink_colour(column: str) -> str:
    """Return the colour of a `Run.column`; the ink of the style instead of black."""
    own = colour(column)
    return str(mpl.rcParams["text.color"]) if own == "#000000" else own


def marker(column: str) -> str:
    """Return the marker of a `Run.column`."""
    markers = {SAME_LOAD.name: "o", PUBLISHED.name: "x", "paper-sheet": "s", "measured": "D"}
    return markers.get(column, "^")


def line_style(column: str) -> dict[str, Any]:
    """Return colour and marker of a `Run.column` as properties of a line."""
    return {"color": ink_colour(column), "marker": marker(column)}


def dashes(column: str) -> Any:
    """Return the dashes of the waveform of a `Run.column`, for print in grey."""
    return (0, (5, 1)) if column == "paper-sheet" else "solid"


def label(column: str) -> str:
    """Return the name of a `Run.column` in legends and tables."""
    by_name = {
        **{model.name: model.label for model in (SAME_LOAD, PUBLISHED)},
        "paper-sheet": "paper sheet",
        "paper-sheet-loose": "loose sheet",
        "skin-slab": "skin slab",
    }
    return by_name.get(column, column)
