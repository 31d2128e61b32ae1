"""A pattern from one kind of file to another: scene, AdapTics, CSV, WAV, pyautd3."""

import argparse
from math import isfinite
from pathlib import Path

from skinwave.commands.common import add_reporting, metre, summarise
from skinwave.system.plain_text import number_in


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    parser.add_argument("source", type=Path, metavar="IN", help=".toml .adaptics .csv .wav")
    parser.add_argument("target", type=Path, metavar="OUT", help=".toml .adaptics .csv .py")
    parser.add_argument("--scene", type=Path, metavar="SCENE", help="what to put the pattern on")
    parser.add_argument("--rate", type=float, metavar="HZ", help="samples a second of CSV or WAV")
    parser.add_argument("--height", type=float, metavar="MM", help="focus above the array, mm")
    parser.add_argument("--hold", action="store_true", help="a focal point stays until the next")
    parser.add_argument("--role", default="modulation", help="what a WAV is: modulation, envelope")
    parser.add_argument("--scale", default="full", help="of a WAV's samples: full, peak or rms")
    parser.add_argument(
        "--parameter", action="append", default=[], metavar="NAME=VALUE",
        help="of an AdapTics file, instead of its default; may be repeated",
    )  # fmt: skip
    parser.add_argument("--resize", type=float, default=1.0, metavar="FACTOR", help="of the path")
    parser.add_argument("--overwrite", action="store_true", help="replace an existing file")
    add_reporting(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; the exit code."""
    from skinwave.patterns import Options, convert
    from skinwave.results.outputs import output_file
    from skinwave.scene.file import read

    asked = Options(
        rate=options.rate,
        height=metre(options.height),
        hold=options.hold,
        role=options.role,
        scale=options.scale,
        parameters=dict(map(_parameter, options.parameter)),
        resize=options.resize,
    )
    base = read(options.scene) if options.scene else None
    inputs = [options.source, *([options.scene] if options.scene else [])]
    with output_file(options.target, overwrite=options.overwrite, inputs=inputs) as file:
        content, notes = convert(options.source, options.target, asked, base)
        file.write(content)
    summary = {"out": str(options.target), "bytes": len(content), "notes": notes}
    said = "".join(f"\n  {note}" for note in notes)
    summarise(options, summary, f"wrote {options.target}{said}")
    return 0


def _parameter(text: str) -> tuple[str, float]:
    """Name and value of NAME=VALUE."""
    name, _, value = text.rpartition("=")
    number = number_in(value)
    if not name or number is None or not isfinite(number):
        raise ValueError(f"--parameter {text} is not NAME=VALUE, such as proximity=0.5")
    return name.strip(), number
