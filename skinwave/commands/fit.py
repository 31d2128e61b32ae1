"""Fit numbers of a scene to a measurement, or inspect a file of measurements."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from skinwave.commands import common
from skinwave.system.formats import MEASUREMENTS, suffixes

if TYPE_CHECKING:
    from skinwave.measure import Measurement

SIGNS = {"in": 1, "out": -1}
TEXTS = (  # options about a file, each a text
    ("quantity", "NAME", "quantity in the file: displacement, velocity or acceleration"),
    ("unit", "UNIT", 'unit in the file: mm/s, um, g; or "20 mm/s" if 1 in the file is 20 mm/s'),
    ("places", "XY", 'places of the channels in mm, such as "0,0 5,0", or a file of places'),
    ("variable", "NAME", "name of the array in a file of several arrays"),
    ("columns", "NAMES", 'columns of motion: names such as "CH1,CH3", or numbers from 1'),
)


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    add = parser.add_argument
    add("scene", type=Path, nargs="?", metavar="SCENE", help="scene file (TOML) of the measurement")
    add("--measured", type=Path, metavar="FILE", help="file of the measurement")
    add(
        "--vary", action="extend", nargs="+", metavar="KEY=LOW:HIGH", default=[],
        help="numbers to fit, such as body.material.shear_modulus_pa=5000:50000; also gain, "
        "delay_ms, offset_x_mm and offset_y_mm of the measurement",
    )  # fmt: skip
    add(
        "--tie", action="extend", nargs="+", default=[], metavar="KEY=EXPRESSION",
        help="compute a key from the varied keys",
    )  # fmt: skip
    add(
        "--to", choices=("waveforms", "lines", "amplitudes"),
        help="data to fit: waveforms (default), complex lines, or amplitudes",
    )  # fmt: skip
    common.add_options(parser, "--model")
    add(
        "--starts",
        type=int,
        default=8,
        metavar="N",
        help="number of starting points of the search (default: 8)",
    )
    add("--seed", type=int, default=0, help="seed of the starts (default: 0)")
    add(
        "--inspect", type=Path, metavar="FILE", help="report what a file contains, without a fit: "
        f"{suffixes(MEASUREMENTS)}",
    )  # fmt: skip
    add(
        "--false-alarm", type=float, default=0.01, metavar="P",
        help="with --inspect: probability that noise alone shows any line (default: 0.01)",
    )  # fmt: skip
    for name, metavar, words in TEXTS:
        add(f"--{name}", default="", metavar=metavar, help=words)
    add("--positive", choices=tuple(SIGNS), help="positive motion is into the body or out of it")
    add("--rate", type=float, metavar="HZ", help="samples per second")
    add("--direction", choices=("x", "y", "z"), help="direction of motion in a Universal File")
    common.add_output(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit code."""
    if options.inspect:
        return _inspect(options)
    if not (options.scene and options.measured):
        raise ValueError("no data to fit; give SCENE and --measured FILE, or --inspect FILE")
    from skinwave.measure.findings import cautions
    from skinwave.measure.fit import fit
    from skinwave.measure.fit_page import summary, write
    from skinwave.scene.file import read
    from skinwave.sweeps.sampling import check_seed

    check_seed(options.seed)
    scene = read(options.scene)
    measured = _read_measurement(options.measured, options)
    with common.result_folder(options, f"{options.scene.stem}-fit", scene) as (folder, progress):
        found = fit(
            scene, measured, options.vary, tie=options.tie, kind=options.to or "",
            model=options.model, starts=options.starts, seed=options.seed, progress=progress,
        )  # fmt: skip
        write(folder, found)
    if not options.json and not options.quiet:
        common.warn(cautions(found))
    code = common.summarise_page(options, failures=found.solution.failures, **summary(found))
    return code if found.solution.converged else 1


def _inspect(options: argparse.Namespace) -> int:
    """Print what a file contains, and write its page if a folder is given."""
    from skinwave.measure.inspection import inspect
    from skinwave.measure.inspection_page import summary, text, write

    if options.scene or options.measured or options.vary:
        raise ValueError("--inspect only reads a file; remove SCENE, --measured and --vary")
    found = inspect(_read_measurement(options.inspect, options), alarm=options.false_alarm)
    contents, lines = summary(found), [text(found)]
    if options.out:
        with common.result_folder(options, "") as (folder, _):
            write(folder, found)
        contents["out"] = str(options.out)
        lines.append(f"open {options.out}/index.html")
    return common.summarise(options, contents, lines)


def _read_measurement(file: Path, options: argparse.Namespace) -> "Measurement":
    """Read a measurement; options give what the file does not state."""
    from skinwave.measure.reading import parse_places, read

    return read(
        file, quantity=options.quantity, unit=options.unit,
        places=parse_places(options.places) if options.places else None,
        sign=SIGNS[options.positive] if options.positive else None,
        rate=options.rate, variable=options.variable, direction=options.direction or "",
        columns=tuple(name.strip() for name in options.columns.split(",") if name.strip()),
    )  # fmt: skip
