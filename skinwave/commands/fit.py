"""A scene's material, or any of its numbers, fitted to a measurement, with intervals."""

import argparse
from pathlib import Path

from skinwave.commands.common import add_output, add_scene, progress_of, summarise, warn
from skinwave.commands.measured import add_reading, measured_in
from skinwave.models import names

KINDS = ("waveforms", "lines", "amplitudes")


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    add_scene(parser)
    parser.add_argument(
        "--measured", type=Path, required=True, metavar="FILE", help="what was measured"
    )
    parser.add_argument(
        "--vary", action="extend", nargs="+", metavar="KEY=LOW:HIGH", required=True,
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
        "--samples", type=int, default=0, metavar="N",
        help="sample the posterior, too, by so many steps of each walker",
    )  # fmt: skip
    add_reading(parser)
    add_output(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; the exit code."""
    from skinwave.measure.findings import cautions, sentences
    from skinwave.measure.fit import fit, sampled
    from skinwave.measure.fit_page import summary, write
    from skinwave.results import record
    from skinwave.results.outputs import output_folder
    from skinwave.scene.file import read

    if options.seed < 0:
        raise ValueError(f"--seed = {options.seed} is below 0; give 0 or a whole number above")
    scene = read(options.scene)
    measured = measured_in(options.measured, options)
    out = options.out or Path(f"{options.scene.stem}-fit")
    inputs = [options.scene, options.measured, scene.body.file]
    with output_folder(out, overwrite=options.overwrite, inputs=inputs) as folder:
        with progress_of(options) as progress:
            found = fit(
                scene, measured, options.vary, tie=options.tie, kind=options.to or "",
                model=options.model, starts=options.starts, seed=options.seed, progress=progress,
            )  # fmt: skip
            if options.samples:
                found = sampled(found, options.samples, options.seed, progress)
        write(folder, found)
        record.write(folder, record.of_command(options), scene=scene)
    if not options.json and not options.quiet:
        warn(cautions(found))
    said = "\n".join([*sentences(found), f"open {out}/index.html"])
    summarise(options, {"out": str(out), **summary(found)}, said)
    return 0 if found.solution.converged else 1
