"""The command line: `skinwave COMMAND`, each in a module of `skinwave.commands`.

Only argparse is imported before a command is known, so that help is immediate.
"""

import argparse
import errno
import os
import sys
from collections.abc import Sequence
from typing import Any, NoReturn

import skinwave
from skinwave.commands import COMMANDS
from skinwave.commands.common import note_scenes
from skinwave.commands.kept import run_or_recall
from skinwave.system import extensions
from skinwave.system.plain_text import printable, say
from skinwave.system.processes import SAFE_PATH, environment

CACHE = "SKINWAVE_CACHE"
READER_GONE = 141  # 128 + SIGPIPE, the exit code of `yes` in `yes | head -1`


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; return 0 on success, 1 if interrupted or if a check or a part of the result
    failed, 2 on bad input.
    """
    typed = list(sys.argv[1:] if arguments is None else arguments)
    debug = "--debug" in typed
    try:
        code = _command(typed)
        sys.stdout.flush()
        return code
    except KeyboardInterrupt as interrupt:
        message, code = f"interrupted; {interrupt or 'no result was written'}", 1
    except BrokenPipeError:  # the reader of standard output has ended
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return READER_GONE
    except (ValueError, ArithmeticError, MemoryError, OSError) as error:
        if debug:
            raise
        message, code = _message(error), 2
    say(f"skinwave: {' '.join(message.split())}", sys.stderr)
    return code


def _command(typed: list[str]) -> int:
    if typed[:1] == ["--version"]:  # imports are slow, and help needs none
        print(f"skinwave {skinwave.__version__}")
        return 0
    extensions.load()
    options = parser().parse_args(_join_up_option(typed))
    if options.command_name is None:
        parser().error(f"no command given; use one of {', '.join(COMMANDS)}")
    options.typed = typed
    no_cache = {CACHE: ""} if getattr(options, "no_cache", False) else {}
    with environment({**SAFE_PATH, **no_cache}):
        note_scenes(options)
        return run_or_recall(options)


def _message(error: Exception) -> str:
    """Return the message of an error; add a cure to those of the system and of memory."""
    if isinstance(error, MemoryError):
        return str(error) or "not enough memory; use larger elements"
    if not isinstance(error, OSError) or not error.strerror:
        return str(error)
    place = "a file" if error.filename is None else error.filename
    is_full = error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
    cure = "free space there" if is_full else "check its name and permissions"
    return f"{place} cannot be read or written ({error.strerror}); {cure}"


def _join_up_option(arguments: Sequence[str]) -> list[str]:
    """Join `--up -z`, which argparse would read as two options, to `--up=-z`."""
    joined: list[str] = []
    for argument in arguments:
        if joined[-1:] == ["--up"] and argument in ("-x", "-y", "-z"):
            joined[-1] = f"--up={argument}"
        else:
            joined.append(argument)
    return joined


class _Parser(argparse.ArgumentParser):
    """Argument parser whose errors are one sentence, and whose options have no abbreviations."""

    def __init__(self, **how: Any) -> None:
        super().__init__(allow_abbrev=False, **how)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Refuse unknown options in the parser of their command, which knows similar ones."""
        known, unknown = super().parse_known_args(args, namespace)
        if unknown:
            from simple_model.choices import SHORTEST_PART, suggestion

            given = unknown[0].partition("=")[0]
            names = {name: action for action in self._actions for name in action.option_strings}
            word = given.strip("-")
            near = [name for name, action in names.items() if action.dest == word]
            near = near or [name for name in names if len(word) >= SHORTEST_PART and word in name]
            hint = f"; use {near[0]}" if near else suggestion(given, names)
            what = "option" if given.startswith("-") else "argument"
            self.error(f"unrecognized {what} {given}{hint}")
        return known, unknown

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"skinwave: {printable(message, keep='')}; see {self.prog} --help\n")


def parser() -> argparse.ArgumentParser:
    """Return the parser of all commands; `command` of its results is the function to call."""
    parser = _Parser(
        prog="skinwave",
        description="Simulate waves in skin and paper under mid-air ultrasound haptics.",
        epilog=f"The environment variable {CACHE} names the folder of cached meshes, reduced "
        "bodies and results (at most 5 GiB; an empty value turns the cache off).",
    )
    parser.add_argument("--version", action="store_true", help="print the version and exit")
    commands = parser.add_subparsers(dest="command_name", metavar="COMMAND")
    for name, module in COMMANDS.items():
        text = module.__doc__ or ""
        command = commands.add_parser(name, help=text.rstrip("."), description=text)
        module.options(command)
        if name != "convert":  # which does not use the cache
            command.add_argument(
                "--no-cache", action="store_true", help="do not use the cache of meshes, bodies "
                f"and results (its folder: environment variable {CACHE})",
            )  # fmt: skip
        command.set_defaults(command=module.run)
    return parser
