"""Page, figure and table of a map of a quantity."""

from math import isfinite
from pathlib import Path

import numpy as np

from simple_model.numbers import significant, stated_error
from skinwave.report.figures import png
from skinwave.report.maps import surfaces_figure
from skinwave.results.propagation import NEAR, distance_from_path
from skinwave.results.surface import SurfaceField, save
from skinwave.scene.file import dumps
from skinwave.scene.scene import Scene
from skinwave.system.document import Picture, Report
from skinwave.system.table import Table

CAPTION = (
    "RMS of the quantity about its mean in the steady state. Dotted: the path of the focus; white: "
    f"{NEAR:g} dB re the largest."
)


def sentences(scene: Scene, found: SurfaceField) -> list[str]:
    """Sentences on the largest value, where it is, how far it spreads, and its error."""
    if not np.nanmax(found.rms):
        return ["Nothing vibrates: the load is constant."]
    row, column = np.unravel_index(np.nanargmax(found.rms), found.rms.shape)
    largest, x, y = found.rms[row, column], 1e3 * found.x[column], 1e3 * found.y[row]
    moving = np.nan_to_num(found.rms) >= largest * 10 ** (NEAR / 20)
    reach = 1e3 * distance_from_path(scene, found.places)[moving].max()
    border = np.abs(found.places[moving]).max(axis=0) >= [found.x[-1], found.y[-1]]
    error = f"; expected error {stated_error(found.error)} of the largest"
    return [
        f"The RMS of the {scene.reading.words} is largest at ({x:g}, {y:g}) mm, "
        f"{found.quantity.text(largest)}, and above {NEAR:g} dB of that up to "
        f"{significant(reach, 2)} mm from the path"
        + (", or further: the map ends there." if border.any() else "."),
        f"Computed by {found.note}{error * isfinite(found.error)}.",
    ]


def write(folder: Path, scene: Scene, found: SurfaceField) -> None:
    """index.html, map.png, map.csv, map.npz and scene.toml, into an empty folder."""
    (folder / "scene.toml").write_text(dumps(scene), encoding="utf-8")
    X, Y = np.meshgrid(1e3 * found.x, 1e3 * found.y)
    rows = zip(X.flat, Y.flat, found.shown.flat, strict=True)
    columns = ("x_mm", "y_mm", f"rms_{found.quantity.column}")
    (folder / "map.csv").write_bytes(Table(columns, rows, stored=7).to_csv())
    save(folder / "map.npz", found)
    title = f"{scene.name}: {scene.reading.words}"
    figure = surfaces_figure(scene, {scene.reading.words: found})
    Report(title, sentences(scene, found), [Picture(png(figure), CAPTION, "map")]).write(folder)
