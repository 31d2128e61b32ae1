"""Print the model, the mesh and the expected error for a scene, with reasons."""

import argparse

from skinwave.commands import common


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    model = ("--model", "--tolerance", "--dt", "--element-size", "--solver")
    common.add_options(parser, "scene", *model, "--quiet", "--json", "--debug")


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit code."""
    from dataclasses import replace

    from skinwave.planning.budget import mesh_row
    from skinwave.scene.file import read
    from skinwave.system.progress_bar import announce

    scene = read(options.scene)
    with common.progress_of(options) as progress:
        found = common.plan_of_command(options, scene, progress)
        announce(progress, "uncertainty")
        row = mesh_row(replace(scene, body=found.body), found.h, found.error)
    found = replace(found, rows=(*found.rows, row))
    width = [max(len(getattr(row, name)) for row in found.rows) for name in ("what", "value")]
    lines = (f"{r.what:<{width[0]}}  {r.value:<{width[1]}}  {r.reason}" for r in found.rows)
    return common.summarise(options, found.table(), lines)
