"""Installed versions, renderer and solver of this machine, and missing packages."""

import argparse
import json

from skinwave.system.plain_text import say


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    parser.add_argument("--json", action="store_true", help="as JSON")
    parser.add_argument("--debug", action="store_true", help="traceback of an error")


def run(options: argparse.Namespace) -> int:
    """Run the command; the exit code."""
    from skinwave.commands.installation import examine

    found = examine()
    if options.json:
        say(json.dumps([{"what": f.what, "value": f.value, "cure": f.cure} for f in found]))
        return 0
    width = max(len(finding.what) for finding in found)
    for finding in found:
        say(f"{finding.what:<{width}}  {finding.value}")
        if finding.cure:
            say(f"{'':<{width}}  -> {finding.cure}")
    missing = sum(bool(finding.cure) for finding in found)
    say(f"{missing} of {len(found)} could be better" if missing else "nothing is missing")
    return 0
