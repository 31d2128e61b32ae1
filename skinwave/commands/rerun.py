"""A result folder once more, from its record.json."""

import argparse
import io
import os
import re
import shlex
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

from skinwave.commands import compare, dispersion, fit, measured, report, validate
from skinwave.commands import map as map_command
from skinwave.commands import run as run_command
from skinwave.commands.common import add_output, progress_of, summarise

REPEATED = {
    "run": run_command, "compare": compare, "report": report, "dispersion": dispersion,
    "map": map_command, "fit": fit, "validate": validate, "measured": measured,
}  # fmt: skip
ONCE_EACH = ("format", "vary", "tie")  # options that are given once for each of their values
PLACES = ("source", "file", "scene")  # arguments without a name, of which a command has one


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    parser.add_argument(
        "folder", type=Path, metavar="DIR", help="folder that run, compare, report, dispersion, "
        "map, fit, validate or measured wrote, or a folder of one run in it; the new one is "
        "DIR-rerun",
    )  # fmt: skip
    add_output(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; the exit code."""
    from skinwave.results import record
    from skinwave.results.marks import within
    from skinwave.system.effort import threads

    kept = record.read(options.folder)
    if kept["threads"].items() - threads().items():  # which are set when a process begins
        return _with_threads(options, kept["threads"])
    folder = options.folder.resolve()
    if options.out and within(folder, options.out):
        raise ValueError(f"{options.out} holds the result that is repeated; choose another --out")
    out = options.out or folder.with_name(f"{folder.name}-rerun")
    with tempfile.TemporaryDirectory() as place:
        scene = Path(place) / "scene.toml"
        if kept["scene"] is not None:
            scene.write_text(kept["scene"], encoding="utf-8")
        if kept["command"]["name"] in ("compute", "plan"):
            return _model_again(options, kept, scene, out)
        return _command_again(options, kept, scene, out)


def _with_threads(options: argparse.Namespace, threads: dict[str, str]) -> int:
    """The same command in a process with as many threads as the record has."""
    words = [sys.executable, "-P", "-m", "skinwave", *options.typed]
    # In a group of its own: what interrupts or ends this process is handed on to it once.
    group = None if sys.platform == "win32" else 0
    with subprocess.Popen(words, env=os.environ | threads, process_group=group) as again:
        try:
            return again.wait()
        except KeyboardInterrupt:
            again.send_signal(signal.SIGINT)
            return int(again.wait() != 0)  # which is negative before it listens to signals
        except SystemExit:
            again.terminate()
            raise


def _command_again(
    options: argparse.Namespace, kept: dict[str, Any], scene: Path, out: Path
) -> int:
    """The command of the command line, with the options that it had."""
    name, asked = kept["command"]["name"], kept["command"]["options"]
    place = next((name for name in PLACES if name in asked), PLACES[-1])
    given = str(scene) if kept["scene"] is not None else asked.get(place)
    if name not in REPEATED:
        raise ValueError(
            f"the record's command '{name[:40]}' is none of {', '.join(REPEATED)}; type it again, "
            f"with another --out: {kept['command']['typed'][:300]}"
        )
    words = [word for key, value in asked.items() if key != place for word in _words(key, value)]
    again = _parsed(name, [*words, *([] if given is None else ["--", str(given)])])
    if strange := [key for key in asked if key != "scheduler" and key not in vars(again)]:
        raise ValueError(f"the record's option '{strange[0][:40]}' is none; make the result anew")
    for key in ("overwrite", "quiet", "json", "debug"):
        setattr(again, key, getattr(options, key))
    try:
        again.out, again.typed = out, shlex.split(kept["command"]["typed"])[1:]
    except ValueError:
        raise ValueError("the record's command cannot be split; make the result anew") from None
    return int(REPEATED[name].run(again))


def _words(key: str, value: Any) -> Iterator[str]:
    """An option of a record as it would be typed; nothing where it was not given."""
    from skinwave.results.record import REPORTING

    known = re.fullmatch(r"[a-z_]+", key) and key not in REPORTING
    if value is None or value is False or value == []:
        return
    if not known or not isinstance(value, str | int | float | list):
        raise ValueError(f"the record's option '{key[:40]}' is none; make the result anew")
    flag = f"--{key.replace('_', '-')}"
    if value is True:
        yield flag
    elif isinstance(value, list) and all(isinstance(item, list) for item in value):
        for item in value:
            yield from (flag, *_plain_words(key, item))
    elif key in ONCE_EACH and isinstance(value, list):
        yield from (f"{flag}={item}" for item in value if item != "png")  # which is there already
    else:
        yield f"{flag}={','.join(map(str, value)) if isinstance(value, list) else value}"


def _plain_words(key: str, item: list[Any]) -> list[str]:
    """Words of one option that has several, none of which is another option."""
    words = [str(word) for word in item]
    if any(word.startswith("-") for word in words):
        raise ValueError(f"the record's option '{key[:40]}' is none; make the result anew")
    return words


def _parsed(name: str, words: list[str]) -> argparse.Namespace:
    """Parse the words of a command that come from a file, without printing the usage."""
    parser, said = argparse.ArgumentParser(prog=f"skinwave {name}"), io.StringIO()
    REPEATED[name].options(parser)
    parser.set_defaults(command_name=name, version=False)  # as in the record of any command
    try:
        with redirect_stderr(said), redirect_stdout(said):
            return parser.parse_args(words)
    except SystemExit:
        reason = said.getvalue().strip().splitlines()[-1:] or ["it asks for help"]
        raise ValueError(
            f"the record's command cannot be repeated ({reason[0]}); make the result anew"
        ) from None


def _model_again(options: argparse.Namespace, kept: dict[str, Any], scene: Path, out: Path) -> int:
    """One model of a folder with several."""
    from dataclasses import replace
    from math import nan

    from skinwave.models.options import SolveOptions
    from skinwave.planning.plan import plan
    from skinwave.planning.simulate import compute, solve
    from skinwave.results.files import fill
    from skinwave.results.outputs import output_folder
    from skinwave.results.run import Run
    from skinwave.scene.file import read
    from skinwave.system.json_kinds import fitting

    asked, by = kept["command"]["options"], kept["command"]["name"]
    kinds = {"h": float, "dt": float, "solver": str, "model": str, "tacton": str, "body": str}
    given = {key: value for key, value in asked.items() if value is not None}
    fitting(given, {f"{key}?": kind for key, kind in kinds.items()}, "options of the record")
    if missing := kinds.keys() - asked.keys():
        raise ValueError(f"options of the record lack '{min(missing)}'; make the result anew")
    if kept["scene"] is None:
        raise ValueError("the record has no scene; make the result anew")
    its, h, solver = read(scene), asked["h"], asked["solver"]
    with (
        output_folder(
            out, overwrite=options.overwrite, inputs=[options.folder, its.body.file]
        ) as folder,
        progress_of(options) as progress,
    ):
        if by == "plan" and its.body.of_kind.discretise:
            response = solve(its, plan(its, SolveOptions(h=h, solver=solver, progress=progress)))
        else:
            response = compute(its, asked["model"], progress=progress, h=h, dt=asked["dt"],
                               solver=solver)  # fmt: skip
        error = kept["expected_error"]
        response = replace(response, expected_error=nan if error is None else error)
        run = Run(tacton=asked["tacton"], body=asked["body"], scene=its, response=response)
        fill(folder, run, by=by, h=h)
    summarise(options, {"out": str(out), "model": response.model}, f"{response.model}: wrote {out}")
    return 0
