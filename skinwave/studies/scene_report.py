"""The report of a scene: one page that needs no network, built from a folder of results alone."""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from simple_model.numbers import percent
from skinwave.report import description
from skinwave.report.levels import strongest_probe
from skinwave.report.maps import surfaces_figure
from skinwave.report.palette import label
from skinwave.report.renderer import renderer
from skinwave.report.styles import Style
from skinwave.results.claims import claimed, evaluate
from skinwave.results.exports import write_field, write_probes, write_sound
from skinwave.results.files import distinct_names, folder_name
from skinwave.results.run import Run
from skinwave.results.surface import kernel_map
from skinwave.scene.file import dumps
from skinwave.studies import dispersion_page, summary, tables
from skinwave.studies.album import Album, only, open_album
from skinwave.studies.changes import Drawn, beside_kernels, shown
from skinwave.studies.driven_modes import driven_modes
from skinwave.studies.gallery import Gallery, pictures, run_figures, tactons
from skinwave.studies.quantity_map_page import CAPTION, sentences
from skinwave.system.document import (
    Details,
    Markup,
    Part,
    Report,
    Section,
    preformatted,
    warnings_banner,
)
from skinwave.system.effort import Progress, versions
from skinwave.system.table import Column, Table

ASSESSED = 0.5  # s that a Tacton must last for claims about its lines to be assessed
CASES = (
    "Results of some cases of skinwave verify on this installation; the whole suite compares the "
    "program with closed forms, series and published tables."
)
CASE_COLUMNS = (
    "case, by its check nearest to the tolerance", Column("value", digits=5),
    Column("reference", digits=5), Column("error", digits=2), Column("tolerance", digits=2), "",
    "source",
)  # fmt: skip


def write_report(
    results: Path,
    out: Path,
    style: Style,
    progress: Progress,
    *,
    formats: Sequence[str] = ("png",),
    columns: Sequence[str] = (),
) -> None:
    """index.html, pictures/ and, for other programs, data/ in `out` from the results in a folder,
    or from some columns of them.

    No model of a body is run.

    Raises
    ------
    ValueError
        If the folder holds no result, or no such column.
    """
    album = only(open_album(results), columns)
    (out / "pictures").mkdir()
    gallery = Gallery(folder=out / "pictures", style=style, formats=formats)
    views = pictures(album, gallery, progress)
    drawn = run_figures(album, gallery, progress)
    progress("write data", 0.0)
    _write_data(out / "data", album)
    groups = tactons(album)
    parts = [
        *_first_screen(album, gallery),
        warnings_banner(_efforts(album.runs)),
        *description.other_quantity(album.scene),
        Section("What was asked", [
            Table(["", ""], description.asked_rows(album.scene)),
            Details("The scene in full", [preformatted(dumps(album.scene))]),
        ]),
        Section("What was modelled, and what was left out", _modelled(album)),
        *mapped(album, gallery),
        Section("What comes out", views),
        Section("What the probes see",
                [*drawn, *(part for runs in groups.values() for part in tables.lines_table(runs))]),
        *_guided(album, gallery),
        Section("How far the models agree", _comparison(album)),
        Section("Effort", _effort(album)),
        Section("How far to trust it", _trust(album)),
        Section("Do it again", _again(album)),
    ]  # fmt: skip
    Report(album.title, parts=parts, pictures="pictures").write(out)


def _efforts(runs: Sequence[Run]) -> list[tuple[str, Any]]:
    """Efforts of runs: by body and, if there are several, by Tacton."""
    several = len({run.tacton for run in runs}) > 1
    names = (f"{run.tacton} on {run.body}" if several else run.body for run in runs)
    return [(name, run.response.effort) for name, run in zip(names, runs, strict=True)]


def _first_screen(album: Album, gallery: Gallery) -> list[Part]:
    """Effect of propagation on the first Tacton, with maps where views were saved."""
    groups = {name: _with_kernels(runs) for name, runs in tactons(album).items()}
    first = shown(groups, lambda run: _maps(album, run))
    if first is None:
        return []
    draw = partial(gallery.figure, "propagation")
    return summary.top(first, draw, first.kernel.tacton * (len(groups) > 1), gallery.style)


def _with_kernels(runs: Sequence[Run]) -> Sequence[Run]:
    """Runs of one Tacton with both point kernels, computed anew, as they are formulas."""
    bodies = [run for run in runs if run.is_motion]
    return [*beside_kernels(bodies[0])[:2], *bodies] if bodies else runs


def _maps(album: Album, run: Run) -> Drawn:
    """A body's map as it was saved with its view, and the kernel's."""
    view, surface = album.views.get(run.column), album.maps.get(run.column)
    if view is None or surface is None or view.scene.pressure != run.scene.pressure:
        return ()
    return surface, kernel_map(run.scene.pressure, surface.x, surface.y)


def _write_data(folder: Path, album: Album) -> None:
    """Probes, their sound and, of every view, a few frames of its field."""
    folder.mkdir()
    groups = tactons(album)
    names = distinct_names(groups) if len(groups) > 1 else [""]
    for name, runs in zip(names, groups.values(), strict=True):
        for run in runs:
            stem = folder_name(f"{name}-{run.column}" if name else run.column)
            write_probes(folder / f"{stem}_probes", run.response)
        write_sound(folder, runs[-1].response, strongest_probe(runs[-1:]))
    for view in album.views.values():
        write_field(folder, view)


def mapped(album: Album, gallery: Gallery) -> list[Part]:
    """Maps of the quantity that the probes read, where it is not the motion of the surface."""
    scenes = {run.column: run.scene for run in album.runs}
    parts = []
    for name, found in album.maps.items():
        if (scene := scenes[name]).reading.is_plain:
            continue
        caption = f"{label(name)}: {' '.join(sentences(scene, found))} {CAPTION}"
        figure = surfaces_figure(scene, {name: found}, gallery.style)
        parts.append(gallery.figure(f"quantity-{folder_name(name)}", figure, caption))
    return [Section("Where the quantity is largest", parts)] if parts else []


def _modelled(album: Album) -> list[Part]:
    parts: list[Part] = [*description.modelled(list(album.runs))]
    if (planned := album.planned) is None:
        return [*parts, "No plan was saved with these results; skinwave plan scene.toml makes one."]
    heading = (
        f"What the scene requires for a relative error of {100 * planned['tolerance']:g} % at its "
        "probes, and why. Pictures show the whole body, by finite elements or the modes of a plate."
    )
    rows = [[row["what"], row["value"], row["reason"]] for row in planned["rows"]]
    warned = (f"Warning: {text}." for text in planned["warnings"])
    return [*parts, heading, Table(["", "", "reason"], rows), *warned]


def _guided(album: Album, gallery: Gallery) -> list[Part]:
    """Dispersion curves of the scene's body, folded; nothing of a body that has none."""
    if album.scene.body.of_kind.dispersion is None:
        return []
    try:
        found = driven_modes(album.scene)
        parts = [
            " ".join(dispersion_page.sentences(found)),
            *dispersion_page.taken_as(album.scene),
            *dispersion_page.page_parts(found, gallery.figure, gallery.style),
        ]
    except ValueError as error:  # such as a table of moduli that ends below the curves
        parts = [f"No dispersion curves: {error}."]
    folded = Details("Speeds and decay of its modes, and which the load drives", parts)
    return [Section("Which waves the body guides", [folded])]


def _comparison(album: Album) -> list[Part]:
    groups = tactons(album)
    parts: list[Part] = []
    if any(len(runs) > 1 for runs in groups.values()):
        parts.append(tables.agreement_table(groups))
    long = [r for r in claimed(album.runs) if r.scene.tacton.duration >= ASSESSED]
    if assessed_claims := evaluate(long):
        parts.append("Claims of Lim, Seifi and Park, evaluated on these runs:")
        parts.append(tables.claims_table(assessed_claims))
    return parts or ["There is one model only."]


def _effort(album: Album) -> list[Part]:
    efforts = {run.body: run.response.effort for run in album.runs if run.response.record.of_body}
    return tables.effort_table(efforts, len(tactons(album)))


def _trust(album: Album) -> list[Part]:
    efforts = [(run.body, run.response.effort) for run in album.runs if run.response.record.of_body]
    found = [
        f"{label(body)}: relative error of the energy balance {effort.energy_imbalance:.0e} "
        "(refused beyond 1e-2); estimated relative error of the reduced-order model "
        f"{percent(effort.estimate)}."
        for body, effort in efforts
        if effort.dofs
    ]
    trust: Mapping[str, Any] = album.trust or {}
    if {"misfit", "model"} <= trust.keys():
        found.append(
            f"At the probes, the motion in pictures, which have larger elements, differs from the "
            f"response by {trust['model']} by {percent(trust['misfit'])}."
        )
    found.append("The pressure of a device is uncertain by a factor of 2, and all motion with it.")
    parts: list[Part] = [*dict.fromkeys(found)]
    if cases := trust.get("cases"):
        kept = ("title", "value", "reference", "error", "bar")
        rows = [
            [*(case[key] for key in kept), "passed" if case["passed"] else "FAILED", case["source"]]
            for case in cases
        ]
        parts += [CASES, Table(CASE_COLUMNS, rows)]
    return parts


def _again(album: Album) -> list[Part]:
    made = album.runs[-1].response.effort.versions or versions()
    named = ", ".join(f"{name} {version}" for name, version in made.items())
    command = (album.trust or {}).get("command") or "skinwave report scene.toml"
    said = renderer().said if renderer().found else "none"
    code = Markup("<p><code>{}</code></p>").format(command)
    made_by = f"Computed with {named}; drawn with {said}. The scene:"
    return [code, made_by, preformatted(dumps(album.scene))]
