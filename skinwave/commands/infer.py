"""Sheets, supports and drive laws that would show what was measured; goes on where it ended."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from skinwave.commands.common import add_reporting, progress_of, summarise
from skinwave.system.plain_text import say

if TYPE_CHECKING:
    from skinwave.sweeps.sweep import SweepOutcome


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    parser.add_argument(
        "--samples", type=int, default=2000, metavar="N", help="candidates of a Latin hypercube"
    )
    parser.add_argument(
        "--search", type=int, default=0, metavar="N", help="more of them, near the best"
    )
    parser.add_argument(
        "--large-deflection", type=int, default=0, metavar="N",
        help="compute the N nearest sheets by fem-nonlinear, too, about a minute a Tacton",
    )  # fmt: skip
    parser.add_argument("--seed", type=int, default=0, help="of both")
    parser.add_argument("-o", "--out", type=Path, default=Path("which-sheet"), metavar="DIR",
                        help="folder of the table and its page")  # fmt: skip
    parser.add_argument(
        "--scheduler", default="processes", metavar="WHERE",
        help="processes (default), threads, or the address of a Dask scheduler",
    )  # fmt: skip
    parser.add_argument("--workers", type=int, metavar="N", help="candidates at a time")
    parser.add_argument("--quiet", action="store_true", help="no progress, no summary")
    add_reporting(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; the exit code."""
    from skinwave.results import record
    from skinwave.sweeps import engine

    engine.check(options.scheduler)
    from skinwave.inference import files, stretched_table, table
    from skinwave.inference.conclusions import conclusions

    for name, value, least in (("samples", options.samples, 2), ("search", options.search, 0),
                               ("large-deflection", options.large_deflection, 0),
                               ("seed", options.seed, 0)):  # fmt: skip
        if value < least:
            raise ValueError(f"--{name} = {value} is below {least}; give at least that")
    command = record.of_command(options)
    table.open_folder(options.out, command)
    files.refuse_changed(options.out)
    table.enter_command(options.out, command)
    outcomes = _computed(options)
    if not any(each.found + each.done + each.failed for each in outcomes.values()):
        raise KeyboardInterrupt
    rows = files.write(options.out)
    said = conclusions(rows, stretched_table.read(options.out, rows))
    found, stretched = outcomes[table.HYPERCUBE], outcomes.get(stretched_table.PHASE)
    summary = {
        "out": str(options.out), "planned": found.planned, "done": found.done,
        "there_before": found.found, "failed": found.failed, "missing": found.missing,
        "large_deflection": stretched.done + stretched.found if stretched else 0,
        "rows": len(rows), "conclusions": said,
    }  # fmt: skip
    summarise(options, summary, f"{said[0]}\nopen {options.out}/index.html")
    for phase, each in outcomes.items():
        if each.missing:
            say(f"skinwave: {each.missing} of {phase} are missing; the same command goes on with "
                "them", sys.stderr)  # fmt: skip
    return 1 if any(each.missing for each in outcomes.values()) else 0


def _computed(options: argparse.Namespace) -> "dict[str, SweepOutcome]":
    """Outcome of each phase that was asked for, up to the one that was interrupted."""
    from skinwave.inference import stretched_table, table
    from skinwave.inference.design import hypercube
    from skinwave.sweeps import dataset

    out = options.out
    outcomes: dict[str, SweepOutcome] = {}
    how = {"scheduler": options.scheduler, "workers": options.workers}
    with progress_of(options) as progress:
        phases = {
            table.HYPERCUBE: lambda: table.fill(
                out, hypercube(options.samples, options.seed), table.HYPERCUBE, progress, **how
            ),
            table.SEARCH: options.search and (lambda: table.search(
                out, options.search, progress, seed=options.seed, **how
            )),
            stretched_table.PHASE: options.large_deflection and (lambda: stretched_table.fill(
                out, dataset.read(out), options.large_deflection, progress, **how
            )),
        }  # fmt: skip
        for phase, compute in phases.items():
            if compute and not any(each.interrupted for each in outcomes.values()):
                outcomes[phase] = compute()
    return outcomes
