"""The command line: `skinwave COMMAND`, each in a module of `skinwave.commands`.

Only argparse is imported before a command is known, so that help is immediate.
"""

import argparse
import errno
import os
import sys
from collections.abc import Sequence
from functools import partial
from typing import Any, NoReturn

import skinwave
from skinwave.commands import COMMANDS
from skinwave.commands.common import note_central_values
from skinwave.system import extensions
from skinwave.system.plain_text import printable, say
from skinwave.system.processes import SAFE_PATH, environment

CACHE = "SKINWAVE_CACHE"
NO_CACHE = f"neither read nor write cached meshes and reduced bodies; {CACHE} names their folder"
# Commands that compute nothing, or always anew.
UNCACHED = ("convert",)
READER_GONE = 141  # 128 + SIGPIPE, as a shell has it of `yes | head -1`
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; 0 if it succeeded, 1 if interrupted or refuted, 2 if its input was wrong."""
    typed = list(sys.argv[1:] if arguments is None else arguments)
    debug = "--debug" in typed
    try:
        code = _command(typed)
        sys.stdout.flush()
        return code
    except KeyboardInterrupt as interrupt:
        said, code = f"interrupted; {interrupt or 'nothing was finished'}", 1
    except BrokenPipeError:  # nobody reads what is written
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return READER_GONE
    except (ValueError, ArithmeticError, MemoryError, OSError) as error:
        if debug:
            raise
        said, code = _explained(error), 2
    say(f"skinwave: {' '.join(said.split())}", sys.stderr)
    return code


def _command(typed: list[str]) -> int:
    if typed[:1] == ["--version"]:  # looked up here, because help need not wait for it
        print(f"skinwave {skinwave.__version__}")
        return 0
    extensions.load()
    options = parser().parse_args(_joined(typed))
    if options.command_name is None:
        parser().error(f"no command is given; use one of {', '.join(COMMANDS)}")
    options.typed = typed
    no_cache = {CACHE: ""} if getattr(options, "no_cache", False) else {}
    with environment({**SAFE_PATH, **no_cache}):
        note_central_values(options)
        return int(options.command(options))


def _explained(error: Exception) -> str:
    """The sentence of an error; those of the system and of memory lack a cure of their own."""
    if isinstance(error, MemoryError):
        return str(error) or "not enough memory; take larger elements"
    if not isinstance(error, OSError) or not error.strerror:
        return str(error)
    place = "a file" if error.filename is None else error.filename
    cure = "make room there" if error.errno in FULL else "check its name, place and permissions"
    return f"{place} cannot be read or written ({error.strerror}); {cure}"


def _joined(arguments: Sequence[str]) -> list[str]:
    """The arguments with `--up -z` as one, which argparse takes for two options."""
    found: list[str] = []
    for argument in arguments:
        if found[-1:] == ["--up"] and argument in ("-x", "-y", "-z"):
            found[-1] = f"--up={argument}"
        else:
            found.append(argument)
    return found


class _Parser(argparse.ArgumentParser):
    """Argument parser, of the commands too, whose errors are a sentence with the nearest word."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self.register("type", float, _number)
        self.register("type", int, partial(_number, kind=int))

    def error(self, message: str) -> NoReturn:
        shown = printable(message, keep="")
        self.exit(2, f"skinwave: {shown}; see {self.prog} --help\n")

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        found, unknown = super().parse_known_args(args, namespace)
        if unknown:
            from simple_model.choices import meant

            known = [word for action in self._actions for word in action.option_strings]
            what = "option" if unknown[0].startswith("-") else "argument"
            name = unknown[0].partition("=")[0]
            self.error(f"unknown {what} {name}{meant(name, known).rstrip('?')}")
        return found, unknown

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            from simple_model.choices import choose

            try:
                choose("value", value, action.choices)
            except ValueError as error:
                raise argparse.ArgumentError(action, str(error).rstrip("?")) from None


def _number(text: str, kind: type = float) -> Any:
    """The number of an option."""
    try:
        return kind(text)
    except ValueError:
        words = "a whole number" if kind is int else "a number, such as 0.5"
        raise argparse.ArgumentTypeError(f"'{text}' must be {words}") from None


def parser() -> argparse.ArgumentParser:
    """The parser of all commands; its results have `command`, which does it, and its name."""
    parser = _Parser(
        prog="skinwave",
        description="Waves in skin and paper under mid-air ultrasound haptics.",
        epilog=f"{CACHE}: folder where meshes and reduced bodies are cached, 5 GiB at most, those "
        "used longest ago leave first; empty for none.",
    )
    parser.add_argument("--version", action="store_true", help="print the version and exit")
    commands = parser.add_subparsers(dest="command_name", metavar="COMMAND")
    for name, module in COMMANDS.items():
        command = commands.add_parser(name, help=(module.__doc__ or "").rstrip("."))
        module.options(command)
        if name not in UNCACHED:
            command.add_argument("--no-cache", action="store_true", help=NO_CACHE)
        command.set_defaults(command=module.run)
    return parser
