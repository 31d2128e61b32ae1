"""Parameter sweep: many scenes in one table. Each body is reduced once, and each scene run once."""

import time
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

from simple_model import Response
from simple_model.choices import choose
from skinwave.models import named, names
from skinwave.models.options import SolveOptions
from skinwave.planning.plan import plan
from skinwave.planning.simulate import compute, solve_as_planned
from skinwave.scene.scene import Scene
from skinwave.scene.variation import DesignPoint
from skinwave.sweeps import dataset, engine
from skinwave.sweeps.measures import input_columns, result_columns, waveform_columns
from skinwave.sweeps.reductions import Mesh, model_of, on_mesh, shared_meshes
from skinwave.system.effort import Progress, silent
from skinwave.system.failures import reason

Combinations = Sequence[Mapping[str, Any]]  # values by key, for each run
Item = tuple[str, DesignPoint, Mesh | None]  # a run by its name


@dataclass(frozen=True, kw_only=True)
class SweepOutcome:
    """Numbers of runs: `planned`, done `earlier`, and `done` or `failed` in this call."""

    planned: int
    earlier: int
    done: int
    failed: int
    interrupted: bool
    seconds: float = 0.0

    @property
    def missing(self) -> int:
        """Number of runs without a row."""
        return self.planned - self.earlier - self.done - self.failed


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """Folder, design and options of a sweep.

    Parameters
    ----------
    folder : a new folder, or that of an earlier sweep, which is resumed
    points : function of combinations of values that returns the point of each
    options : model, tolerance, h and solver of all runs
    assessed : whether to estimate the error of runs without a mesh
    progress : called with the name of the phase and the fraction done
    scheduler : "processes", "threads", or the address of a Dask scheduler
    workers : number of runs at a time on this machine; all cores by default
    command : `record.command_entry` for the record.json of a new folder
    all_columns : whether files also have the columns with one value in all rows
    waveforms : whether to write the waveforms into another table of the folder
    """

    folder: Path
    points: Callable[[Combinations], list[DesignPoint]]
    options: SolveOptions
    assessed: bool = True
    progress: Progress = silent
    scheduler: str = "processes"
    workers: int | None = None
    command: Mapping[str, Any] | None = None
    all_columns: bool = False
    waveforms: bool = False

    def run(self, points: Sequence[DesignPoint]) -> SweepOutcome:
        """Run every point without a row in the folder, and append its row.

        Written rows survive an interrupt. A run that fails is a row with its error.
        """
        choose("model", self.options.model, ("auto", *names()))
        engine.check(self.scheduler)
        count = engine.worker_count(self.scheduler, self.workers)
        wanted = {self._name(point): point for point in points}
        with dataset.lock_rows(dataset.open_folder(self.folder, self.command)):
            outcome = self._run_missing(wanted, count)
            for folder in (self.folder, *[self.folder / dataset.WAVEFORMS] * self.waveforms):
                dataset.merge(folder, all_columns=self.all_columns)
        return outcome

    def rows(self, points: Sequence[DesignPoint], columns: Sequence[str] = ()) -> list[dataset.Row]:
        """Return the row of each point that has one, with all columns or some."""
        by_name = {row[dataset.KEY]: row for row in dataset.read(self.folder, columns)}
        rows = (by_name.get(self._name(point)) for point in points)
        return [row for row in rows if row]

    def _name(self, point: DesignPoint) -> str:
        """Return the name of a row, which depends on the scene and the options."""
        how = self.options
        return point.name(
            version("skinwave"), how.model, how.tolerance, how.h, how.solver, self.assessed
        )

    def _run_missing(self, wanted: Mapping[str, DesignPoint], count: int) -> SweepOutcome:
        started, earlier = time.perf_counter(), dataset.names(self.folder)
        index = dataset.number_rows(wanted, earlier) | earlier
        waveforms = self.folder / dataset.WAVEFORMS
        complete = earlier.keys() & dataset.names(waveforms) if self.waveforms else earlier
        missing = {name: point for name, point in wanted.items() if name not in complete}
        tally = {"done": 0, "failed": 0}
        constant = {
            "version": version("skinwave"), "asked_model": self.options.model,
            "tolerance": self.options.tolerance,
            "asked_h_mm": 1e3 * self.options.h if self.options.h else None,
        }  # fmt: skip

        def write(rows: Collection[dict[str, Any]]) -> None:
            places = [{"index": index[row["key"]], "key": row["key"]} for row in rows]
            waves = [row.pop("waveforms", {}) for row in rows]
            if rows and self.waveforms:  # first: a run with a row has its waveforms, too
                dataset.append(waveforms, [p | own for p, own in zip(places, waves, strict=True)])
            if rows:
                numbered = [p | constant | row for p, row in zip(places, rows, strict=True)]
                dataset.append(self.folder, numbered)
            for row in rows:
                tally[row["status"]] += 1
            self.progress("run", sum(tally.values()) / max(len(missing), 1))

        def distribute(work: Callable[[Any], Any], items: Sequence[Any], done: Any) -> None:
            engine.run_all(work, items, self.scheduler, count, done)

        interrupted = False
        try:
            runs = {name: point for name, point in missing.items() if point.scene}
            write([{"key": n} | input_columns(missing[n]) for n in missing if n not in runs])
            meshes = shared_meshes(runs, self.options, count, distribute, self.progress)
            write([])
            work = partial(_row, self.options, self.assessed, self.waveforms)
            items = [(name, runs[name], mesh) for name, mesh in meshes.items()]
            distribute(work, items, lambda rows: write(rows.values()))
        except KeyboardInterrupt:
            interrupted = True
        return SweepOutcome(
            planned=len(wanted), earlier=len(wanted) - len(missing), **tally,
            interrupted=interrupted, seconds=time.perf_counter() - started,
        )  # fmt: skip


def _row(options: SolveOptions, assessed: bool, waveforms: bool, item: Item) -> dict[str, Any]:
    """Return the row of one run, on a worker, with a row of `waveforms` if they are written."""
    name, point, mesh = item
    row, started = {"key": name} | input_columns(point), time.perf_counter()
    assert point.scene
    try:
        if mesh is None:
            response = _alone(point.scene, options, assessed)
        else:
            response, mesh = on_mesh(point.scene, options, mesh)
            row["h_mm"] = 1e3 * mesh.h
            row["reduced_together"] = mesh.family.members if mesh.family else 1
        row |= response.effort.errors.columns()
        row |= result_columns(point.scene, response)
        if waveforms:
            row["waveforms"] = waveform_columns(response)
    except Exception as error:  # of any kind: the other runs continue
        row["error"] = reason(error)
    return row | {"seconds": time.perf_counter() - started}


def _alone(scene: Scene, options: SolveOptions, assessed: bool) -> Response:
    """Return the response of a run without a shared reduction."""
    model = model_of(scene, options)
    if assessed or named(model).default_size is not None:
        return solve_as_planned(scene, plan(scene, replace(options, model=model)))
    return compute(scene, model, tolerance=options.tolerance)
