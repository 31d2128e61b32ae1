"""Results of commands in the cache: an unchanged command copies its earlier result.

A result depends on the options of its command, the content of the files that these name, the code,
and the versions of its libraries. Results with failed parts, and those of extensions, are not kept.
"""

import argparse
import json
import os
import shlex
import sys
import warnings
from datetime import datetime
from html import escape
from pathlib import Path
from typing import Any

from skinwave.commands.common import paths_of, summarise, warn
from skinwave.system.extensions import VARIABLE
from skinwave.system.plain_text import say

COMMANDS = ("run", "compare", "relax", "report")


def run_or_recall(options: argparse.Namespace) -> int:
    """Run a command, or copy the result of the same command; return its exit code."""
    if options.command_name not in COMMANDS:
        return int(options.command(options))
    from meshes import cache

    name = _name(options) if cache.folder() else None
    if name and (entry := cache.load(name)):
        return _recall(options, entry.pop("meta"), entry)
    code = int(options.command(options))
    if name and code == 0:
        _keep(name, options)
    return code


def _name(options: argparse.Namespace) -> str | None:
    """Return the cache key of a command's result, or None if it is not kept."""
    from importlib.metadata import version

    from meshes import cache
    from skinwave.results import record
    from skinwave.scene.file import read
    from skinwave.system.effort import usable_cores, versions

    given = record.command_entry(options)["options"]
    if os.environ.get(VARIABLE) or ("source" in given and os.path.isdir(given["source"])):
        return None
    texts = {key: value for key, value in given.items() if isinstance(value, str)}
    files = {key: Path(value) for key, value in texts.items() if os.path.isfile(value)}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the command itself warns
            scenes = [read(path) for key, path in files.items() if key in ("scene", "source")]
        bodies = [Path(scene.body.file) for scene in scenes if scene.body.file]
        contents = [path.read_bytes() for path in (*files.values(), *bodies)]
    except (ValueError, OSError):  # the command itself says what is wrong
        return None
    code = [(str(p), p.stat().st_size, p.stat().st_mtime_ns) for p in _sources()]
    drawing = [version(package) for package in ("matplotlib", "pyvista")]
    return cache.key("result", options.command_name, given, contents, code, versions(), drawing,
                     usable_cores())  # fmt: skip


def _sources() -> list[Path]:
    """Return the files of the code, and of the pages that it fills."""
    root = Path(__file__).parents[2]
    packages = ("fem", "meshes", "simple_model", "skinwave")
    found = (path for name in packages for path in (root / name).rglob("*"))
    return sorted(path for path in found if path.is_file() and path.suffix != ".pyc")


def _keep(name: str, options: argparse.Namespace, most_bytes: int = 200_000_000) -> None:
    """Keep the folder and the summary of a command, unless the folder is too large."""
    import numpy as np

    from meshes import cache
    from skinwave.report.renderer import begin

    is_incomplete = begin.cache_info().currsize and not begin().result().is_available
    if is_incomplete or not hasattr(options, "summary") or not options.out.is_dir():
        return
    files = {path: path.read_bytes() for path in options.out.rglob("*") if path.is_file()}
    if sum(map(len, files.values())) > most_bytes:
        return
    summary, text = options.summary
    meta = {
        "summary": summary, "text": text, "out": str(options.out), "typed": options.typed,
        "default": str(options.default_out), "written": f"{datetime.now():%Y-%m-%d %H:%M}",
    }  # fmt: skip
    arrays = {
        path.relative_to(options.out).as_posix(): np.frombuffer(content, np.uint8)
        for path, content in files.items()
    }
    cache.store(name, meta, arrays)


def _recall(options: argparse.Namespace, meta: dict[str, Any], files: dict[str, Any]) -> int:
    """Write a kept result to the place that the options name, and print its summary."""
    from skinwave.results import record
    from skinwave.results.outputs import output_folder

    options.out = options.out or Path(meta["default"])
    inputs = paths_of(options)
    with output_folder(options.out, overwrite=options.overwrite, inputs=inputs) as folder:
        for name, content in files.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content.tobytes())
        command = record.command_entry(options)
        said = record.read(folder) | {"command": command}
        (folder / record.FILE).write_text(json.dumps(said, indent=1), encoding="utf-8")
        page, before = folder / "index.html", escape(shlex.join(["skinwave", *meta["typed"]]))
        if page.exists():
            text = page.read_text(encoding="utf-8").replace(before, escape(command["typed"]))
            page.write_text(text, encoding="utf-8")
    warn(meta["summary"].get("warnings", ()))
    if not (options.quiet or options.json):
        say(f"skinwave: nothing has changed since {meta['written']}: the same result, from the "
            "cache; --no-cache computes it again", sys.stderr)  # fmt: skip
    summary = meta["summary"] | {"out": str(options.out), "from_cache": meta["written"]}
    return summarise(options, summary, [meta["text"].replace(meta["out"], str(options.out))])
