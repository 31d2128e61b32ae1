"""Options, progress, result folder and closing line that commands share."""

import argparse
import json
import sys
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

from skinwave.models import names
from skinwave.system.plain_text import say

if TYPE_CHECKING:
    from simple_model import Response
    from skinwave.planning.rows import Plan
    from skinwave.scene.scene import Scene
    from skinwave.system.effort import Progress


def add_output(
    parser: argparse.ArgumentParser, metavar: str = "DIR", what: str = "folder to write"
) -> None:
    """Options of output: where and how results are written."""
    parser.add_argument("-o", "--out", type=Path, metavar=metavar, help=what)
    parser.add_argument("--overwrite", action="store_true", help="replace what skinwave wrote")
    add_reporting(parser)


def add_reporting(parser: argparse.ArgumentParser) -> None:
    """Options of reporting."""
    parser.add_argument("--quiet", action="store_true", help="no progress, no summary")
    parser.add_argument("--json", action="store_true", help="summary as JSON")
    parser.add_argument("--debug", action="store_true", help="traceback of an error")


def add_scene(parser: argparse.ArgumentParser) -> None:
    """The scene file."""
    parser.add_argument("scene", type=Path, metavar="SCENE", help="scene file (TOML)")


def add_scenes(parser: argparse.ArgumentParser, without: str) -> None:
    """Scene files of a live page; without any it has other bodies."""
    parser.add_argument(
        "scenes", nargs="*", type=Path, metavar="SCENE",
        help="scene files (TOML) whose bodies and Tactons the page has; without any, the bodies "
        f"{without}",
    )  # fmt: skip


def add_width(parser: argparse.ArgumentParser) -> None:
    """The width of figures."""
    parser.add_argument(
        "--width", type=float, metavar="INCH",
        help="of every figure, for print, with letters of 8 points (subscripts 5.6): 3.5 or 7 for "
        "a journal",
    )  # fmt: skip


def add_mesh(parser: argparse.ArgumentParser) -> None:
    """Solver options: element size and direct solver."""
    add_size(parser, help="element size, mm (default: planned)")
    parser.add_argument("--solver", default="auto", help="auto, pardiso or superlu")


def add_size(parser: argparse.ArgumentParser, **how: Any) -> None:
    """The element size in mm."""
    parser.add_argument("--element-size", dest="h", type=float, metavar="MM", **how)


def add_model(parser: argparse.ArgumentParser, *, has_steps: bool = True) -> None:
    """Options of the model: its name, its tolerance and its time step."""
    parser.add_argument("--model", choices=("auto", *names()), default="auto")
    help_ = "relative error of waveforms"
    parser.add_argument("--tolerance", type=float, default=0.05, help=help_)
    if has_steps:
        help_ = "time step of transient models, s"
        parser.add_argument("--dt", type=float, metavar="S", help=help_)


def required_plan(options: argparse.Namespace, scene: "Scene", **more: Any) -> "Plan":
    """Plan with the user's choices, and more options; a warning for each that exceeds the
    tolerance.
    """
    from skinwave.models.options import SolveOptions
    from skinwave.planning.plan import plan

    asked = SolveOptions(
        model=options.model, tolerance=options.tolerance, h=metre(options.h), dt=options.dt,
        solver=options.solver, **more,
    )  # fmt: skip
    required = plan(scene, asked)
    warn(required.warnings)
    return required


def warn(sentences: Iterable[str]) -> None:
    """Print warnings of what falls short of the request."""
    for sentence in sentences:
        say(f"skinwave: warning: {' '.join(sentence.split())}", sys.stderr)


def told(response: "Response") -> dict[str, Any]:
    """Accuracy of a response, as a summary in JSON has it."""
    error = response.expected_error
    return {
        "expected_error": error if isfinite(error) else None,
        "warnings": list(response.effort.warnings),
    }


def note_central_values(options: argparse.Namespace) -> None:
    """Say once that a command takes the central values of a scene's uncertain numbers, if it does.

    A file that cannot be read is the command's to refuse.
    """
    path, name = getattr(options, "scene", None), options.command_name
    samples = (name == "run" and options.samples is not None) or getattr(options, "best", None)
    if samples or name == "plan" or not isinstance(path, Path) or not path.is_file():
        return
    if getattr(options, "quiet", False):
        return
    from skinwave.scene.file import read

    with warnings.catch_warnings(), suppress(ValueError):
        warnings.simplefilter("ignore")
        if spreads := read(path).spreads:
            keys = ", ".join(key for key, _ in spreads)
            say(f"skinwave: central values are taken of {keys}; skinwave run --samples takes their "
                "spread", sys.stderr)  # fmt: skip


@contextmanager
def result_folder(
    options: argparse.Namespace,
    default: str,
    inputs: Iterable[str | Path] = (),
    scene: "Scene | None" = None,
) -> "Iterator[tuple[Path, Progress]]":
    """Folder of a result, and where progress goes: that of --out or else the default, with its
    record, put in place when all is written.
    """
    from skinwave.results import record
    from skinwave.results.outputs import output_folder

    options.out = options.out or Path(default)
    with (
        output_folder(options.out, overwrite=options.overwrite, inputs=inputs) as folder,
        progress_of(options) as progress,
    ):
        yield folder, progress
        record.write(folder, record.of_command(options), scene=scene)


def closing(options: argparse.Namespace, sentences: list[str], **summary: Any) -> None:
    """The closing lines of a result folder: its sentences, and the page to open."""
    summary = {"out": str(options.out), "sentences": sentences} | summary
    summarise(options, summary, "\n".join([*sentences, f"open {options.out}/index.html"]))


def summarise(options: argparse.Namespace, summary: dict[str, Any], sentence: str) -> None:
    """The closing line, or all that it sums up as JSON."""
    if options.json:
        say(json.dumps(summary))
    elif not options.quiet:
        say(sentence)


def metre(millimetre: float | None) -> float | None:
    """Metre of what is given in millimetre, if it is."""
    return None if millimetre is None else millimetre / 1e3


@contextmanager
def progress_of(options: argparse.Namespace) -> "Iterator[Progress]":
    """A bar with the step named and the time left; on a pipe a line per step; nothing if not
    wanted.
    """
    from skinwave.system.progress_bar import reported

    with reported(not (options.quiet or options.json)) as shown:
        yield shown
