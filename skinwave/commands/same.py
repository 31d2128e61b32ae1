"""Whether two result folders hold the same."""

import argparse
from pathlib import Path

from skinwave.commands.common import add_reporting, summarise


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    for name in ("first", "second"):
        parser.add_argument(name, type=Path, metavar="DIR", help="folder of results")
    parser.add_argument(
        "--rtol", type=float, default=1e-9, metavar="X",
        help="difference that is allowed, relative to the largest value of an array (default 1e-9)",
    )  # fmt: skip
    parser.add_argument("--quiet", action="store_true", help="no sentence, only the exit code")
    add_reporting(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; 0 if they hold the same, 1 if not."""
    from skinwave.results.same import differences

    found = differences(options.first, options.second, options.rtol)
    sentence = f"the same within {options.rtol:g}"
    if found:
        more = f"; {len(found) - 1} more differ" if len(found) > 1 else ""
        sentence = f"different: {found[0].words}{more}"
    summary = {"same": not found, "differences": [one.words for one in found]}
    summarise(options, summary, sentence)
    return 1 if found else 0
