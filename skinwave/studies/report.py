"""The report of a scene: one page, its pictures and data for other programs, from the results in a
folder; and the page of a map alone.
"""

import io
from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from math import isfinite
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from PIL import Image as Pillow
from PIL import features

from simple_model.numbers import percent, significant, stated_error
from skinwave.report import description, maps, render
from skinwave.report.figures import png
from skinwave.report.films import film, lasts, seam
from skinwave.report.levels import strongest_probe
from skinwave.report.maps import surfaces_figure
from skinwave.report.palette import label
from skinwave.report.renderer import renderer
from skinwave.report.styles import Style
from skinwave.report.turntable import turntable
from skinwave.results import record, surface
from skinwave.results.exports import write_field, write_probes, write_sound
from skinwave.results.files import distinct_names, folder_name
from skinwave.results.propagation import NEAR, distance_from_path
from skinwave.results.run import Run
from skinwave.results.surface import SurfaceField, kernel_map
from skinwave.results.views import View
from skinwave.scene.file import dumps
from skinwave.scene.scene import Scene
from skinwave.studies import dispersion
from skinwave.studies.album import Album, only, open_album
from skinwave.studies.changes import Drawn, beside_kernels, shown
from skinwave.studies.pages import Gallery, page_of
from skinwave.system.document import Choice, Details, Part, Picture, Report, Section, inner_page
from skinwave.system.effort import Progress
from skinwave.system.table import Table

FILM_PANEL = (352, 304)  # pixels of a model in the film of a page
FILM_QUALITY = 60
NO_VIEWS = (
    "No motion of whole bodies was saved here, and so there is no picture of a surface; "
    "skinwave report SCENE computes it."
)
TURNED = (
    "Turn it with the mouse, a finger or the arrow keys. Motion into the body is red, out of it "
    "blue, about the mean; where the legend says ≥, rare larger values have the last colour. "
    "Black: path and focus; orange: probes."
)
MARKS = "Black: path and focus; yellow: probes."
COMPARED = (
    "Colour: motion into the body about its mean, or the point kernel's pressure, over each "
    "model's largest: a pressure and a motion have no common unit. All receive the same load."
)
SNAPSHOTS = (
    "The surface when the body moves most, and a quarter, half and three quarters of a turn of the "
    "focus later (of a period of the strongest line, if it rests). Behind a focus that is faster "
    "than the surface wave, the Mach angle asin(c/v); no clean cone forms on a circle smaller than "
    "a wavelength."
)
MAP = (
    "RMS of the quantity about its mean in the steady state. Dotted: the path of the focus; white: "
    f"{NEAR:g} dB re the largest."
)


def write_report(
    results: Path,
    out: Path,
    style: Style,
    progress: Progress,
    *,
    formats: Sequence[str] = (),
    columns: Sequence[str] = (),
    command: str = "",
) -> None:
    """index.html, pictures/ and, for other programs, data/ in `out` from the results in a folder,
    or from some columns of them, which a command made. No model of a body is run. A ValueError if
    the folder holds no result, or no such column.
    """
    album = only(open_album(results), columns)
    gallery = Gallery(style=style, formats=formats)
    seen = [*pictures(album, gallery, progress), *mapped(album, gallery)]
    progress("write data", 0.0)
    _write_data(out / "data", album)
    beside = {name: _with_kernels(runs) for name, runs in album.groups.items()}
    asked = Details("What was asked", [Table(["", ""], description.asked_rows(album.scene))])
    drawn_with = renderer().said if renderer().found else "nothing"
    page_of(
        album.title, album.groups, shown(beside, partial(_maps, album)), gallery, seen=seen,
        more=[asked, *_guided(album, gallery)], modelled=_planned(album), progress=progress,
        again=[command or _command(results), f"Three-dimensional pictures: {drawn_with}."],
    ).write(out)  # fmt: skip


def pictures(album: Album, gallery: Gallery, progress: Progress) -> list[Part]:
    """Parts of a page that show an album's views, and why any of them is missing."""
    views = list(album.views.values())
    if not views:
        return [NO_VIEWS]
    same = [v for v in views if v.scene.body == album.scene.body and v.quantity.of_body]
    own = (same or views)[-1]
    frame = int(np.abs(own.pushed).max(axis=1).argmax())
    options: dict[str, Part] = {}
    missing = [f"Pictures in three dimensions and the film are left out: {renderer().said}."]
    if renderer().found:
        options, missing = _spatial(own, frame, views, gallery, progress), []
    progress("draw snapshots", 0.0)
    figure = maps.snapshots_figure(views, gallery.style)
    options["snapshots"] = gallery.figure("snapshots", figure, SNAPSHOTS)
    turned = inner_page(turntable(own, frame), f"{label(own.column)}. {TURNED}")
    return [Section("Pictures", [*missing, Choice("pictures", options), turned])]


def _spatial(
    own: View, frame: int, views: Sequence[View], gallery: Gallery, progress: Progress
) -> dict[str, Part]:
    """Pictures in three dimensions at a frame, and the film."""
    progress("draw side by side", 0.0)
    scales = (f"{label(view.column)}: {render.shown_scale(view)}" for view in views)
    peaks = (f"{label(view.column)} {view.quantity.text(view.peak)}" for view in views)
    caption = f"{'; '.join(scales)}. The largest: {', '.join(peaks)}. {MARKS} {COMPARED}"
    beside = render.picture(views, gallery.style, frame)
    parts: dict[str, Part] = {
        "side by side": gallery.image("side-by-side", beside, caption),
        "film": _film(own, views, gallery.style, progress),
    }
    if len(own.tets):
        progress("draw cut open", 0.0)
        largest = np.abs(own.pushed).max(axis=1)
        in_view = own.scene.tacton.trajectory.position(own.times)[:, 1] >= 0
        behind = int(np.where(in_view, largest, -1.0).argmax())
        cut = render.picture([own], gallery.style, behind, camera="front", cut=True)
        caption = (
            f"{label(own.column)} cut open along y = 0, the section below the black line: "
            f"{render.shown_scale(own)}. {MARKS}"
        )
        parts["cut open"] = gallery.image("cut-open", cut, caption)
    return parts


def _film(own: View, views: Sequence[View], style: Style, progress: Progress) -> Picture:
    """The film, on the page in a third of the bytes of its GIF where that can be done."""
    count = len(own.times)
    slower = significant(lasts(count) / own.period, 2)
    caption = f"Film: {seam(own)}. {count} frames, {slower} times more slowly."
    with TemporaryDirectory() as folder:
        path = Path(folder, "film.gif")
        film(path, views, style, progress, panel=FILM_PANEL)
        gif = path.read_bytes()
    if not features.check("webp"):
        return Picture(gif, caption, "film", "gif")
    buffer = io.BytesIO()
    with Pillow.open(io.BytesIO(gif)) as frames:
        frames.save(buffer, format="webp", save_all=True, quality=FILM_QUALITY, method=2, loop=0)
    return Picture(buffer.getvalue(), caption, "film", "webp", {"gif": gif})


def mapped(album: Album, gallery: Gallery) -> list[Part]:
    """Maps of the quantity that the probes read, where it is not the motion of the surface."""
    scenes = {run.column: run.scene for run in album.runs}
    parts = []
    for name, found in album.maps.items():
        if (scene := scenes[name]).reading.is_plain:
            continue
        caption = f"{label(name)}: {' '.join(map_sentences(scene, found))} {MAP}"
        figure = surfaces_figure(scene, {name: found}, gallery.style)
        parts.append(gallery.figure(f"quantity-{folder_name(name)}", figure, caption))
    return [Section("Where the quantity is largest", parts)] if parts else []


def _with_kernels(runs: Sequence[Run]) -> Sequence[Run]:
    """Runs of one Tacton with both point kernels, computed anew, as they are formulas."""
    bodies = [run for run in runs if run.is_motion]
    return [*beside_kernels(bodies[0])[:2], *bodies] if bodies else runs


def _maps(album: Album, run: Run) -> Drawn:
    """A body's map as it was saved with its view, and the kernel's."""
    view, found = album.views.get(run.column), album.maps.get(run.column)
    if view is None or found is None or view.scene.pressure != run.scene.pressure:
        return ()
    return found, kernel_map(run.scene.pressure, found.x, found.y)


def _write_data(folder: Path, album: Album) -> None:
    """Probes, their sound and, of every view, a few frames of its field."""
    folder.mkdir()
    names = distinct_names(album.groups) if len(album.groups) > 1 else [""]
    for name, runs in zip(names, album.groups.values(), strict=True):
        for run in runs:
            stem = folder_name(f"{name}-{run.column}" if name else run.column)
            write_probes(folder / f"{stem}_probes", run.response)
        write_sound(folder, runs[-1].response, strongest_probe(runs[-1:]))
    for view in album.views.values():
        write_field(folder, view)


def _planned(album: Album) -> list[Part]:
    """The plan of the response, and how far pictures are from it."""
    if (planned := album.planned) is None:
        return ["No plan was saved with these results; skinwave plan scene.toml makes one."]
    heading = (
        f"What the scene requires for a relative error of {100 * planned['tolerance']:g} % at its "
        "probes, and why. Pictures show the whole body, by finite elements or the modes of a plate."
    )
    rows = [[row["what"], row["value"], row["reason"]] for row in planned["rows"]]
    parts: list[Part] = [heading, Table(["", "", "reason"], rows)]
    if "misfit" in planned:
        parts.append(
            f"At the probes, the motion in pictures, which have larger elements, differs from the "
            f"response by {planned['model']} by {percent(planned['misfit'])}."
        )
    return [*parts, *(f"Warning: {text}." for text in planned["warnings"])]


def _guided(album: Album, gallery: Gallery) -> list[Part]:
    """Dispersion curves of the scene's body; nothing of a body that has none."""
    if album.scene.body.of_kind.dispersion is None:
        return []
    try:
        parts = dispersion.page_parts(dispersion.driven_modes(album.scene), gallery)
    except ValueError as error:  # such as a table of moduli that ends below the curves
        parts = [f"No dispersion curves: {error}."]
    return [Details("Which waves the body guides, and which the load drives", parts)]


def _command(results: Path) -> str:
    """The command that made a folder, if its record says so."""
    typed = ""
    with suppress(ValueError, KeyError):
        typed = str(record.read(results)["command"]["typed"])
    return typed or "skinwave report scene.toml"


def map_sentences(scene: Scene, found: SurfaceField) -> list[str]:
    """Sentences on the largest value of a map, where it is, how far it spreads, and its error."""
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


def write_map(folder: Path, scene: Scene, found: SurfaceField) -> None:
    """index.html, map.png, map.csv, map.npz and scene.toml, into an empty folder."""
    (folder / "scene.toml").write_text(dumps(scene), encoding="utf-8")
    X, Y = np.meshgrid(1e3 * found.x, 1e3 * found.y)
    rows = zip(X.flat, Y.flat, found.shown.flat, strict=True)
    columns = ("x_mm", "y_mm", f"rms_{found.quantity.column}")
    (folder / "map.csv").write_bytes(Table(columns, rows, stored=7).to_csv())
    surface.save(folder / "map.npz", found)
    figure = surfaces_figure(scene, {scene.reading.words: found})
    title = f"{scene.name}: {scene.reading.words}"
    Report(title, map_sentences(scene, found), [Picture(png(figure), MAP, "map")]).write(folder)
