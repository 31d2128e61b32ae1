"""Model and discretisation that a scene requires, and why."""

import argparse
import json
from typing import TYPE_CHECKING

from skinwave.commands.common import (
    add_mesh,
    add_model,
    add_reporting,
    add_scene,
    add_show,
    required_plan,
    show,
)
from skinwave.system.plain_text import say

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from skinwave.scene.scene import Scene


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    add_scene(parser)
    add_model(parser)
    add_mesh(parser)
    add_show(parser)
    add_reporting(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; the exit code."""
    from dataclasses import replace

    from skinwave.planning.budget import mesh_row
    from skinwave.planning.costs import rows
    from skinwave.scene.file import read

    scene = read(options.scene)
    required = required_plan(options, scene)
    row = mesh_row(replace(scene, body=required.body), required.h, required.error)
    required = replace(required, rows=(*required.rows, row, *rows(scene, required)))
    if options.json:
        say(json.dumps(required.table()))
        return 0
    width = [max(len(getattr(row, f)) for row in required.rows) for f in ("what", "value")]
    for row in required.rows:
        say(f"{row.what:<{width[0]}}  {row.value:<{width[1]}}  {row.reason}")
    show(options, lambda: _figures(scene))
    return 0


def _figures(scene: "Scene") -> "dict[str, Figure]":
    from skinwave.report.scene_plot import scene_figure

    return {scene.name: scene_figure(scene)}
