"""How pictures are dressed for a report, a talk or a printed page."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

from simple_model.choices import choose

# Read when a file is written: text as text in SVG, and TrueType fonts in PDF, none of Type 3.
TEXT: Any = {"svg.fonttype": "none", "pdf.fonttype": 42, "ps.fonttype": 42}
SHOWN = 0.030  # s of waveform shown, at the end of the Tacton
NARROWEST, WIDEST = 2.0, 15.0  # inch of a figure
NARROW = 5.0  # inch: narrower figures have one column of panels
ONE_COLUMN = 6.5  # inch of letters of 10 points: wider figures take two columns in print


@dataclass(frozen=True, kw_only=True)
class Style:
    """Colours of `paper` and `ink`, `font` size in points, `dpi`; `columns`, the widths in inch of
    one column of a printed page and of two, if figures are to have these; in three dimensions the
    `panel` in pixels (width, height) of one model, and how much finer it is drawn, `oversampling`.
    """

    paper: str = "#ffffff"
    ink: str = "#222222"
    font: float = 10.0
    dpi: int = 110
    columns: tuple[float, float] | None = None
    panel: tuple[int, int] = (480, 432)
    oversampling: int = 1

    @property
    def zoom(self) -> float:
        """How large letters are, over those of 10 points."""
        return self.font / 10

    @property
    def is_narrow(self) -> bool:
        """Whether no column has room for two panels beside each other: they stand in one."""
        return self.columns is not None and max(self.columns) < NARROW

    def size(self, width: float, height: float) -> tuple[float, float]:
        """Width and height in inch of a figure that would be so large with letters of 10 points."""
        if self.columns is None:
            return width * self.zoom, height * self.zoom
        column = self.columns[width > ONE_COLUMN]
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


STYLES = {
    "report": Style(),
    "talk": Style(paper="#15181c", ink="#f2f2f2", font=14.0, dpi=107, panel=(640, 576)),
    "print": Style(ink="#000000", font=8.0, dpi=300, columns=(3.5, 7.0), oversampling=2),
}


def style(name: str, width: float | None = None) -> Style:
    """A style by its name; with a width in inch that of print, all figures of that width, on the
    paper and with the ink of its name. A ValueError if it is unknown, or no width of a page.
    """
    chosen = STYLES[choose("style", name, STYLES)]
    if width is None:
        return chosen
    if not NARROWEST <= width <= WIDEST:
        raise ValueError(
            f"width = {width:g} inch is outside {NARROWEST:g}..{WIDEST:g}; one column of a journal "
            "is 3.5 inch, two are 7"
        )
    return replace(STYLES["print"], columns=(width, width), ink=chosen.ink, paper=chosen.paper)


@contextmanager
def paper(width: float = 3.5, height: float | None = None) -> Iterator[None]:
    """Settings of matplotlib for figures of a paper: this width and height in inch (0.7 of the
    width if not given), letters of 8 points (subscripts of 5.6), 300 dots an inch, TrueType fonts
    in PDF and text as text in SVG, drawn and saved within.
    """
    import matplotlib as mpl

    chosen = style("print", width)
    size: Any = {"figure.figsize": (width, height or 0.7 * width), "savefig.dpi": chosen.dpi}
    thin: Any = {"axes.linewidth": 0.6, "lines.markersize": 4.0}
    with mpl.rc_context({**chosen.rc, **TEXT, **size, **thin}):
        yield
