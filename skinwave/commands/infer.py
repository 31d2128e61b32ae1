"""Sheets, supports and drive laws that would show what was measured; goes on where it ended."""

import argparse
import sys
from pathlib import Path

from skinwave.commands.common import add_reporting, progress_of, summarise
from skinwave.plain_text import say


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    parser.add_argument(
        "--samples", type=int, default=2000, metavar="N", help="candidates of a Latin hypercube"
    )
    parser.add_argument(
        "--search", type=int, default=0, metavar="N", help="more of them, near the best"
    )
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
    from skinwave import record
    from skinwave.sweeps import engine

    engine.check(options.scheduler)
    from skinwave.inference import files, table
    from skinwave.inference.conclusions import conclusions
    from skinwave.inference.design import hypercube

    for name, value, least in (("samples", options.samples, 2), ("search", options.search, 0),
                               ("seed", options.seed, 0)):  # fmt: skip
        if value < least:
            raise ValueError(f"--{name} = {value} is below {least}; give at least that")
    command = record.of_command(options)
    table.open_folder(options.out, command)
    files.refuse_changed(options.out)
    table.enter_command(options.out, command)
    how = {"scheduler": options.scheduler, "workers": options.workers}
    with progress_of(options) as progress:
        found = table.fill(
            options.out, hypercube(options.samples, options.seed), table.HYPERCUBE, progress, **how
        )
        if options.search and not found.interrupted:
            table.search(options.out, options.search, progress, seed=options.seed, **how)
    rows = files.write(options.out)
    summary = {
        "out": str(options.out), "planned": found.planned, "done": found.done,
        "there_before": found.found, "failed": found.failed, "missing": found.missing,
        "rows": len(rows), "conclusions": conclusions(rows),
    }  # fmt: skip
    summarise(options, summary, f"{conclusions(rows)[0]}\nopen {options.out}/index.html")
    if found.missing:
        say(f"skinwave: {found.missing} candidates are missing; the same command goes on with "
            "them", sys.stderr)  # fmt: skip
    return 1 if found.missing else 0
