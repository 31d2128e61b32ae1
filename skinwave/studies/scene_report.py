"""The report of a scene: one page that needs no network, built from a folder of results alone."""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from skinwave.report.levels import strongest_probe
from skinwave.report.palette import label
from skinwave.report.renderer import renderer
from skinwave.report.styles import Style
from skinwave.results.claims import claimed, evaluate
from skinwave.results.exports import write_field, write_probes, write_sound
from skinwave.results.files import distinct_names, folder_name
from skinwave.results.run import Run
from skinwave.results.surface import kernel_map
from skinwave.scene.file import dumps
from skinwave.scene.scene import Scene
from skinwave.studies import description, summary, tables
from skinwave.studies.album import Album, open_album
from skinwave.studies.changes import Drawn, beside_kernels, shown
from skinwave.studies.chosen import only
from skinwave.studies.dispersion_page import page_parts
from skinwave.studies.driven_modes import driven_modes
from skinwave.studies.gallery import Gallery, pictures, run_figures, tactons
from skinwave.studies.lines_table import lines_table
from skinwave.studies.quantity_map_page import CAPTION, quantity_figure, sentences
from skinwave.system import document
from skinwave.system.effort import Progress, versions
from skinwave.system.numbers import significant

ASSESSED = 0.5  # s that a Tacton must last for claims about its lines to be assessed


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
    names = _names(album.runs)
    parts = [
        *_first_screen(album, gallery),
        document.warnings_banner(
            (name, run.response.effort) for name, run in zip(names, album.runs, strict=True)
        ),
        *map(document.paragraph, description.other_quantity(album.scene)),
        _asked(album),
        document.section("What was modelled, and what was left out", *_modelled(album)),
        *mapped(album, gallery),
        document.section("What comes out", *views),
        document.section("What the probes see", *drawn, *map(lines_table, groups.values())),
        *_guided(album, gallery),
        document.section("How far the models agree", *_comparison(album)),
        document.section("Effort", _effort(album)),
        document.section("How far to trust it", *_trust(album)),
        document.section("Do it again", *_again(album)),
    ]
    (out / "index.html").write_text(document.page(album.title, *parts), encoding="utf-8")


def _names(runs: Sequence[Run]) -> list[str]:
    """Names of runs: by body and, if there are several, by Tacton."""
    several = len({run.tacton for run in runs}) > 1
    return [f"{run.tacton} on {run.body}" if several else run.body for run in runs]


def _first_screen(album: Album, gallery: Gallery) -> list[str]:
    """Effect of propagation on the first Tacton, with maps where views were saved."""
    groups = {name: _with_kernels(runs) for name, runs in tactons(album).items()}
    first = shown(groups, lambda run: _maps(album, run))
    if first is None:
        return []
    name = first.kernel.tacton * (len(groups) > 1)
    draw = partial(gallery.figure, "propagation")
    return summary.top(first, draw, name, gallery.style)


def _with_kernels(runs: Sequence[Run]) -> Sequence[Run]:
    """Runs of one Tacton with both point kernels, computed anew, as they are formulas."""
    bodies = [run for run in runs if run.is_motion]
    return [*beside_kernels(bodies[0])[:2], *bodies] if bodies else runs


def _maps(album: Album, run: Run) -> Drawn:
    """A body's map as it was saved with its view, and the kernel's."""
    view, surface = album.views.get(run.column), album.surfaces.get(run.column)
    if view is None or surface is None or view.scene.pressure != run.scene.pressure:
        return ()
    return surface, kernel_map(run.scene.pressure, surface.x, surface.y)


def _write_data(folder: Path, album: Album) -> None:
    """Probes, their sound and, of every view, a few frames of its field."""
    folder.mkdir()
    groups = tactons(album)
    names = distinct_names(groups) if len(groups) > 1 else [""]
    for name, runs in zip(names, groups.values(), strict=True):
        for k, run in enumerate(runs):
            stem = folder_name(f"{name}-{run.column}" if name else run.column)
            write_probes(folder / f"{stem}_probes", run.response)
            if k == len(runs) - 1:
                write_sound(folder, run.response, strongest_probe([run]))
    for view in album.views.values():
        write_field(folder, view)


def mapped(album: Album, gallery: Gallery) -> list[str]:
    """Maps of the quantity that the probes read, where it is not the motion of the surface."""
    scenes = {run.column: run.scene for run in album.runs}
    parts: list[str] = []
    for name, found in album.maps.items():
        caption = f"{label(name)}: {' '.join(sentences(scenes[name], found))} {CAPTION}"
        figure = quantity_figure(scenes[name], found, gallery.style)
        parts.append(gallery.figure(f"quantity-{folder_name(name)}", figure, caption))
    return [document.section("Where the quantity is largest", *parts)] if parts else []


def _asked(album: Album) -> str:
    rows = _asked_rows(album.scene)
    folded = document.Markup(
        '<details class="screen"><summary>The scene in full</summary>{}</details>'
    )
    scene = folded.format(document.preformatted(dumps(album.scene)))
    return document.section("What was asked", document.table(["", ""], rows), scene)


def _asked_rows(scene: Scene) -> list[list[str]]:
    tacton, pressure, body = scene.tacton, scene.pressure, scene.body
    depth = pressure.depth_of_modulation
    of_depth = f", depth of modulation {depth:g}" if pressure.law.uses_depth else ""
    return [
        ["focus", description.path_of(tacton)],
        ["amplitude modulation", ", ".join(description.tones_of(tacton)) or "none"],
        ["amplitude", ", ".join(description.levels_of(tacton)) or "100 % of full drive"],
        ["drive", f"{pressure.drive}{of_depth}, {description.spot_of(pressure)}, "
                  f"{pressure.peak_pressure:g} Pa at full drive, "
                  f"{1e3 * pressure.height:g} mm above the array"],
        ["body", description.extent(body) + description.above(body)],
        ["duration", f"{tacton.duration:g} s"],
        ["probes", ", ".join(f"({1e3 * x:g}, {1e3 * y:g})" for x, y in scene.probes) + " mm"],
        ["they read", scene.reading.words],
    ]  # fmt: skip


def _modelled(album: Album) -> list[str]:
    parts = [document.paragraph(text) for text in description.modelled(list(album.runs))]
    if album.planned is None:
        return [*parts, document.paragraph("No plan was saved with these results; skinwave plan "
                                         "scene.toml makes one.")]  # fmt: skip
    planned = album.planned
    rows = [[row["what"], row["value"], row["reason"]] for row in planned["rows"]]
    heading = (
        f"What the scene requires for a relative error of {100 * planned['tolerance']:g} % at its "
        "probes, and why. Pictures show the whole body, by finite elements or the modes of a plate."
    )
    warned = [document.paragraph(f"Warning: {text}.") for text in planned["warnings"]]
    return [*parts, document.paragraph(heading), document.table(["", "", "reason"], rows), *warned]


def _guided(album: Album, gallery: Gallery) -> list[str]:
    """Dispersion curves of the scene's body, folded; nothing of a body that has none."""
    if album.scene.body.of_kind.dispersion is None:
        return []
    try:
        parts = page_parts(driven_modes(album.scene), gallery.figure, gallery.style)
    except ValueError as error:  # such as a table of moduli that ends below the curves
        parts = [document.paragraph(f"No dispersion curves: {error}.")]
    folded = document.Markup(
        "<details><summary>Speeds and decay of its modes, and which the load drives</summary>{}"
        "</details>"
    )
    inside = document.Markup("\n").join(parts)
    return [document.section("Which waves the body guides", folded.format(inside))]


def _comparison(album: Album) -> list[str]:
    groups = tactons(album)
    parts: list[str] = []
    if any(len(runs) > 1 for runs in groups.values()):
        parts.append(tables.agreement_table(groups))
    long = [r for r in claimed(album.runs) if r.scene.tacton.duration >= ASSESSED]
    if assessed_claims := evaluate(long):
        parts.append(document.paragraph("Claims of Lim, Seifi and Park, evaluated on these runs:"))
        parts.append(tables.claims_table(assessed_claims))
    return parts or [document.paragraph("There is one model only.")]


def _effort(album: Album) -> str:
    efforts = {run.body: run.response.effort for run in album.runs if run.response.record.of_body}
    return tables.effort_table(efforts, len(tactons(album)))


def _trust(album: Album) -> list[str]:
    efforts = [(run.body, run.response.effort) for run in album.runs if run.response.record.of_body]
    found = [
        f"{label(body)}: relative error of the energy balance {effort.energy_imbalance:.0e} "
        "(refused beyond 1e-2); estimated relative error of the reduced-order model "
        f"{significant(100 * effort.estimate, 2)} %."
        for body, effort in efforts
        if effort.dofs
    ]
    trust: Mapping[str, Any] = album.trust or {}
    if {"misfit", "model"} <= trust.keys():
        found.append(
            f"At the probes, the motion in pictures, which have larger elements, differs from the "
            f"response by {trust['model']} by {significant(100 * trust['misfit'], 2)} %."
        )
    found.append("The pressure of a device is uncertain by a factor of 2, and all motion with it.")
    parts: list[str] = [document.paragraph(text) for text in dict.fromkeys(found)]
    if trust.get("cases"):
        parts.append(document.paragraph(
            "Results of some cases of skinwave verify on this installation; the whole suite "
            "compares the program with closed forms, series and published tables."))  # fmt: skip
        parts.append(_cases(trust["cases"]))
    return parts


def _cases(cases: Sequence[Mapping[str, Any]]) -> str:
    rows = [
        [case["title"], f"{case['value']:.5g}", f"{case['reference']:.5g}", f"{case['error']:.1e}",
         f"{case['bar']:.1e}", "passed" if case["passed"] else "FAILED", case["source"]]
        for case in cases
    ]  # fmt: skip
    header = ["case, by its check nearest to the tolerance", "value", "reference", "error",
              "tolerance", ""]  # fmt: skip
    return document.table([*header, "source"], rows)


def _again(album: Album) -> list[str]:
    made = album.runs[-1].response.effort.versions or versions()
    named = ", ".join(f"{name} {version}" for name, version in made.items())
    command = (album.trust or {}).get("command") or "skinwave report scene.toml"
    said = renderer().said if renderer().found else "none"
    made_by = document.paragraph(f"Computed with {named}; drawn with {said}. The scene:")
    code = document.Markup("<p><code>{}</code></p>").format(command)
    return [code, made_by, document.preformatted(dumps(album.scene))]
