"""Convert a pattern between file formats: scene, AdapTics, CSV, WAV, AUTD3."""

import argparse
from math import isfinite
from pathlib import Path

from skinwave.commands.common import add_options, metre, summarise
from skinwave.system.formats import PATTERN_READERS, PATTERN_WRITERS, suffixes
from skinwave.system.plain_text import number_in


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    add = parser.add_argument
    add("source", type=Path, metavar="IN", help=f"file to read: {suffixes(PATTERN_READERS)}")
    add("target", type=Path, metavar="OUT", help=f"file to write: {suffixes(PATTERN_WRITERS)}")
    add("--scene", type=Path, metavar="SCENE", help="scene file that receives the pattern")
    add(
        "--rate", type=float, metavar="HZ", help="samples per second of a CSV file, read or written"
    )
    add("--height", type=float, metavar="MM", help="height of the focus above the array in mm")
    add("--hold", action="store_true", help="a focal point stays until the next sample")
    add(
        "--role", default="modulation", help="what a WAV contains: modulation (default) or envelope"
    )
    add(
        "--scale", default="full", help="scale of the samples of a WAV: full (default), peak or rms"
    )
    add(
        "--parameter", action="append", default=[], metavar="NAME=VALUE",
        help="value of a parameter of an AdapTics file; may be repeated",
    )  # fmt: skip
    add("--resize", type=float, default=1.0, metavar="FACTOR", help="multiply the path by a factor")
    add(
        "--package", default="pyautd3", help="package that a Python script (OUT.py) uses: pyautd3 "
        "(default) or autd3, 0.12 or later",
    )  # fmt: skip
    add("--overwrite", action="store_true", help="replace an existing file")
    add_options(parser, "--quiet", "--json", "--debug")


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit code."""
    from skinwave.patterns import Options, convert
    from skinwave.results.outputs import output_file
    from skinwave.scene.file import read

    choices = Options(
        rate=options.rate, height=metre(options.height), hold=options.hold, role=options.role,
        scale=options.scale, parameters=dict(map(_parameter, options.parameter)),
        resize=options.resize, package=options.package,
    )  # fmt: skip
    base = read(options.scene) if options.scene else None
    inputs = [options.source, *([options.scene] if options.scene else [])]
    with output_file(options.target, overwrite=options.overwrite, inputs=inputs) as file:
        content, notes = convert(options.source, options.target, choices, base)
        file.write(content)
    summary = {"out": str(options.target), "bytes": len(content), "notes": notes}
    return summarise(options, summary, ["\n  ".join([f"wrote {options.target}", *notes])])


def _parameter(text: str) -> tuple[str, float]:
    """Return name and value of NAME=VALUE."""
    name, _, value = text.rpartition("=")
    number = number_in(value)
    if not name or number is None or not isfinite(number):
        raise ValueError(
            f"--parameter {text} does not have the form NAME=VALUE; write, for example, "
            "proximity=0.5"
        )
    return name.strip(), number
