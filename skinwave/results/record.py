"""record.json of a result: the command that made it, its scene, its model and versions."""

import json
import shlex
from argparse import Namespace
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from meshes import reading
from simple_model import Response
from skinwave.scene.file import dumps
from skinwave.scene.scene import Scene
from skinwave.system.effort import threads, versions

FILE = "record.json"
RESPONSES = "responses.npz"


def command_entry(options: Namespace) -> dict[str, Any]:
    """Return a record of a command: as typed, its name and its options."""
    # Options that do not affect the result.
    reporting = (
        "command", "command_name", "out", "overwrite", "quiet", "json", "debug", "no_cache",
        "typed", "scheduler", "default_out", "summary",
    )  # fmt: skip
    given = {name: value for name, value in vars(options).items() if name not in reporting}
    return {
        "typed": shlex.join(["skinwave", *options.typed]),
        "name": options.command_name,
        "options": {
            name: str(value.resolve()) if isinstance(value, Path) else value
            for name, value in given.items()
        },
    }


def write(
    folder: Path,
    command: Mapping[str, Any],
    *,
    scene: Scene | None = None,
    response: Response | None = None,
) -> None:
    """Write record.json of a folder from a `command_entry` and, if given, scene and response."""
    content: dict[str, Any] = {
        "command": command, "scene": dumps(scene) if scene else None,
        "versions": versions(), "threads": threads(),
    }  # fmt: skip
    if response:
        effort = response.effort
        content |= {
            "model": response.model, "solver": effort.solver, "mesh": effort.mesh or None,
            "h_m": effort.h or None, "dt_s": effort.dt or None,
            **effort.errors.summary(),
        }  # fmt: skip
    (folder / FILE).write_text(json.dumps(content, indent=1), encoding="utf-8")


def read(folder: Path) -> dict[str, Any]:
    """Read record.json of a result folder; raises a ValueError if it is missing or damaged."""
    path = folder / FILE
    if not path.exists():
        raise ValueError(f"{folder} has no {FILE}. Give a folder that skinwave wrote")
    content = reading.load_json(path)
    if not isinstance(content, dict) or not isinstance(content.get("command"), dict):
        raise ValueError(f"{path} is damaged. Compute the result again")
    return content
