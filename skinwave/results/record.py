"""Record of a result, record.json: input to repeat it, and digests to compare it by."""

import json
import re
import shlex
from argparse import Namespace
from collections.abc import Mapping
from math import isfinite
from pathlib import Path
from typing import Any

from meshes import cache, reading
from simple_model import Response
from skinwave.results.run import Run
from skinwave.scene.file import dumps
from skinwave.scene.scene import Scene
from skinwave.system.effort import THREADS, threads, versions
from skinwave.system.json_kinds import fitting

FILE, FORMAT = "record.json", 1
FITTING = {
    "format": float, "threads": {str: str},
    "command": {"typed": str, "name": str, "options": {str: object}},
}  # fmt: skip
RESPONSES = ("responses.npz", "response.npz")  # today's name, and that of version 0.2
# Options that say where to compute and how to report, not what to compute.
REPORTING = ("command", "command_name", "out", "overwrite", "quiet", "json", "debug", "no_cache",
             "typed", "scheduler")  # fmt: skip


def of_command(options: Namespace) -> dict[str, Any]:
    """A command of the command line: as typed, its name, and all of its options."""
    kept = {name: value for name, value in vars(options).items() if name not in REPORTING}
    return {
        "typed": shlex.join(["skinwave", *options.typed]),
        "name": options.command_name,
        "options": {name: _plain(value) for name, value in kept.items()},
    }


def of_model(run: Run, name: str = "compute", h: float | None = None) -> dict[str, Any]:
    """One model by itself, as `planning.simulate.compute` takes it or, with the name "plan", as
    planned, with the element size h in metre if that was asked for.
    """
    effort = run.response.effort
    solver = "auto" if effort.solver == "none" else effort.solver
    options = {
        "tacton": run.tacton, "body": run.body, "model": run.model,
        "h": h if name == "plan" else effort.h or None, "dt": effort.dt or None, "solver": solver,
    }  # fmt: skip
    return {"typed": "", "name": name, "options": options}


def write(
    folder: Path,
    command: Mapping[str, Any],
    *,
    scene: Scene | None = None,
    response: Response | None = None,
) -> None:
    """record.json of a folder that has its responses already, if it has any."""
    asked = command["options"]
    record: dict[str, Any] = {
        "format": FORMAT,
        "command": command,
        "scene": dumps(scene) if scene else None,
        "tolerance": asked.get("tolerance"),
        "model": {"asked": asked.get("model")},
        "solver": {"asked": asked.get("solver")},
        "versions": versions(),
        "threads": threads(),
    }
    meshes = {}
    if response:
        effort, error = response.effort, response.expected_error
        record["model"]["used"], record["solver"]["used"] = response.model, effort.solver
        record |= {"h_m": effort.h or None, "dt_s": effort.dt or None}
        record["expected_error"] = error if isfinite(error) else None
        meshes = {"mesh": effort.mesh} if effort.mesh else {}
    record["hashes"] = meshes | {"arrays": hashes(folder)}
    (folder / FILE).write_text(json.dumps(record, indent=1), encoding="utf-8")


def read(folder: Path) -> dict[str, Any]:
    """The record of a result folder.

    Raises
    ------
    ValueError
        If there is none, or none that can be read.
    """
    path = folder / FILE
    if not path.exists():
        raise ValueError(
            f"{path} cannot be read; name a folder that run, compare, report, dispersion, map, "
            "fit, validate or measured wrote"
        )
    try:
        record = fitting(reading.parsed(path), FITTING, "record")
        if record["format"] != FORMAT:
            raise ValueError(f"format {record['format']}, not {FORMAT}")
        _check_threads(record["threads"])
        for key, kind in (("scene", str), ("expected_error", float)):
            if record.setdefault(key, None) is not None:
                fitting(record[key], kind, key)
    except ValueError as error:
        raise ValueError(f"{path} is no record ({error}); make the result anew") from None
    return dict(record)


def _check_threads(counted: Mapping[str, str]) -> None:
    """Refuse what is set in the environment of a process and is no number of threads."""
    for name, value in counted.items():
        if name not in THREADS or not re.fullmatch(r"[0-9]{1,4}(,[0-9]{1,4})*", value):
            raise ValueError(f"threads has '{name[:40]}' = '{value[:40]}', no number of threads")


def responses(folder: Path) -> Path | None:
    """The file of a folder's waveforms, by today's name or that of version 0.2."""
    return next((folder / name for name in RESPONSES if (folder / name).is_file()), None)


def hashes(folder: Path) -> dict[str, str]:
    """SHA-256 of each array, by type, shape and bytes, of a folder's waveforms."""
    path = responses(folder)
    if path is None:
        return {}
    return {name: cache.digest(array) for name, array in reading.arrays(path).items()}


def _plain(value: Any) -> Any:
    """A value as JSON has it; the path of what exists from anywhere, also among several words."""
    if isinstance(value, Path) or (isinstance(value, str) and Path(value).is_file()):
        return str(Path(value).resolve())
    if isinstance(value, list) and all(isinstance(item, list) for item in value):
        return [[_plain(word) for word in item] for item in value]
    return value
