"""Styles of pictures for a report, a talk or a printed page."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

from simple_model.choices import choose

# Settings for writing files: text as text in SVG, TrueType fonts in PDF.
TEXT: Any = {"svg.fonttype": "none", "pdf.fonttype": 42, "ps.fonttype": 42}
SHOWN = 0.030  # s of waveform shown, at the end of the Tacton


@dataclass(frozen=True, kw_only=True)
class Style:
    """Style of pictures: colours of paper and ink, font size in points, dots per inch, and widths
    in inches of one and of two columns of a printed page, or None for a screen.

    Pictures in three dimensions have `panel` pixels for each model on a screen, and `screen` pixels
    of width in all. On a `page` in inches, their letters have `solid_font` points. The colour bar
    is `bar` times as wide as the picture is high.
    """

    paper: str = "#ffffff"
    ink: str = "#222222"
    font: float = 10.0
    dpi: int = 110
    columns: tuple[float, float] | None = None
    panel: tuple[int, int] = (480, 432)
    screen: int = 1600
    page: float = 7.0
    solid_font: float = 8.0
    bar: float = 0.26

    @property
    def zoom(self) -> float:
        """Font size over 10 points."""
        return self.font / 10

    @property
    def is_narrow(self) -> bool:
        """Whether figures have one column of panels."""
        return self.columns is not None and is_narrow(max(self.columns))

    def pixels(self, inch: float) -> int:
        """Return the width in pixels of a picture that is `inch` wide in print."""
        return round(inch * self.dpi) if self.columns else self.screen

    def letter(self, width: int, inch: float) -> float:
        """Return the pixels of a letter of a picture that is `width` pixels and `inch` wide."""
        return self.solid_font / 72 * width / inch

    def size(self, width: float, height: float) -> tuple[float, float]:
        """Return the size in inches of a figure that has a given size with letters of 10 points."""
        if self.columns is None:
            return width * self.zoom, height * self.zoom
        one_column = 6.5  # inch, with letters of 10 points: wider figures span two columns in print
        column = self.columns[width > one_column]
        return column, column * height / width

    @property
    def rc(self) -> Any:
        """Settings of matplotlib."""
        inks = ("text.color", "axes.labelcolor", "axes.edgecolor", "xtick.color", "ytick.color")
        papers = ("figure.facecolor", "axes.facecolor", "savefig.facecolor")
        titles = ("axes.titlesize", "figure.titlesize") if self.columns else ()
        return {
            "font.size": self.font,
            **dict.fromkeys(titles, "medium"),
            **dict.fromkeys(inks, self.ink),
            **dict.fromkeys(papers, self.paper),
        }


def is_narrow(inch: float) -> bool:
    """Whether a figure of this width has one column of panels."""
    return inch < 5.0


STYLES = {
    "report": Style(),
    "talk": Style(paper="#15181c", ink="#f2f2f2", font=14.0, dpi=107, panel=(640, 576)),
    "print": Style(ink="#000000", font=8.0, dpi=300, columns=(3.5, 7.0)),
}


def style(name: str, width: float | None = None) -> Style:
    """Return a style by name.

    With a width in inches, all figures have this width and the letters of print, in the colours of
    the named style. Raises a ValueError if the style is unknown or the width out of range.
    """
    chosen = STYLES[choose("style", name, STYLES)]
    if width is None:
        return chosen
    narrowest, widest = 2.0, 15.0  # inch, of a figure
    if not narrowest <= width <= widest:
        raise ValueError(
            f"width = {width:g} inch must be {narrowest:g} to {widest:g} inch. One column of a "
            "journal is 3.5 inch wide, two columns are 7 inch wide"
        )
    return replace(STYLES["print"], columns=(width, width), ink=chosen.ink, paper=chosen.paper)


@contextmanager
def paper(width: float = 3.5, height: float | None = None) -> Iterator[None]:
    """Context manager with settings of matplotlib for figures of a paper.

    Letters have 8 points, subscripts 5.6 points. Files have 300 dots per inch, TrueType fonts in
    PDF, and text as text in SVG. Draw and save figures within the context.

    Parameters
    ----------
    width : float, inches
    height : float, inches, 0.7 times the width by default

    Raises a ValueError if the width is out of range.

    >>> import matplotlib, skinwave
    >>> with skinwave.paper(width=7.0, height=3.0):
    ...     matplotlib.rcParams["figure.figsize"]
    [7.0, 3.0]
    """
    import matplotlib as mpl

    chosen = style("print", width)
    size: Any = {"figure.figsize": (width, height or 0.7 * width), "savefig.dpi": chosen.dpi}
    thin: Any = {"axes.linewidth": 0.6, "lines.markersize": 4.0}
    with mpl.rc_context({**chosen.rc, **TEXT, **size, **thin}):
        yield
