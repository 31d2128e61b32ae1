"""The main job: Tactons on several bodies, compared, in one folder."""

import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from html import escape
from pathlib import Path

from matplotlib.figure import Figure

from simple_model import Effort
from skinwave import document
from skinwave.effort import Progress, peak_memory
from skinwave.files import fill, write_claims, write_lines, write_responses, write_run
from skinwave.models.bodies import check_mesh, default_size
from skinwave.models.prepared import Prepared, answer, prepare
from skinwave.pictures.figures import label, overview_figure, png, tacton_figure
from skinwave.planning.assessment import assessed
from skinwave.run import Run
from skinwave.scene import BODIES, Body, Scene, with_body
from skinwave.scene_file import dumps
from skinwave.simulation import check_knobs, compute
from skinwave.studies import paper15, summary, tables
from skinwave.studies.changes import Shown, all_maps, beside_kernels, changes, quick_maps, shown
from skinwave.studies.claims import Verdict, evaluate
from skinwave.studies.description import levels_of, modelled, path_of, tones_of, untold

EXAMPLES = ("am140", "stm20", "am140-stm20")  # what the paper's comparison figure shows


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What a comparison left: its verdicts and warnings, what it cost, how much of it was done."""

    verdicts: list[Verdict]
    warnings: list[str]
    runs: int
    planned: int
    seconds: float
    peak_memory: int


def paper_scenes(bodies: Mapping[str, Body] | None = None) -> dict[str, dict[str, Scene]]:
    """Tacton -> column -> scene of the paper's 15 Tactons: both point kernels, and bodies by name,
    or paper and skin.
    """
    return {name: paper15.scenes(name, tacton, bodies) for name, tacton in paper15.tactons()}


def own_scenes(scene: Scene, name: str) -> dict[str, dict[str, Scene]]:
    """The same for one scene: on its own body or, if it has none, on paper and skin."""
    if scene.body.kind != "none":
        known = (label for label, body in BODIES.items() if body == scene.body)
        bodies = {next(known, scene.body.kind): scene}
    else:
        bodies = {key: with_body(scene, BODIES[key]) for key in paper15.MEASURED_ON}
    return {name: paper15.beside_kernels(scene) | bodies}


def run_study(
    scenes: Mapping[str, Mapping[str, Scene]],
    folder: Path,
    progress: Progress,
    *,
    title: str,
    command: str,
    h: float | None = None,
    solver: str = "auto",
) -> Outcome:
    """Answer every scene, writing each run as it is finished, then the tables and the page.

    An interrupt ends the answering early; what is finished is still compared and written.
    """
    check_knobs(solver, h=h)
    for solid in {s.body for group in scenes.values() for s in group.values()}:
        if solid.kind != "none":
            check_mesh(
                solid, h or default_size(solid)
            )  # refuses what cannot be meshed before any run
    started = time.perf_counter()
    runs: list[Run] = []
    prepared: dict[str, Prepared] = {}
    planned = sum(map(len, scenes.values()))
    try:
        for column in dict.fromkeys(column for group in scenes.values() for column in group):
            for name, group in scenes.items():
                if column in group:
                    runs.append(_answer(name, column, group[column], prepared, progress, h, solver))
                    write_run(folder / name / column, runs[-1])
                    progress(f"answer {name} by {column}", len(runs) / planned)
    except KeyboardInterrupt:
        if not runs:
            raise
    groups: dict[str, list[Run]] = {}
    for run in runs:
        groups.setdefault(run.tacton, []).append(run)
    first = None
    with suppress(KeyboardInterrupt):
        maps = partial(all_maps, progress=progress, solver=solver)
        first = shown(groups, maps) if len(runs) == planned else None
    outcome = Outcome(
        verdicts=evaluate(runs),
        warnings=document.worst_warnings(_efforts(runs)),
        runs=len(runs),
        planned=planned,
        seconds=time.perf_counter() - started,
        peak_memory=peak_memory(),
    )
    progress("write tables", 0.0)
    write_claims(folder / "claims.csv", outcome.verdicts)
    write_lines(folder / "lines.csv", runs)
    write_responses(folder / "responses.npz", {f"{r.tacton}/{r.body}/{r.model}": r for r in runs})
    _write_page(folder, groups, first, outcome, prepared, progress, title, command)
    return replace(outcome, seconds=time.perf_counter() - started, peak_memory=peak_memory())


def write_single(folder: Path, run: Run) -> None:
    """The folder of one run, with its page."""
    fill(folder, run)
    figure = tacton_figure(run.tacton, [run])
    group = beside_kernels(run) if run.response.unit == "m" else []
    first = shown({run.tacton: group}, quick_maps)
    parts = [
        *(summary.top(first, lambda f, text: document.picture(png(f), text)) if first else []),
        document.warnings_banner([("", run.response.effort)]),
        document.picture(png(figure), caption(run.tacton, [run]), "tacton"),
        *map(document.paragraph, untold([run])),
        document.section("Effort", tables.effort_table({run.body: run.response.effort}, 1)),
        document.section("The scene", f"<pre>{escape(dumps(run.scene))}</pre>"),
    ]
    title = f"{run.tacton} on {run.body}: {run.model}"
    (folder / "index.html").write_text(document.page(title, *parts), encoding="utf-8")


def _answer(
    name: str,
    body: str,
    scene: Scene,
    prepared: dict[str, Prepared],
    progress: Progress,
    h: float | None,
    solver: str,
) -> Run:
    """One run; a body is prepared when it is first met."""
    if scene.body.kind == "none":
        return Run(tacton=name, body="none", scene=scene, response=compute(scene, body))
    if body not in prepared:

        def named(phase: str, fraction: float) -> None:
            progress(f"{body}: {phase}", fraction)

        prepared[body] = prepare(scene.body, scene.probe_points, named, h=h, solver=solver)
    response = assessed(scene, answer(prepared[body], scene), prepared[body], h, solver=solver)
    return Run(tacton=name, body=body, scene=scene, response=response)


def _write_page(
    folder: Path,
    groups: Mapping[str, list[Run]],
    first: Shown | None,
    outcome: Outcome,
    prepared: dict[str, Prepared],
    progress: Progress,
    title: str,
    command: str,
) -> None:
    """index.html, and a PNG of each figure in it."""
    runs = [run for group in groups.values() for run in group]
    (folder / "figures").mkdir()
    pictures = []
    for k, (name, group) in enumerate(groups.items()):
        progress("draw", k / len(groups))
        figure = tacton_figure(name, group)
        pictures.append(_picture(folder, name, figure, caption(name, group)))
    few = {n: groups[n] for n in EXAMPLES if n in groups} or dict(list(groups.items())[:3])
    overview = overview_figure(few, min(2, len(runs[0].scene.probes) - 1))
    efforts = {
        body: replace(
            p.effort,
            **{
                name: max(getattr(r.response.effort, name) for r in runs if r.body == body)
                for name in ("energy_imbalance", "radiated")
            },
        )
        for body, p in prepared.items()
    }
    drawn = partial(_picture, folder, "propagation")
    parts = [
        *(summary.top(first, drawn, first.kernel.tacton * (len(groups) > 1)) if first else []),
        document.warnings_banner(_efforts(runs)),
        *_introduction(outcome, groups),
        *map(document.paragraph, untold(runs)),
        _picture(folder, "overview", overview, OVERVIEW_CAPTION),
        document.section("What propagation changes", summary.per_tacton(changes(groups))),
        document.section(
            "Which of the paper's claims hold where",
            tables.claims_table(outcome.verdicts),
            *map(document.paragraph, _disagreements(outcome.verdicts)),
        ),
        document.section("What was modelled, and what was left out",
                       *map(document.paragraph, modelled(runs))),
        document.section("Every Tacton", *pictures),
        document.section("How far the models agree", tables.agreement_table(groups)),
        document.section("Effort", tables.effort_table(efforts, len(groups), outcome.seconds)),
        document.section("Do it again", document.paragraph(
            f"{command}; or, for one run, skinwave run TACTON/BODY/scene.toml in this folder.")),
    ]  # fmt: skip
    (folder / "index.html").write_text(document.page(title, *parts), encoding="utf-8")


def _efforts(runs: list[Run]) -> list[tuple[str, Effort]]:
    """Efforts by what a run is called."""
    return [(f"{run.tacton} on {run.body}", run.response.effort) for run in runs]


def _picture(folder: Path, name: str, figure: Figure, caption: str) -> str:
    """A figure drawn once: as a file, and inside the page."""
    drawn = png(figure)
    (folder / "figures" / f"{name}.png").write_bytes(drawn)
    return document.picture(drawn, caption, name)


def _introduction(outcome: Outcome, groups: Mapping[str, list[Run]]) -> list[str]:
    if outcome.runs == outcome.planned:
        state = f"{len(groups)} Tacton{'s' * (len(groups) != 1)}, {outcome.runs} runs."
    else:
        state = f"Interrupted: {outcome.runs} of {outcome.planned} runs are finished and shown."
    return [
        document.paragraph(
            f"{state} The point-kernel model of Lim, Seifi and Park (CHI EA '24, "
            "doi 10.1145/3613905.3650981), as published and under the load that the bodies "
            "receive, beside finite elements of these bodies. Amplitudes of every line are in "
            "lines.csv, waveforms in responses.npz; each run's folder has its scene."
        )
    ]


def _disagreements(verdicts: list[Verdict]) -> list[str]:
    """Where a body contradicts what was measured on paper, and whether propagation is the cause."""
    of_kernel = {v.claim: v.holds for v in verdicts if v.model == "point-kernel"}
    texts = []
    for verdict in verdicts:
        if verdict.body != "none" and verdict.claim.startswith("M") and not verdict.holds:
            alone = of_kernel.get(verdict.claim, False)
            texts.append(
                f"The {label(verdict.body)} contradicts {verdict.claim}, which was measured on "
                f"paper: {verdict.sentence}. "
                + (
                    "The point kernel under the same load does not, so that propagation is the "
                    "cause."
                    if alone
                    else "So does the point kernel under the same load: propagation is not the "
                    "cause."
                )
            )
    return texts


OVERVIEW_CAPTION = (
    "Top: motion about its mean at one probe, relative to each model's largest motion at any "
    "probe. Middle: its spectrum; markers are the Tacton's own lines, unmarked peaks are pairs "
    "with 2 f_AM and the free vibration that the start of the Tacton leaves in a body. "
    "Bottom: how far the motion spreads."
)


def caption(name: str, group: list[Run]) -> str:
    """What a Tacton's figure shows."""
    tacton = group[0].scene.tacton
    moved = [] if tacton.trajectory.is_static else [path_of(tacton)]
    parts = [*tones_of(tacton), *moved, *levels_of(tacton)]
    return f"{name}: {', '.join(parts) or 'constant pressure'}. Rows are probes."
