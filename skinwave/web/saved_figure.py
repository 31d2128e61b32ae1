"""The figure that a page saves: maps and plots as they are on the screen, in the style of print."""

import re
from math import ceil, hypot
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np

from skinwave.pictures.styles import paper, style
from skinwave.web.asked import numbers
from skinwave.web.saved_maps import CHARACTERS, area, axes, body, is_body, title_of

PLOTS = ("commanded_plot", "waveform_plot", "spectrum_plot")
MAPS = ("kernel_map", "wave_map", "pinned_map")
MARKS = ("path", "pinned_path", "influenced", "x", "y", "body")
# In inch.
LINE, PLOT_HIGH, LARGEST_MAP = 0.15, 1.25, 2.2
LEFT, RIGHT, BELOW, TITLE = 0.62, 0.72, 0.42, 0.2
MAP_LEFT, MAP_BELOW = 0.5, 0.7
ENTRY = 2.3  # inch of a name in a legend
DASHES = {"dash": (0, (5, 3)), "dot": (0, (1.2, 2))}
BAND, MIRRORED = 0.28, 0.4  # opacity, as on the page
# Points from a line to its name: to the right and up, the nearest first.
PLACES = sorted(((aside, up) for up in range(2, 70, 4) for aside in range(-48, 49, 8)),
                key=lambda place: hypot(*place))  # fmt: skip
SHEET = Path(__file__).with_name("static") / "skinwave.css"
View = dict[str, tuple[float, ...]]
VIEWED = {**dict.fromkeys(PLOTS, 2), "body": 5, "foci": 1}  # numbers that a page gives of each


def view_of(text: str) -> View:
    """Numbers of what a page alone knows of its view, such as "waveform_plot:10:20".

    Raises
    ------
    ValueError
        If it is no such text.
    """
    found = {}
    for part in text.split():
        name, *values = part.split(":")
        if VIEWED.get(name) != len(values):
            raise ValueError(f"'{part[:40]}' is no part of a view; reload the page")
        found[name] = numbers(*map(float, values))
    return found


def seen(session: Any, view: View) -> dict[str, Any]:
    """Plots, maps and marks on a session's screen; the moving body in place of the map of waves."""
    state = session.state
    found = {key: state[key] for key in (*PLOTS, *MAPS, *MARKS)}
    for key in PLOTS:
        low, high = view.get(key, (0.0, 0.0))
        if low < high:
            found[key] = found[key] | {"x": found[key]["x"] | {"range": [low, high]}}
    if state.waves_stale:
        found["wave_map"] = found["wave_map"] | {"said": "being computed"}
    solid = state.solid and session.waves is not None
    found["moving"] = session.waves.moving if solid else None
    found["view"] = view.get("body", (0.0, -0.5, 0.95, 1.0, 0.0))
    (phase,) = view.get("foci", (0.0,))
    found["foci"] = state.foci_track[int(phase) % len(state.foci_track)]
    return found


def figure_of(seen: dict[str, Any], kind: str, width: float) -> bytes:
    """The figure of what was `seen`, `width` inch wide, as a file of a kind."""
    from matplotlib.figure import Figure

    from skinwave.pictures.figures import drawn

    maps = [key for key in MAPS if seen[key]["picture"]]
    side = min(LARGEST_MAP, width / len(maps) - MAP_LEFT - 0.15)
    lines = max(title_of(seen[key], seen, side).count("\n") + 1 for key in maps)
    rows = [side + MAP_BELOW + LINE * lines + 0.1, *(_height(seen[key], width) for key in PLOTS)]
    with paper(width, sum(rows)):
        figure = Figure()
        colours = _colours(seen["body"])
        for k, key in enumerate(maps):
            corner = (k * width / len(maps) + MAP_LEFT, sum(rows[1:]) + MAP_BELOW)
            draw = body if is_body(seen[key], seen) else area
            draw(figure, corner, side, seen, key)
        for k, key in enumerate(PLOTS, 1):
            _plot(figure, sum(rows[k + 1 :]), seen[key], colours)
        return drawn(figure, kind, style("print").dpi)


def _colours(body: str) -> dict[str, str]:
    """Colour of each role as the page in the light has it: they are those of its style sheet."""
    sheet = SHEET.read_text(encoding="utf-8")
    own = re.search(rf"^\.sw-of-{re.escape(body)} {{(.*?)}}", sheet, re.MULTILINE)
    said = sheet.partition("}")[0] + (own[1] if own else "")
    return dict(re.findall(r"--sw-(\w+): (#\w+)", said))


def _height(plot: dict[str, Any], width: float) -> float:
    """Height in inch of a plot with its title and legend."""
    lines = _legend_rows(plot, width) + _title(plot, width).count("\n")
    return PLOT_HIGH + BELOW + TITLE + LINE * lines


def _title(plot: dict[str, Any], width: float) -> str:
    title = plot["title"].partition(";")[0]  # what follows says how to see more on a screen
    return "\n".join(wrap(title, int(CHARACTERS * (width - LEFT))))


def _columns(width: float) -> int:
    return max(1, int((width - LEFT) / ENTRY))


def _legend_rows(plot: dict[str, Any], width: float) -> int:
    named = [curve for curve in plot["data"] if curve.get("name")]
    shown = len(plot["data"]) > 1 or plot.get("legend")
    return ceil(len(named) / _columns(width)) if shown else 0


def _plot(figure: Any, bottom: float, plot: dict[str, Any], colours: dict[str, str]) -> None:
    """A plot as canvases of the page draw it, its curves named above it."""
    width = figure.get_figwidth()
    box = (LEFT, bottom + BELOW, width - LEFT - RIGHT, PLOT_HIGH)
    sides = {"y": axes(figure, box)}
    if "y2" in plot:
        sides["y2"] = sides["y"].twinx()
    for curve in plot["data"]:
        _curve(sides[curve["axis"]], curve, colours)
    for name, ax in sides.items():
        ax.set(ylabel="\n".join(wrap(plot[name]["said"], 24)), ylim=plot[name]["range"])
    first = sides["y"]
    first.set(xlabel=plot["x"]["said"], xlim=plot["x"]["range"])
    first.grid(alpha=0.25, lw=0.5)
    rows = _legend_rows(plot, width)
    first.set_title(_title(plot, width), loc="left", fontsize="medium", weight="bold",
                    pad=3 + 72 * LINE * rows)  # fmt: skip
    if rows:
        _legend(sides, rows)
    _names(sides, plot)


def _legend(sides: dict[str, Any], rows: int) -> None:
    """Names of all curves in rows above a plot."""
    handles, labels = [], []
    for ax in sides.values():
        of_axis = ax.get_legend_handles_labels()
        handles += of_axis[0]
        labels += of_axis[1]
    sides["y"].legend(
        handles, labels, loc="lower left", bbox_to_anchor=(-0.01, 0.99), frameon=False,
        ncols=ceil(len(labels) / rows), borderpad=0, borderaxespad=0.2, labelspacing=0.25,
        handlelength=1.6, columnspacing=1.0,
    )  # fmt: skip


def _curve(ax: Any, curve: dict[str, Any], colours: dict[str, str]) -> None:
    y = np.array(curve["y"], float)
    x = np.array(curve["x"]) if "x" in curve else curve["x0"] + curve["dx"] * np.arange(len(y))
    colour, name = colours[curve["role"]], curve.get("name")
    if "low" in curve:
        ax.fill_between(x, curve["low"], y, color=colour, alpha=BAND, lw=0, label=name)
        return
    line = {"color": colour, "lw": 0.7 * curve.get("width", 1.4), "alpha": curve.get("opacity", 1),
            "ls": DASHES.get(curve.get("dash", ""), "-")}  # fmt: skip
    ax.plot(x, y, label=name, **line)
    if curve.get("mirrored"):
        ax.plot(x, -y, **line)
        ax.fill_between(x, -y, y, color=colour, alpha=MIRRORED, lw=0)


def _names(sides: dict[str, Any], plot: dict[str, Any]) -> None:
    """Names of lines, the strongest first, each on no curve and no other; left out where there is
    no such place.
    """
    low, high = plot["x"]["range"]
    curves = [line.get_transform().transform_path(line.get_path())
              for ax in sides.values() for line in ax.lines]  # fmt: skip
    placed: list[Any] = []
    for name in plot.get("names", ()):
        if not low <= name["x"] <= high:
            continue
        text = sides[name["axis"]].annotate(
            "\n".join(_mathematical(part) for part in name["said"]), (name["x"], name["y"]), (0, 0),
            textcoords="offset points", ha="center", va="bottom", linespacing=1.0,
            arrowprops={"arrowstyle": "-", "lw": 0.4, "shrinkA": 0, "shrinkB": 0},
        )  # fmt: skip
        if (frame := _placed(text, sides["y"].bbox, curves, placed)) is None:
            text.remove()
        else:
            placed.append(frame)


def _placed(text: Any, box: Any, curves: list[Any], others: list[Any]) -> Any:
    """Frame of a text at the place nearest its line that is on nothing; None if there is none."""
    from matplotlib.text import Text  # whose frame is that of the letters, without the arrow

    def is_free(frame: Any) -> bool:
        within = box.x0 <= frame.x0 and frame.x1 <= box.x1 and frame.y1 <= box.y1
        return within and not (
            any(map(frame.overlaps, others))
            or any(curve.intersects_bbox(frame, filled=False) for curve in curves)
        )

    for place in PLACES:
        text.set_position(place)
        text.get_window_extent()  # which moves it there
        if is_free(frame := Text.get_window_extent(text)):
            return frame
    return None


def _mathematical(said: str) -> str:
    """A name with its subscripts lowered, as matplotlib writes it."""
    return re.sub(r"(\w)<sub>(\w+)</sub>", r"$\1_{\\mathrm{\2}}$", said)
