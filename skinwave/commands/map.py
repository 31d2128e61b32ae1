"""Map of the quantity that a scene's probes read: its RMS over the body, at their depth."""

import argparse
from pathlib import Path

from skinwave.commands.common import (
    add_mesh,
    add_output,
    add_scene,
    metre,
    progress_of,
    summarise,
)


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    add_scene(parser)
    parser.add_argument(
        "--reach", type=float, default=30.0, metavar="MM", help="either way from the middle"
    )
    parser.add_argument("--step", type=float, default=1.0, metavar="MM", help="between places")
    parser.add_argument("--quantity", metavar="NAME", help="instead of the scene's")
    parser.add_argument("--depth", metavar="MM", help="instead of the scene's, or a receptor")
    add_mesh(parser)
    add_output(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; the exit code."""
    from dataclasses import replace

    from skinwave.results import record
    from skinwave.results.outputs import output_folder
    from skinwave.results.quantity_map import quantity_map
    from skinwave.scene.file import read
    from skinwave.scene.keys import depth_of
    from skinwave.studies.quantity_map_page import sentences, write

    scene = read(options.scene)
    if options.quantity is not None:
        scene = replace(scene, quantity=options.quantity)
    scene = replace(
        scene, depth=scene.depths[0] if options.depth is None else depth_of(options.depth)
    )
    out = options.out or Path(f"{options.scene.stem}-map")
    inputs = [options.scene, scene.body.file]
    with output_folder(out, overwrite=options.overwrite, inputs=inputs) as folder:
        with progress_of(options) as progress:
            found = quantity_map(
                scene, progress, reach=options.reach / 1e3, step=options.step / 1e3,
                h=metre(options.h), solver=options.solver,
            )  # fmt: skip
        write(folder, scene, found)
        record.write(folder, record.of_command(options), scene=scene)
    said = sentences(scene, found)
    summary = {"out": str(out), "sentences": said}
    summarise(options, summary, "\n".join([*said, f"open {out}/index.html"]))
    return 0
