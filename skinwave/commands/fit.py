"""A scene's material, or any of its numbers, fitted to a measurement; or what a file holds."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from skinwave.commands.common import add_output, closing, result_folder, summarise, warn
from skinwave.models import names

if TYPE_CHECKING:
    from skinwave.measure import Measurement

KINDS = ("waveforms", "lines", "amplitudes")
SIGNS = {"in": 1, "out": -1}


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    parser.add_argument("scene", type=Path, nargs="?", metavar="SCENE.toml", help="what was moved")
    parser.add_argument("--measured", type=Path, metavar="FILE", help="what was measured")
    parser.add_argument(
        "--vary", action="extend", nargs="+", metavar="KEY=LOW:HIGH", default=[],
        help="what is fitted: body.material.shear_modulus_pa=5000:50000; gain, delay_ms, "
        "offset_x_mm and offset_y_mm of the measurement",
    )  # fmt: skip
    parser.add_argument(
        "--tie", action="extend", nargs="+", default=[], metavar="KEY=EXPRESSION",
        help="a key that follows from those that are varied",
    )  # fmt: skip
    parser.add_argument("--to", choices=KINDS, help="waveforms (default), or lines of these")
    parser.add_argument("--model", choices=("auto", *names()), default="auto")
    parser.add_argument("--starts", type=int, default=8, metavar="N", help="of the search")
    parser.add_argument("--seed", type=int, default=0, help="of the starts")
    parser.add_argument(
        "--inspect", type=Path, metavar="FILE", help="say what a file holds and lacks, without a "
        "fit: .csv .txt .lvm .tdms .npz .wav .mat .uff .f32",
    )  # fmt: skip
    parser.add_argument(
        "--false-alarm", type=float, default=0.01, metavar="P",
        help="of --inspect: probability that noise alone has any line (default: 0.01)",
    )  # fmt: skip
    for name, metavar, words in (
        ("quantity", "NAME", "displacement, velocity or acceleration"),
        ("unit", "UNIT", 'mm/s, um, g, or "20 mm/s" of 1'),
        ("places", "XY", 'places in mm, "0,0 5,0", or a file'),
        ("variable", "NAME", "array of a file of several"),
        ("columns", "NAMES", 'columns of motion, "CH1,CH3" or numbers from 1'),
    ):
        parser.add_argument(f"--{name}", default="", metavar=metavar, help=words)
    parser.add_argument("--positive", choices=tuple(SIGNS), help="into the body or out of it")
    parser.add_argument("--rate", type=float, metavar="HZ", help="samples a second")
    parser.add_argument("--direction", choices=("x", "y", "z"),
                        help="of the motion in a Universal File")  # fmt: skip
    add_output(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; the exit code."""
    if options.inspect:
        return _inspect(options)
    if not (options.scene and options.measured):
        raise ValueError("give a scene and --measured FILE, or --inspect FILE")
    from skinwave.measure.findings import cautions
    from skinwave.measure.fit import fit
    from skinwave.measure.fit_page import summary, write
    from skinwave.scene.file import read

    if options.seed < 0:
        raise ValueError(f"--seed = {options.seed} is below 0; give 0 or a whole number above")
    scene = read(options.scene)
    measured = _measured(options.measured, options)
    name, inputs = f"{options.scene.stem}-fit", [options.scene, options.measured, scene.body.file]
    with result_folder(options, name, inputs, scene) as (folder, progress):
        found = fit(
            scene, measured, options.vary, tie=options.tie, kind=options.to or "",
            model=options.model, starts=options.starts, seed=options.seed, progress=progress,
        )  # fmt: skip
        write(folder, found)
    if not options.json and not options.quiet:
        warn(cautions(found))
    closing(options, **summary(found))
    return 0 if found.solution.converged else 1


def _inspect(options: argparse.Namespace) -> int:
    """Say what a file holds and, if a folder is given, write it."""
    from skinwave.measure.inspection import inspect
    from skinwave.measure.inspection_page import summary, text, write

    if options.scene or options.measured or options.vary:
        raise ValueError("--inspect fits nothing; leave out the scene, --measured and --vary")
    found = inspect(_measured(options.inspect, options), alarm=options.false_alarm)
    told, said = summary(found), text(found)
    if options.out:
        with result_folder(options, "", [options.inspect]) as (folder, _):
            write(folder, found)
        told["out"] = str(options.out)
        said += f"\nopen {options.out}/index.html"
    summarise(options, told, said)
    return 0


def _measured(file: Path, options: argparse.Namespace) -> "Measurement":
    """The measurement in a file, by the options of what it does not say."""
    from skinwave.measure.reading import places_of, read

    return read(
        file, quantity=options.quantity, unit=options.unit,
        places=places_of(options.places) if options.places else None,
        sign=SIGNS[options.positive] if options.positive else None,
        rate=options.rate, variable=options.variable, direction=options.direction or "",
        columns=tuple(name.strip() for name in options.columns.split(",") if name.strip()),
    )  # fmt: skip
