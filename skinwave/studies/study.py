"""The main job: Tactons on several bodies, compared, in one folder."""

import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from simple_model import Response
from skinwave.bodies.sizes import check_mesh, default_size
from skinwave.measure.comparison import (
    Measured,
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
from skinwave.planning.assessment import assessed, coarser_body
from skinwave.planning.plan import chosen_model, plan
from skinwave.planning.simulate import compute, solve
from skinwave.results.claims import AssessedClaim, claimed, evaluate, write_claims
from skinwave.results.files import write_lines, write_responses, write_run
from skinwave.results.run import Run
from skinwave.results.surface import has_wavenumber_integral
from skinwave.scene import paper15
from skinwave.scene.scene import BODIES, Body, Scene, body_name, check_load, with_body
from skinwave.studies.changes import Drawn, first_of, quick_maps, shown, slow_maps
from skinwave.studies.pages import Gallery, efforts_of, page_of
from skinwave.system import document
from skinwave.system.effort import Progress, one_thread, peak_memory
from skinwave.system.processes import pool

# Of the models that plans choose, those that leave out more come first.
COMPLETE = (
    "flat-body-harmonic", "flat-body", "plate-modes-transient", "fem", "plate-modes-nonlinear",
)  # fmt: skip
SLOW = 3.0  # s of a model: its responses come last
ABOUT = (
    "The point-kernel model of Lim, Seifi and Park (CHI EA '24, doi 10.1145/3613905.3650981), as "
    "published and under the load that the bodies receive, beside the motion of these bodies. "
    "Amplitudes of all lines are in lines.csv, waveforms in responses.npz; each run's folder has "
    "its scene."
)


@dataclass(frozen=True, kw_only=True)
class StudyOutcome:
    """Outcome of a comparison: assessed claims, warnings, cost, and how much of it was done."""

    assessed_claims: list[AssessedClaim]
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
    """The same for one scene: on its own body or, if it has none, on paper and skin. A ValueError
    if its load is another than the pressure of a focus, or it has gravity.
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
    measurement beside the models, if there is one of that Tacton. The page has `more` parts.

    Each body has one model: the given one, or of those that plans take for its scenes the one that
    leaves out least; elements if their size h in metre is given. An interrupt ends the runs early;
    those that are finished are still compared and written.
    """
    options = SolveOptions(solver=solver, h=h)
    models = _models(scenes, FEM.name if h and model == "auto" else model, h)
    started, planned = time.perf_counter(), sum(map(len, scenes.values()))
    groups: dict[str, list[Run]] = {}
    prepared: dict[str, ReducedBody] = {}
    with one_thread(), pool(2) as workers:
        maps = {
            scene.body: workers.submit(slow_maps, scene, h, solver)
            for scene in scenes[first_of(scenes)].values()
            if scene.body.of_kind.discretise and scene.reading.is_plain
            and not has_wavenumber_integral(scene)
        }  # fmt: skip
        with suppress(KeyboardInterrupt):
            for run in _runs(scenes, models, options, prepared, progress, workers):
                write_run(folder / run.tacton / run.column, run)
                groups.setdefault(run.tacton, []).append(run)
        if not groups:
            raise KeyboardInterrupt
        runs = [run for group in groups.values() for run in group]
        progress("write tables", 0.0)
        assessed_claims = evaluate(claimed(runs))
        write_claims(folder / "claims.csv", assessed_claims)
        write_lines(folder / "lines.csv", runs)
        by_name = {f"{r.tacton}/{r.body}/{r.model}": r for r in runs}
        write_responses(folder / "responses.npz", by_name)
        first = None
        with suppress(KeyboardInterrupt):
            if len(runs) == planned:
                first = shown(groups, lambda run: _maps(run, maps, progress))
    parts: list[document.Part] = []
    figures: dict[str, Sequence[Run]] = dict(groups)
    for name, group in groups.items() if measured else ():
        from skinwave.measure import comparison_page  # which takes a second

        assert measured
        asked = measured.measurement.quantity
        comparison = compare_measured(
            measured, [in_quantity(run, asked, prepared) for run in group]
        )
        comparison_page.write_tables(folder, comparison)
        parts.append(comparison_page.page_part(comparison, Gallery().figure))
        figures[name] = beside(comparison, [column.run for column in comparison.columns])
        first = replace(first, measured=measured_places(comparison)) if first else None
    page_of(
        title, groups, first, Gallery(), figures=figures, progress=progress,
        seen=[*more, *parts] if len(runs) == planned else
        [f"Interrupted: {len(runs)} of {planned} runs are finished and shown.", *more, *parts],
        modelled=[ABOUT], seconds=time.perf_counter() - started,
        again=[f"{command}; or, for one run, skinwave run TACTON/BODY/scene.toml in this folder."],
    ).write(folder)  # fmt: skip
    return StudyOutcome(
        assessed_claims=assessed_claims, warnings=document.worst_warnings(efforts_of(runs)),
        runs=len(runs), planned=planned, seconds=time.perf_counter() - started,
        peak_memory=max(peak_memory(), *(run.response.effort.peak_memory for run in runs)),
    )  # fmt: skip


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


def _runs(
    scenes: Mapping[str, Mapping[str, Scene]], models: Mapping[str, str], options: SolveOptions,
    prepared: dict[str, ReducedBody], progress: Progress, workers: Executor,
) -> Iterator[Run]:  # fmt: skip
    """Every run, those of fast models first. Bodies are reduced here, into `prepared`, once for all
    Tactons; the coarser ones that give their errors, and all other responses, are computed by the
    workers.
    """
    every = [(name, column, s) for name, group in scenes.items() for column, s in group.items()]
    reduced = {column for column, model in models.items() if named(model).is_reduced}
    every.sort(key=lambda each: (each[1] in reduced, named(models[each[1]]).seconds > SLOW))
    coarse = {s.body: s for _, column, s in every if column in reduced}
    begun = {body: workers.submit(coarser_body, s, options) for body, s in coarse.items()}
    others = {
        (name, column): workers.submit(_response, scene, replace(options, model=models[column]))
        for name, column, scene in every
        if column not in reduced
    }
    for k, (name, column, scene) in enumerate(every):
        if column in reduced:
            body = prepared.get(column) or _prepared(scene, column, options, progress)
            prepared[column] = body
            found, coarser = answer(body, scene), begun[scene.body].result()
            response = assessed(scene, found, body, options, compared=coarser)
        else:
            response = others[name, column].result()
        progress(f"response of {name} by {column}", (k + 1) / len(every))
        body_of = column if scene.body.of_kind.discretise else "none"
        yield Run(tacton=name, body=body_of, scene=scene, response=response)


def _prepared(scene: Scene, column: str, options: SolveOptions, progress: Progress) -> ReducedBody:
    return prepare(
        scene.body, scene.probe_points,
        lambda phase, fraction: progress(f"{column}: {phase}", fraction),
        h=options.h, solver=options.solver, reading=scene.reading,
    )  # fmt: skip


def _response(scene: Scene, options: SolveOptions) -> Response:
    if not scene.body.of_kind.discretise:
        return compute(scene, options.model)
    return solve(scene, plan(scene, options))


def _maps(run: Run, begun: Mapping[Body, Future[Drawn]], progress: Progress) -> Drawn:
    if run.scene.body not in begun:
        return quick_maps(run)
    progress(f"map of {run.column}", 0.0)
    return begun[run.scene.body].result()
