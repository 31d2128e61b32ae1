"""Every picture of an album, drawn once: parts of a page, with their files."""

import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image as Pillow
from PIL import features

from simple_model.numbers import significant
from skinwave.models.point_kernel import PUBLISHED, SAME_LOAD
from skinwave.report import maps, render
from skinwave.report.figures import drawn, tacton_figure
from skinwave.report.films import film, lasts, seam
from skinwave.report.levels import levels_figure, strongest_probe
from skinwave.report.palette import label
from skinwave.report.renderer import renderer
from skinwave.report.styles import Style
from skinwave.report.turntable import turntable
from skinwave.results.run import Run
from skinwave.results.views import View
from skinwave.studies.album import Album
from skinwave.system.document import Part, Picture, inner_page
from skinwave.system.effort import Progress

FILM_PANEL = (352, 304)  # pixels of a model in the film of a page
QUALITY, FILM_QUALITY = 88, 60  # of pictures inside a page


@dataclass(frozen=True, kw_only=True)
class Gallery:
    """How pictures are drawn: `style`, `formats` of figures beside PNG; `folder` of films."""

    folder: Path
    style: Style
    formats: Sequence[str] = ("png",)

    def figure(self, name: str, figure: Figure, caption: str) -> Picture:
        """A figure, with its files."""
        kinds = dict.fromkeys(("png", *self.formats))
        files = {kind: drawn(figure, kind, self.style.dpi) for kind in kinds}
        with Pillow.open(io.BytesIO(files["png"])) as image:
            small, kind = _compressed(image.convert("RGB"))
        return Picture(small, caption, name, kind, files)

    def image(self, name: str, pixels: render.Image, caption: str) -> Picture:
        """A view in three dimensions, with its file."""
        image, buffer = Pillow.fromarray(pixels), io.BytesIO()
        image.save(buffer, format="png", optimize=True)
        small, kind = _compressed(image)
        return Picture(small, caption, name, kind, {"png": buffer.getvalue()})


def pictures(album: Album, gallery: Gallery, progress: Progress) -> list[Part]:
    """Parts of a page that show an album's views, and why any of them is missing."""
    views = list(album.views.values())
    if not views:
        return [NO_VIEWS]
    own = _own(album, views)
    frame = int(np.abs(own.pushed).max(axis=1).argmax())
    parts: list[Part] = [
        f"Pictures in three dimensions and the film are left out: {renderer().said}."
    ]
    if renderer().found:
        parts = _spatial(own, frame, views, gallery, progress)
    caption = f"{label(own.column)}, to turn with the mouse, a finger or the arrow keys. {TURNED}"
    parts.append(inner_page(turntable(own, frame), caption))
    progress("draw snapshots", 0.0)
    parts.append(
        gallery.figure("snapshots", maps.snapshots_figure(views, gallery.style), SNAPSHOTS)
    )
    return parts


def _spatial(
    own: View, frame: int, views: Sequence[View], gallery: Gallery, progress: Progress
) -> list[Part]:
    """Pictures in three dimensions at a frame, and the film."""
    style = gallery.style
    progress("draw side by side", 0.0)
    beside = render.picture(views, style, frame)
    parts: list[Part] = [
        gallery.image("side-by-side", beside, f"{_drawn(views)} {MARKS} {COMPARED}")
    ]
    path, count = gallery.folder / "film.gif", len(own.times)
    film(path, views, style, progress, panel=FILM_PANEL)
    slower = significant(lasts(count) / own.period, 2)
    caption = f"Film: {seam(own)}. {count} frames, {slower} times more slowly."
    parts.append(_film_part(path, caption))
    if len(own.tets):
        progress("draw cut open", 0.0)
        cut = render.picture([own], style, _behind(own), camera="front", cut=True)
        section = f"{label(own.column)} cut open along y = 0, the section below the black line"
        caption = f"{section}: {render.shown_scale(own)}. {MARKS}"
        parts.append(gallery.image("cut-open", cut, caption))
    return parts


def run_figures(album: Album, gallery: Gallery, progress: Progress) -> list[Part]:
    """Waveforms, spectra and sensation levels, for every Tacton of an album."""
    parts: list[Part] = []
    for name, runs in tactons(album).items():
        progress(f"draw {name}", 0.0)
        figure = tacton_figure(name, runs, gallery.style)
        parts.append(gallery.figure(f"waveforms-{len(parts)}", figure, _waveforms(runs)))
        if any(run.response.record.of_body for run in runs):
            figure = levels_figure(runs, strongest_probe(runs), gallery.style)
            parts.append(gallery.figure(f"sensation-{len(parts)}", figure, f"{name}. {SENSATION}"))
    return parts


def _waveforms(runs: Sequence[Run]) -> str:
    """Caption of a Tacton's waveforms, and the cause of each difference between them."""
    columns = [run.column for run in runs]
    text = "Waveforms and spectra. Rows are probes."
    if {PUBLISHED.name, SAME_LOAD.name} <= set(columns):
        text += f" {LOADS}"
    if SAME_LOAD.name in columns and any(run.response.record.of_body for run in runs):
        text += f" {PROPAGATED}"
    return text


def tactons(album: Album) -> dict[str, list[Run]]:
    """Runs by Tacton."""
    groups: dict[str, list[Run]] = {}
    for run in album.runs:
        groups.setdefault(run.tacton, []).append(run)
    return groups


def _own(album: Album, views: Sequence[View]) -> View:
    """The view of the scene's own body, or the last."""
    same = [v for v in views if v.scene.body == album.scene.body and v.quantity.of_body]
    return (same or views)[-1]


def _drawn(views: Sequence[View]) -> str:
    scales = (f"{label(view.column)}: {render.shown_scale(view)}" for view in views)
    peaks = (f"{label(view.column)} {view.quantity.text(view.peak)}" for view in views)
    return f"{'; '.join(scales)}. The largest: {', '.join(peaks)}."


def _behind(view: View) -> int:
    """The frame of the largest motion among those whose focus is on the half that is drawn."""
    largest = np.abs(view.pushed).max(axis=1)
    seen = view.scene.tacton.trajectory.position(view.times)[:, 1] >= 0
    return int(np.where(seen, largest, -1.0).argmax())


def _film_part(path: Path, caption: str) -> Picture:
    """A film as a part of the page, in a third of the bytes of its GIF where that can be done."""
    gif = {"gif": path.read_bytes()}
    if not features.check("webp"):
        return Picture(gif["gif"], caption, "film", "gif")
    buffer = io.BytesIO()
    with Pillow.open(path) as film:
        film.save(buffer, format="webp", save_all=True, quality=FILM_QUALITY, method=2, loop=0)
    return Picture(buffer.getvalue(), caption, "film", "webp", gif)


def _compressed(image: Pillow.Image) -> tuple[bytes, str]:
    """A picture in as few bytes as a browser needs, and their format."""
    buffer, kind = io.BytesIO(), "webp" if features.check("webp") else "png"
    image.save(buffer, format=kind, quality=QUALITY, method=4)
    return buffer.getvalue(), kind


NO_VIEWS = (
    "No motion of whole bodies was saved here, and so there is no picture of a surface; "
    "skinwave report SCENE computes it."
)
TURNED = (
    "Motion into the body is red, out of it blue, about the mean; where the legend says ≥, rare "
    "larger values have the last colour. Black: path and focus; orange: probes."
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
LOADS = (
    "The kernel as published has the paper's load, a linear drive in a sinc^2 main lobe; all "
    "others have the scene's: the two kernels differ by drive law and focal spot."
)
PROPAGATED = "A body differs from the kernel under the same load by propagation alone."
SENSATION = (
    "Lines of the motion at the probe that moves most, and the detection threshold (for a focal "
    "spot on the hand; Verrillo 1963 and Bolanowski et al. 1988, uncertain by 5 dB and more)."
)
