"""The main job: Tactons on several bodies, compared, in one folder."""

import time
from collections.abc import Mapping
from concurrent.futures import Executor, Future
from contextlib import ExitStack, nullcontext, suppress
from dataclasses import replace
from pathlib import Path

from meshes import cache
from skinwave import document
from skinwave.effort import Progress, helper, one_thread, peak_memory
from skinwave.files import write_claims, write_lines, write_responses, write_run
from skinwave.models.bodies import check_mesh, default_size
from skinwave.models.prepared import Prepared, answer, prepare
from skinwave.planning.assessment import assessed, coarser_body
from skinwave.run import Run
from skinwave.scene import BODIES, Body, Scene, with_body
from skinwave.simulation import check_knobs, compute
from skinwave.studies import paper15
from skinwave.studies.changes import (
    Drawn,
    Maps,
    element_maps,
    first_of,
    quick_maps,
    shown,
)
from skinwave.studies.claims import evaluate
from skinwave.studies.study_page import (
    Outcome,
    again,
    effort_section,
    efforts,
    overview_png,
    page_parts,
    tacton_png,
)
from skinwave.surface import has_wavenumber_integral


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
    with helper() as aside, ExitStack() as threads:
        coarser = _begun_coarser(scenes, aside, h, solver)
        maps = _begun_maps(scenes, aside, progress, solver)
        groups, prepared, figures = _answered(scenes, folder, aside, coarser, progress, h, solver)
        threads.enter_context(one_thread())
        figures["overview"] = aside.submit(overview_png, groups)
        runs = [run for group in groups.values() for run in group]
        outcome = Outcome(
            verdicts=evaluate(runs),
            warnings=document.worst_warnings(efforts(runs)),
            runs=len(runs),
            planned=sum(map(len, scenes.values())),
            seconds=0.0,
            peak_memory=0,
        )
        progress("write tables", 0.0)
        write_claims(folder / "claims.csv", outcome.verdicts)
        write_lines(folder / "lines.csv", runs)
        by_name = {f"{r.tacton}/{r.body}/{r.model}": r for r in runs}
        write_responses(folder / "responses.npz", by_name)
        first = None
        with suppress(KeyboardInterrupt):
            first = shown(groups, maps) if outcome.runs == outcome.planned else None
        parts = page_parts(folder, groups, first, outcome, progress, figures)
        spent = replace(outcome, seconds=time.perf_counter() - started, peak_memory=peak_memory())
        parts += [effort_section(groups, prepared, spent), again(command)]
    (folder / "index.html").write_text(document.page(title, *parts), encoding="utf-8")
    return spent


def _begun_coarser(
    scenes: Mapping[str, Mapping[str, Scene]], aside: Executor, h: float | None, solver: str
) -> dict[Body, Future[None]]:
    """The coarser meshes that answers are assessed by, begun aside and left in the cache."""
    if cache.folder() is None:
        return {}
    solids = {s.body: s for group in scenes.values() for s in group.values()}
    return {
        body: aside.submit(_cache_coarser, scene, h, solver)
        for body, scene in solids.items()
        if body.kind != "none"
    }


def _cache_coarser(scene: Scene, h: float | None, solver: str) -> None:
    coarser_body(scene, h, solver=solver)


def _begun_maps(
    scenes: Mapping[str, Mapping[str, Scene]], aside: Executor, progress: Progress, solver: str
) -> Maps:
    """The maps of the Tacton that is shown first; those of elements are begun at once, aside."""
    begun = {
        scene.body: aside.submit(element_maps, scene, solver)
        for scene in scenes[first_of(scenes)].values()
        if scene.body.kind != "none" and not has_wavenumber_integral(scene)
    }

    def maps(run: Run) -> Drawn:
        if run.scene.body not in begun:
            return quick_maps(run)
        progress(f"map of {run.column}", 0.0)
        return begun[run.scene.body].result()

    return maps


def _answered(
    scenes: Mapping[str, Mapping[str, Scene]],
    folder: Path,
    aside: Executor,
    coarser: Mapping[Body, Future[None]],
    progress: Progress,
    h: float | None,
    solver: str,
) -> tuple[dict[str, list[Run]], dict[str, Prepared], dict[str, Future[bytes]]]:
    """Every run, both kernels of all Tactons first, the bodies that were prepared for them, and
    each Tacton's figure, drawn aside as soon as its runs are there.
    """
    groups: dict[str, list[Run]] = {}
    prepared: dict[str, Prepared] = {}
    figures: dict[str, Future[bytes]] = {}
    every = [(name, column, scene) for name, g in scenes.items() for column, scene in g.items()]
    with suppress(KeyboardInterrupt):
        for k, (name, column, scene) in enumerate(
            sorted(every, key=lambda each: each[2].body.kind != "none")
        ):
            new = scene.body.kind != "none" and column not in prepared
            with nullcontext() if new else one_thread():
                run = _answer(name, column, scene, prepared, coarser, progress, h, solver)
                write_run(folder / name / column, run)
            groups.setdefault(name, []).append(run)
            if len(groups[name]) == len(scenes[name]):
                figures[name] = aside.submit(tacton_png, name, groups[name])
            progress(f"answer {name} by {column}", (k + 1) / len(every))
    if not groups:
        raise KeyboardInterrupt
    return groups, prepared, figures


def _answer(
    name: str,
    body: str,
    scene: Scene,
    prepared: dict[str, Prepared],
    coarser: Mapping[Body, Future[None]],
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
    if scene.body in coarser:
        coarser[scene.body].result()
    response = assessed(scene, answer(prepared[body], scene), prepared[body], h, solver=solver)
    return Run(tacton=name, body=body, scene=scene, response=response)
