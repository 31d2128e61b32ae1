"""Many scenes in one table, on all cores or a cluster, and its figures; resumes."""

import argparse
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from skinwave.commands.common import (
    TOLERANCE,
    add_mesh,
    add_reporting,
    add_width,
    metre,
    progress_of,
    summarise,
)
from skinwave.models import names
from skinwave.system.plain_text import say

if TYPE_CHECKING:
    from skinwave.sweeps.best import Best
    from skinwave.sweeps.sweep import SweepOutcome
    from skinwave.system.effort import Progress

SAID_EACH = 5.0  # s between two lines of progress on a pipe
FORMATS = ("png", "svg", "pdf")


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    parser.add_argument(
        "scene", type=Path, metavar="FILE", help="scene (TOML); or the folder of a sweep, for "
        "--plot and --csv",
    )  # fmt: skip
    parser.add_argument(
        "--vary", action="extend", nargs="+", metavar="KEY=VALUES", default=[],
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
    _figure_options(parser)
    parser.add_argument("--quiet", action="store_true", help="no progress, no summary")
    add_reporting(parser)


def _figure_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--plot", nargs="*", metavar="COLUMN",
        help="draw columns of the table, such as peak_um (default), level_db, f_AM_um[2] at one "
        "probe, into its folder figures",
    )  # fmt: skip
    parser.add_argument("--x", metavar="KEY", help="along the axis (default: most values)")
    parser.add_argument("--by", metavar="KEY", help="a curve for each value (default: the next)")
    parser.add_argument("--heat", action="store_true", help="a map over --x and --by instead")
    parser.add_argument("--format", choices=FORMATS, default="png")
    parser.add_argument("--style", default="report", help="report, talk or print")
    add_width(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; the exit code."""
    from skinwave.sweeps import dataset, engine

    engine.check(options.scheduler)
    summary: dict[str, Any] = {}
    said: list[str] = []
    out, missing = options.scene, 0
    if options.scene.is_dir():
        if options.vary or not (options.csv or options.plot is not None):
            raise ValueError(
                f"{out} is a folder; give --plot or --csv without --vary, or a scene with --vary"
            )
        dataset.check_folder(out)
    else:
        out = options.out or Path(f"{options.scene.stem}-sweep")
        found, best, files = _swept(options, out)
        summary, missing = _summary(out, found, best, files), found.missing
        said = [best.words] if best else []
        said.append(
            f"{found.done} of {found.planned} runs done in {found.seconds:.0f} s, {found.failed} "
            f"failed, {found.found} were there; {out}/{dataset.ROWS} is the table"
            + (f", {out}/{files[-1]} its percentiles" if files else "")
        )
        if found.planned == missing:
            options.csv, options.plot = False, None
    if options.csv:
        dataset.write_beside(out, {dataset.CSV: dataset.csv_of(dataset.read(out))})
    if options.plot is not None:
        summary["figures"] = _drawn(options, out)
        said += [f"wrote {path}" for path in summary["figures"]]
    summarise(options, summary, "\n".join(said))
    return 1 if missing else 0


def _swept(options: argparse.Namespace, out: Path) -> "tuple[SweepOutcome, Best | None, list[str]]":
    """Run what is missing; the outcome, the best value, and the names of tables of percentiles."""
    from skinwave.results import record
    from skinwave.scene.variation import SAMPLED, cases, combinations, parse
    from skinwave.sweeps import best, dataset, uncertainty_page
    from skinwave.sweeps.reductions import ModelOptions
    from skinwave.sweeps.sweep import Sweep

    if options.seed < 0:
        raise ValueError(f"--seed = {options.seed} is below 0; give 0 or a whole number above")
    if options.best and options.design in SAMPLED:
        raise ValueError(
            f"--best takes a grid of values, not --design {options.design}; leave it out"
        )
    variations = [parse(text) for text in options.vary]
    samples = None if options.best else options.samples
    combined = combinations(variations, options.design, samples, options.seed)
    wanted = cases(options.scene, combined)
    if options.best:
        best.check(variations, options.best, wanted, options.samples)
    is_sampled = options.design in SAMPLED and not any(each.values for each in variations)
    tables = uncertainty_page.SAMPLED_FILES if is_sampled else ()
    dataset.refuse_changed(out, [*tables, *[dataset.CSV] * options.csv])  # before all is computed
    how = ModelOptions(
        model=options.model, tolerance=options.tolerance, h=metre(options.h), solver=options.solver
    )
    optimum, files = None, list[str]()
    with _progress(options, len(wanted)) as progress:
        sweep = Sweep(
            folder=out, options=how, progress=progress, scheduler=options.scheduler,
            workers=options.workers, command=record.of_command(options),
        )  # fmt: skip
        found = sweep.run(wanted)
        if options.best and not found.missing:
            optimum = best.best_value(
                sweep, partial(cases, options.scene), variations[0], options.best,
                options.samples, options.seed,
            )  # fmt: skip
    if is_sampled and not found.missing:
        rows = sweep.in_order(wanted, combined)
        sampled = uncertainty_page.Sampled(
            rows=rows, variations=variations, has_indices=options.design == "sobol"
        )
        files = uncertainty_page.write_sampled(out, sampled)
    if found.missing:
        why = "interrupted" if found.interrupted else "workers were killed"
        say(f"skinwave: {why}; {found.missing} runs are missing, the same command goes on with "
            "them", sys.stderr)  # fmt: skip
    return found, optimum, files


def _summary(
    out: Path, found: "SweepOutcome", best: "Best | None", files: list[str]
) -> dict[str, Any]:
    summary = {
        "out": str(out), "planned": found.planned, "there_before": found.found,
        "done": found.done, "failed": found.failed, "missing": found.missing,
        "seconds": round(found.seconds, 1), "files": files,
    }  # fmt: skip
    if best:
        summary["best"] = asdict(best) | {"is_at_end": best.is_at_end}
    return summary


def _drawn(options: argparse.Namespace, out: Path) -> list[str]:
    """Draw columns of a sweep's table; the paths of the figures."""
    from skinwave.report.figures import drawn
    from skinwave.report.styles import style
    from skinwave.results.files import distinct_names
    from skinwave.sweeps import dataset
    from skinwave.sweeps.table_figures import finished, heat_figure, line_figure, varied

    chosen = style(options.style, options.width)
    rows = finished(dataset.read(out))
    keys = varied(rows)
    x = options.x or next(iter(keys), None)
    if x is None:
        raise ValueError(f"{out} varies no key; name a column with --x")
    by = options.by or next((key for key in keys if key != x), None)
    figures = {}
    for column in options.plot or ["peak_um"]:
        name = f"{column} over {x}" + (f" and {by}" if by else "")
        if not options.heat:
            figures[name] = line_figure(rows, column, x, by, chosen)
        elif by:
            figures[f"{name} map"] = heat_figure(rows, column, x, by, chosen)
        else:
            raise ValueError("a map needs two varied keys; leave out --heat or give --by")
    stems = distinct_names(name.replace(" ", "-") for name in figures)
    files = {
        f"figures/{stem}.{options.format}": drawn(figure, options.format, chosen.dpi)
        for stem, figure in zip(stems, figures.values(), strict=True)
    }
    dataset.write_beside(out, files)
    return [str(out / name) for name in files]


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
