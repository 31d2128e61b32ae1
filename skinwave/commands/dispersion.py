"""Dispersion curves of a scene's body: speeds and decay of its waves, and which a Tacton drives."""

import argparse

from skinwave.commands.common import add_output, add_scene, closing, result_folder


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    add_scene(parser)
    parser.add_argument(
        "--highest", type=float, default=650.0, metavar="HZ", help="up to which frequency"
    )
    parser.add_argument("--modes", type=int, default=6, metavar="N", help="how many modes, 1 to 12")
    add_output(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; the exit code."""
    from skinwave.scene.file import read
    from skinwave.scene.scene import check_load
    from skinwave.studies.dispersion import driven_modes, sentences, write

    if not 1 <= options.modes <= 12:
        raise ValueError(f"--modes {options.modes} is outside 1..12; give one of these")
    scene = read(options.scene)
    check_load(scene, "dispersion")
    found = driven_modes(scene, highest=options.highest, most=options.modes)
    name, inputs = f"{options.scene.stem}-dispersion", [options.scene, scene.body.file]
    with result_folder(options, name, inputs, scene) as (folder, _):
        write(folder, found)
    closing(options, sentences(found))
    return 0
