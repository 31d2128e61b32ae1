"""Cost of accuracy on a scene, measured for every model."""

import argparse
from pathlib import Path

from skinwave.commands.common import add_output, add_scene, progress_of, summarise


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    add_scene(parser)
    add_output(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; the exit code."""
    from skinwave.results import record
    from skinwave.results.outputs import output_folder
    from skinwave.scene.file import read
    from skinwave.studies.tradeoff import sentences, study, write

    scene = read(options.scene)
    out = options.out or Path(f"{options.scene.stem}-tradeoff")
    inputs = [options.scene, scene.body.file]
    with output_folder(out, overwrite=options.overwrite, inputs=inputs) as folder:
        with progress_of(options) as progress:
            found = study(scene, progress)
        write(folder, scene, found)
        record.write(folder, record.of_command(options), scene=scene)
    summary = {"out": str(out), "accepted": found.accepted, "sentences": sentences(found)}
    summarise(options, summary, "\n".join([*sentences(found), f"open {out}/index.html"]))
    return 0
