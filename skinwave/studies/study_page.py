"""The page of a comparison, and that of a single run."""

from collections.abc import Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from matplotlib.figure import Figure

from simple_model import Effort
from simple_model.numbers import counted, decibel
from skinwave.models.point_kernel import SAME_LOAD
from skinwave.models.reduced import ReducedBody
from skinwave.report.description import (
    levels_of,
    modelled,
    other_quantity,
    path_of,
    tones_of,
    unresolved,
)
from skinwave.report.figures import overview_figure, png, tacton_figure
from skinwave.report.palette import label
from skinwave.results.claims import AssessedClaim
from skinwave.results.files import fill
from skinwave.results.run import Run
from skinwave.scene.file import dumps
from skinwave.studies import summary
from skinwave.studies.changes import Shown, beside_kernels, changes, quick_maps, shown
from skinwave.studies.tables import agreement_table, claims_table, effort_table, lines_table
from skinwave.system.document import (
    Part,
    Picture,
    Report,
    Section,
    preformatted,
    warnings_banner,
)
from skinwave.system.effort import Progress

EXAMPLES = ("am140", "stm20", "am140-stm20")  # what the paper's comparison figure shows
FIGURES = "figures"  # folder of a comparison's figures
LEVELS = (
    "Levels are relative to f_AM at the same probe, and those of the probe where that is largest, "
    "which may be one where f_AM is weak."
)
OVERVIEW_CAPTION = (
    "Top: motion about its mean at one probe, relative to each model's largest motion at any "
    "probe. Middle: its spectrum; filled markers are lines of the load, open ones free vibrations "
    "excited by the start of the Tacton. Bottom: how far the motion spreads."
)


@dataclass(frozen=True, kw_only=True)
class StudyOutcome:
    """Outcome of a comparison: assessed claims, warnings, cost, and how much of it was done."""

    assessed_claims: list[AssessedClaim]
    warnings: list[str]
    runs: int
    planned: int
    seconds: float = 0.0
    peak_memory: int = 0


def write_single(folder: Path, run: Run, more: Sequence[Part] = ()) -> None:
    """The folder of one run, with its page, which may have more parts before the effort."""
    fill(folder, run)
    group = beside_kernels(run) if run.is_motion and run.scene.load.is_plain else []
    first = shown({run.tacton: group}, quick_maps)
    parts = [
        *(summary.top(first, lambda figure, text: Picture(png(figure), text)) if first else []),
        warnings_banner([("", run.response.effort)]),
        Picture(png(tacton_figure(run.tacton, [run])), caption(run.tacton, [run])),
        *unresolved([run]),
        *more,
        Section("Effort", effort_table({run.body: run.response.effort}, 1)),
        Section("The scene", [preformatted(dumps(run.scene))]),
    ]
    Report(f"{run.tacton} on {run.body}: {run.model}", parts=parts).write(folder)


def page_parts(
    groups: Mapping[str, list[Run]],
    drawn_runs: Mapping[str, list[Run]],
    first: Shown | None,
    outcome: StudyOutcome,
    progress: Progress,
    figures: Mapping[str, Future[bytes]],
) -> list[Part]:
    """Parts of the page of a comparison.

    Parameters
    ----------
    groups : runs by Tacton
    drawn_runs : runs that figures show, by Tacton
    first : the Tacton of the first screen, if there is one
    outcome : StudyOutcome
    progress : called with the name of the phase and the fraction done
    figures : by Tacton and "overview", as far as they are begun
    """
    runs = [run for group in groups.values() for run in group]
    name = first.kernel.tacton * (len(groups) > 1) if first else ""
    begun = not figures["overview"].cancel()
    overview = figures["overview"].result() if begun else overview_png(drawn_runs)
    parts: list[Part] = [
        *(summary.top(first, partial(picture, "propagation"), name) if first else []),
        warnings_banner(efforts(runs)),
        _introduction(outcome, groups),
        *other_quantity(runs[-1].scene),
        *unresolved(runs),
        Picture(overview, OVERVIEW_CAPTION, "overview"),
        _changes(groups),
        Section(
            "Which of the paper's claims hold where",
            [
                LEVELS,
                claims_table(outcome.assessed_claims),
                *_disagreements(outcome.assessed_claims),
            ],
        ),
        Section("What was modelled, and what was left out", modelled(runs)),
        Section("How far the models agree", [agreement_table(groups)]),
    ]
    images = _images(drawn_runs, figures, progress)
    every = [Picture(images[n], caption(n, group), n) for n, group in groups.items()]
    return [*parts, Section("Every Tacton", every)]


def _changes(groups: Mapping[str, list[Run]]) -> Section:
    """Effect of propagation; of another quantity than the displacement, for which the point kernel
    has nothing to compare with, its lines.
    """
    if found := changes(groups):
        return Section("What propagation changes", summary.per_tacton(found))
    return Section("Lines", [part for group in groups.values() for part in lines_table(group)])


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
    groups: Mapping[str, list[Run]], prepared: Mapping[str, ReducedBody], outcome: StudyOutcome
) -> Section:
    """Cost of each body and of the whole."""
    runs = [run for group in groups.values() for run in group]
    efforts = {}
    for body in dict.fromkeys(run.body for run in runs if run.response.record.of_body):
        spent = [r.response.effort for r in runs if r.body == body]
        worst = max(e.energy_imbalance for e in spent), max(e.radiated for e in spent)
        first = prepared[body].effort if body in prepared else spent[0]
        efforts[body] = replace(first, energy_imbalance=worst[0], radiated=worst[1])
    return Section("Effort", effort_table(efforts, len(groups), outcome.seconds))


def again(command: str) -> Section:
    """Command that repeats the comparison."""
    text = f"{command}; or, for one run, skinwave run TACTON/BODY/scene.toml in this folder."
    return Section("Do it again", [text])


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


def picture(name: str, figure: Figure, caption: str) -> Picture:
    """A figure in a comparison's page and folder."""
    return Picture(png(figure), caption, name)


def _introduction(outcome: StudyOutcome, groups: Mapping[str, list[Run]]) -> str:
    if outcome.runs == outcome.planned:
        state = f"{counted(len(groups), 'Tacton')}, {outcome.runs} runs."
    else:
        state = f"Interrupted: {outcome.runs} of {outcome.planned} runs are finished and shown."
    return (
        f"{state} The point-kernel model of Lim, Seifi and Park (CHI EA '24, "
        "doi 10.1145/3613905.3650981), as published and under the load that the bodies "
        "receive, beside the motion of these bodies. Amplitudes of every line are in "
        "lines.csv, waveforms in responses.npz; each run's folder has its scene."
    )


def _disagreements(assessed_claims: list[AssessedClaim]) -> list[Part]:
    """Claims measured on paper that a body contradicts, and whether propagation is the cause."""
    of_kernel = {v.claim: v for v in assessed_claims if v.model == SAME_LOAD.name}
    texts: list[Part] = []
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


def caption(name: str, group: list[Run]) -> str:
    """Caption of a Tacton's figure."""
    tacton = group[0].scene.tacton
    moved = [] if tacton.trajectory.is_static else [path_of(tacton)]
    parts = [*tones_of(tacton), *moved, *levels_of(tacton)]
    return f"{name}: {', '.join(parts) or 'constant pressure'}. Rows are probes."
