"""The main job: Tactons on several bodies, compared, in one folder."""

import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, Future
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

from simple_model import Response
from skinwave.bodies.sizes import check_mesh, default_size
from skinwave.measure import comparison_page
from skinwave.measure.comparison import (
    Measured,
    MeasuredComparison,
    beside,
    compare_measured,
    in_quantity,
    measured_places,
)
from skinwave.models import named
from skinwave.models.limits import check_taken
from skinwave.models.linear_elements import FEM
from skinwave.models.options import SolveOptions
from skinwave.models.reduced import ReducedBody, answer, prepare
from skinwave.planning.assessment import Coarser, assessed, coarser_body
from skinwave.planning.plan import chosen_model, plan
from skinwave.planning.simulate import compute, solve
from skinwave.results.claims import claimed, evaluate, write_claims
from skinwave.results.files import write_lines, write_responses, write_run
from skinwave.results.run import Run
from skinwave.results.surface import has_wavenumber_integral
from skinwave.scene import paper15
from skinwave.scene.scene import BODIES, Body, Scene, body_name, check_load, with_body
from skinwave.studies import study_page
from skinwave.studies.changes import Drawn, Maps, first_of, quick_maps, shown, slow_maps
from skinwave.studies.study_page import StudyOutcome
from skinwave.system import document
from skinwave.system.effort import Progress, one_thread, peak_memory
from skinwave.system.processes import pool

# Of the models that plans choose, those that leave out more come first.
COMPLETE = (
    "flat-body-harmonic", "flat-body", "plate-modes-transient", "fem", "plate-modes-nonlinear",
)  # fmt: skip
SLOW = 3.0  # s of a model: from there on responses are computed in two processes


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
    model: str = "auto",
    h: float | None = None,
    solver: str = "auto",
    measured: Measured | None = None,
    more: Sequence[document.Part] = (),
) -> StudyOutcome:
    """Run every scene, writing each run as it is finished, then the tables and the page; with a
    measurement beside the models, if there is one of that Tacton. The page has `more` parts before
    its effort.

    Each body has one model: the given one, or of those that plans take for its scenes the one that
    leaves out least; elements if their size h in metre is given. An interrupt ends the runs early;
    those that are finished are still compared and written.
    """
    SolveOptions(solver=solver, h=h)  # which refuses what is out of range
    models = _models(scenes, FEM.name if h and model == "auto" else model, h)
    started = time.perf_counter()
    with pool(1) as aside, one_thread():
        how = _How(models=models, h=h, solver=solver)
        bodies = _begun_bodies(scenes, aside, progress, how)
        begun = _begun_responses(scenes, aside, how)
        maps = _begun_maps(scenes, aside, progress, how)
        figures: dict[str, Future[bytes]] = {}
        drawn: dict[str, list[Run]] = {}
        found: list[MeasuredComparison] = []

        def finished(name: str, group: list[Run], prepared: Mapping[str, ReducedBody]) -> None:
            drawn[name] = group
            if measured:
                asked = measured.measurement.quantity
                runs = [in_quantity(run, asked, prepared) for run in group]
                found.append(compare_measured(measured, runs))
                drawn[name] = beside(found[-1], runs)
            figures[name] = aside.submit(study_page.tacton_png, name, drawn[name])

        groups, prepared = _answered(scenes, folder, bodies, begun, progress, how, finished)
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
        parts = study_page.page_parts(groups, drawn, first, outcome, progress, figures)
        for comparison in found:
            comparison_page.write_tables(folder, comparison)
            parts.insert(0, comparison_page.page_part(comparison, study_page.picture))
        spent = replace(
            outcome,
            seconds=time.perf_counter() - started,
            peak_memory=peak_memory() + aside.submit(peak_memory).result(),
        )
        parts += [
            *more,
            study_page.effort_section(groups, prepared, spent),
            study_page.again(command),
        ]
    document.Report(title, parts=parts, pictures=study_page.FIGURES).write(folder)
    return spent


@dataclass(frozen=True, kw_only=True)
class _How:
    """By column the model, and the element size in metre and solver that are asked for."""

    models: Mapping[str, str]
    h: float | None
    solver: str

    def is_reduced(self, column: str) -> bool:
        """Whether a column is of bodies that are reduced once for all Tactons."""
        return named(self.models[column]).is_reduced


def _models(
    scenes: Mapping[str, Mapping[str, Scene]], model: str, h: float | None
) -> dict[str, str]:
    """Model of each column; a ValueError of a scene that it does not take, before any run."""
    if model != "auto" and not named(model).needs_body:
        raise ValueError(f"{model} moves no body; give a model that does, or leave --model out")
    found: dict[str, str] = {}
    for column, scene in (each for group in scenes.values() for each in group.items()):
        if not scene.body.of_kind.discretise:
            found[column] = column
            continue
        mine = model
        if model == "auto":
            mine = chosen_model(scene) if found.get(column) != COMPLETE[-1] else COMPLETE[-1]
        check_taken(named(mine), scene)
        if named(mine).is_reduced:
            check_mesh(scene.body, h or default_size(scene.body))
        found[column] = max(found.get(column, mine), mine, key=_completeness)
    return found


def _completeness(model: str) -> int:
    """How little a model that plans choose leaves out."""
    return COMPLETE.index(model) if model in COMPLETE else -1


Bodies = Callable[[Scene], tuple[ReducedBody, Coarser]]  # reduced, and the one on a coarser mesh


def _begun_bodies(
    scenes: Mapping[str, Mapping[str, Scene]], aside: Executor, progress: Progress, how: _How
) -> Bodies:
    """Reduced bodies: the last is reduced here when it is first asked for; meanwhile the others and
    the coarser ones that responses are assessed by, are reduced in other processes.
    """
    h, solver = how.h, how.solver
    every = [each for group in scenes.values() for each in group.items()]
    solids = {s.body: (column, s) for column, s in every if how.is_reduced(column)}
    others, last = list(solids)[:-1], next(reversed(solids), None)
    begun = {body: aside.submit(_prepared, solids[body][1], h, solver) for body in others}
    coarse = {
        body: aside.submit(coarser_body, scene, SolveOptions(h=h, solver=solver))
        for body, (_, scene) in solids.items()
    }

    @lru_cache
    def here() -> ReducedBody:
        assert last
        column, scene = solids[last]

        def named(phase: str, fraction: float) -> None:
            progress(f"{column}: {phase}", fraction)

        return _prepared(scene, h, solver, named)

    def bodies(scene: Scene) -> tuple[ReducedBody, Coarser]:
        mine = here()  # before anything is waited for
        found = begun[scene.body].result() if scene.body in begun else mine
        return found, coarse[scene.body].result()

    return bodies


def _prepared(
    scene: Scene, h: float | None, solver: str, progress: Progress | None = None
) -> ReducedBody:
    return prepare(
        scene.body, scene.probe_points, progress, h=h, solver=solver, reading=scene.reading
    )


def _begun_responses(
    scenes: Mapping[str, Mapping[str, Scene]], aside: Executor, how: _How
) -> dict[Scene, Future[Response]]:
    """Responses of slow models without a reduced body. The last are begun first, aside, while the
    first are computed here.
    """
    slow = [
        (scene, how.models[column])
        for group in scenes.values() for column, scene in group.items()
        if not how.is_reduced(column) and named(how.models[column]).seconds > SLOW
    ]  # fmt: skip
    return {
        scene: aside.submit(_response, scene, model, how.h, how.solver)
        for scene, model in reversed(slow)
    }


def _response(scene: Scene, model: str, h: float | None, solver: str) -> Response:
    if not scene.body.of_kind.discretise:
        return compute(scene, model)
    return solve(scene, plan(scene, SolveOptions(model=model, h=h, solver=solver)))


def _begun_maps(
    scenes: Mapping[str, Mapping[str, Scene]], aside: Executor, progress: Progress, how: _How
) -> Maps:
    """Maps of the Tacton that is shown first; slow ones are begun at once, aside."""
    begun = {
        scene.body: aside.submit(slow_maps, scene, how.h, how.solver)
        for scene in scenes[first_of(scenes)].values()
        if scene.body.of_kind.discretise and scene.reading.is_plain
        and not has_wavenumber_integral(scene)
    }  # fmt: skip

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
    begun: Mapping[Scene, Future[Response]],
    progress: Progress,
    how: _How,
    finished: Callable[[str, list[Run], Mapping[str, ReducedBody]], None],
) -> tuple[dict[str, list[Run]], dict[str, ReducedBody]]:
    """Every run, both kernels of all Tactons first, and the reduced bodies behind them; `finished`
    is called with each Tacton as soon as its runs are there.
    """
    groups: dict[str, list[Run]] = {}
    prepared: dict[str, ReducedBody] = {}
    every = [(name, column, scene) for name, g in scenes.items() for column, scene in g.items()]
    quick = sorted(every, key=lambda each: (how.is_reduced(each[1]), each[2] in begun))
    with suppress(KeyboardInterrupt):
        for k, (name, column, scene) in enumerate(quick):
            if how.is_reduced(column):
                prepared[column], coarser = bodies(scene)
                found = answer(prepared[column], scene)
                response = assessed(
                    scene,
                    found,
                    prepared[column],
                    SolveOptions(h=how.h, solver=how.solver),
                    compared=coarser,
                )
            elif scene in begun and not begun[scene].cancel():
                response = begun[scene].result()
            else:
                response = _response(scene, how.models[column], how.h, how.solver)
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
