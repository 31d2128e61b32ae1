"""Options, progress, result folder and closing line that commands share."""

import argparse
import json
import sys
import warnings
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from skinwave.models import names
from skinwave.system.plain_text import say

if TYPE_CHECKING:
    from skinwave.models.options import SolveOptions
    from skinwave.planning.record import Plan
    from skinwave.scene.scene import Scene
    from skinwave.system.effort import Progress


def add_options(parser: argparse.ArgumentParser, *shared: str) -> None:
    """Add options that several commands have, by their names."""
    options: dict[str, dict[str, Any]] = {
        "scene": {"type": Path, "metavar": "SCENE", "help": "scene file (TOML)"},
        "--unit": {
            "default": "m", "help": "unit of the body's file: m (default), cm, mm, um or in",
        },
        "--up": {
            "default": "+z", "metavar": "AXIS", "help": "axis of that file that points to the "
            "device: +z (default), -z, +x, -x, +y or -y",
        },
        "--width": {
            "type": float, "metavar": "INCH", "help": "width of every figure for print, such as "
            "3.5 or 7 for a journal; letters are 8 points, names of lines 10 points, and their "
            "subscripts 7 points",
        },
        "--model": {
            "choices": ("auto", *names()), "default": "auto", "metavar": "MODEL",
            "help": f"auto (default: the plan selects a model), {', '.join(names())}",
        },
        "--tolerance": {
            "type": float, "default": 0.05, "metavar": "ERROR",
            "help": "relative error that waveforms may have (default: 0.05)",
        },
        "--dt": {
            "type": float, "metavar": "S",
            "help": "time step of transient models in s (default: by the model)",
        },
        "--element-size": {
            "dest": "h", "type": float, "metavar": "MM",
            "help": "element size in mm (default: by the plan)",
        },
        "--solver": {"default": "auto", "help": "auto (default), pardiso or superlu"},
        "--overwrite": {
            "action": "store_true", "help": "replace an earlier result at this place",
        },
        "--quiet": {"action": "store_true", "help": "print no progress and no summary"},
        "--json": {"action": "store_true", "help": "print the summary as JSON"},
        "--debug": {"action": "store_true", "help": "print the traceback of an error"},
    }  # fmt: skip
    for name in shared:
        parser.add_argument(name, **options[name])


def add_output(
    parser: argparse.ArgumentParser, metavar: str = "DIR", what: str = "result folder"
) -> None:
    """Add options for where and how results are written."""
    parser.add_argument("-o", "--out", type=Path, metavar=metavar, help=what)
    add_options(parser, "--overwrite", "--quiet", "--json", "--debug")


def add_scenes(parser: argparse.ArgumentParser, default: str) -> None:
    """Add the scene files of a live page; `default` describes a page without any."""
    parser.add_argument(
        "scenes", nargs="*", type=Path, metavar="SCENE",
        help=f"scene files (TOML) whose bodies and Tactons the page offers (default: {default})",
    )  # fmt: skip


def solve_options(options: argparse.Namespace, progress: "Progress") -> "SolveOptions":
    """Return those options of a command that are `SolveOptions`."""
    from skinwave.models.options import SolveOptions

    names = {"model", "tolerance", "dt", "solver"} & vars(options).keys()
    given: dict[str, Any] = {name: getattr(options, name) for name in names}
    return SolveOptions(h=metre(options.h), progress=progress, **given)


def plan_of_command(options: argparse.Namespace, scene: "Scene", progress: "Progress") -> "Plan":
    """Plan a scene with the options of a command, and print the warnings of the plan."""
    from skinwave.planning.plan import plan

    found = plan(scene, solve_options(options, progress))
    warn(found.warnings)
    return found


def paths_of(options: argparse.Namespace) -> list[Path]:
    """Return the files and folders that options name, without the result."""
    given = {key: x for key, x in vars(options).items() if key not in ("out", "default_out")}
    return [x for x in given.values() if isinstance(x, Path)]


def warn(sentences: Iterable[str]) -> None:
    """Print warnings."""
    for sentence in sentences:
        say(f"skinwave: warning: {' '.join(sentence.split())}", sys.stderr)


def note_scenes(options: argparse.Namespace) -> None:
    """Warn of implausible numbers in the scenes of a command, and print notes on the map of a focus
    and on distributions that the command ignores.

    Commands whose responses have these warnings get notes only. Each command itself refuses a file
    that cannot be read.
    """
    name = options.command_name
    has_own_warnings = name in ("plan", "run")
    samples = (name == "run" and options.samples is not None) or getattr(options, "best", None)
    is_quiet = getattr(options, "quiet", False)
    has_no_note = samples or name == "plan" or is_quiet
    if has_own_warnings and is_quiet:
        return
    from skinwave.planning.plan_warnings import implausible
    from skinwave.scene.file import read
    from skinwave.scene.focus_file import focus_note

    for path in [getattr(options, "scene", None), *getattr(options, "scenes", [])]:
        with warnings.catch_warnings(), suppress(ValueError):
            warnings.simplefilter("ignore")
            if not isinstance(path, Path) or not path.is_file():
                continue
            scene = read(path)
            warn(() if has_own_warnings else implausible(scene))
            if not is_quiet and (note := focus_note(scene.pressure)):
                say(f"skinwave: {note}", sys.stderr)
            if scene.spreads and not has_no_note:
                keys = ", ".join(key for key, _ in scene.spreads)
                say(f"skinwave: uses the central values of {keys}; skinwave run --samples N "
                    "samples their distributions", sys.stderr)  # fmt: skip


@contextmanager
def result_folder(
    options: argparse.Namespace,
    default: str | Path,
    scene: "Scene | None" = None,
    inputs: Iterable[str | Path] = (),
) -> "Iterator[tuple[Path, Progress]]":
    """Yield the folder of a result, --out or the default, and a progress callback.

    At the end the folder gets its record, unless it has one, and replaces the target. It may not
    contain files of the options, of the scene, or other `inputs`.
    """
    from skinwave.results import record
    from skinwave.results.outputs import output_folder

    options.default_out = Path(default)
    options.out = options.out or options.default_out
    inputs = [*paths_of(options), *(scene.files if scene else ()), *inputs]
    with output_folder(options.out, overwrite=options.overwrite, inputs=inputs) as folder:
        with progress_of(options) as progress:
            yield folder, progress
        if not (folder / record.FILE).exists():
            record.write(folder, record.command_entry(options), scene=scene)


def summarise_page(
    options: argparse.Namespace, sentences: list[str], failures: Mapping[str, str] | None = None,
    **summary: Any,
) -> int:  # fmt: skip
    """Print the sentences and the page of a result, or everything as JSON; see `summarise`."""
    summary = {"out": str(options.out), "sentences": with_failures(failures, sentences)} | summary
    return summarise(
        options, summary, [*sentences, f"open {options.out}/index.html"], failures or {}
    )


def with_failures(failures: Mapping[str, str] | None, sentences: Iterable[str]) -> list[str]:
    """Return sentences after one on the failures, if there are any."""
    from skinwave.system.failures import failure_text

    return [*filter(None, [failure_text(failures or {})]), *sentences]


def summarise(
    options: argparse.Namespace, summary: dict[str, Any], lines: Iterable[str],
    failures: Mapping[str, str] | None = None,
) -> int:  # fmt: skip
    """Print lines, or the summary as JSON, and keep both in the options; failed parts come first.

    Returns the exit code: 1 if a part failed.
    """
    if failures is not None:
        summary = summary | {"failures": dict(failures)}
    text = "\n".join(with_failures(failures, lines))
    options.summary = summary, text
    if options.json:
        say(json.dumps(summary))
    elif not options.quiet:
        say(text)
    return 1 if failures else 0


def metre(millimetre: float | None) -> float | None:
    """Convert mm to m; None stays None."""
    return None if millimetre is None else millimetre / 1e3


@contextmanager
def progress_of(options: argparse.Namespace) -> "Iterator[Progress]":
    """Yield a progress callback: a bar on a terminal, lines on a pipe, nothing if quiet."""
    from skinwave.system.progress_bar import progress_callback

    with progress_callback(not (options.quiet or options.json)) as progress:
        yield progress
