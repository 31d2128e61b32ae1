"""Parameter sweep: many scenes in one table, each body reduced once, each run once."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from math import isfinite
from pathlib import Path
from typing import Any

from simple_model import Response
from simple_model.choices import choose
from skinwave.models import named, names
from skinwave.models.options import SolveOptions
from skinwave.planning.plan import plan
from skinwave.planning.simulate import compute, solve
from skinwave.scene.scene import Scene
from skinwave.scene.variation import DesignPoint
from skinwave.sweeps import dataset, engine
from skinwave.sweeps.measures import commanded, measured
from skinwave.sweeps.reductions import (
    Mesh,
    Solid,
    model_of,
    on_mesh,
    said,
    shared_meshes,
    solid_of_run,
)
from skinwave.system.effort import Progress, silent

BATCH = 8  # runs of one body that are handed out together, at most
Combined = Sequence[Mapping[str, Any]]  # values by key, of each run


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
    """Where and how combinations of values are run, each a point of a design.

    Parameters
    ----------
    folder : a new one, or that of a sweep, which is resumed
    points : combinations of values -> the point of each
    options : model, tolerance, h and solver of all runs
    assessed : whether the error of runs without a mesh is estimated
    progress : called with the name of the phase and the fraction done
    scheduler : "processes", "threads", or the address of a Dask scheduler
    workers : how many runs go on at a time on this machine; all cores if not given
    command : what a new folder's record.json says of how it was made, as `record.of_command`
    """

    folder: Path
    points: Callable[[Combined], list[DesignPoint]]
    options: SolveOptions
    assessed: bool = True
    progress: Progress = silent
    scheduler: str = "processes"
    workers: int | None = None
    command: Mapping[str, Any] | None = None

    def run(self, points: Sequence[DesignPoint]) -> SweepOutcome:
        """Run every point that the folder has no row of, and append a row for each.

        An interrupt ends it early; the rows that are written stay. An error of a run is its row.
        """
        choose("model", self.options.model, ("auto", *names()))
        engine.check(self.scheduler)
        count = engine.workers(self.scheduler, self.workers)
        wanted = {self._name(point): point for point in points}
        with dataset.locked(dataset.open_folder(self.folder, self.command)):
            return self._swept(wanted, count)

    def rows(self, points: Sequence[DesignPoint]) -> list[dataset.Row]:
        """The row of each point that has one."""
        there = {row[dataset.KEY]: row for row in dataset.read(self.folder)}
        found = (there.get(self._name(point)) for point in points)
        return [row for row in found if row]

    def _name(self, point: DesignPoint) -> str:
        """The name of a row, the same for the same scene and options."""
        how = self.options
        return point.name(
            version("skinwave"), how.model, how.tolerance, how.h, how.solver, self.assessed
        )

    def _swept(self, wanted: Mapping[str, DesignPoint], count: int) -> SweepOutcome:
        started, there = time.perf_counter(), dataset.names(self.folder)
        left = {name: point for name, point in wanted.items() if name not in there}
        index = dataset.numbered(wanted, there)
        tally = {"done": 0, "failed": 0}
        constant = {
            "version": version("skinwave"), "asked_model": self.options.model,
            "tolerance": self.options.tolerance,
            "asked_h_mm": 1e3 * self.options.h if self.options.h else None,
        }  # fmt: skip

        def written(rows: Sequence[dict[str, Any]]) -> None:
            if rows:
                numbered = [{"index": index[row["key"]]} | constant | row for row in rows]
                dataset.append(self.folder, numbered)
            for row in rows:
                tally[row["status"]] += 1
            self.progress("run", (len(wanted) - len(left) + sum(tally.values())) / len(wanted))

        def spread(work: Callable[[Any], Any], items: Sequence[Any], done: Any) -> None:
            engine.run_all(work, items, self.scheduler, count, done)

        interrupted = False
        try:
            written([{"key": n} | commanded(point) for n, point in left.items() if not point.scene])
            runs = {name: point for name, point in left.items() if point.scene}
            meshes = shared_meshes(runs.values(), self.options, count, spread, self.progress)
            batches = self._batches(runs, meshes, count)
            spread(partial(_rows, self.options, self.assessed), batches, lambda _, r: written(r))
        except KeyboardInterrupt:
            interrupted = True
        return SweepOutcome(
            planned=len(wanted), found=len(wanted) - len(left), **tally, interrupted=interrupted,
            seconds=time.perf_counter() - started,
        )  # fmt: skip

    def _batches(
        self, runs: Mapping[str, DesignPoint], meshes: Mapping[Solid, Mesh], count: int
    ) -> list[tuple[dict[str, DesignPoint], Mesh | None]]:
        """Runs on one body follow each other; others are alone, unless they are short."""
        groups: dict[Solid | None, list[str]] = {}
        for name, point in runs.items():
            groups.setdefault(solid_of_run(point, self.options), []).append(name)
        # Several batches for each worker, so that none waits long for the last.
        size = max(1, min(BATCH, len(runs) // (4 * count)))
        return [
            ({n: runs[n] for n in names[k : k + step]}, solid and meshes[solid])
            for solid, names in groups.items()
            for step in [size if solid or not self.assessed else 1]
            for k in range(0, len(names), step)
        ]


def _rows(
    options: SolveOptions, assessed: bool, batch: tuple[dict[str, DesignPoint], Mesh | None]
) -> list[dict[str, Any]]:
    """Run a batch, on a worker."""
    runs, mesh = batch
    return [{"key": name} | _row(point, options, assessed, mesh) for name, point in runs.items()]


def _row(
    point: DesignPoint, options: SolveOptions, assessed: bool, mesh: Mesh | None
) -> dict[str, Any]:
    row, started = commanded(point), time.perf_counter()
    assert point.scene
    try:
        if mesh is None:
            response = _alone(point.scene, options, assessed)
        else:
            response, mesh = on_mesh(point.scene, options, mesh)
            row["h_mm"] = 1e3 * mesh.h
            row["reduced_together"] = mesh.family.members if mesh.family else 1
        if isfinite(response.expected_error):
            row["expected_error"] = response.expected_error
        row |= measured(point.scene, response)
    except Exception as error:  # any: one run's failure is its row, not the end of the others
        row["error"] = said(error)
    return row | {"seconds": time.perf_counter() - started}


def _alone(scene: Scene, options: SolveOptions, assessed: bool) -> Response:
    """Response of a run that shares nothing, with its expected error if that is estimated."""
    model = model_of(scene, options.model)
    if assessed or named(model).default_size is not None:
        asked = SolveOptions(
            model=model, tolerance=options.tolerance, h=options.h, solver=options.solver
        )
        return solve(scene, plan(scene, asked))
    return compute(scene, model, tolerance=options.tolerance)
