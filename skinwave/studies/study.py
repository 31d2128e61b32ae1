"""The main job: Tactons on several bodies, compared, in one folder."""

import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

from simple_model import Effort, Response
from skinwave.bodies.sizes import check_mesh, default_size
from skinwave.live import html_file
from skinwave.measure import comparison as measuring
from skinwave.measure.comparison import Measured
from skinwave.models import named
from skinwave.models.limits import check_takes
from skinwave.models.linear_elements import FEM
from skinwave.models.options import SolveOptions
from skinwave.models.point_kernel import SAME_LOAD
from skinwave.models.reduced import ReducedBody, answer, reduce_scene
from skinwave.planning.assessment import assess, coarser_body
from skinwave.planning.plan import cheapest_model, plan
from skinwave.planning.simulate import compute, solve_as_planned
from skinwave.results.claims import AssessedClaim, assessable_runs, evaluate, write_claims
from skinwave.results.files import write_lines, write_responses, write_run
from skinwave.results.playback import played_part
from skinwave.results.run import Run
from skinwave.scene import paper15
from skinwave.scene.scene import Body, Scene
from skinwave.studies import surfaces
from skinwave.studies.album import scene_columns
from skinwave.studies.first_screen import (
    Maps,
    first_screen,
    first_tacton,
    has_quick_map,
    quick_maps,
)
from skinwave.studies.pages import Gallery, efforts_of, page_of
from skinwave.studies.surfaces import Playback, Surfaces
from skinwave.system import document
from skinwave.system.effort import Progress, one_thread, peak_memory, silent
from skinwave.system.failures import failure_text, or_failed
from skinwave.system.processes import pool
from skinwave.system.progress_bar import announce, expecting

# Models that plans choose, in the order of increasing completeness.
COMPLETENESS = (
    "flat-body-harmonic", "flat-body", "plate-modes-transient", "fem", "plate-modes-nonlinear",
)  # fmt: skip
Scenes = Mapping[str, Mapping[str, Scene]]  # Tacton -> column -> scene


@dataclass(frozen=True, kw_only=True)
class StudyOutcome:
    """Outcome of a comparison: numbers of finished `runs` and of `planned` ones, reasons of failed
    parts, and conclusions on the agreement with a measurement.
    """

    assessed_claims: list[AssessedClaim]
    warnings: list[str]
    failures: Mapping[str, str]
    runs: int
    planned: int
    seconds: float
    peak_memory: int
    conclusions: list[str]


def paper_scenes(bodies: Mapping[str, Body] | None = None) -> Scenes:
    """Return the scenes of the paper's 15 Tactons, by both point kernels and on bodies by name, by
    default paper and skin.
    """
    return {name: paper15.scenes(name, tacton, bodies) for name, tacton in paper15.tactons()}


def own_scenes(scene: Scene, name: str) -> Scenes:
    """Return the scenes in which a scene is compared; raises a ValueError if no body fits."""
    columns = scene_columns(scene)
    if not any(each.body.of_kind.discretise for each in columns.values()):
        raise ValueError(
            "path or probes fit neither on the paper sheet nor on the palm. Give the scene a body "
            "under [body]"
        )
    return {name: columns}


def run_study(
    scenes: Scenes,
    folder: Path,
    options: SolveOptions,
    *,
    title: str,
    command: str,
    measured: Measured | None = None,
    live: Sequence[Scene] = (),
) -> StudyOutcome:
    """Run every scene, write each run when it is finished, then write tables and page.

    Each body has one model: the given one, finite elements if their size is given, or the most
    complete one that plans choose for its scenes. A body of one scene is planned as by `run`. A
    body of several scenes has elements of the given size, of that in `paper15.SIZES`, or of the
    default size. A measurement is compared with the models of the only Tacton. `live` are the
    scenes of a live page. After an interrupt or a failure, the other runs are compared and written.
    Raises a ValueError if all fail.
    """
    models = _models(scenes, options)
    started, planned = time.perf_counter(), sum(map(len, scenes.values()))
    progress = options.progress
    groups: dict[str, list[Run]] = {}
    found, interrupted = BesideRuns(), True
    failed = found.failures
    options = replace(options, model="auto", progress=silent)
    about = (
        "The point-kernel model of Lim, Seifi and Park (CHI EA '24, doi 10.1145/3613905.3650981) "
        "is run as published and under the load of the bodies. Amplitudes of all lines are in "
        "lines.csv, waveforms in responses.npz; the folder of each run has its scene."
    )
    live_file = "live.html"
    with one_thread(), pool(2) as workers:
        live_page = workers.submit(html_file.comparison_page, live)
        with suppress(KeyboardInterrupt):
            for run in _runs(scenes, models, options, progress, workers, found):
                write_run(folder / run.tacton / run.column, run)
                groups.setdefault(run.tacton, []).append(run)
            interrupted = False
        if interrupted:
            workers.shutdown(wait=False, cancel_futures=True)
        for name, group in groups.items():  # in the order of the columns
            group.sort(key=lambda run: [*scenes[name]].index(run.column))
        runs = [run for group in groups.values() for run in group]
        if interrupted and not runs:
            raise KeyboardInterrupt
        if not (interrupted or any(run.response.record.of_body for run in runs)):
            raise ValueError(failure_text(failed))
        progress("write tables", 0.0)
        assessed_claims = evaluate(assessable_runs(runs))
        write_claims(folder / "claims.csv", assessed_claims)
        write_lines(folder / "lines.csv", runs)
        by_name = {f"{r.tacton}/{r.body}/{r.model}": r.response for r in runs}
        write_responses(folder / "responses.npz", by_name)
        first = None
        if not interrupted:
            views = surfaces.views_of(scenes[first_tacton(scenes)], found.surfaces)
            first = first_screen(groups, found.maps, views, found.checks)
        parts: list[document.Part] = []
        with or_failed(failed, "live page"):
            html, why = ("", {}) if interrupted else live_page.result()
            failed |= why
            if html:
                (folder / live_file).write_text(html, encoding="utf-8")
                parts.append(document.live_link(live_file))
        figures: dict[str, Sequence[Run]] = dict(groups)
        conclusions: list[str] = []
        if measured:
            from skinwave.measure import comparison_page  # slow to import

            ((name, group),) = groups.items()
            quantity = measured.measurement.quantity
            comparison = measuring.compare_measured(
                measured, [measuring.in_quantity(run, quantity, found.prepared) for run in group]
            )
            conclusions += [comparison_page.conclusion(comparison, c) for c in comparison.bodies]
            comparison_page.write_tables(folder, comparison)
            parts.append(comparison_page.page_section(comparison, Gallery().figure))
            figures[name] = measuring.runs_to_draw(comparison)
            places = measuring.measured_places(comparison)
            first = replace(first, measured=places) if first else None
        if interrupted:
            said = f"Interrupted: this page shows the {len(runs)} finished of {planned} runs."
            parts.insert(0, said)
        drawing = None if interrupted else workers
        gallery = Gallery(workers=drawing, progress=progress, failures=failed)
        page_of(
            title, groups, first, gallery, figures=figures, before=parts, modelled=[about],
            seconds=time.perf_counter() - started, command=command,
            notes=["For one run: skinwave run TACTON/BODY/scene.toml in this folder."],
        ).write(folder)  # fmt: skip
    return StudyOutcome(
        assessed_claims=assessed_claims, warnings=document.worst_warnings(efforts_of(runs)),
        failures=failed, runs=len(runs), planned=planned, seconds=time.perf_counter() - started,
        conclusions=conclusions,
        peak_memory=max(peak_memory(), *(run.response.effort.peak_memory for run in runs)),
    )  # fmt: skip


def _models(scenes: Scenes, options: SolveOptions) -> dict[str, str]:
    """Return the model of each column; raise a ValueError if it cannot compute a scene."""
    model = FEM.name if options.h and options.model == "auto" else options.model
    if model != "auto" and not named(model).needs_body:
        raise ValueError(f"{model} moves no body. Choose a model of a body, or leave --model out")
    models: dict[str, str] = {}
    every = [each for group in scenes.values() for each in group.items()]
    for k, (column, scene) in enumerate(every):
        announce(options.progress, "choose models", k / len(every))
        if not scene.body.of_kind.discretise:
            models[column] = column
            continue
        own = model
        if model == "auto":
            is_complete = models.get(column) == COMPLETENESS[-1]
            own = COMPLETENESS[-1] if is_complete else cheapest_model(scene)
        check_takes(named(own), scene)
        if named(own).is_reduced:
            check_mesh(scene.body, options.h or default_size(scene.body))
        models[column] = max(models.get(column, own), own, key=_completeness)
    return models


def _completeness(model: str) -> int:
    return COMPLETENESS.index(model) if model in COMPLETENESS else -1


@dataclass(frozen=True, kw_only=True, eq=False)
class BesideRuns:
    """What a study computes besides its runs: reduced bodies by column, surfaces, runs of flat
    slabs for comparison by column, and reasons of failed parts.
    """

    prepared: dict[str, ReducedBody] = field(default_factory=dict)
    surfaces: Surfaces = field(default_factory=dict)
    checks: dict[str, Run] = field(default_factory=dict)
    failures: dict[str, str] = field(default_factory=dict)

    def collect(self, surfaces: Surfaces, failures: Mapping[str, str]) -> None:
        """Add surfaces and failures of a worker."""
        self.surfaces.update(surfaces)
        self.failures.update(failures)

    def maps(self, run: Run) -> Maps:
        """Return the maps of a body and of the kernel, or none if they fail or are not known."""
        if surface := self.surfaces.get((run.tacton, run.column)):
            return surface.maps
        with or_failed(self.failures, f"map of {run.column}"):
            return quick_maps(run)  # of a body that needs no mesh, but was computed by elements
        return ()


def _runs(
    scenes: Scenes, models: Mapping[str, str], options: SolveOptions, progress: Progress,
    workers: Executor, found: BesideRuns,
) -> Iterator[Run]:  # fmt: skip
    """Yield every run that does not fail, those of fast models first.

    Bodies are reduced here, once for all Tactons. Workers compute coarser bodies for the errors,
    all other responses, surfaces and checks.
    """
    prepared, failures = found.prepared, found.failures
    every = [(name, column, s) for name, group in scenes.items() for column, s in group.items()]
    reduced = {column for column, model in models.items() if named(model).is_reduced}
    # Bodies are reduced here while workers compute slow responses.
    every.sort(
        key=lambda each: 1 if each[1] in reduced else 2 * named(models[each[1]]).is_nonlinear
    )
    several = len(scenes) > 1
    sizes = paper15.SIZES if several else {}
    size_of = {column: replace(options, h=options.h or sizes.get(column)) for column in reduced}
    coarse = {column: s for _, column, s in every if several and column in reduced}
    coarser = {c: workers.submit(coarser_body, s, options, sizes.get(c)) for c, s in coarse.items()}
    pictured = first_tacton(scenes)
    part = played_part(scenes[pictured][SAME_LOAD.name].pressure)
    meshed = {
        column: {name: group[column] for name, group in scenes.items() if column in group}
        for _, column, s in every
        if s.body.of_kind.discretise and s.reading.is_plain and not has_quick_map(s)
    }
    moved = [
        workers.submit(surfaces.element_surfaces, column, own, options, part)
        for column, own in meshed.items()
    ]
    flat = {
        column: workers.submit(surfaces.flat_run, pictured, scene, options)
        for column, scene in scenes[pictured].items() if column in reduced and scene.body.is_solid
    }  # fmt: skip
    others = {
        (name, column): workers.submit(
            _response, name, column, scene, replace(options, model=models[column]),
            part if name == pictured else None,
        )
        for name, column, scene in every
        if column not in reduced
    }  # fmt: skip
    for k, (name, column, scene) in enumerate(every):
        reporting = replace(
            size_of.get(column, options), progress=partial(_report, progress, column)
        )
        if several and column in reduced and column not in {*prepared, *failures}:
            with or_failed(failures, column):
                prepared[column] = reduce_scene(scene, reporting)
        if column in failures:
            continue  # all Tactons on this body failed
        with or_failed(failures, f"{name} on {column}"):
            if column not in reduced:
                progress(f"response of {name} by {column} ({k + 1} of {len(every)})", 0.0)
                cost = named(models[column]).cost
                seconds = cost(scene, options, Effort()).seconds if cost else None
                with expecting(progress, seconds):
                    response, shown = others[name, column].result()
                found.collect(*shown)
            elif several:
                progress(f"response of {name} by {column}", k / len(every))
                response, body = answer(prepared[column], scene), prepared[column]
                compared = coarser[column].result()
                response = assess(scene, response, body, size_of[column], compared=compared)
            else:
                planned = plan(scene, replace(reporting, model=models[column]))
                response = solve_as_planned(scene, planned)
                if planned.prepared:
                    prepared[column] = planned.prepared
            body_name = column if scene.body.of_kind.discretise else "none"
            yield Run(tacton=name, body=body_name, scene=scene, response=response)
    for column, future in zip(meshed, moved, strict=True):
        progress(f"maps of {column}", 1.0)
        with or_failed(failures, f"maps of {column}"):
            found.collect(*future.result())
    for column, slab in flat.items():
        with or_failed(failures, f"flat slab beside {column}"):
            if run := slab.result():
                found.checks[column] = run


def _report(progress: Progress, column: str, phase: str, fraction: float) -> None:
    progress(f"{column}: {phase}", fraction)


def _response(
    name: str, column: str, scene: Scene, options: SolveOptions, part: Playback | None
) -> tuple[Response, tuple[Surfaces, dict[str, str]]]:
    """Return a response and, of a body whose surface needs no mesh, its map and view."""
    if not scene.body.of_kind.discretise:
        return compute(scene, options.model), ({}, {})
    response = solve_as_planned(scene, plan(scene, options))
    run = Run(tacton=name, body=column, scene=scene, response=response)
    return response, surfaces.quick_surface(run, part)
