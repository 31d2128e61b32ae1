"""Many scenes in one table, on all cores or a cluster, and its figures; resumes."""

import argparse
import sys
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from skinwave.commands.common import (
    add_mesh,
    add_model,
    add_reporting,
    add_width,
    metre,
    progress_of,
    summarise,
)
from skinwave.system.plain_text import say

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
    add_model(parser, has_steps=False)
    add_mesh(parser)
    parser.add_argument("--csv", action="store_true", help="write rows.csv, too")
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
    add_reporting(parser)


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
        summary, said = _swept(options, out)
        missing = summary["missing"]
    if missing < summary.get("planned", 1):
        if options.csv:
            dataset.write_beside(out, {dataset.CSV: dataset.csv_of(dataset.read(out))})
        if options.plot is not None:
            summary["figures"] = _drawn(options, out)
            said += [f"wrote {path}" for path in summary["figures"]]
    summarise(options, summary, "\n".join(said))
    return 1 if missing else 0


def _swept(options: argparse.Namespace, out: Path) -> tuple[dict[str, Any], list[str]]:
    """Run what is missing; its summary, and sentences on it."""
    from skinwave.models.options import SolveOptions
    from skinwave.results import record
    from skinwave.scene.distributions import Spread
    from skinwave.scene.variation import SAMPLED, cases, combinations, parse
    from skinwave.sweeps import best, dataset, uncertainty_page
    from skinwave.sweeps.sweep import Sweep

    if options.seed < 0:
        raise ValueError(f"--seed = {options.seed} is below 0; give 0 or a whole number above")
    is_sampled = options.design in SAMPLED
    if options.best and is_sampled:
        raise ValueError(
            f"--best takes a grid of values, not --design {options.design}; leave it out"
        )
    variations = [parse(text) for text in options.vary]
    varied = best.check(variations, options.samples) if options.best else None
    samples = None if options.best else options.samples
    combined = combinations(variations, options.design, samples, options.seed)
    spreads = [each for each in variations if is_sampled and isinstance(each, Spread)]
    has_page = len(spreads) == len(variations)
    tables = uncertainty_page.SAMPLED_FILES if has_page else ()
    dataset.refuse_changed(out, [*tables, *[dataset.CSV] * options.csv])  # before all is computed
    solving = SolveOptions(
        model=options.model, tolerance=options.tolerance, h=metre(options.h), solver=options.solver
    )
    points = cases(options.scene, combined)
    optimum, files = None, list[str]()
    with progress_of(options) as progress:
        sweep = Sweep(
            folder=out, points=partial(cases, options.scene), options=solving, progress=progress,
            scheduler=options.scheduler, workers=options.workers,
            command=record.of_command(options),
        )  # fmt: skip
        found = sweep.run(points)
        if varied and not found.missing:
            optimum = best.best_value(sweep, varied, options.best, options.samples, options.seed)
    if has_page and not found.missing:
        files = uncertainty_page.write_sampled(
            out, sweep.rows(points), spreads, has_indices=options.design == "sobol"
        )
    if found.missing:
        why = "interrupted" if found.interrupted else "workers were killed"
        say(f"skinwave: {why}; {found.missing} runs are missing, the same command goes on with "
            "them", sys.stderr)  # fmt: skip
    summary = {
        "out": str(out), "planned": found.planned, "there_before": found.found,
        "done": found.done, "failed": found.failed, "missing": found.missing,
        "seconds": round(found.seconds, 1), "files": files,
    }  # fmt: skip
    said = [
        f"{found.done} of {found.planned} runs done in {found.seconds:.0f} s, {found.failed} "
        f"failed, {found.found} were there; {out}/{dataset.ROWS} is the table"
        + (f", {out}/{files[-1]} its percentiles" if files else "")
    ]
    if optimum:
        summary["best"] = asdict(optimum) | {"is_at_end": optimum.is_at_end}
        said.insert(0, optimum.words)
    return summary, said


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
