"""The page of responses that `run`, `compare` and `report` write.

The first screen has the verdict, four numbers, one picture and the contents. Waveforms have a
selector, and details are folded. `skinwave.results.propagation` defines the numbers.
"""

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from PIL import Image as Pillow
from PIL import features

from simple_model import Effort
from simple_model.numbers import interval, percent, significant
from simple_model.quantities import DISPLACEMENT, PRESSURE, Quantity
from skinwave.models.point_kernel import PUBLISHED, SAME_LOAD
from skinwave.report import description
from skinwave.report.figures import REPORT, drawn, tacton_figure
from skinwave.report.levels import levels_figure, strongest_probe
from skinwave.report.maps import BESIDE, SURFACES, surfaces_figure
from skinwave.report.palette import label
from skinwave.report.styles import Style
from skinwave.results.claims import claimed, evaluate
from skinwave.results.files import distinct_names, fill
from skinwave.results.propagation import NEAR, OUTSIDE, Component, Propagation, Reach, added_lines
from skinwave.results.run import Run
from skinwave.scene.file import dumps
from skinwave.studies import tables
from skinwave.studies.changes import Shown, beside_kernels, changes, first_of, quick_maps, shown
from skinwave.system.document import (
    Choice,
    Details,
    Part,
    Picture,
    Report,
    Section,
    contents,
    preformatted,
)
from skinwave.system.effort import Progress, silent
from skinwave.system.table import Table

PICTURES = "pictures"  # folder of a page's figures
QUALITY = 88  # of pictures inside a page
NAMED = 3  # lines that a sentence names
NOTHING = "Nothing vibrates: a constant pressure on a focus at rest leaves no wave."
ABOUT_MAPS = (
    "Maps give shares and spreads; they reach 44 mm either way. The map of a slab is that of a "
    "laterally infinite layer. For other bodies only the first Tacton has a map. The strongest "
    "component has the largest amplitude at any probe. Its phase delay is known up to whole "
    "periods and includes the phase of a body that is driven off resonance."
)
WAVEFORMS = "Waveforms and spectra. Rows are probes."
LOADS = (
    "The kernel as published has the paper's load, a linear drive in a sinc² main lobe; all others "
    "have the scene's."
)
SENSATION = (
    "Lines of the motion at the probe that moves most, and the detection threshold (for a focal "
    "spot on the hand; Verrillo 1963 and Bolanowski et al. 1988, uncertain by 5 dB and more)."
)


@dataclass(frozen=True, kw_only=True)
class Gallery:
    """How pictures are drawn: `style`, and the `formats` of figures beside PNG."""

    style: Style = REPORT
    formats: Sequence[str] = ()

    def figure(self, name: str, figure: Figure, caption: str) -> Picture:
        """A figure, with its files."""
        kinds = ("png", *self.formats)
        files = {kind: drawn(figure, kind, self.style.dpi) for kind in kinds}
        with Pillow.open(io.BytesIO(files["png"])) as image:
            small, kind = _compressed(image.convert("RGB"))
        return Picture(small, caption, name, kind, files)

    def image(self, name: str, pixels: Any, caption: str) -> Picture:
        """An image (ny, nx, 3) of bytes, with its file."""
        image, buffer = Pillow.fromarray(pixels), io.BytesIO()
        image.save(buffer, format="png", optimize=True)
        small, kind = _compressed(image)
        return Picture(small, caption, name, kind, {"png": buffer.getvalue()})


def _compressed(image: Pillow.Image) -> tuple[bytes, str]:
    """A picture in as few bytes as a browser needs, and their format."""
    buffer, kind = io.BytesIO(), "webp" if features.check("webp") else "png"
    image.save(buffer, format=kind, quality=QUALITY, method=4)
    return buffer.getvalue(), kind


def page_of(
    title: str,
    groups: Mapping[str, Sequence[Run]],
    first: Shown | None,
    gallery: Gallery,
    *,
    figures: Mapping[str, Sequence[Run]] | None = None,
    seen: Sequence[Part] = (),
    more: Sequence[Part] = (),
    modelled: Sequence[Part] = (),
    again: Sequence[Part] = (),
    seconds: float | None = None,
    progress: Progress = silent,
) -> Report:
    """The page of runs by Tacton.

    Parameters
    ----------
    first : the Tacton of the first screen, if a body was run beside both kernels
    figures : runs that figures show, if not the same
    seen, more : parts before and after the waveforms
    modelled, again : further parts of what was modelled, and of how to repeat it
    seconds : of the whole, the sum of all runs if not given
    """
    runs = [run for group in groups.values() for run in group]
    of_one = len(groups) == 1
    top: list[Part] = [*_first_screen(first, gallery)] if first else []
    below: list[Part] = [*seen, *_waveforms(figures or groups, gallery, progress), *more]
    below += tables.claims_parts(evaluate(claimed(runs)))
    effects: Mapping[str, Mapping[str, Propagation]] = changes(groups)
    if not effects and first:
        effects = {first.kernel.tacton: first.changes}
    if effects:
        below.append(Details("What propagation changes", _per_tacton(effects)))
    if of_one or not effects:
        lines = [part for group in groups.values() for part in tables.lines_table(group)]
        below.append(Details("Lines", lines))
    below.append(Details("What was modelled, and what was left out",
                         [*description.modelled(runs), *modelled]))  # fmt: skip
    if any(len(group) > 1 for group in groups.values()):
        below.append(Details("How far the models agree", [tables.agreement_table(groups)]))
    below.append(Details("Effort", tables.effort_table(_spent(runs), len(groups), seconds)))
    scene = [preformatted(dumps(runs[-1].scene))] if of_one else []
    below.append(Details("The scene, and how to do it again", [*again, *scene]))
    notes = [*description.other_quantity(runs[-1].scene), *description.unresolved(runs)]
    verdict = sentences(first) if first else []
    if first and not of_one:
        verdict[0] = f"{first.kernel.tacton}, one of the Tactons below: {verdict[0]}"
    numbers = [four_numbers(first)] if first else []
    parts = [*numbers, contents(below), *top, *notes, *below]
    return Report(title, verdict, parts, efforts_of(runs), PICTURES)


def efforts_of(runs: Sequence[Run]) -> list[tuple[str, Effort]]:
    """Efforts of runs: by body and, if there are several, by Tacton."""
    several = len({run.tacton for run in runs}) > 1
    names = (f"{run.tacton} on {run.body}" if several else run.body for run in runs)
    return [(name, run.response.effort) for name, run in zip(names, runs, strict=True)]


def write_run_page(folder: Path, run: Run, more: Sequence[Part] = ()) -> None:
    """The folder of one run, with its page, which may have more parts."""
    fill(folder, run)
    group = beside_kernels(run) if run.is_motion and run.scene.load.is_plain else []
    first = shown({run.tacton: group}, quick_maps)
    title = f"{run.tacton} on {run.body}: {run.model}"
    page_of(title, {run.tacton: [run]}, first, Gallery(), more=more).write(folder)


def _spent(runs: Sequence[Run]) -> dict[str, Effort]:
    """Effort by body: of its first response, with the largest errors of all."""
    spent: dict[str, list[Effort]] = {}
    for run in runs:
        if run.response.record.of_body:
            spent.setdefault(run.body, []).append(run.response.effort)
    return {
        body: replace(
            efforts[0], energy_imbalance=max(e.energy_imbalance for e in efforts),
            radiated=max(e.radiated for e in efforts),
        )
        for body, efforts in spent.items()
    }  # fmt: skip


def _waveforms(
    groups: Mapping[str, Sequence[Run]], gallery: Gallery, progress: Progress
) -> list[Part]:
    """A figure of each Tacton, of which one is seen at a time."""
    options: dict[str, Part] = {}
    files = dict(zip(groups, distinct_names(groups), strict=True))
    for k, name in enumerate(sorted(groups, key=lambda each: each != first_of(groups))):
        progress(f"draw {name}", k / len(groups))
        runs = list(groups[name])
        seen = name if len(groups) > 1 else "waveforms and spectra"
        figure = tacton_figure(name, runs, gallery.style)
        options[seen] = gallery.figure(files[name], figure, _caption(name, runs))
        if len(groups) == 1 and any(run.response.record.of_body for run in runs):
            figure = levels_figure(runs, strongest_probe(runs), gallery.style)
            options["sensation levels"] = gallery.figure("sensation", figure, SENSATION)
    return [Section("Waveforms", [Choice("waveforms", options)])]


def _caption(name: str, runs: Sequence[Run]) -> str:
    tacton, columns = runs[0].scene.tacton, {run.column for run in runs}
    moved = [] if tacton.trajectory.is_static else [description.path_of(tacton)]
    commanded = [*description.tones_of(tacton), *moved, *description.levels_of(tacton)]
    text = f"{name}: {', '.join(commanded) or 'constant pressure'}. {WAVEFORMS}"
    return f"{text} {LOADS}" if {PUBLISHED.name, SAME_LOAD.name} <= columns else text


def _first_screen(shown: Shown, gallery: Gallery) -> list[Part]:
    """The maps, and how sure the numbers are."""
    parts: list[Part] = []
    if shown.surfaces and shown.changes[shown.body.column].strongest:
        figure = surfaces_figure(
            shown.kernel.scene, shown.surfaces, gallery.style, measured=shown.measured
        )
        caption = f"{SURFACES} {BESIDE}" if shown.measured else SURFACES
        parts.append(gallery.figure("propagation", figure, caption))
    return [*parts, _sure(shown)]


def sentences(shown: Shown) -> list[str]:
    """The verdict: what propagation changes, and what the drive law and the focus do."""
    found = shown.changes[shown.body.column]
    return [_propagated(found), _driven(shown.kernel, shown.published)]


def four_numbers(shown: Shown) -> Table:
    """Level, reach, share and delay: the kernel and bodies under the same load, a column each."""
    found = list(shown.changes.values())
    rows = [
        ["highest sensation level at the probes", "-"]
        + [_highest_sensation(c.highest_sensation) for c in found],
        ["above threshold up to this distance from the path", "-"]
        + [_above_threshold(c) for c in found],
        [f"share of motion outside the kernel's {OUTSIDE:g} dB region"]
        + ["-" if found[0].share is None else "0 %", *(_percent(c.share) for c in found)],
        ["delay of the strongest component", "0 ms"]
        + [f"{_delay(c)} ms" if c.delay is not None else "-" for c in found],
    ]
    name = f"{shown.kernel.tacton}: same load"
    return Table([name, "point kernel", *(label(c.column) for c in found)], rows)


def _propagated(found: Propagation) -> str:
    if found.strongest is None:
        return NOTHING
    name, said = label(found.column), found.strongest
    if found.share is None:
        return f"The {name} moves most at {said.frequency:.0f} Hz ({said.name})."
    return (
        f"{percent(found.share)} of the mean-square motion of the {name} lies outside the kernel's "
        f"{OUTSIDE:g} dB region. It spreads up to {_reach(found.spread)} mm from the path "
        f"({NEAR:g} dB); kernel: {_reach(found.kernel_spread)} mm."
    )


def _driven(kernel: Run, published: Run) -> str:
    names, pressure = added_lines(kernel, published), kernel.scene.pressure
    if pressure == published.scene.pressure:
        return "The load is the published one: only propagation differs from the paper's model."
    names_of = f"{pressure.drive}, {pressure.profile_name}".replace("_", " ")
    law = f"Drive law and focus ({names_of})"
    if not names:
        return f"{law} change strengths of components and add none."
    said = ", ".join(names[:NAMED]) + " and others" * (len(names) > NAMED)
    return f"{law} add {said}; propagation adds no component."


def _sure(shown: Shown) -> str:
    """What the numbers are uncertain by."""
    said = [f"{shown.budget.words}."] if shown.budget else []
    if shown.shares:
        low, high = (100 * share for share in shown.shares)
        said.append(
            f"For materials within what is known, the share outside is {interval(low, high)} %."
        )
    if shown.body.scene.body.of_kind.is_plate:
        said.append(
            "Grammage, stiffness and support of the measured sheet are not published. Detection "
            "thresholds are those of skin, so a sheet has no level and no reach."
        )
    if any(c.above_threshold for c in shown.changes.values()):
        said.append(
            "The pressure is known to a factor of 2: distances in brackets are for half and twice "
            "the pressure."
        )
    return " ".join(said)


def _above_threshold(found: Propagation) -> str:
    """Reach above the threshold, and in brackets with half and twice the pressure."""
    if not found.above_threshold:
        return "-"
    half, now, twice = (_reach(each) if each else "none" for each in found.above_threshold)
    return f"{now} mm ({half} to {twice})" if half != twice else f"{now} mm"


def _component(found: Component | None, quantity: Quantity = DISPLACEMENT) -> str:
    if found is None:
        return "none"
    return f"{found.name}, {found.frequency:.0f} Hz, {quantity.text(found.amplitude, 2)}"


def _delay(found: Propagation) -> str:
    return "-" if found.delay is None else significant(1e3 * found.delay, 2)


def _highest_sensation(found: Component | None) -> str:
    if found is None or found.level is None:
        return "-"
    return f"{found.level:+.0f} dB ({found.name}, {found.frequency:.0f} Hz)"


def _percent(share: float | None) -> str:
    return "-" if share is None else percent(share)


def _reach(found: Reach | None) -> str:
    return "-" if found is None else f"{'> ' * found.beyond}{1e3 * found.metre:.0f}"


def _per_tacton(found: Mapping[str, Mapping[str, Propagation]]) -> list[Part]:
    """Tacton -> body -> what propagation changes, a row each."""
    rows = [
        [name, label(c.column), _percent(c.share), _reach(c.kernel_spread), _reach(c.spread),
         _delay(c), _component(c.kernel_strongest, PRESSURE), _component(c.strongest),
         _highest_sensation(c.highest_sensation)]
        for name, columns in found.items()
        for c in columns.values()
    ]  # fmt: skip
    columns = ["Tacton", "body", "share outside", "spread of kernel, mm", "of body, mm"]
    columns += ["phase delay of strongest in body, ms", "strongest in kernel", "in body"]
    return [ABOUT_MAPS, Table([*columns, "highest sensation level"], rows)]
