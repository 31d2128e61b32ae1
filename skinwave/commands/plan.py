"""Print the model, the mesh and the expected error for a scene, with reasons."""

import argparse

from skinwave.commands.common import (
    add_mesh,
    add_model,
    add_reporting,
    add_scene,
    plan_of_command,
    progress_of,
    summarise,
)


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    add_scene(parser)
    add_model(parser)
    add_mesh(parser)
    add_reporting(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit code."""
    from dataclasses import replace

    from skinwave.planning.budget import mesh_row
    from skinwave.scene.file import read
    from skinwave.system.progress_bar import announce

    scene = read(options.scene)
    with progress_of(options) as progress:
        found = plan_of_command(options, scene, progress=progress)
        announce(progress, "uncertainty")
        row = mesh_row(replace(scene, body=found.body), found.h, found.error)
    found = replace(found, rows=(*found.rows, row))
    width = [max(len(getattr(row, name)) for row in found.rows) for name in ("what", "value")]
    lines = (f"{r.what:<{width[0]}}  {r.value:<{width[1]}}  {r.reason}" for r in found.rows)
    summarise(options, found.table(), "\n".join(lines))
    return 0
