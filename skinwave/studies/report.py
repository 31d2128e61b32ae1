"""The report of a scene, one page with its pictures and data, and the page of a map."""

import io
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from copy import copy
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
from skinwave.report.films import duration, film, played_text
from skinwave.report.palette import label
from skinwave.report.renderer import renderer
from skinwave.report.spectra import strongest_probe
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
from skinwave.studies.album import Album, open_album
from skinwave.studies.first_screen import Maps, first_screen, with_kernels
from skinwave.studies.pages import MARKS, Gallery, page_of, side_by_side
from skinwave.system.document import Choice, Details, Part, Picture, Report, Section, inner_page
from skinwave.system.effort import Progress, silent
from skinwave.system.failures import or_failed
from skinwave.system.processes import pool
from skinwave.system.table import Table


def write_report(
    results: Path,
    out: Path,
    style: Style,
    progress: Progress,
    *,
    formats: Sequence[str] = (),
    columns: Sequence[str] = (),
    command: str = "",
    failures: Mapping[str, str] | None = None,
) -> dict[str, str]:
    """Write index.html, pictures/ and data/ into `out` from the results in a folder.

    No model of a body is run. `columns` select models; `command` made the results, without the
    parts in `failures`. Returns the reasons of all parts that failed. Raises a ValueError if the
    folder has no result or no such column.
    """
    album = open_album(results, columns)
    with pool(1) as workers:
        gallery = Gallery(
            style=style, formats=formats, workers=workers, progress=progress,
            failures=dict(failures or {}),
        )  # fmt: skip
        page = _page(album, gallery, out, command or _command(results))
    page.write(out)
    return gallery.failures


def _page(album: Album, gallery: Gallery, out: Path, command: str) -> Report:
    """Return the page, and write the data of its pictures."""
    before = [*picture_parts(album, gallery), *map_parts(album, gallery)]
    gallery.progress("write data", 0.0)
    _write_data(out / "data", album)
    groups: dict[str, Sequence[Run]] = {}
    for name, runs in album.groups.items():  # both point kernels are computed again
        bodies = [run for run in runs if run.is_motion]
        groups[name] = [*with_kernels(bodies[0])[:2], *bodies] if bodies else runs
    scene = Details("The scene in words", [Table(["", ""], description.scene_rows(album.scene))])
    drawn_with = renderer().detail if renderer().is_available else "none"
    return page_of(
        album.title, album.groups, first_screen(groups, partial(_maps, album)), gallery,
        before=before, after=[scene, *_wave_parts(album, gallery)],
        modelled=_plan_parts(album), command=command,
        notes=[f"Renderer of three-dimensional pictures: {drawn_with}."],
    )  # fmt: skip


def picture_parts(album: Album, gallery: Gallery) -> list[Part]:
    """Return parts of a page that show the views, or say why there are none."""
    if not (views := list(album.views.values())):
        return [
            "These results contain no motion of whole bodies, so that there is no picture of a "
            "surface. skinwave report SCENE computes it."
        ]
    of_scene = [v for v in views if v.scene.body == album.scene.body and v.quantity.of_body]
    own = (of_scene or views)[-1]
    options: dict[str, Part] = {}
    missing: list[Part] = []
    drawn_film: Callable[[], Picture] | None = None
    if renderer().is_available:
        # Copies, because a view keeps what it computes while a thread sends it.
        copies = copy(own), [copy(view) for view in views]
        drawn_film = gallery.begin(_film, *copies, gallery.style)
        options = _spatial_parts(own, views, gallery)
    else:
        missing = [f"Three-dimensional pictures and the film are left out: {renderer().detail}."]
    gallery.progress("draw snapshots", 0.0)
    figure = maps.snapshots_figure(views, gallery.style)
    snapshots = (
        "The surface when the body moves most, then at quarters of a turn of the focus, or of a "
        "period of the strongest line if the focus rests. If the focus is faster than the surface "
        "wave, lines behind it show the Mach angle asin(c/v). On a circle smaller than a "
        "wavelength, no clean cone forms."
    )
    options["snapshots"] = gallery.figure("snapshots", figure, snapshots)
    gallery.progress("draw snapshots", 0.5)
    if drawn_film:
        gallery.progress("film", 0.0)
        with or_failed(gallery.failures, "film"):
            options["film"] = drawn_film()
    turned_caption = (
        "Turn it with the mouse, a finger or the arrow keys. Colour: motion about its mean, red "
        "into the body, blue out of it. If the legend has ≥, larger values have the end colour. "
        "Black: path and focus; orange: probes."
    )
    turned = inner_page(turntable(own, own.peak_frame), f"{label(own.column)}. {turned_caption}")
    order = ("side by side", "film", "cut open", "snapshots")
    pictures = Choice("pictures", {name: options[name] for name in order if name in options})
    return [Section("Pictures", [*missing, pictures, turned])]


def _spatial_parts(own: View, views: Sequence[View], gallery: Gallery) -> dict[str, Part]:
    """Return three-dimensional pictures by name, without those that fail."""
    parts: dict[str, Part] = {}
    gallery.progress("draw side by side", 0.0)
    with or_failed(gallery.failures, "picture side by side"):
        parts["side by side"] = side_by_side(views, own.peak_frame, gallery)
    if not len(own.tets):
        return parts
    with or_failed(gallery.failures, "picture cut open"):
        gallery.progress("draw cut open", 0.0)
        largest = np.abs(own.inward).max(axis=1)
        in_view = own.scene.tacton.trajectory.position(own.times)[:, 1] >= 0
        behind = int(np.where(in_view, largest, -1.0).argmax())
        cut = render.picture([own], gallery.style, behind, camera="front", cut=True)
        caption = (
            f"{label(own.column)} cut open along y = 0; the section is below the black line. "
            f"{render.scale_text(own).capitalize()}. {MARKS}"
        )
        parts["cut open"] = gallery.image("cut-open", cut, caption)
    return parts


def _film(own: View, views: Sequence[View], style: Style) -> Picture:
    """Return the film as GIF; the page shows WebP if possible, a third of its size."""
    count = len(own.times)
    slower = significant(duration(count) / own.period, 2)
    caption = f"Film: {played_text(own)}. {count} frames, slowed down {slower} times."
    film_panel = (352, 304)  # pixels of a model in the film of a page
    with TemporaryDirectory() as folder:
        path = Path(folder, "film.gif")
        film(path, views, style, silent, panel=film_panel)
        gif = path.read_bytes()
    if not features.check("webp"):
        return Picture(gif, caption, "film", "gif")
    buffer = io.BytesIO()
    with Pillow.open(io.BytesIO(gif)) as frames:
        frames.save(buffer, format="webp", save_all=True, quality=60, method=2, loop=0)
    return Picture(buffer.getvalue(), caption, "film", "webp", {"gif": gif})


def map_parts(album: Album, gallery: Gallery) -> list[Part]:
    """Return maps of the probes' quantity, unless it is the motion of the surface."""
    scenes = {run.column: run.scene for run in album.runs}
    parts = []
    for name, field in album.maps.items():
        if (scene := scenes[name]).reading.is_plain:
            continue
        caption = f"{label(name)}: {' '.join(map_sentences(scene, field))} {_map_caption(scene)}"
        figure = maps.surfaces_figure(scene, {name: field}, gallery.style)
        parts.append(gallery.figure(f"quantity-{folder_name(name)}", figure, caption))
    return [Section("Where the quantity is largest", parts)] if parts else []


def _map_caption(scene: Scene) -> str:
    map_caption = f"Dotted: path of the focus; white: {NEAR:g} dB re the largest."
    return f"{maps.rms_text(scene.pressure)} {map_caption}"


def _maps(album: Album, run: Run) -> Maps:
    """Return a body's saved map, and the kernel's."""
    view, field = album.views.get(run.column), album.maps.get(run.column)
    if view is None or field is None or view.scene.pressure != run.scene.pressure:
        return ()
    return field, kernel_map(run.scene.pressure, field.x, field.y)


def _write_data(folder: Path, album: Album) -> None:
    """Write probes, their sound, and a few frames of the field of every view."""
    folder.mkdir()
    names = distinct_names(album.groups) if len(album.groups) > 1 else [""]
    for name, runs in zip(names, album.groups.values(), strict=True):
        for run in runs:
            stem = folder_name(f"{name}-{run.column}" if name else run.column)
            write_probes(folder / f"{stem}_probes", run.response)
        write_sound(folder, runs[-1].response, strongest_probe(runs[-1:]))
    for view in album.views.values():
        write_field(folder, view)


def _plan_parts(album: Album) -> list[Part]:
    """Return the plan of the response, and by how much the pictures differ from it."""
    if (planned := album.planned) is None:
        return ["These results contain no plan. skinwave plan SCENE makes one."]
    heading = (
        f"Plan for a relative error of {100 * planned['tolerance']:g} % at the probes. Pictures "
        "show the whole body, by finite elements (sheets: by plate modes)."
    )
    rows = [[row[name] for name in ("what", "value", "reason")] for row in planned["rows"]]
    parts: list[Part] = [heading, Table(["", "", "reason"], rows)]
    if "misfit" in planned:
        parts.append(
            "Pictures have larger elements. At the probes, their motion differs by "
            f"{percent(planned['misfit'])} from the response of {planned['model']}."
        )
    return [*parts, *(f"Warning: {text}." for text in planned["warnings"])]


def _wave_parts(album: Album, gallery: Gallery) -> list[Part]:
    """Return dispersion curves of the scene's body, if it has any."""
    if album.scene.body.of_kind.dispersion is None:
        return []
    # Such as a table of moduli that does not cover the frequencies.
    with or_failed(gallery.failures, "dispersion curves"):
        parts = dispersion.page_parts(dispersion.driven_modes(album.scene), gallery)
        return [Details("Which waves the body guides, and which the load drives", parts)]
    return []


def _command(results: Path) -> str:
    """Return the command that made a folder, from its record."""
    typed = ""
    with suppress(ValueError, KeyError):
        typed = str(record.read(results)["command"]["typed"])
    return typed or "skinwave report scene.toml"


def map_sentences(scene: Scene, field: SurfaceField) -> list[str]:
    """Return sentences on a map: largest value, its place, spread and error."""
    if not np.nanmax(field.rms):
        return ["Nothing vibrates, because the load is constant."]
    row, column = np.unravel_index(np.nanargmax(field.rms), field.rms.shape)
    largest, x, y = field.rms[row, column], 1e3 * field.x[column], 1e3 * field.y[row]
    inside = np.nan_to_num(field.rms) >= largest * 10 ** (NEAR / 20)
    reach = 1e3 * distance_from_path(scene, field.places)[inside].max()
    at_edge = np.abs(field.places[inside]).max(axis=0) >= [field.x[-1], field.y[-1]]
    error = f"; expected error {stated_error(field.error)} of the largest"
    return [
        f"The RMS of the {scene.reading.words} is largest at ({x:g}, {y:g}) mm, "
        f"{field.quantity.text(largest)}. It is above {NEAR:g} dB of that up to "
        f"{significant(reach, 2)} mm from the path"
        + (", or further, because the map ends there." if at_edge.any() else "."),
        f"Computed by {field.note}{error * isfinite(field.error)}.",
    ]


def write_map(folder: Path, scene: Scene, field: SurfaceField) -> None:
    """Write index.html, map.png, map.csv, map.npz and scene.toml into an empty folder."""
    (folder / "scene.toml").write_text(dumps(scene), encoding="utf-8")
    X, Y = np.meshgrid(1e3 * field.x, 1e3 * field.y)
    rows = zip(X.flat, Y.flat, field.unit_rms.flat, strict=True)
    columns = ("x_mm", "y_mm", f"rms_{field.quantity.column}")
    (folder / "map.csv").write_bytes(Table(columns, rows, stored=7).to_csv())
    surface.save(folder / "map.npz", field)
    figure = maps.surfaces_figure(scene, {scene.reading.words: field})
    title = f"{scene.name}: {scene.reading.words}"
    Report(
        title, map_sentences(scene, field), [Picture(png(figure), _map_caption(scene), "map")]
    ).write(folder)
