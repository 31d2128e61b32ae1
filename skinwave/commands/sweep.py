"""Many scenes in one table, on all cores or a cluster; goes on where it ended."""

import argparse
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from skinwave.commands.common import (
    TOLERANCE,
    add_mesh,
    add_reporting,
    add_scene,
    metre,
    progress_of,
    summarise,
)
from skinwave.models import names
from skinwave.system.plain_text import say

if TYPE_CHECKING:
    from skinwave.system.effort import Progress

SAID_EACH = 5.0  # s between two lines of progress on a pipe


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    add_scene(parser)
    parser.add_argument(
        "--vary", action="extend", nargs="+", metavar="KEY=VALUES", required=True,
        help="tacton.speed_m_per_s=1:12:12, body.thickness_mm=10,15, body=skin-slab,palm; "
        "start:stop or normal(25e3,0.3), lognormal, factor, uniform, triangular of lhs and sobol",
    )  # fmt: skip
    parser.add_argument(
        "--design", default="factorial", help="factorial (default), zip, lhs or sobol"
    )
    parser.add_argument(
        "--samples", type=int, metavar="N",
        help="runs of lhs; rows of each matrix of sobol; samples of spreads of --best (199)",
    )  # fmt: skip
    parser.add_argument("--seed", type=int, default=0, help="of samples")
    parser.add_argument(
        "--best", metavar="COLUMN",
        help="the value of the varied key at which a column such as level_db[0] is largest, and "
        "its 95 %% interval under the spreads of the scene",
    )  # fmt: skip
    parser.add_argument("-o", "--out", type=Path, metavar="DIR", help="folder of the table")
    parser.add_argument(
        "--scheduler", default="processes", metavar="WHERE",
        help="processes (default), threads, or the address of a Dask scheduler",
    )  # fmt: skip
    parser.add_argument("--workers", type=int, metavar="N", help="runs at a time on this machine")
    parser.add_argument("--model", choices=("auto", *names()), default="auto")
    parser.add_argument("--tolerance", type=float, default=0.05, help=TOLERANCE)
    add_mesh(parser)
    parser.add_argument("--csv", action="store_true", help="write rows.csv, too")
    parser.add_argument("--quiet", action="store_true", help="no progress, no summary")
    add_reporting(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; the exit code."""
    from importlib.metadata import version

    from skinwave.results import record
    from skinwave.sweeps import dataset, engine

    engine.check(options.scheduler)
    from skinwave.scene.variation import SAMPLED, cases, combinations, parse
    from skinwave.sweeps import of_sweep
    from skinwave.sweeps.best import Request, best_value, check
    from skinwave.sweeps.sweep import ModelOptions, sweep

    if options.seed < 0:
        raise ValueError(f"--seed = {options.seed} is below 0; give 0 or a whole number above")
    variations = [parse(text) for text in options.vary]
    design = options.design
    if options.best and design in SAMPLED:
        raise ValueError(f"--best takes a grid of values, not --design {design}; leave it out")
    samples = None if options.best else options.samples
    combined = combinations(variations, design, samples, options.seed)
    wanted = cases(options.scene, combined)
    if options.best:
        check(variations, options.best, wanted, options.samples)
    is_sampled = design in SAMPLED and not any(each.values for each in variations)
    model_options = ModelOptions(
        model=options.model, tolerance=options.tolerance, h=metre(options.h), solver=options.solver
    )
    out = options.out or Path(f"{options.scene.stem}-sweep")
    if options.csv:
        dataset.refuse_changed(out, dataset.CSV)  # now, not when all is computed
    if is_sampled:
        of_sweep.refuse_changed(out)
    with _progress(options, len(wanted)) as progress:
        found = sweep(
            wanted, out, model_options, progress, scheduler=options.scheduler,
            workers=options.workers, command=record.of_command(options),
        )  # fmt: skip
        best = None
        if options.best and not found.missing:
            request = Request(
                cases=partial(cases, options.scene), variation=variations[0], column=options.best,
                folder=out, model_options=model_options, samples=options.samples,
                seed=options.seed, scheduler=options.scheduler, workers=options.workers,
                command=record.of_command(options),
            )  # fmt: skip
            best = best_value(request, progress)
    if options.csv and found.planned > found.missing:
        dataset.write_csv(out, dataset.read(out))
    sampled: list[str] = []
    if is_sampled and found.done + found.found and not found.missing:
        names = {case.name(version("skinwave"), model_options): case for case in wanted}
        has_indices = design == "sobol"
        rows = of_sweep.in_order(dataset.read(out), names, combined)
        sampled = of_sweep.write(
            out, of_sweep.Sampled(rows=rows, variations=variations, has_indices=has_indices)
        )
    summary = {
        "out": str(out),
        "planned": found.planned,
        "there_before": found.found,
        "done": found.done,
        "failed": found.failed,
        "missing": found.missing,
        "seconds": round(found.seconds, 1),
        "files": sampled,
    }
    if best:
        summary["best"] = asdict(best) | {"is_at_end": best.is_at_end}
    sentence = (
        f"{found.done} of {found.planned} runs done in {found.seconds:.0f} s, {found.failed} "
        f"failed, {found.found} were there; {out}/{dataset.ROWS} is the table"
    ) + (f", {out}/{of_sweep.PAGE} its percentiles" if sampled else "")
    if best:
        sentence = f"{best.words}\n{sentence}"
    summarise(options, summary, sentence)
    if found.missing:
        why = "interrupted" if found.interrupted else "workers were killed"
        say(f"skinwave: {why}; {found.missing} runs are missing, the same command goes on with "
            "them", sys.stderr)  # fmt: skip
    return 1 if found.missing else 0


@contextmanager
def _progress(options: argparse.Namespace, runs: int) -> "Iterator[Progress]":
    """A bar; on a pipe a line now and then, with the time left."""
    if options.quiet or options.json or sys.stderr.isatty():
        with progress_of(options) as progress:
            yield progress
        return
    begun: dict[str, tuple[float, float]] = {}
    said = [-SAID_EACH]

    def log(phase: str, fraction: float) -> None:
        now = time.perf_counter()
        started, at = begun.setdefault(phase, (now, fraction))
        if now - said[0] < SAID_EACH and fraction < 1:
            return
        said[0] = now
        left = ""
        if at < fraction < 1:
            left = f", {(now - started) * (1 - fraction) / (fraction - at):.0f} s left"
        told = f"{round(fraction * runs)} of {runs} runs" if phase == "run" else phase
        say(told + left, sys.stderr)

    yield log
