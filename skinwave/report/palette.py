"""Colours, markers and names of bodies and models, the same in every picture.

Colours are Okabe and Ito's, distinguishable with every kind of colour vision.
"""

from typing import Any

import matplotlib as mpl

from skinwave.models.point_kernel import PUBLISHED, SAME_LOAD

BLUE, ORANGE = "#0072B2", "#D55E00"
SPARE = ("#009E73", "#CC79A7", "#E69F00", "#56B4E9")
SERIES = (BLUE, ORANGE, *SPARE)  # of other curves
COLUMNS = {  # label, colour and marker of each `Run.column` that has its own
    SAME_LOAD.name: (SAME_LOAD.label, SAME_LOAD.colour, "o"),
    PUBLISHED.name: (PUBLISHED.label, PUBLISHED.colour, "x"),
    "paper-sheet": ("paper sheet", ORANGE, "s"),
    "paper-sheet-loose": ("loose sheet", "", "^"),
    "skin-slab": ("skin slab", BLUE, "^"),
    "palm": ("palm", SPARE[0], "^"),
    "measured": ("measured", "#CC79A7", "D"),
}
SIGNED, SEQUENTIAL = "RdBu_r", "cividis"  # colour maps of quantities with and without a sign


def colour(column: str) -> str:
    """Return the colour of a `Run.column`."""
    return COLUMNS.get(column, ("", ""))[1] or SPARE[sum(map(ord, column)) % len(SPARE)]


def ink_colour(column: str) -> str:
    """Return the colour of a `Run.column`; the ink of the style instead of black."""
    own = colour(column)
    return str(mpl.rcParams["text.color"]) if own == "#000000" else own


def marker(column: str) -> str:
    """Return the marker of a `Run.column`."""
    return COLUMNS[column][2] if column in COLUMNS else "^"


def line_style(column: str) -> dict[str, Any]:
    """Return colour and marker of a `Run.column` as properties of a line."""
    return {"color": ink_colour(column), "marker": marker(column)}


def dashes(column: str) -> Any:
    """Return the dashes of the waveform of a `Run.column`, for print in grey."""
    return (0, (5, 1)) if column == "paper-sheet" else "solid"


def label(column: str) -> str:
    """Return the name of a `Run.column` in legends and tables."""
    return COLUMNS[column][0] if column in COLUMNS else column
