"""Model and discretisation that a scene requires, and why."""

import argparse
import json
from typing import TYPE_CHECKING

from skinwave.commands.common import (
    add_mesh,
    add_model,
    add_reporting,
    add_scene,
    required_plan,
)
from skinwave.system.plain_text import say

if TYPE_CHECKING:
    pass


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
    if options.json:
        say(json.dumps(required.table()))
        return 0
    width = [max(len(getattr(row, f)) for row in required.rows) for f in ("what", "value")]
    for row in required.rows:
        say(f"{row.what:<{width[0]}}  {row.value:<{width[1]}}  {row.reason}")
    return 0
