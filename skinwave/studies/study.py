"""The main job: Tactons on several bodies, compared, in one folder."""

import time
from collections.abc import Callable, Mapping
from concurrent.futures import Executor, Future
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path

from skinwave import document
from skinwave.effort import Progress, one_thread, peak_memory
from skinwave.files import write_lines, write_responses, write_run
from skinwave.models.prepared import Prepared, answer, prepare
from skinwave.planning.assessment import Coarser, assessed, coarser_body
from skinwave.processes import helper
from skinwave.run import Run
from skinwave.scene import BODIES, Body, Scene, body_name, check_load, with_body
from skinwave.simulation import answered, check_options, compute, has_elements
from skinwave.studies import measured_page, measured_tables, paper15, study_page
from skinwave.studies.changes import Drawn, Maps, element_maps, first_of, quick_maps, shown
from skinwave.studies.claims import claimed, evaluate, write_claims
from skinwave.studies.measured_runs import beside, in_quantity, measured_places
from skinwave.studies.measured_study import (
    Measured,
    MeasuredComparison,
    compare_measured,
)
from skinwave.studies.study_page import StudyOutcome
from skinwave.surface import has_wavenumber_integral


def paper_scenes(bodies: Mapping[str, Body] | None = None) -> dict[str, dict[str, Scene]]:
    """Tacton -> column -> scene of the paper's 15 Tactons: both point kernels, and bodies by name,
    or paper and skin.
    """
    return {name: paper15.scenes(name, tacton, bodies) for name, tacton in paper15.tactons()}


def own_scenes(scene: Scene, name: str) -> dict[str, dict[str, Scene]]:
    """The same for one scene: on its own body or, if it has none, on paper and skin.

    Raises
    ------
    ValueError
        If its load is another than the pressure of a focus, or it has gravity.
    """
    check_load(scene, "a comparison with the point kernel")
    if scene.body.of_kind.discretise:
        bodies = {body_name(scene.body): scene}
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
    measured: Measured | None = None,
) -> StudyOutcome:
    """Run every scene, writing each run as it is finished, then the tables and the page; with a
    measurement beside the models, if there is one of that Tacton.

    An interrupt ends the runs early; those that are finished are still compared and written.
    """
    check_options(solver, h=h)
    for scene in (s for group in scenes.values() for s in group.values()):
        has_elements(scene, h)  # which refuses before any run
    started = time.perf_counter()
    with helper() as aside, one_thread():
        bodies = _begun_bodies(scenes, aside, progress, h, solver)
        maps = _begun_maps(scenes, aside, progress, h, solver)
        figures: dict[str, Future[bytes]] = {}
        drawn: dict[str, list[Run]] = {}
        found: list[MeasuredComparison] = []

        def finished(name: str, group: list[Run], prepared: Mapping[str, Prepared]) -> None:
            drawn[name] = group
            if measured:
                asked = measured.measurement.quantity
                runs = [in_quantity(run, asked, prepared) for run in group]
                found.append(compare_measured(measured, runs))
                drawn[name] = beside(found[-1], runs)
            figures[name] = aside.submit(study_page.tacton_png, name, drawn[name])

        groups, prepared = _answered(scenes, folder, bodies, progress, h, solver, finished)
        drawn = {**groups, **drawn}
        figures["overview"] = aside.submit(study_page.overview_png, drawn)
        runs = [run for group in groups.values() for run in group]
        outcome = StudyOutcome(
            assessed_claims=evaluate(claimed(runs)),
            warnings=document.worst_warnings(study_page.efforts(runs)),
            runs=len(runs),
            planned=sum(map(len, scenes.values())),
        )
        progress("write tables", 0.0)
        write_claims(folder / "claims.csv", outcome.assessed_claims)
        write_lines(folder / "lines.csv", runs)
        by_name = {f"{r.tacton}/{r.body}/{r.model}": r for r in runs}
        write_responses(folder / "responses.npz", by_name)
        first = None
        with suppress(KeyboardInterrupt):
            first = shown(groups, maps) if outcome.runs == outcome.planned else None
            if first and found:
                first = replace(first, measured=measured_places(found[-1]))
        parts = study_page.page_parts(folder, groups, drawn, first, outcome, progress, figures)
        for comparison in found:
            measured_tables.write_tables(folder, comparison)
            parts[:0] = measured_page.page_parts(comparison, partial(study_page.kept, folder))
        spent = replace(
            outcome,
            seconds=time.perf_counter() - started,
            peak_memory=peak_memory() + aside.submit(peak_memory).result(),
        )
        parts += [study_page.effort_section(groups, prepared, spent), study_page.again(command)]
    (folder / "index.html").write_text(document.page(title, *parts), encoding="utf-8")
    return spent


Bodies = Callable[[Scene], tuple[Prepared, Coarser]]  # reduced, and the one on a coarser mesh


def _begun_bodies(
    scenes: Mapping[str, Mapping[str, Scene]],
    aside: Executor,
    progress: Progress,
    h: float | None,
    solver: str,
) -> Bodies:
    """Reduced bodies: the last is reduced here when it is first asked for; meanwhile the others and
    the coarser ones that responses are assessed by, are reduced in other processes.
    """
    every = [each for group in scenes.values() for each in group.items()]
    solids = {s.body: (column, s) for column, s in every if has_elements(s, h)}
    others, last = list(solids)[:-1], next(reversed(solids), None)
    begun = {body: aside.submit(_prepared, solids[body][1], h, solver) for body in others}
    coarse = {
        body: aside.submit(coarser_body, scene, h, solver=solver)
        for body, (_, scene) in solids.items()
    }

    @lru_cache
    def here() -> Prepared:
        assert last
        column, scene = solids[last]

        def named(phase: str, fraction: float) -> None:
            progress(f"{column}: {phase}", fraction)

        return _prepared(scene, h, solver, named)

    def bodies(scene: Scene) -> tuple[Prepared, Coarser]:
        mine = here()  # before anything is waited for
        found = begun[scene.body].result() if scene.body in begun else mine
        return found, coarse[scene.body].result()

    return bodies


def _prepared(
    scene: Scene, h: float | None, solver: str, progress: Progress | None = None
) -> Prepared:
    return prepare(
        scene.body, scene.probe_points, progress, h=h, solver=solver, reading=scene.reading
    )


def _begun_maps(
    scenes: Mapping[str, Mapping[str, Scene]],
    aside: Executor,
    progress: Progress,
    h: float | None,
    solver: str,
) -> Maps:
    """Maps of the Tacton that is shown first; those by finite elements are begun at once, aside."""
    begun = {
        scene.body: aside.submit(element_maps, scene, h, solver)
        for scene in scenes[first_of(scenes)].values()
        if has_elements(scene, h) and scene.reading.is_plain and not has_wavenumber_integral(scene)
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
    bodies: Bodies,
    progress: Progress,
    h: float | None,
    solver: str,
    finished: Callable[[str, list[Run], Mapping[str, Prepared]], None],
) -> tuple[dict[str, list[Run]], dict[str, Prepared]]:
    """Every run, both kernels of all Tactons first, and the reduced bodies behind them; `finished`
    is called with each Tacton as soon as its runs are there.
    """
    groups: dict[str, list[Run]] = {}
    prepared: dict[str, Prepared] = {}
    every = [(name, column, scene) for name, g in scenes.items() for column, scene in g.items()]
    with suppress(KeyboardInterrupt):
        for k, (name, column, scene) in enumerate(
            sorted(every, key=lambda each: has_elements(each[2], h))
        ):
            if not scene.body.of_kind.discretise:
                response = compute(scene, column)
            elif not has_elements(scene, h):
                response = answered(scene, solver=solver)
            else:
                prepared[column], coarser = bodies(scene)
                found = answer(prepared[column], scene)
                response = assessed(
                    scene, found, prepared[column], h, solver=solver, compared=coarser
                )
            body = column if scene.body.of_kind.discretise else "none"
            run = Run(tacton=name, body=body, scene=scene, response=response)
            write_run(folder / name / column, run)
            groups.setdefault(name, []).append(run)
            if len(groups[name]) == len(scenes[name]):
                finished(name, groups[name], prepared)
            progress(f"response of {name} by {column}", (k + 1) / len(every))
    if not groups:
        raise KeyboardInterrupt
    return groups, prepared
