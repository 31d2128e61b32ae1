"""The page of a comparison, and that of a single run."""

from collections.abc import Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, replace
from pathlib import Path

from matplotlib.figure import Figure

from simple_model import Effort
from skinwave.models.point_kernel import SAME_LOAD
from skinwave.models.prepared import Prepared
from skinwave.report.figures import overview_figure, png, tacton_figure
from skinwave.report.palette import label
from skinwave.results.claims import AssessedClaim
from skinwave.results.files import fill
from skinwave.results.run import Run
from skinwave.scene.file import dumps
from skinwave.studies import summary, tables
from skinwave.studies.changes import Shown, beside_kernels, changes, quick_maps, shown
from skinwave.studies.description import (
    levels_of,
    modelled,
    other_quantity,
    path_of,
    tones_of,
    unresolved,
)
from skinwave.studies.lines_table import lines_table
from skinwave.system import document
from skinwave.system.effort import Progress
from skinwave.system.numbers import decibel

EXAMPLES = ("am140", "stm20", "am140-stm20")  # what the paper's comparison figure shows


@dataclass(frozen=True, kw_only=True)
class StudyOutcome:
    """Outcome of a comparison: assessed claims, warnings, cost, and how much of it was done."""

    assessed_claims: list[AssessedClaim]
    warnings: list[str]
    runs: int
    planned: int
    seconds: float = 0.0
    peak_memory: int = 0


def write_single(folder: Path, run: Run, more: Sequence[str] = ()) -> None:
    """The folder of one run, with its page, which may have more parts before the effort."""
    fill(folder, run)
    figure = tacton_figure(run.tacton, [run])
    group = beside_kernels(run) if run.is_motion and run.scene.load.is_plain else []
    first = shown({run.tacton: group}, quick_maps)
    parts = [
        *(summary.top(first, lambda f, text: document.picture(png(f), text)) if first else []),
        document.warnings_banner([("", run.response.effort)]),
        document.picture(png(figure), caption(run.tacton, [run]), "tacton"),
        *map(document.paragraph, unresolved([run])),
        *more,
        document.section("Effort", tables.effort_table({run.body: run.response.effort}, 1)),
        document.section("The scene", document.preformatted(dumps(run.scene))),
    ]
    title = f"{run.tacton} on {run.body}: {run.model}"
    (folder / "index.html").write_text(document.page(title, *parts), encoding="utf-8")


def page_parts(
    folder: Path,
    groups: Mapping[str, list[Run]],
    drawn_runs: Mapping[str, list[Run]],
    first: Shown | None,
    outcome: StudyOutcome,
    progress: Progress,
    figures: Mapping[str, Future[bytes]],
) -> list[str]:
    """Parts of index.html, and a PNG of each figure in it.

    Parameters
    ----------
    folder : Path
    groups : runs by Tacton
    drawn_runs : runs that figures show, by Tacton
    first : the Tacton of the first screen, if there is one
    outcome : StudyOutcome
    progress : called with the name of the phase and the fraction done
    figures : by Tacton and "overview", as far as they are begun
    """
    runs = [run for group in groups.values() for run in group]
    (folder / "figures").mkdir()

    def drawn(figure: Figure, caption: str) -> str:
        return kept(folder, "propagation", figure, caption)

    begun = not figures["overview"].cancel()
    overview = figures["overview"].result() if begun else overview_png(drawn_runs)
    parts = [
        *(summary.top(first, drawn, first.kernel.tacton * (len(groups) > 1)) if first else []),
        document.warnings_banner(efforts(runs)),
        _introduction(outcome, groups),
        *map(document.paragraph, [*other_quantity(runs[-1].scene), *unresolved(runs)]),
        _kept(folder, "overview", overview, OVERVIEW_CAPTION),
        *_changes(groups),
        document.section(
            "Which of the paper's claims hold where",
            document.paragraph(LEVELS),
            tables.claims_table(outcome.assessed_claims),
            *map(document.paragraph, _disagreements(outcome.assessed_claims)),
        ),
        document.section("What was modelled, and what was left out",
                         *map(document.paragraph, modelled(runs))),
        document.section("How far the models agree", tables.agreement_table(groups)),
    ]  # fmt: skip
    images = _images(drawn_runs, figures, progress)
    pictures = [_kept(folder, n, images[n], caption(n, group)) for n, group in groups.items()]
    return [*parts, document.section("Every Tacton", *pictures)]


def _changes(groups: Mapping[str, list[Run]]) -> list[str]:
    """Effect of propagation; of another quantity than the displacement, for which the point kernel
    has nothing to compare with, its lines.
    """
    if found := changes(groups):
        return [document.section("What propagation changes", summary.per_tacton(found))]
    return [document.section("Lines", *map(lines_table, groups.values()))]


def tacton_png(name: str, group: list[Run]) -> bytes:
    """A Tacton's figure as a PNG file."""
    return png(tacton_figure(name, group))


def overview_png(groups: Mapping[str, list[Run]]) -> bytes:
    """A few Tactons side by side as a PNG file."""
    few = {n: groups[n] for n in EXAMPLES if n in groups} or dict(list(groups.items())[:3])
    probes = next(iter(few.values()))[0].scene.probes
    return png(overview_figure(few, min(2, len(probes) - 1)))


def efforts(runs: list[Run]) -> list[tuple[str, Effort]]:
    """Efforts by what a run is called."""
    return [(f"{run.tacton} on {run.body}", run.response.effort) for run in runs]


def effort_section(
    groups: Mapping[str, list[Run]], prepared: Mapping[str, Prepared], outcome: StudyOutcome
) -> str:
    """Cost of each body and of the whole."""
    runs = [run for group in groups.values() for run in group]
    efforts = {}
    for body in dict.fromkeys(run.body for run in runs if run.response.record.of_body):
        spent = [r.response.effort for r in runs if r.body == body]
        worst = max(e.energy_imbalance for e in spent), max(e.radiated for e in spent)
        first = prepared[body].effort if body in prepared else spent[0]
        efforts[body] = replace(first, energy_imbalance=worst[0], radiated=worst[1])
    return document.section("Effort", tables.effort_table(efforts, len(groups), outcome.seconds))


def again(command: str) -> str:
    """Command that repeats the comparison."""
    return document.section("Do it again", document.paragraph(
        f"{command}; or, for one run, skinwave run TACTON/BODY/scene.toml in this folder."
    ))  # fmt: skip


def _images(
    groups: Mapping[str, list[Run]], figures: Mapping[str, Future[bytes]], progress: Progress
) -> dict[str, bytes]:
    """Each Tacton's figure; what is not begun yet aside is drawn here, from the last on."""
    here: dict[str, bytes] = {}
    for name in reversed(list(groups)):
        if name not in figures or figures[name].cancel():
            progress("draw", len(here) / len(groups))
            here[name] = tacton_png(name, groups[name])
    return {name: here[name] if name in here else figures[name].result() for name in groups}


def kept(folder: Path, name: str, figure: Figure, caption: str) -> str:
    """A figure as a file, and inside the page."""
    return _kept(folder, name, png(figure), caption)


def _kept(folder: Path, name: str, image: bytes, caption: str) -> str:
    """A figure drawn once: as a file, and inside the page."""
    (folder / "figures" / f"{name}.png").write_bytes(image)
    return document.picture(image, caption, name)


def _introduction(outcome: StudyOutcome, groups: Mapping[str, list[Run]]) -> str:
    if outcome.runs == outcome.planned:
        state = f"{len(groups)} Tacton{'s' * (len(groups) != 1)}, {outcome.runs} runs."
    else:
        state = f"Interrupted: {outcome.runs} of {outcome.planned} runs are finished and shown."
    return document.paragraph(
        f"{state} The point-kernel model of Lim, Seifi and Park (CHI EA '24, "
        "doi 10.1145/3613905.3650981), as published and under the load that the bodies "
        "receive, beside the motion of these bodies. Amplitudes of every line are in "
        "lines.csv, waveforms in responses.npz; each run's folder has its scene."
    )


def _disagreements(assessed_claims: list[AssessedClaim]) -> list[str]:
    """Claims measured on paper that a body contradicts, and whether propagation is the cause."""
    of_kernel = {v.claim: v for v in assessed_claims if v.model == SAME_LOAD.name}
    texts = []
    for assessed in assessed_claims:
        kernel = of_kernel.get(assessed.claim)
        if assessed.body == "none" or not assessed.claim.startswith("M") or assessed.holds:
            continue
        text = (
            f"The {label(assessed.body)} contradicts {assessed.claim}, which was measured on "
            f"paper: {assessed.sentence}."
        )
        if kernel is not None and assessed.claim != "M2":  # which is about places, in Hz
            same = "holds" if kernel.holds else "fails, too"
            text += (
                f" In the point kernel under the same load it {same}: what decides is "
                f"{decibel(kernel.value)} dB there and {decibel(assessed.value)} dB here, and that "
                "difference is propagation's."
            )
        texts.append(text)
    return texts


LEVELS = (
    "Levels are relative to f_AM at the same probe, and those of the probe where that is largest, "
    "which may be one where f_AM is weak."
)
OVERVIEW_CAPTION = (
    "Top: motion about its mean at one probe, relative to each model's largest motion at any "
    "probe. Middle: its spectrum; filled markers are lines of the load, open ones free vibrations "
    "excited by the start of the Tacton. Bottom: how far the motion spreads."
)


def caption(name: str, group: list[Run]) -> str:
    """Caption of a Tacton's figure."""
    tacton = group[0].scene.tacton
    moved = [] if tacton.trajectory.is_static else [path_of(tacton)]
    parts = [*tones_of(tacton), *moved, *levels_of(tacton)]
    return f"{name}: {', '.join(parts) or 'constant pressure'}. Rows are probes."
