"""Verification against closed forms and series from the literature."""

import argparse
from pathlib import Path

from skinwave.commands.common import add_output, progress_of, summarise


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    parser.add_argument("--quick", action="store_true", help="only cases of a few seconds each")
    add_output(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; the exit code."""
    from skinwave.results import record
    from skinwave.results.outputs import output_folder
    from skinwave.verify.page import summary_table
    from skinwave.verify.suite import run_suite, suite

    entries = [entry for entry in suite() if not (options.quick and entry.slow)]
    out = options.out or Path("verification")
    with (
        output_folder(out, overwrite=options.overwrite) as folder,
        progress_of(options) as progress,
    ):
        results = run_suite(
            entries, folder, progress, left_out=len(suite()) - len(entries), debug=options.debug
        )
        record.write(folder, record.of_command(options))
    failed = [result.entry.name for result in results if not result.case.passed]
    summary = {
        "out": str(out),
        "passed": len(results) - len(failed),
        "failed": len(failed),
        "planned": len(entries),
        "failures": failed,
        "seconds": round(sum(result.seconds for result in results), 1),
    }
    broken = len(results) < len(entries)
    state = f"interrupted after {len(results)} of {len(entries)} cases; " if broken else ""
    summarise(options, summary, f"{state}open {out}/index.html\n{summary_table(results)}")
    return 1 if failed or broken else 0
