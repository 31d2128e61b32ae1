"""Simulate many scenes on all cores or a cluster, and write one table."""

from __future__ import annotations

import argparse
import sys
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from skinwave.commands import common
from skinwave.system.plain_text import say

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    add = parser.add_argument
    add(
        "scene", type=Path, metavar="SCENE|DIR",
        help="scene file (TOML), or the folder of a sweep for --plot and --csv",
    )  # fmt: skip
    add(
        "--vary", action="extend", nargs="+", metavar="KEY=VALUES", default=[],
        help="keys to vary: tacton.speed_m_per_s=1:12:12 (start:stop:number), "
        "body.thickness_mm=10,15, body=skin-slab,palm; for lhs and sobol start:stop, "
        "normal(25e3,0.3), lognormal, factor, uniform or triangular",
    )  # fmt: skip
    add(
        "--design", default="factorial", help="factorial (default: all combinations), zip (values "
        "side by side), lhs (Latin hypercube) or sobol (Sobol indices)",
    )  # fmt: skip
    add(
        "--samples", type=int, metavar="N",
        help="number of samples: runs of lhs, rows of each matrix of sobol (both need it), or "
        "samples for the intervals of --best (default there: 199)",
    )  # fmt: skip
    add("--seed", type=int, default=0, help="seed of the samples (default: 0)")
    add(
        "--best", metavar="COLUMN",
        help="find the values of one or two varied keys that make a column such as level_db[0] "
        "largest, with 95 %% intervals from the distributions of the scene; --plot draws it",
    )  # fmt: skip
    add("-o", "--out", type=Path, metavar="DIR", help="folder of the table")
    add(
        "--scheduler", default="processes", metavar="WHERE",
        help="processes (default), threads, or the address of a Dask scheduler",
    )  # fmt: skip
    add(
        "--workers", type=int, metavar="N",
        help="number of runs at a time on this machine (default: all cores)",
    )  # fmt: skip
    common.add_options(parser, "--model", "--tolerance", "--element-size", "--solver")
    add("--csv", action="store_true", help="also write rows.csv")
    add(
        "--all-columns", action="store_true",
        help="also write columns with the same value in all rows (default: only in the metadata)",
    )  # fmt: skip
    add(
        "--waveforms", action="store_true",
        help="also write the waveforms at all probes into waveforms/rows, a list for each run",
    )  # fmt: skip
    add(
        "--plot", nargs="*", metavar="COLUMN",
        help="draw columns of the table into the folder figures: peak_um (default), level_db, "
        "f_AM_um[2] for one probe, counted from 0",
    )  # fmt: skip
    add("--x", metavar="KEY", help="key of the horizontal axis (default: the one with most values)")
    add(
        "--by",
        metavar="KEY",
        help="key with a curve for each value (default: the one with next most values)",
    )
    add("--heat", action="store_true", help="draw a map over --x and --by")
    add(
        "--format", choices=("png", "svg", "pdf"), default="png",
        help="format of figures (default: png)",
    )  # fmt: skip
    add("--style", default="report", help="report (default), talk or print")
    common.add_options(parser, "--width", "--quiet", "--json", "--debug")


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit code."""
    from skinwave.sweeps import dataset, engine

    engine.check(options.scheduler)
    summary: dict[str, Any] = {}
    lines: list[str] = []
    out, missing, failures, figures = options.scene, 0, dict[str, str](), dict[str, Any]()
    if options.scene.is_dir():
        if options.vary or not (options.csv or options.plot is not None):
            raise ValueError(
                f"{out} is a folder; add --plot or --csv and remove --vary, or name a scene file"
            )
        dataset.check_folder(out)
        failures = dataset.failures_of(dataset.read(out))
    else:
        out = options.out or Path(f"{options.scene.stem}-sweep")
        summary, lines, failures, figures = _sweep(options, out)
        missing = summary["missing"]
    if missing < summary.get("planned", 1):
        if options.csv:
            dataset.write_beside(out, {dataset.CSV: dataset.csv_of(dataset.read(out))})
        if options.plot is not None:
            summary["figures"] = _draw(options, out, figures)
            lines += [f"wrote {path}" for path in summary["figures"]]
    code = common.summarise(options, summary, lines, failures)
    return 1 if missing else code


def _sweep(
    options: argparse.Namespace, out: Path
) -> tuple[dict[str, Any], list[str], dict[str, str], dict[str, Figure]]:
    """Run the missing points of the design; return a summary, sentences, failures and figures."""
    from skinwave.report.styles import style
    from skinwave.results import record
    from skinwave.scene.distributions import Spread
    from skinwave.scene.variation import SAMPLED, cases, combinations, parse
    from skinwave.sweeps import best, dataset, uncertainty_page
    from skinwave.sweeps.sampling import check_seed
    from skinwave.sweeps.sweep import Sweep
    from skinwave.sweeps.table_figures import best_figure
    from skinwave.system.effort import silent

    check_seed(options.seed)
    is_sampled = options.design in SAMPLED
    if options.best and is_sampled:
        raise ValueError(f"--best needs a grid of values; remove --design {options.design}")
    variations = [parse(text) for text in options.vary]
    grids = best.check(variations, options.samples) if options.best else []
    combined = combinations(
        variations, options.design, None if grids else options.samples, options.seed
    )
    spreads = [each for each in variations if is_sampled and isinstance(each, Spread)]
    has_page = len(spreads) == len(variations)
    tables = uncertainty_page.SAMPLED_FILES if has_page else ()
    dataset.check_own_files(out, [*tables, *[dataset.CSV] * options.csv])  # before any run
    solving = common.solve_options(options, silent)  # the processes of runs have no progress
    points = cases(options.scene, combined)
    optimum, files, failures = tuple[best.Best, ...](), list[str](), dict[str, str]()
    figures = dict[str, Any]()
    with common.progress_of(options) as progress:
        sweep = Sweep(
            folder=out, points=partial(cases, options.scene), options=solving, progress=progress,
            scheduler=options.scheduler, workers=options.workers,
            command=record.command_entry(options), all_columns=options.all_columns,
            waveforms=options.waveforms,
        )  # fmt: skip
        outcome = sweep.run(points)
        if outcome.planned > outcome.missing:
            failures |= dataset.failures_of(sweep.rows(points, dataset.OUTCOME))
        if grids and not outcome.missing:
            optimum = best.find_best(sweep, grids, options.best, options.samples, options.seed)
    if has_page and not outcome.missing:
        files = uncertainty_page.write_uncertainty(
            out, sweep.rows(points), spreads, has_indices=options.design == "sobol"
        )
    if outcome.missing:
        cause = "interrupted" if outcome.interrupted else "workers were killed"
        say(f"skinwave: {cause}; {outcome.missing} runs are missing; repeat the command to resume",
            sys.stderr)  # fmt: skip
    summary = {
        "out": str(out), "planned": outcome.planned, "there_before": outcome.earlier,
        "done": outcome.done, "failed": outcome.failed, "missing": outcome.missing,
        "seconds": round(outcome.seconds, 1), "files": files,
    }  # fmt: skip
    lines = [
        f"{outcome.done} of {outcome.planned} runs done in {outcome.seconds:.0f} s, "
        f"{outcome.failed} failed, {outcome.earlier} done earlier; table in {out}/{dataset.ROWS}"
        + (f", percentiles in {out}/{files[-1]}" if files else "")
    ]
    if optimum:
        summary["best"] = [
            {name: x for name, x in asdict(each).items() if name != "drawn"}
            | {"is_at_end": each.is_at_end}
            for each in optimum
        ]
        lines.insert(0, best.words(optimum))
        if optimum[0].failed:
            failures[f"{optimum[0].failed} samples"] = f"no number in column {options.best}"
        if options.plot is not None:
            chosen = style(options.style, options.width)
            figures[f"best {options.best}"] = best_figure(sweep.rows(points), optimum, chosen)
    return summary, lines, failures, figures


def _draw(options: argparse.Namespace, out: Path, figures: dict[str, Figure]) -> list[str]:
    """Draw columns of a sweep's table, and write these and other figures; return their paths."""
    from skinwave.report.figures import figure_file
    from skinwave.report.styles import style
    from skinwave.results.files import distinct_names
    from skinwave.sweeps import dataset
    from skinwave.sweeps.table_figures import finished_rows, heat_figure, line_figure, varied_keys

    chosen = style(options.style, options.width)
    rows = finished_rows(dataset.read(out))
    keys = varied_keys(rows)
    x = options.x or next(iter(keys), None)
    if x is None:
        raise ValueError(f"no key varies in {out}; name a column for the axis with --x")
    by = options.by or next((key for key in keys if key != x), None)
    if options.heat and not by:
        raise ValueError(f"only {x} varies in {out}, but a map needs two keys; remove --heat")
    for column in options.plot or ([] if figures else ["peak_um"]):
        name = f"{column} over {x}" + (f" and {by}" if by else "")
        if options.heat and by:
            figures[f"{name} map"] = heat_figure(rows, column, x, by, chosen)
        else:
            figures[name] = line_figure(rows, column, x, by, chosen)
    stems = distinct_names(name.replace(" ", "-") for name in figures)
    files = {
        f"figures/{stem}.{options.format}": figure_file(figure, options.format, chosen.dpi)
        for stem, figure in zip(stems, figures.values(), strict=True)
    }
    dataset.write_beside(out, files)
    return [str(out / name) for name in files]
