"""Parameter sweep: many scenes in one table, each body reduced once, each run once."""

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import version
from math import isfinite
from pathlib import Path
from typing import Any

from simple_model import Response
from simple_model.choices import choose
from skinwave.bodies.analytic import is_flat_layer, is_laterally_infinite
from skinwave.models import named, names
from skinwave.models.flat_body import FLAT_BODY
from skinwave.models.limits import default_model, takes
from skinwave.models.reduced import answer
from skinwave.planning.assessment import assessed
from skinwave.planning.plan import plan
from skinwave.planning.simulate import compute, solve
from skinwave.scene.scene import Scene
from skinwave.scene.variation import DesignPoint
from skinwave.sweeps import dataset, engine
from skinwave.sweeps.measures import columns, commanded, measured
from skinwave.sweeps.reductions import (
    Mesh,
    ModelOptions,
    Solid,
    families,
    highest,
    mesh_of_body,
    mesh_of_family,
    prepared,
    solid_of,
)
from skinwave.system.effort import Progress, silent

BATCH = 8  # runs of one body that are handed out together, at most
Combined = Sequence[Mapping[str, Any]]  # values by key, of each run
LOST = Mesh(error="its worker was killed each time; give it more memory or larger elements")


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


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """Where and how cases are run.

    Parameters
    ----------
    folder : a new one, or that of a sweep, which is resumed
    options : ModelOptions of all runs
    progress : called with the name of the phase and the fraction done
    scheduler : "processes", "threads", or the address of a Dask scheduler
    workers : how many runs go on at a time on this machine; all cores if not given
    command : what a new folder's record.json says of how it was made, as `record.of_command`
    """

    folder: Path
    options: ModelOptions
    progress: Progress = silent
    scheduler: str = "processes"
    workers: int | None = None
    command: Mapping[str, Any] | None = None

    def run(self, cases: Iterable[DesignPoint]) -> SweepOutcome:
        """Run every case that the folder has no row of, and append a row for each.

        An interrupt ends it early; the rows that are written stay. An error of a run is its row.

        Raises
        ------
        ValueError
            If an option is wrong, an extra is not installed, no scheduler responds, the folder is
            not that of a sweep, or another sweep writes into it.
        """
        started = time.perf_counter()
        choose("model", self.options.model, ("auto", *names()))
        self.options.solving()  # which refuses what is out of range
        engine.check(self.scheduler)
        count = engine.workers(self.scheduler, self.workers)
        with dataset.locked(dataset.open_folder(self.folder, self.command)):
            found = _swept(self, self.by_name(cases), count)
        return replace(found, seconds=time.perf_counter() - started)

    def by_name(self, cases: Iterable[DesignPoint]) -> dict[str, DesignPoint]:
        """Cases by the names of their rows."""
        release = version("skinwave")
        return {case.name(release, self.options): case for case in cases}

    def in_order(
        self, cases: Iterable[DesignPoint], combined: Combined, columns: Sequence[str] = ()
    ) -> list[dataset.Row]:
        """Row of each combination of values, in the order of its design; of the columns given."""
        rows = {row[dataset.KEY]: row for row in dataset.read(self.folder, columns)}
        by_values = {
            tuple(case.varied.items()): rows[name] for name, case in self.by_name(cases).items()
        }
        return [by_values[tuple(each.items())] for each in combined]


def _swept(sweep: Sweep, named: Mapping[str, DesignPoint], count: int) -> SweepOutcome:
    """Run the cases that a folder has no rows of, while no other sweep writes there."""
    there, options = dataset.names(sweep.folder), sweep.options
    left = {name: case for name, case in named.items() if name not in there}
    index = dataset.numbered(list(named), there)
    types = columns(named.values())
    tally = {"done": 0, "failed": 0}
    constant = {
        "version": version("skinwave"), "asked_model": options.model,
        "tolerance": options.tolerance, "asked_h_mm": 1e3 * options.h if options.h else None,
    }  # fmt: skip

    def written(rows: Sequence[dict[str, Any]]) -> None:
        if rows:
            numbered = [{"index": index[row["key"]]} | constant | row for row in rows]
            dataset.append(sweep.folder, numbered, types)
        for row in rows:
            tally[row["status"]] += 1
        sweep.progress("run", (len(named) - len(left) + sum(tally.values())) / len(named))

    interrupted = False
    try:
        written([{"key": k} | commanded(case) for k, case in left.items() if not case.scene])
        runs = {name: case for name, case in left.items() if case.scene}
        batches = _batches(runs, options, _shared_meshes(sweep, runs, count), count)
        engine.run_all(
            partial(_rows, options), batches, sweep.scheduler, count, lambda k, rows: written(rows)
        )
    except KeyboardInterrupt:
        interrupted = True
    return SweepOutcome(
        planned=len(named), found=len(named) - len(left), **tally, interrupted=interrupted
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


def _solid(case: DesignPoint, options: ModelOptions) -> Solid | None:
    """Body and probes by which a run shares a reduced body with others, if it does."""
    scene = case.scene
    if (
        scene is None
        or not named(model_of(scene, options.model)).is_reduced
        or not scene.body.of_kind.discretise
    ):
        return None
    return solid_of(scene)


def _shared_meshes(sweep: Sweep, runs: Mapping[str, DesignPoint], count: int) -> dict[Solid, Mesh]:
    """Find a mesh for each body that several runs share, and reduce it, each body once; families of
    bodies together, where they can be.
    """

    def on_workers(work: Callable[..., Mesh], items: Sequence[Any]) -> list[Mesh]:
        found: dict[int, Mesh] = {}

        def done(k: int, mesh: Mesh) -> None:
            found[k] = mesh
            sweep.progress("reduce bodies", len(found) / len(items))

        engine.run_all(partial(_mesh, work, sweep.options), items, sweep.scheduler, count, done)
        return [found.get(k, LOST) for k in range(len(items))]

    sweep.progress("reduce bodies", 0.0)
    hardest = _hardest(runs, sweep.options)
    shared = families(hardest, sweep.options.tolerance, count)
    meshes = on_workers(mesh_of_family, [family for family, _ in shared])
    found = {
        solid: replace(mesh, values=values)
        for (_, members), mesh in zip(shared, meshes, strict=True)
        for solid, values in members.items()
        if not mesh.error
    }
    alone = {solid: case.scene for solid, case in hardest.items() if solid not in found}
    return found | dict(zip(alone, on_workers(mesh_of_body, list(alone.values())), strict=True))


def _hardest(runs: Mapping[str, DesignPoint], options: ModelOptions) -> dict[Solid, DesignPoint]:
    """Run with the highest line on each body that runs share."""
    found: dict[Solid, tuple[float, DesignPoint]] = {}
    for case in runs.values():
        if (solid := _solid(case, options)) and case.scene:
            line = highest(case.scene)
            if solid not in found or line > found[solid][0]:
                found[solid] = line, case
    return {solid: case for solid, (_, case) in found.items()}


def _mesh(work: Callable[[ModelOptions, Any], Mesh], options: ModelOptions, item: Any) -> Mesh:
    """Mesh of a body or a family, or the error why there is none."""
    try:
        return work(options, item)
    except Exception as error:  # any: it is that of every run on this body
        return Mesh(error=_said(error))


@dataclass(frozen=True, kw_only=True)
class Batch:
    """Runs by name that are handed out together, and the mesh that they share."""

    runs: dict[str, DesignPoint]
    mesh: Mesh | None


def _batches(
    runs: dict[str, DesignPoint], options: ModelOptions, meshes: dict[Solid, Mesh], count: int
) -> list[Batch]:
    """Runs on one body follow each other; others are alone, unless they are short."""
    groups: dict[Solid | None, list[str]] = {}
    for name, case in runs.items():
        groups.setdefault(_solid(case, options), []).append(name)
    # Several batches for each worker, so that none waits long for the last.
    size = max(1, min(BATCH, len(runs) // (4 * count)))
    return [
        Batch(runs={n: runs[n] for n in names[k : k + step]}, mesh=solid and meshes[solid])
        for solid, names in groups.items()
        for step in [size if solid or not options.is_assessed else 1]
        for k in range(0, len(names), step)
    ]


def _rows(options: ModelOptions, batch: Batch) -> list[dict[str, Any]]:
    """Run a batch, on a worker."""
    return [{"key": name} | _row(case, options, batch.mesh) for name, case in batch.runs.items()]


def _row(case: DesignPoint, options: ModelOptions, mesh: Mesh | None) -> dict[str, Any]:
    row, started = commanded(case), time.perf_counter()
    assert case.scene
    try:
        if mesh is None:
            model = model_of(case.scene, options.model)
            has_mesh = named(model).default_size is not None
            asked = options.solving(model)
            response = (
                solve(case.scene, plan(case.scene, asked))
                if options.is_assessed or has_mesh
                else compute(case.scene, model, tolerance=asked.tolerance)
            )
        else:
            response, mesh = _on_mesh(case.scene, options, mesh)
            row["h_mm"] = 1e3 * mesh.h
            row["reduced_together"] = mesh.family.members if mesh.family else 1
        if isfinite(response.expected_error):
            row["expected_error"] = response.expected_error
        row |= measured(case.scene, response)
    except Exception as error:  # any: one run's failure is its row, not the end of the others
        row["error"] = _said(error)
    return row | {"seconds": time.perf_counter() - started}


def _on_mesh(scene: Scene, options: ModelOptions, mesh: Mesh) -> tuple[Response, Mesh]:
    """Response of a reduced body, with its expected relative error, and the mesh that it is on: the
    body's own where that of its family is too coarse.
    """
    if mesh.error:
        raise ValueError(mesh.error)
    fine, coarse = (
        prepared(solid_of(scene), h, options, mesh.family, mesh.values)
        for h in (mesh.h, mesh.coarser)
    )
    response = assessed(
        scene, answer(fine, scene), fine, options.solving(h=mesh.h),
        compared=(mesh.coarser, coarse), meshed=mesh.meshed,
    )  # fmt: skip
    is_shared = mesh.family and not options.h
    if is_shared and response.expected_error > options.tolerance:
        return _on_mesh(scene, options, _mesh(mesh_of_body, options, scene))
    return response, mesh


def _said(error: Exception) -> str:
    """An error as an entry of the table; its kind, too, where it is not a refusal."""
    text = " ".join(str(error).split())
    refusal = isinstance(error, ValueError | ArithmeticError) and text
    return text if refusal else f"{type(error).__name__}: {text}"
