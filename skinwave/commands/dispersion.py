"""Compute dispersion curves of a body: speed and decay of its waves, and which a Tacton excites."""

import argparse

from skinwave.commands.common import add_options, add_output, result_folder, summarise_page


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    add_options(parser, "scene")
    parser.add_argument(
        "--highest", type=float, default=650.0, metavar="HZ",
        help="highest frequency in Hz (default: 650)",
    )  # fmt: skip
    parser.add_argument(
        "--modes", type=int, default=6, metavar="N", help="number of modes, 1 to 12 (default: 6)",
    )  # fmt: skip
    add_output(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit code."""
    from skinwave.scene.file import read
    from skinwave.scene.scene import check_load
    from skinwave.studies.dispersion import driven_modes, sentences, write

    if not 1 <= options.modes <= 12:
        raise ValueError(f"--modes is {options.modes}; give a number from 1 to 12")
    scene = read(options.scene)
    check_load(scene, "dispersion")
    found = driven_modes(scene, highest=options.highest, most=options.modes)
    with result_folder(options, f"{options.scene.stem}-dispersion", scene) as (folder, _):
        write(folder, found)
    return summarise_page(options, sentences(found))
