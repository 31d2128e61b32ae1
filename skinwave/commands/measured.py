"""Inspect a measurement: duration, rate, places, lines, noise floor, mains hum, clipping, lacks."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from skinwave.commands.common import add_output, summarise

if TYPE_CHECKING:
    from skinwave.measure import Measurement
    from skinwave.measure.inspection import Inspection

SIGNS = {"in": 1, "out": -1}


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    parser.add_argument(
        "file", type=Path, metavar="FILE", help=".csv .txt .lvm .tdms .npz .wav .mat .uff .f32"
    )
    add_reading(parser)
    parser.add_argument(
        "--false-alarm", type=float, default=0.01, metavar="P",
        help="probability that noise alone has any line (default: 0.01)",
    )  # fmt: skip
    add_output(parser)


def add_reading(parser: argparse.ArgumentParser) -> None:
    """Options of what a file does not say."""
    parser.add_argument("--quantity", default="", metavar="NAME",
                        help="displacement, velocity or acceleration")  # fmt: skip
    parser.add_argument("--unit", default="", metavar="UNIT", help='mm/s, um, g, or "20 mm/s" of 1')
    parser.add_argument("--places", metavar="XY", help='places in mm, "0,0 5,0", or a file')
    parser.add_argument("--positive", choices=tuple(SIGNS), help="into the body or out of it")
    parser.add_argument("--rate", type=float, metavar="HZ", help="samples a second")
    parser.add_argument("--variable", default="", metavar="NAME", help="array of a file of several")
    parser.add_argument("--columns", default="", metavar="NAMES",
                        help='columns of motion, "CH1,CH3" or numbers from 1')  # fmt: skip
    parser.add_argument("--direction", choices=("x", "y", "z"),
                        help="of the motion in a file of several")  # fmt: skip


def measured_in(file: Path, options: argparse.Namespace) -> "Measurement":
    """The measurement in a file, by the options of `add_reading`."""
    from skinwave.measure.reading import places_of, read

    return read(
        file, quantity=options.quantity, unit=options.unit,
        places=places_of(options.places) if options.places else None,
        sign=SIGNS[options.positive] if options.positive else None,
        rate=options.rate, variable=options.variable, direction=options.direction or "",
        columns=tuple(name.strip() for name in options.columns.split(",") if name.strip()),
    )  # fmt: skip


def run(options: argparse.Namespace) -> int:
    """Run the command; the exit code."""
    from skinwave.measure.inspection import inspect
    from skinwave.measure.summary import summary, text

    measured = measured_in(options.file, options)
    found = inspect(measured, alarm=options.false_alarm)
    told = summary(found)
    said = text(found)
    if options.out:
        _write(options, found)
        told["out"] = str(options.out)
        said += f"\nopen {options.out}/index.html"
    summarise(options, told, said)
    return 0


def _write(options: argparse.Namespace, found: "Inspection") -> None:
    from skinwave.measure.inspection_page import write
    from skinwave.results import record
    from skinwave.results.outputs import output_folder

    with output_folder(options.out, overwrite=options.overwrite, inputs=[options.file]) as folder:
        write(folder, found)
        record.write(folder, record.of_command(options))
