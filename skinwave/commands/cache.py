"""Cache of meshes and reduced bodies: where it is and how large; clear it."""

import argparse

from skinwave.commands.common import add_reporting, summarise


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    parser.add_argument(
        "--clear", action="store_true",
        help="remove all entries; above 5 GiB those used longest ago are removed anyway",
    )  # fmt: skip
    parser.add_argument("--quiet", action="store_true", help="no summary")
    add_reporting(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; the exit code."""
    from meshes import cache

    found = cache.clear() if options.clear else cache.contents()
    if found is None:
        summarise(options, {"folder": None}, "there is none: SKINWAVE_CACHE is empty")
        return 0
    summary = {
        "folder": str(found.folder),
        "removed" if options.clear else "entries": found.entries,
        "bytes": found.size,
        "limit_bytes": cache.LIMIT,
    }
    counted = f"{found.entries} entries, {found.size / 2**30:.2f} GiB"
    sentence = (
        f"removed {counted} from {found.folder}"
        if options.clear
        else f"{found.folder}\n{counted} of {cache.LIMIT / 2**30:g} GiB at most"
    )
    summarise(options, summary, sentence)
    return 0
