"""Table of sheets at large deflection, in a folder of its own beside the rows of the candidates:
one row a sheet and Tacton, so that what Ctrl-C ends goes on there.
"""

import hashlib
import time
from collections.abc import Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from skinwave.inference.large_deflection import CLAIMS, deciding, stretched_row, stretched_sheets
from skinwave.inference.ranking import Row
from skinwave.sweeps import dataset, engine
from skinwave.sweeps.sweep import SweepOutcome
from skinwave.system.effort import Progress, one_thread

FOLDER = "large-deflection"
PHASE = "large deflection"
COLUMNS = {
    "key": "text", "index": "whole", "version": "text", "status": "text", "error": "text",
    "seconds": "number", "sheet": "text", "tacton": "text",
    "linear_over_thickness": "number", "large_over_thickness": "number",
    **{f"{claim}_{how}_holds": "whole" for claim in CLAIMS for how in ("linear", "large")},
    **{f"{claim}_{how}": "number" for claim in CLAIMS for how in ("linear", "large")},
}  # fmt: skip
Task = tuple[Row, str]  # a sheet's row, a Tacton's name


def read(out: Path, rows: Sequence[Row]) -> list[dict[str, Any]]:
    """All rows of the table within a folder of candidates that are of sheets among its `rows`."""
    folder, known = out / FOLDER, {row["key"] for row in rows}
    there = dataset.read(folder) if dataset.names(folder) else []
    return [row for row in there if row["sheet"] in known]


def fill(
    out: Path,
    rows: Sequence[Row],
    count: int,
    progress: Progress,
    *,
    scheduler: str = "processes",
    workers: int | None = None,
) -> SweepOutcome:
    """Compute the nearest sheets at large deflection that the folder has no row of, and where that
    leaves a claim open, under all Tactons that it is about.

    Parameters
    ----------
    out : folder of the candidates' table
    rows : of that table
    count : sheets
    progress : called with the phase and the fraction done
    scheduler, workers : as for `sweeps.sweep.sweep`

    Returns
    -------
    SweepOutcome, of sheets under Tactons
    """
    workers, chosen = engine.workers(scheduler, workers), stretched_sheets(rows, count)
    (out / FOLDER / dataset.ROWS).mkdir(parents=True, exist_ok=True)
    first = _fill_once(out, rows, chosen, progress, scheduler, workers)
    if first.interrupted:
        return first
    then = _fill_once(out, rows, chosen, progress, scheduler, workers)
    return replace(
        then, found=first.found, done=first.done + then.done, failed=first.failed + then.failed,
        seconds=first.seconds + then.seconds,
    )  # fmt: skip


def _fill_once(
    out: Path,
    rows: Sequence[Row],
    chosen: Sequence[Row],
    progress: Progress,
    scheduler: str,
    workers: int,
) -> SweepOutcome:
    """Compute what decides the claims of some sheets, as far as their rows tell so far."""
    started, release, folder = time.perf_counter(), version("skinwave"), out / FOLDER
    stretched = read(out, rows)
    wanted = {_key(sheet, tacton, release): (sheet, tacton)
              for sheet in chosen for tacton in deciding(sheet, stretched)}  # fmt: skip
    there = dataset.names(folder)
    index = dataset.numbered(list(wanted), there)
    left = [key for key in wanted if key not in there]
    tally = {"done": 0, "failed": 0}

    def written(k: int, row: dict[str, Any]) -> None:
        own = {"key": left[k], "index": index[left[k]], "version": release}
        dataset.append(folder, [row | own], COLUMNS)
        tally[row["status"]] += 1
        progress(PHASE, (len(wanted) - len(left) + sum(tally.values())) / len(wanted))

    progress(PHASE, 0.0)
    tasks, interrupted = [wanted[key] for key in left], False
    try:
        engine.run_all(_row, tasks, scheduler, workers, written)
    except KeyboardInterrupt:
        interrupted = True
    return SweepOutcome(
        planned=len(wanted), found=len(wanted) - len(left), **tally, interrupted=interrupted,
        seconds=time.perf_counter() - started,
    )  # fmt: skip


def _key(sheet: Row, tacton: str, release: str) -> str:
    return hashlib.sha256(repr((sheet["key"], tacton, release)).encode()).hexdigest()[:24]


def _row(task: Task) -> dict[str, Any]:
    with one_thread():
        return stretched_row(*task)
