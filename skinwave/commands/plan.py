"""Model and discretisation that a scene requires, and why."""

import argparse

from skinwave.commands.common import (
    add_mesh,
    add_model,
    add_reporting,
    add_scene,
    required_plan,
    summarise,
)


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    add_scene(parser)
    add_model(parser)
    add_mesh(parser)
    add_reporting(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; the exit code."""
    from dataclasses import replace

    from skinwave.planning.budget import mesh_row
    from skinwave.scene.file import read

    scene = read(options.scene)
    required = required_plan(options, scene)
    row = mesh_row(replace(scene, body=required.body), required.h, required.error)
    required = replace(required, rows=(*required.rows, row))
    width = [max(len(getattr(row, f)) for row in required.rows) for f in ("what", "value")]
    lines = (f"{r.what:<{width[0]}}  {r.value:<{width[1]}}  {r.reason}" for r in required.rows)
    summarise(options, required.table(), "\n".join(lines))
    return 0
