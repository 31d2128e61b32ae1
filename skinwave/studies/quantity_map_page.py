"""Page, figure and tables of a map of a quantity."""

from math import isfinite
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from simple_model.numbers import stated_error
from skinwave.report.figures import REPORT, measured, png
from skinwave.report.maps import draw_path
from skinwave.report.palette import SEQUENTIAL
from skinwave.report.styles import Style
from skinwave.results.propagation import NEAR, distance_from_path
from skinwave.results.quantity_map import QuantityMap, save
from skinwave.scene.file import dumps
from skinwave.scene.scene import Scene
from skinwave.system import document
from skinwave.system.numbers import significant
from skinwave.system.plain_text import csv_table

WIDTH, HEIGHT = 5.6, 5.0  # inch of the figure
CAPTION = (
    "RMS of the quantity about its mean in the steady state. Dotted: the path of the focus; white: "
    f"{NEAR:g} dB re the largest."
)


def sentences(scene: Scene, found: QuantityMap) -> list[str]:
    """Sentences on the largest value, where it is, how far it spreads, and how sure it is."""
    if not np.nanmax(found.rms):
        return ["Nothing vibrates: the load is constant."]
    row, column = np.unravel_index(np.nanargmax(found.rms), found.rms.shape)
    largest, x, y = found.rms[row, column], 1e3 * found.x[column], 1e3 * found.y[row]
    places = np.stack(np.meshgrid(found.x, found.y), axis=-1)
    moving = np.nan_to_num(found.rms) >= largest * 10 ** (NEAR / 20)
    reach = 1e3 * distance_from_path(scene, places)[moving].max()
    border = np.abs(places[moving]).max(axis=0) >= [found.x[-1], found.y[-1]]
    return [
        f"The RMS of the {scene.reading.words} is largest at ({x:g}, {y:g}) mm, "
        f"{measured(largest, found.asked)}, and above {NEAR:g} dB of that up to "
        f"{significant(reach, 2)} mm from the path"
        + (", or further: the map ends there." if border.any() else "."),
        f"Computed by {found.note}"
        + (
            f"; expected error {stated_error(found.error)} of the largest."
            if isfinite(found.error)
            else "."
        ),
    ]


def write(folder: Path, scene: Scene, found: QuantityMap) -> None:
    """index.html, map.png, map.csv, map.npz and scene.toml, into an empty folder."""
    drawn = png(quantity_figure(scene, found))
    (folder / "map.png").write_bytes(drawn)
    (folder / "scene.toml").write_text(dumps(scene), encoding="utf-8")
    X, Y = np.meshgrid(1e3 * found.x, 1e3 * found.y)
    shown = found.asked.per_unit * found.rms
    rows = (
        [f"{value:.7g}" for value in row] for row in zip(X.flat, Y.flat, shown.flat, strict=True)
    )
    header = ("x_mm", "y_mm", f"rms_{found.asked.column}")
    (folder / "map.csv").write_bytes(csv_table(header, rows))
    save(folder / "map.npz", found)
    parts = [
        *map(document.paragraph, sentences(scene, found)),
        document.picture(drawn, CAPTION),
    ]
    title = f"{scene.name}: {scene.reading.words}"
    (folder / "index.html").write_text(document.page(title, *parts), encoding="utf-8")


def quantity_figure(scene: Scene, found: QuantityMap, style: Style = REPORT) -> Figure:
    """RMS with its unit, the path, and where it is 6 dB below its largest."""
    x, y = 1e3 * found.x, 1e3 * found.y
    shown = found.asked.per_unit * found.rms
    with mpl.rc_context(style.rc):
        figure = Figure(figsize=style.size(WIDTH, HEIGHT), layout="constrained")
        ax = figure.subplots()
        extent = (x[0], x[-1], y[0], y[-1])
        image = ax.imshow(shown, cmap=SEQUENTIAL, vmin=0, origin="lower", extent=extent)
        level = np.nanmax(shown) * 10 ** (NEAR / 20)
        if np.nanmin(shown) < level:
            ax.contour(x, y, shown, [level], colors="white", linewidths=1.3)
        draw_path(ax, scene, "white")
        ax.set_xlabel("x, mm")
        ax.set_ylabel("y, mm")
        ax.set_title(scene.reading.words)
        label = f"RMS about the mean, ${found.asked.symbol}$, {found.asked.shown}"
        figure.colorbar(image, ax=ax, label=label, shrink=0.9)
        inks = {f"{NEAR:g} dB": "solid", "path of the focus": "dotted"}
        handles = [Line2D([], [], color="0.5", ls=dashes) for dashes in inks.values()]
        figure.legend(handles, list(inks), loc="outside lower center", ncols=2, frameon=False)
    return figure
