"""Table of candidates on disk: computed on all cores, resumable, read as one table.

The files are those of a sweep's rows. Rows of a hypercube are a fair sample; those of a search,
which begins at the best of all rows, are not, and have another `stage`.
"""

import json
import time
from collections.abc import Mapping, Sequence
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from skinwave.inference.assess import CLAIMED, row
from skinwave.inference.design import PARAMETERS, Candidate, Parameter, name
from skinwave.inference.ranking import Row, nearest
from skinwave.results import record
from skinwave.results.outputs import output_file
from skinwave.sweeps import dataset, engine
from skinwave.sweeps.sweep import SweepOutcome
from skinwave.system.effort import Progress, one_thread, silent

COMMAND = "infer"
BATCH = 4  # candidates in one file
GENERATION = 24  # candidates of a search that are computed before the next ones are chosen
PARENTS = 8  # of the best rows, near which the next ones are
STEP = 0.15  # of a parameter's range, standard deviation
CHANGED = 0.35  # of the parameters of a parent
HYPERCUBE, SEARCH = "hypercube", "search"
COLUMNS = {
    "key": "text", "index": "whole", "version": "text", "stage": "text", "status": "text",
    "error": "text", "seconds": "number",
    **{p.key: "text" if p.values else "number" for p in PARAMETERS},
    "first_mode_hz": "number", "mean_over_thickness": "number",
    "vibration_over_thickness": "number", "sag_over_thickness": "number",
    "second_harmonic_db": "number",
    **{f"{claim}_holds": "whole" for claim in CLAIMED},
    **{f"{claim}_value": "number" for claim in CLAIMED},
    "rival_db": "numbers", "rival_by_path_db": "numbers", "multiple_db": "numbers",
    "multiple_by_path_db": "numbers", "rival_of_mean_db": "number", "rival_line": "text",
    "rival_tacton": "text", "multiple_tacton": "text",
    "tactons_highest": "whole", "tactons_much_lower": "whole",
}  # fmt: skip


def open_folder(out: Path, command: Mapping[str, Any]) -> None:
    """The folder of a table, made if it is new.

    Raises
    ------
    ValueError
        If it is something else.
    """
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        try:
            known = record.read(out)["command"]["name"]
        except ValueError:
            known = ""
        if known != COMMAND:
            raise ValueError(
                f"{out} exists and is none of skinwave {COMMAND}; choose another --out"
            )
    (out / dataset.ROWS).mkdir(parents=True, exist_ok=True)
    if not (out / record.FILE).exists():
        record.write(out, command)


def enter_command(out: Path, command: Mapping[str, Any]) -> None:
    """Have the record of a folder name the last command, which has all candidates of the first."""
    kept = record.read(out)
    if kept["command"] != command:
        with output_file(out / record.FILE, overwrite=True) as file:
            file.write(json.dumps(kept | {"command": command}, indent=1).encode())


def fill(
    out: Path,
    wanted: Sequence[Candidate],
    stage: str,
    progress: Progress,
    *,
    scheduler: str = "processes",
    workers: int | None = None,
) -> SweepOutcome:
    """Compute the candidates that the folder has no row of, and append their rows.

    Parameters
    ----------
    out : a folder of `open_folder`
    wanted : candidates
    stage : "hypercube" or "search"
    progress : called with the stage and the fraction done
    scheduler, workers : as for `sweeps.sweep.sweep`

    Returns
    -------
    SweepOutcome
    """
    started, release = time.perf_counter(), version("skinwave")
    count = engine.workers(scheduler, workers)
    there = dataset.names(out)
    named = {name(candidate, release): candidate for candidate in wanted}
    index = dataset.numbered(list(named), there)
    left = [candidate for key, candidate in named.items() if key not in there]
    tally = {"done": 0, "failed": 0}

    def written(_: int, rows: Sequence[dict[str, Any]]) -> None:
        placed = [each | {"stage": stage, "index": index[each["key"]]} for each in rows]
        dataset.append(out, placed, COLUMNS)
        for each in rows:
            tally[each["status"]] += 1
        progress(stage, (len(named) - len(left) + sum(tally.values())) / len(named))

    batches = [left[k : k + BATCH] for k in range(0, len(left), BATCH)]
    interrupted = False
    try:
        engine.run_all(partial(_rows, release), batches, scheduler, count, written)
    except KeyboardInterrupt:
        interrupted = True
    return SweepOutcome(
        planned=len(named), found=len(named) - len(left), **tally, interrupted=interrupted,
        seconds=time.perf_counter() - started,
    )  # fmt: skip


def offspring(rows: Sequence[Row], count: int, seed: int) -> list[Candidate]:
    """Candidates near the best rows: some parameters of one of them moved, or of another of them.

    Parameters
    ----------
    rows : of the table
    count : how many
    seed : of what is random

    Returns
    -------
    list of candidates
    """
    best, rng = nearest(rows)[:PARENTS], np.random.default_rng((seed, len(rows)))
    return [
        {p.key: _moved(p, best[rng.integers(len(best))], parent, rng) for p in PARAMETERS}
        for parent in (best[rng.integers(len(best))] for _ in range(count))
    ]


def _moved(p: Parameter, other: Row, parent: Row, rng: np.random.Generator) -> Any:
    """A parameter of a parent, changed now and then: as of another, or by a step within bounds."""
    if rng.random() > CHANGED:
        return parent[p.key]
    if p.bounds is None:
        return other[p.key] if rng.random() < 0.5 else p.values[rng.integers(len(p.values))]
    low, high = p.bounds
    return float(np.clip(parent[p.key] + STEP * (high - low) * rng.normal(), low, high))


def search(
    out: Path,
    count: int,
    progress: Progress,
    *,
    seed: int = 0,
    scheduler: str = "processes",
    workers: int | None = None,
) -> SweepOutcome:
    """Compute candidates near the best rows, generation by generation, until there are so many.

    Parameters
    ----------
    out : a folder with rows
    count : rows of a search, with those that are there
    progress : called with "search" and the fraction done
    seed : of what is random
    scheduler, workers : as for `sweeps.sweep.sweep`

    Returns
    -------
    SweepOutcome
    """
    had = sum(row["stage"] == SEARCH for row in dataset.read(out))
    done, failed, seconds, interrupted = 0, 0, 0.0, False
    while not interrupted and (left := count - had - done - failed) > 0:
        wanted = offspring(dataset.read(out), min(GENERATION, left), seed)
        progress(SEARCH, (count - left) / count)
        each = fill(out, wanted, SEARCH, silent, scheduler=scheduler, workers=workers)
        done, failed = done + each.done, failed + each.failed
        seconds, interrupted = seconds + each.seconds, each.interrupted or not each.done
    return SweepOutcome(
        planned=max(count, had), found=had, done=done, failed=failed, interrupted=interrupted,
        seconds=seconds,
    )  # fmt: skip


def _rows(release: str, batch: Sequence[Candidate]) -> list[dict[str, Any]]:
    with one_thread():
        return [row(candidate, release) for candidate in batch]
