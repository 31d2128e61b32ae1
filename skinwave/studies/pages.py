"""The page of responses that `run`, `compare` and `report` write.

The first screen has the verdict, four numbers, which `skinwave.results.propagation` defines, the
contents and one picture. A reader chooses one Tacton's waveforms at a time, and unfolds details.
"""

import io
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import starmap
from math import isfinite
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from PIL import Image as Pillow
from PIL import features

from simple_model import Effort
from simple_model.line_table import FREE
from simple_model.numbers import first_few, interval, percent, significant
from simple_model.quantities import DISPLACEMENT, PRESSURE, Quantity
from skinwave.models import named
from skinwave.models.point_kernel import PUBLISHED, SAME_LOAD
from skinwave.report import description, render
from skinwave.report.figures import REPORT, figure_file
from skinwave.report.maps import rms_text, surfaces_figure
from skinwave.report.palette import label
from skinwave.report.renderer import renderer
from skinwave.report.spectra import levels_figure, strongest_probe, tacton_figure
from skinwave.report.styles import Style
from skinwave.results.claims import assessable_runs, evaluate
from skinwave.results.files import distinct_names, fill
from skinwave.results.propagation import NEAR, OUTSIDE, Component, Propagation, Reach, added_lines
from skinwave.results.run import Run
from skinwave.results.views import View
from skinwave.scene import paper15
from skinwave.scene.file import dumps
from skinwave.scene.scene import Scene, body_name
from skinwave.studies import first_screen, overview, tables
from skinwave.studies.first_screen import FirstScreen, effects_of, first_tacton, with_kernels
from skinwave.studies.surfaces import Found, Surface, Surfaces, quick_surface, views_of
from skinwave.system import document
from skinwave.system.document import Choice, Details, Part, Picture, Report, Section
from skinwave.system.effort import Progress, silent
from skinwave.system.failures import or_failed
from skinwave.system.table import Column, Table

MARKS = "Black: path and focus; yellow: probes."


@dataclass(frozen=True, kw_only=True)
class Gallery:
    """How pictures are drawn: style, formats of figure files beside PNG, and processes that draw.

    `failures` are the reasons of parts of the page that failed; drawing functions add theirs.
    `at_rest` and `side_by_side` are the pixels of pictures that `begin_gallery` has begun.
    """

    style: Style = REPORT
    formats: Sequence[str] = ()
    workers: Executor | None = None
    progress: Progress = silent
    failures: dict[str, str] = field(default_factory=dict)
    at_rest: "Future[Any] | None" = None
    side_by_side: "Future[Any] | None" = None

    def begin(self, draw: Callable[..., Any], *given: Any) -> Callable[[], Any]:
        """Begin to draw in a process, if there is one; return a function of the result."""
        return self.workers.submit(draw, *given).result if self.workers else partial(draw, *given)

    def figure(self, name: str, figure: Figure, caption: str) -> Picture:
        """Return a figure with its files."""
        kinds = ("png", *self.formats)
        files = {kind: figure_file(figure, kind, self.style.dpi) for kind in kinds}
        with Pillow.open(io.BytesIO(files["png"])) as image:
            small, kind = _compress(image.convert("RGB"))
        return Picture(small, caption, name, kind, files)

    def image(self, name: str, pixels: Any, caption: str) -> Picture:
        """Return an image (ny, nx, 3) of bytes with its file."""
        image, buffer = Pillow.fromarray(pixels), io.BytesIO()
        image.save(buffer, format="png", dpi=(self.style.dpi, self.style.dpi))
        small, kind = _compress(image)
        return Picture(small, caption, name, kind, {"png": buffer.getvalue()})


def _compress(image: Pillow.Image) -> tuple[bytes, str]:
    """Return a small file of a picture, WebP if possible, and its format."""
    buffer, kind = io.BytesIO(), "webp" if features.check("webp") else "png"
    image.save(buffer, format=kind, quality=88, method=4)
    return buffer.getvalue(), kind


def page_of(
    title: str,
    groups: Mapping[str, Sequence[Run]],
    first: FirstScreen | None,
    gallery: Gallery,
    *,
    figures: Mapping[str, Sequence[Run]] | None = None,
    before: Sequence[Part] = (),
    after: Sequence[Part] = (),
    modelled: Sequence[Part] = (),
    command: str = "",
    notes: Sequence[Part] = (),
    seconds: float | None = None,
) -> Report:
    """Return the page of runs by Tacton.

    Parameters
    ----------
    first : results of the first screen, if a body and both kernels were run
    figures : runs that figures show, by default `groups`
    before, after : parts before and after the waveforms
    modelled : further parts of what was modelled
    command, notes : command that makes the page again, and notes on it
    seconds : duration of all runs, by default the sum of their efforts
    """
    runs = [run for group in groups.values() for run in group]
    is_single = len(groups) == 1
    at_rest = _begin_pictures(runs, gallery) if is_single else {}
    drawn = _draw_each(figures or groups, gallery)
    gallery.progress("draw maps", 0.0)
    own = _first_parts(first, gallery) if first else []
    gallery.progress("draw maps", 0.5)
    spatial = _spatial_parts(first, gallery) if first else []
    body = [*before, *_body_parts(at_rest, gallery)]
    body += [_waveforms(drawn, len(groups), gallery.progress), *after]
    body += tables.claims_parts(evaluate(assessable_runs(runs)))
    effects = first.effects if first else effects_of(groups, lambda run: ())
    if effects:
        body.append(Details("What propagation changes", _effects_table(effects)))
    if is_single or not effects:
        lines = [part for group in groups.values() for part in tables.lines_table(group)]
        body.append(Details("Lines", lines))
    models: list[Part] = [*description.model_paragraphs(runs), *modelled]
    body.append(Details("What was modelled, and what was left out", models))
    if any(len(group) > 1 for group in groups.values()):
        agreement = tables.agreement_parts(groups, first.checks if first else {})
        body.append(Details("How far the models agree", agreement))
    effort = tables.effort_table(_efforts_by_body(runs), len(groups), seconds)
    body.append(Details("Errors and effort", effort))
    again: list[Part] = [document.preformat(command)] if command else []
    scene = [document.preformat(dumps(runs[-1].scene))] if is_single else []
    body.append(Details("The scene and the command", [*again, *notes, *scene]))
    caveats = [*description.quantity_notes(runs[-1].scene), *description.unresolved_lines(runs)]
    parts: list[Part] = [document.contents(body), *caveats, *body]
    verdict: list[str] = []
    about_numbers = (
        "Medians over the Tactons, with the smallest and the largest value in brackets. In the "
        "picture each dot is a Tacton, and a bar the median. Half of the motion is half of the "
        "integral of squared RMS. A reach cannot exceed the map or the body. The delay compares "
        "motion with pressure in the kernel's strongest line, at the probe nearest to the path. "
        "Whole periods may be missing. If it is negative, the motion is ahead."
    )
    if first:
        if is_single:
            verdict = sentences(first)
            parts = [four_numbers(first), parts[0], *own[:-1], *spatial, own[-1], *parts[1:]]
        else:
            verdict = [*overview.sentences(effects, groups), *sentences(first)[1:]]
            dots = overview.figure(effects, gallery.style)
            numbers = gallery.figure("numbers", dots, about_numbers)
            detail = Section(f"One Tacton: {first.kernel.tacton}", own)
            parts = [overview.table(effects), numbers, parts[0], *spatial, detail, *parts[1:]]
    return Report(title, [" ".join(verdict)], parts, efforts_of(runs), "pictures", gallery.failures)


def _begin_pictures(runs: Sequence[Run], gallery: Gallery) -> "dict[Run, Callable[[], Any]]":
    """Return functions of the pictures of bodies of elements, which processes draw meanwhile."""
    meshed = [run for run in runs if named(run.model).default_size]
    if gallery.at_rest:
        return dict.fromkeys(meshed, gallery.at_rest.result)
    begin = gallery.begin if renderer().is_available else partial  # which begins nothing
    return {run: begin(_body_picture, run.scene, gallery.style) for run in meshed}


def begin_gallery(
    scene: Scene, moved: "Future[Found]", workers: Executor, progress: Progress
) -> Gallery:
    """Begin to draw a body at rest and, once its surface has moved, the views of a scene, in a
    process beside other work. Their pixels are None without a renderer or views.
    """
    threads = ThreadPoolExecutor(2)

    def at_rest() -> Any:
        can_draw = renderer().is_available
        return workers.submit(_body_picture, scene, REPORT).result() if can_draw else None

    def side_by_side() -> Any:
        scenes = paper15.beside_kernels(scene) | {body_name(scene.body): scene}
        views = views_of(scenes, moved.result()[0])
        if not (views and renderer().is_available):
            return None
        return workers.submit(render.picture, views, REPORT, views[-1].peak_frame).result()

    gallery = Gallery(
        workers=workers, progress=progress, at_rest=threads.submit(at_rest),
        side_by_side=threads.submit(side_by_side),
    )  # fmt: skip
    threads.shutdown(wait=False)
    return gallery


def _body_picture(scene: Scene, style: Style) -> Any:
    """Return the pixels of a body at rest."""
    from skinwave.report.body_picture import body_picture  # slow to import

    return body_picture(scene, style)


def _body_parts(at_rest: "Mapping[Run, Callable[[], Any]]", gallery: Gallery) -> list[Part]:
    """Return the pictures of bodies, or the reason why there are none."""
    if at_rest and not renderer().is_available:
        return [Section("The body", [f"Its picture is left out: {renderer().detail}."])]
    parts: list[Part] = []
    body_caption = (
        "at rest, with its mesh and its boundary conditions. Where the stiffness of a support "
        "rises gradually, its colour fades in. The plate below shows the condition of the base. A "
        "body of several materials is cut open."
    )
    for run, drawn in at_rest.items():
        from skinwave.report.body_picture import drawn_size  # slow to import

        with or_failed(gallery.failures, f"picture of {run.column} at rest"):
            size = significant(1e3 * drawn_size(run.scene.body), 2)
            caption = f"{label(run.column)} {body_caption} Elements in this picture: {size} mm."
            name = "body" if len(at_rest) == 1 else f"body-{run.column}"
            parts.append(gallery.image(name, drawn(), caption))
    return [Section("The body", parts)] if parts else []


def efforts_of(runs: Sequence[Run]) -> list[tuple[str, Effort]]:
    """Return the efforts of runs by body and, if there are several, by Tacton."""
    several = len({run.tacton for run in runs}) > 1
    names = (f"{run.tacton} on {run.body}" if several else run.body for run in runs)
    return [(name, run.response.effort) for name, run in zip(names, runs, strict=True)]


def write_run_page(
    folder: Path, run: Run, gallery: Gallery, *, more: Sequence[Part] = (), command: str = "",
    moved: "Future[Found] | None" = None,
) -> None:  # fmt: skip
    """Write the folder of one run with its page.

    `more` are further parts of the page, `moved` is the surface from `begin_surface`.
    """
    fill(folder, run)
    first = None
    if run.is_motion and run.scene.load.is_plain:
        group = with_kernels(run)
        scenes = {each.column: each.scene for each in group}
        gallery.progress(f"map of {run.column}", 0.0)
        found: Surfaces = {}
        with or_failed(gallery.failures, f"map of {run.column}"):
            found, failed = moved.result() if moved else quick_surface(run, None)
            gallery.failures.update(failed)
        surface = found.get((run.tacton, run.column), Surface())
        views = views_of(scenes, found)
        first = first_screen.first_screen({run.tacton: group}, lambda _: surface.maps, views)
    title = f"{run.tacton} on {label(run.body)}: {run.model}"
    page = page_of(title, {run.tacton: [run]}, first, gallery, after=more, command=command)
    page.write(folder)


def _efforts_by_body(runs: Sequence[Run]) -> dict[str, Effort]:
    """Return the effort of the first response of each body, with the largest errors of all."""
    efforts: dict[str, list[Effort]] = {}
    for run in runs:
        if run.response.record.of_body:
            efforts.setdefault(run.body, []).append(run.response.effort)
    return {
        body: replace(
            of_body[0], energy_imbalance=max(e.energy_imbalance for e in of_body),
            errors=max((e.errors for e in of_body), key=lambda errors: errors.error),
            radiated=max(e.radiated for e in of_body),
        )
        for body, of_body in efforts.items()
    }  # fmt: skip


def _draw_each(
    groups: Mapping[str, Sequence[Run]], gallery: Gallery
) -> Iterator[dict[str, Picture]]:
    """Yield the figures of each Tacton by their titles, the first one first."""
    files = dict(zip(groups, distinct_names(groups), strict=True))
    names = sorted(groups, key=lambda each: each != first_tacton(groups))
    draw = gallery.workers.map if gallery.workers else map
    alone = Gallery(style=gallery.style, formats=gallery.formats)
    one = partial(_tacton_pictures, alone, len(groups) == 1)
    of_each = [(name, files[name], groups[name]) for name in names]
    return _or_here(draw(one, *zip(*of_each, strict=True)), partial(starmap, one, of_each))


def _or_here(drawn: Iterable[Any], here: Callable[[], Iterable[Any]]) -> Iterator[Any]:
    """Yield what processes have drawn, or draw it here if one of them has ended."""
    try:
        yield from drawn
    except BrokenProcessPool:
        yield from here()


def _tacton_pictures(
    gallery: Gallery, is_single: bool, name: str, file: str, group: Sequence[Run]
) -> dict[str, Picture]:
    """Return the waveforms and spectra of a Tacton and, of a single one, its sensation levels."""
    runs, title = list(group), "waveforms and spectra" if is_single else name
    figure = tacton_figure(name, runs, gallery.style)
    pictures = {title: gallery.figure(file, figure, _caption(name, runs))}
    sensation = (
        "Lines of the motion at the probe that moves most. The detection threshold for a focal "
        "spot on the hand (Verrillo 1963; Bolanowski et al. 1988) is uncertain by 5 dB or more."
    )
    if is_single and any(run.response.record.of_body for run in runs):
        figure = levels_figure(runs, strongest_probe(runs), gallery.style)
        pictures["sensation levels"] = gallery.figure("sensation", figure, sensation)
    return pictures


def _waveforms(drawn: Iterator[dict[str, Picture]], count: int, progress: Progress) -> Part:
    """Return a choice between the figures of Tactons."""
    options: dict[str, Part] = {}
    for k, pictures in enumerate(drawn):
        progress(f"draw {next(iter(pictures))}", k / count)
        options |= pictures
    return Section("Waveforms", [Choice("waveforms", options)])


def _caption(name: str, runs: Sequence[Run]) -> str:
    tacton, columns = runs[0].scene.tacton, {run.column for run in runs}
    path = [] if tacton.trajectory.is_static else [description.path_text(tacton)]
    commanded = [*description.tone_texts(tacton), *path, *description.level_texts(tacton)]
    loads = (
        " The published kernel has its published load: a linear drive and a sinc² main lobe. All "
        "other models have the load of the scene."
    ) * ({PUBLISHED.name, SAME_LOAD.name} <= columns)
    tones = ", ".join(commanded) or "constant pressure"
    return f"{name}: {tones}. Waveforms and spectra; each row is a probe.{loads}"


def _first_parts(first: FirstScreen, gallery: Gallery) -> list[Part]:
    """Return the maps and the uncertainty of the numbers."""
    parts: list[Part] = []
    beyond_kernel = (
        "Outside the dashed line the point kernel is below a tenth of its largest value; the body "
        "moves there because waves propagate."
    )
    threshold_caption = (
        "Inside the pink line the strongest component is above the detection threshold of skin."
    )
    measured_caption = (
        "Squares show the measured RMS displacement in the colours of the map. It has only the "
        "lines of the load, and no gain is applied. An arrow on a colour bar means that a measured "
        "value is larger. The kernel's map shows pressure, so its squares only mark the places."
    )
    if first.maps and first.own[first.body.column].strongest:
        figure = surfaces_figure(
            first.kernel.scene, first.maps, gallery.style, measured=first.measured
        )
        has_level = any(surface.level is not None for surface in first.maps.values())
        captions = [
            rms_text(first.kernel.scene.pressure), _free_vibration(first.bodies), beyond_kernel,
            threshold_caption * has_level, measured_caption * bool(first.measured),
        ]  # fmt: skip
        parts.append(gallery.figure("propagation", figure, " ".join(filter(None, captions))))
    return [*parts, _uncertainty(first)]


def _spatial_parts(first: FirstScreen, gallery: Gallery) -> list[Part]:
    """Return the picture of the views when the body moves most, if there are any views."""
    if not first.views:
        return []
    if not renderer().is_available:
        return [f"Three-dimensional pictures are left out: {renderer().detail}."]
    own = next((v for v in first.views if v.column == first.body.column), first.views[-1])
    with or_failed(gallery.failures, "picture in three dimensions"):
        drawn = gallery.side_by_side.result() if gallery.side_by_side else None
        return [side_by_side(first.views, own.peak_frame, gallery, drawn)]
    return []


def side_by_side(views: Sequence[View], frame: int, gallery: Gallery, drawn: Any = None) -> Picture:
    """Return a picture of views in three dimensions at one frame, or of its `drawn` pixels."""
    scales = (f"{label(view.column)}: {render.scale_text(view)}" for view in views)
    peaks = (f"{label(view.column)} {view.quantity.text(view.peak)}" for view in views)
    compared = (
        "Colour: motion into the body (mean removed) or pressure of the kernel, relative to the "
        "largest value of each model. All models receive the same load."
    )
    caption = f"{'; '.join(scales)}. Largest values: {', '.join(peaks)}. {MARKS} {compared}"
    pixels = render.picture(views, gallery.style, frame) if drawn is None else drawn
    return gallery.image("side-by-side", pixels, caption)


def _free_vibration(runs: Iterable[Run]) -> str:
    """Return a sentence on the strongest free vibration of each body, which maps leave out."""
    strongest = {}
    for run in runs:
        if free := [peak for peak in run.unnamed if peak.kind == FREE]:
            strongest[run] = max(free, key=lambda peak: float(peak.amplitudes.max()))
    each = ", ".join(
        f"{label(run.column)} {run.response.record.text(float(peak.amplitudes.max()), 2)} at "
        f"{peak.frequency:.0f} Hz"
        for run, peak in strongest.items()
    )
    return f"Maps leave out the free vibration after the start. At the probes: {each}." * bool(each)


def sentences(first: FirstScreen) -> list[str]:
    """Return the verdict: what propagation changes, and what drive law and focus change."""
    return [_propagation_sentence(first), _drive_sentence(first)]


def four_numbers(first: FirstScreen) -> Table:
    """Return the four numbers of the kernel and of bodies under the same load.

    They are level, reach, share outside and delay. Without skin, the deflection and the spread
    replace level and reach.
    """
    effects = list(first.own.values())
    # Heading, value of the kernel, values of the bodies.
    rows: list[tuple[str, str | None, Iterable[str | None]]]
    if any(run.is_skin for run in first.bodies):
        levels = (_sensation_text(e.highest_sensation) or _why_none(e) for e in effects)
        no_map = "none (no map)"
        reaches = (
            _threshold_text(e) or (no_map if e.highest_sensation else _why_none(e)) for e in effects
        )
        rows = [
            ("highest sensation level at the probes", overview.OF_PRESSURE, levels),
            ("reach above threshold, from the path", overview.OF_PRESSURE, reaches),
        ]
    else:
        rows = [
            ("largest displacement at the probes", None, map(_deflection_text, first.bodies)),
            (f"spread within {-NEAR:g} dB of the largest RMS, from the path",
             _distance(effects[0].kernel_spread), (_distance(each.spread) for each in effects)),
        ]  # fmt: skip
    line = effects[0].kernel_strongest
    of_line = f"{line.name} ({line.frequency:.0f} Hz)" if line else "the strongest line"
    rows += [
        (f"share of mean-square motion outside the kernel's {OUTSIDE:g} dB region",
         None if effects[0].share is None else "0 %", map(_share, effects)),
        (f"delay of {of_line}", "0 ms", map(_delay_text, effects)),
    ]  # fmt: skip
    names = [f"{first.kernel.tacton}, same load", "point kernel"]
    names += [label(each.column) for each in effects]
    table = Table(names, [[heading, kernel, *values] for heading, kernel, values in rows])
    return table if first.maps else table.only(names[0], *names[2:])  # the kernel has no value


def _why_none(effect: Propagation) -> str:
    """Return why a body has no sensation level."""
    return f"none ({overview.NOT_SKIN if effect.strongest else 'nothing vibrates'})"


def _deflection_text(run: Run) -> str:
    """Return the largest displacement; it is marked if a linear sheet is beyond its validity."""
    largest = float(abs(run.response.displacement).max())
    text, body = run.response.record.text(largest), run.scene.body
    if not body.of_kind.is_plate or named(run.model).is_nonlinear or largest < body.depth / 2:
        return text
    return f"{text} (invalid: above half the thickness, where a real sheet is stiffer)"


def _propagation_sentence(first: FirstScreen) -> str:
    effect = first.own[first.body.column]
    if effect.strongest is None:
        return "Nothing vibrates, because a constant pressure at a fixed focus drives no wave."
    name, line = label(effect.column), effect.strongest
    if effect.share is None:
        return f"The {name} moves most at {line.frequency:.0f} Hz ({line.name})."
    others = (e for e in first.own.values() if e.share is not None and e is not effect)
    also = "".join(f" ({label(each.column)}: {_share(each)})" for each in others)
    return (
        f"On the {name}, {_share(effect)} of the mean-square motion{also} lies outside the point "
        f"kernel's {OUTSIDE:g} dB region."
    )


def _drive_sentence(first: FirstScreen) -> str:
    kernel, published, pressure = first.kernel, first.published, first.kernel.scene.pressure
    if pressure == published.scene.pressure:
        return "The load is the published one: only propagation differs from the published model."
    law = f"drive law and focus ({pressure.drive}, {pressure.profile_name})".replace("_", " ")
    text = f"{law.capitalize()} change the amplitudes of lines and add no line."
    if names := added_lines(kernel, published):
        text = f"{law.capitalize()} add the lines {first_few(names)} to the published load."
    if not first.added:
        return f"{text} Linear propagation adds no line." if names else text
    each = (f"{first_few(own) or 'no line'} to the {label(c)}" for c, own in first.added.items())
    return f"{text} Stretching adds {', '.join(each)}. Linear propagation adds no line."


def _uncertainty(first: FirstScreen) -> str:
    """Return sentences on the uncertainty of the numbers."""
    words = first.budget.words if first.budget else ""
    parts = [f"{words[:1].upper()}{words[1:]}."] if words else []
    if first.shares:
        low, high = (100 * share for share in first.shares)
        parts.append(
            f"For moduli and losses within their 90 % intervals, the share outside is "
            f"{interval(low, high)} %."
        )
    if first.body.scene.body.of_kind.is_plate:
        parts.append(
            "Lim, Seifi and Park did not publish grammage, stiffness and support of their sheet. "
            "Detection thresholds are those of skin; a sheet has no sensation level."
        )
    if any(each.above_threshold for each in first.own.values()):
        parts.append(
            "The pressure is known only to within a factor of 2. Distances in brackets are for "
            "half and twice the pressure."
        )
    return " ".join(parts)


def _threshold_text(effect: Propagation) -> str | None:
    """Return the reach above threshold, with that for half and twice the pressure in brackets."""
    if not effect.above_threshold:
        return None
    half, once, twice = (_millimetre(each) or "none" for each in effect.above_threshold)
    text = once if once == "none" else f"{once} mm"
    return f"{text} ({half} to {twice} mm)" if half != twice else text


def _component(component: Component | None, quantity: Quantity = DISPLACEMENT) -> str:
    if component is None:
        return "none"
    size = quantity.text(component.amplitude, 2)
    return f"{component.name}, {component.frequency:.0f} Hz, {size}"


def _sensation_text(component: Component | None) -> str | None:
    if component is None or component.level is None:
        return None
    if not isfinite(component.level):
        return f"none (no threshold is known at {component.frequency:.0f} Hz)"
    return f"{round(component.level):+d} dB ({component.name}, {component.frequency:.0f} Hz)"


def _share(effect: Propagation) -> str | None:
    return None if effect.share is None else percent(effect.share)


def _delay_text(effect: Propagation) -> str:
    """Return the phase delay, or why there is none."""
    if (delay := effect.delay) is None:
        return "none (too weak at the probes)"
    return f"{significant(1e3 * delay, 2)} ms" + ", ahead of the kernel" * (delay < 0)


def _millimetre(reach: Reach | None) -> str | None:
    return None if reach is None else f"{'> ' * reach.beyond}{1e3 * reach.metre:.0f}"


def _distance(reach: Reach | None) -> str | None:
    return f"{_millimetre(reach)} mm" if reach else None


def _effects_table(effects: Mapping[str, Mapping[str, Propagation]]) -> list[Part]:
    """Return a table of the effect of propagation, with a row for each Tacton and body."""
    rows = [
        [name, label(each.column), _share(each), _millimetre(each.kernel_spread),
         _millimetre(each.spread), None if each.delay is None else 1e3 * each.delay,
         _component(each.kernel_strongest, PRESSURE), _component(each.strongest),
         _sensation_text(each.highest_sensation)]
        for name, columns in effects.items()
        for each in columns.values()
    ]  # fmt: skip
    table = Table([
        "Tacton", "body", "share outside", "spread, kernel, mm", "spread, body, mm",
        Column("phase delay of the kernel's strongest component", unit="ms", digits=2),
        "strongest component, kernel", "strongest component, body", "highest sensation level",
    ], rows)  # fmt: skip
    cells = zip(table.columns, zip(*rows, strict=True), strict=True)
    known = [column.name for column, own in cells if any(cell is not None for cell in own)]
    about_maps = (
        "Shares and spreads come from maps that reach 44 mm from the origin along x and y; areas "
        "and distances on a curved body are those along its surface. The map of a slab is that of "
        "a laterally infinite layer. The strongest component is the line with the largest "
        "amplitude at any probe. Whole periods may be missing from the phase delay. It includes "
        "the phase lag of the body. If it is negative, the body is ahead."
    )
    return [about_maps, table.only(*known)]
