"""Parameter sweep: many scenes in one table, each body reduced once, each run once."""

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from importlib.metadata import version
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from simple_model import Response
from simple_model.choices import choose
from skinwave.bodies.analytic import is_flat_layer, is_laterally_infinite
from skinwave.models import named, names, parametric
from skinwave.models.advice import default_model, takes
from skinwave.models.covering import Covering, kept_together
from skinwave.models.flat_body import FLAT_BODY
from skinwave.models.options import SolveOptions
from skinwave.models.prepared import Prepared, answer, prepare, reduction_tolerance
from skinwave.planning.assessment import assessed
from skinwave.planning.plan import plan
from skinwave.planning.refinement import compared_with, refined
from skinwave.planning.simulate import compute, solve
from skinwave.scene.scene import Scene
from skinwave.scene.variation import DesignPoint
from skinwave.sweeps import dataset, engine
from skinwave.sweeps.families import (
    Mesh,
    Solid,
    Values,
    families,
    highest,
    mesh_of,
)
from skinwave.sweeps.measures import columns, commanded, measured
from skinwave.system.effort import Progress, silent

BATCH = 8  # runs of one body that are handed out together, at most
KEPT = 4  # bodies that a worker caches in memory, on two meshes each
LOST = Mesh(error="its worker was killed each time; give it more memory or larger elements")


@dataclass(frozen=True, kw_only=True)
class ModelOptions:
    """Model, tolerance, element size h in metre and solver of every run, and whether the error of
    runs without a mesh is estimated.
    """

    model: str = "auto"
    tolerance: float = 0.05
    h: float | None = None
    solver: str = "auto"
    is_assessed: bool = True


@dataclass(frozen=True, kw_only=True)
class SweepOutcome:
    """Result of a sweep: rows `planned`, `found` there before, `done` and `failed` now."""

    planned: int
    found: int
    done: int
    failed: int
    interrupted: bool
    seconds: float = 0.0

    @property
    def missing(self) -> int:
        """Runs that are not in the table yet."""
        return self.planned - self.found - self.done - self.failed


def sweep(
    wanted: Sequence[DesignPoint],
    folder: Path,
    model_options: ModelOptions,
    progress: Progress | None = None,
    *,
    scheduler: str = "processes",
    workers: int | None = None,
    command: Mapping[str, Any] | None = None,
) -> SweepOutcome:
    """Run every case that the folder has no row of, and append a row for each.

    Parameters
    ----------
    wanted : cases of `variation.cases`
    folder : a new one, or that of a sweep, which is gone on with
    scheduler : "processes", "threads", or the address of a Dask scheduler
    workers : how many runs go on at a time on this machine; all cores if not given
    command : what a new folder's record.json says of how it was made, as `record.of_command`

    An interrupt ends it early; the rows that are written stay. An error of a run is its row.

    Raises
    ------
    ValueError
        If a solver option is wrong, an extra is not installed, no scheduler responds, or the folder
        is not that of a sweep, or another sweep writes into it.
    """
    started = time.perf_counter()
    _check(model_options)
    engine.check(scheduler)
    count = engine.workers(scheduler, workers)
    with dataset.locked(dataset.open_folder(folder, command)):
        found = _swept(
            by_name(wanted, model_options), folder, model_options, progress or silent, scheduler,
            count,
        )  # fmt: skip
        return replace(found, seconds=time.perf_counter() - started)


def by_name(cases: Iterable[DesignPoint], model_options: ModelOptions) -> dict[str, DesignPoint]:
    """Cases by the names of their rows."""
    release = version("skinwave")
    return {case.name(release, model_options): case for case in cases}


def in_order(
    rows: Iterable[dataset.Row],
    cases: Iterable[DesignPoint],
    model_options: ModelOptions,
    combined: Sequence[Mapping[str, Any]],
) -> list[dataset.Row]:
    """Row of each combination of values, in the order of its design."""
    by_key = {row[dataset.KEY]: row for row in rows}
    named = by_name(cases, model_options)
    by_values = {tuple(case.varied.items()): by_key[name] for name, case in named.items()}
    return [by_values[tuple(each.items())] for each in combined]


def _swept(
    named: Mapping[str, DesignPoint],
    folder: Path,
    model_options: ModelOptions,
    report: Progress,
    scheduler: str,
    count: int,
) -> SweepOutcome:
    """Run the cases that a folder has no rows of, while no other sweep writes there."""
    there = dataset.names(folder)
    left = {name: case for name, case in named.items() if name not in there}
    index = dataset.numbered(list(named), there)
    types = columns(named.values())
    tally = {"done": 0, "failed": 0}
    constant = {
        "version": version("skinwave"), "asked_model": model_options.model,
        "tolerance": model_options.tolerance,
        "asked_h_mm": 1e3 * model_options.h if model_options.h else None,
    }  # fmt: skip

    def written(rows: Sequence[dict[str, Any]]) -> None:
        if rows:
            numbered = [{"index": index[row["key"]]} | constant | row for row in rows]
            dataset.append(folder, numbered, types)
        for row in rows:
            tally[row["status"]] += 1
        report("run", (len(named) - len(left) + sum(tally.values())) / len(named))

    interrupted = False
    try:
        written([{"key": k} | commanded(case) for k, case in left.items() if not case.scene])
        runs = {name: case for name, case in left.items() if case.scene}
        meshes = _shared_meshes(runs, model_options, scheduler, count, report)
        batches = _batches(runs, model_options, meshes, count)
        engine.run_all(
            partial(_rows, model_options), batches, scheduler, count, lambda k, rows: written(rows)
        )
    except KeyboardInterrupt:
        interrupted = True
    return SweepOutcome(
        planned=len(named),
        found=len(named) - len(left),
        **tally,
        interrupted=interrupted,
    )


def model_of(scene: Scene, asked: str) -> str:
    """The model of a scene: as asked, or the cheapest that leaves nothing out.

    That is the point kernel without a body, the wavenumber integral for a flat body whose sides
    reflect nothing, and else finite elements.
    """
    if asked != "auto":
        return asked
    if not scene.body.of_kind.discretise:
        return "point-kernel"
    is_exact = is_flat_layer(scene.body) and is_laterally_infinite(scene.body)
    return FLAT_BODY.name if is_exact and takes(FLAT_BODY, scene) else default_model(scene)


def _check(model_options: ModelOptions) -> None:
    _options(model_options)  # which refuses what is out of range
    choose("model", model_options.model, ("auto", *names()))


def _options(
    model_options: ModelOptions, model: str = "auto", h: float | None = None
) -> SolveOptions:
    return SolveOptions(
        model=model, h=h or model_options.h, tolerance=model_options.tolerance,
        solver=model_options.solver,
    )  # fmt: skip


def _key(scene: Scene) -> Solid:
    return scene.body, scene.probes, scene.reading, scene.load


def _solid(case: DesignPoint, model_options: ModelOptions) -> Solid | None:
    """Body and probes by which a run shares a reduced body with others, if it does."""
    scene = case.scene
    if (
        scene is None
        or not named(model_of(scene, model_options.model)).is_reduced
        or not scene.body.of_kind.discretise
    ):
        return None
    return _key(scene)


def _shared_meshes(
    runs: dict[str, DesignPoint],
    model_options: ModelOptions,
    scheduler: str,
    count: int,
    report: Progress,
) -> dict[Solid, Mesh]:
    """Find a mesh for each body that several runs share, and reduce it, each body once; families of
    bodies together, where they can be.
    """

    def on_workers(work: Callable[..., Mesh], items: Sequence[Any]) -> list[Mesh]:
        found = dict.fromkeys(range(len(items)), LOST)

        def done(k: int, mesh: Mesh) -> None:
            found[k] = mesh
            report("reduce bodies", sum(each is not LOST for each in found.values()) / len(items))

        engine.run_all(partial(work, model_options), items, scheduler, count, done)
        return list(found.values())

    report("reduce bodies", 0.0)
    hardest = _hardest(runs, model_options)
    shared = families(hardest, model_options.tolerance, count)
    meshes = on_workers(_mesh_of_family, [family for family, _ in shared])
    found = {
        solid: replace(mesh, values=values)
        for (_, members), mesh in zip(shared, meshes, strict=True)
        for solid, values in members.items()
        if not mesh.error
    }
    alone = {solid: case.scene for solid, case in hardest.items() if solid not in found}
    return found | dict(zip(alone, on_workers(_mesh, list(alone.values())), strict=True))


def _hardest(runs: dict[str, DesignPoint], model_options: ModelOptions) -> dict[Solid, DesignPoint]:
    """Run with the highest line on each body that runs share."""
    found: dict[Solid, tuple[float, DesignPoint]] = {}
    for case in runs.values():
        if (solid := _solid(case, model_options)) and case.scene:
            line = highest(case.scene)
            if solid not in found or line > found[solid][0]:
                found[solid] = line, case
    return {solid: case for solid, (_, case) in found.items()}


def _mesh_of_family(model_options: ModelOptions, family: Covering) -> Mesh:
    """Mesh of a family, or the error why its bodies are reduced one by one; cached on disk."""
    asked = model_options.tolerance, model_options.h, model_options.solver
    try:
        return mesh_of(family, *asked)
    except Exception as error:  # any: each body has its own then
        return Mesh(error=_said(error))


def _mesh(model_options: ModelOptions, scene: Scene) -> Mesh:
    """The mesh that the hardest scene of a body requires; cached on disk for all workers."""
    try:
        if model_options.h:
            _prepared(_key(scene), model_options.h, model_options, None, ())
            coarser = compared_with(scene.body, model_options.h)
            _prepared(_key(scene), coarser, model_options, None, ())
            return Mesh(h=model_options.h, coarser=coarser)
        found = refined(scene, scene.body, _options(model_options))
        return Mesh(h=found.h, coarser=found.compared)
    except Exception as error:  # any: it is that of every run on this body
        return Mesh(error=_said(error))


@lru_cache(maxsize=2 * KEPT)  # a worker meets the same bodies again and again
def _prepared(
    solid: Solid,
    h: float,
    model_options: ModelOptions,
    family: Covering | None,
    values: Values,
) -> Prepared:
    tolerance, solver = model_options.tolerance, model_options.solver
    if family:
        return parametric.at(kept_together(family, h, tolerance, solver), dict(values))
    body, probes, reading, load = solid
    return prepare(
        body, np.array(probes), h=h, solver=solver, tolerance=reduction_tolerance(tolerance),
        reading=reading, load=load,
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Batch:
    """Runs by name that are handed out together, and the mesh that they share."""

    runs: dict[str, DesignPoint]
    mesh: Mesh | None


def _batches(
    runs: dict[str, DesignPoint], model_options: ModelOptions, meshes: dict[Solid, Mesh], count: int
) -> list[Batch]:
    """Runs on one body follow each other; others are alone, unless they are short."""
    groups: dict[Solid | None, list[str]] = {}
    for name, case in runs.items():
        groups.setdefault(_solid(case, model_options), []).append(name)
    # Several batches for each worker, so that none waits long for the last.
    size = max(1, min(BATCH, len(runs) // (4 * count)))
    return [
        Batch(runs={n: runs[n] for n in names[k : k + step]}, mesh=solid and meshes[solid])
        for solid, names in groups.items()
        for step in [size if solid or not model_options.is_assessed else 1]
        for k in range(0, len(names), step)
    ]


def _rows(model_options: ModelOptions, batch: Batch) -> list[dict[str, Any]]:
    """Run a batch, on a worker."""
    return [
        {"key": name} | _row(case, model_options, batch.mesh) for name, case in batch.runs.items()
    ]


def _row(case: DesignPoint, model_options: ModelOptions, mesh: Mesh | None) -> dict[str, Any]:
    row, started = commanded(case), time.perf_counter()
    assert case.scene
    try:
        if mesh is None:
            model = model_of(case.scene, model_options.model)
            has_mesh = named(model).default_size is not None
            asked = _options(model_options, model)
            response = (
                solve(case.scene, plan(case.scene, asked))
                if model_options.is_assessed or has_mesh
                else compute(case.scene, model, tolerance=asked.tolerance)
            )
        else:
            response, mesh = _on_mesh(case.scene, model_options, mesh)
            row["h_mm"] = 1e3 * (mesh.h or 0.0)
            row["reduced_together"] = mesh.family.members if mesh.family else 1
        if isfinite(response.expected_error):
            row["expected_error"] = response.expected_error
        row |= measured(case.scene, response)
    except Exception as error:  # any: one run's failure is its row, not the end of the others
        row["error"] = _said(error)
    return row | {"seconds": time.perf_counter() - started}


def _on_mesh(scene: Scene, model_options: ModelOptions, mesh: Mesh) -> tuple[Response, Mesh]:
    """Response of a reduced body, with its expected relative error, and the mesh that it is on: the
    body's own where that of its family is too coarse.
    """
    if mesh.error or mesh.h is None:
        raise ValueError(mesh.error)
    prepared, coarse = (
        _prepared(_key(scene), h or 0.0, model_options, mesh.family, mesh.values)
        for h in (mesh.h, mesh.coarser)
    )
    response = assessed(
        scene, answer(prepared, scene), prepared, _options(model_options, h=mesh.h),
        compared=(mesh.coarser or 0.0, coarse), meshed=mesh.meshed,
    )  # fmt: skip
    is_shared = mesh.family and not model_options.h
    if is_shared and response.expected_error > model_options.tolerance:
        return _on_mesh(scene, model_options, _mesh(model_options, scene))
    return response, mesh


def _said(error: Exception) -> str:
    """An error as an entry of the table; its kind, too, where it is not a refusal."""
    text = " ".join(str(error).split())
    refusal = isinstance(error, ValueError | ArithmeticError) and text
    return text if refusal else f"{type(error).__name__}: {text}"
