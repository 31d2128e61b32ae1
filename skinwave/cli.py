"""The command line: `skinwave COMMAND`, each in a module of `skinwave.commands`.

Only argparse is imported before a command is known, so that help answers at once.
"""

import argparse
import sys
from collections.abc import Sequence

import skinwave
from skinwave.commands import COMMANDS


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; 0 if it succeeded, 1 if interrupted or refuted, 2 if its input was wrong."""
    arguments = sys.argv[1:] if arguments is None else arguments
    if list(arguments)[:1] == ["--version"]:  # looked up here, because help need not wait for it
        print(f"skinwave {skinwave.__version__}")
        return 0
    options = _parser().parse_args(_joined(arguments))
    try:
        return int(options.command(options))
    except KeyboardInterrupt:
        print("skinwave: interrupted; nothing was finished", file=sys.stderr)
        return 1
    except (ValueError, ArithmeticError, MemoryError, OSError) as error:
        if options.debug:
            raise
        said = " ".join(str(error).split()) or "not enough memory; take larger elements"
        print(f"skinwave: {said}", file=sys.stderr)
        return 2


def _joined(arguments: Sequence[str]) -> list[str]:
    """The arguments with `--up -z` as one, which argparse takes for two options."""
    found: list[str] = []
    for argument in arguments:
        if found[-1:] == ["--up"] and argument in ("-x", "-y", "-z"):
            found[-1] = f"--up={argument}"
        else:
            found.append(argument)
    return found


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="skinwave", description="Waves in skin and paper under mid-air ultrasound haptics."
    )
    parser.add_argument("--version", action="store_true", help="print the version and exit")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for name, module in COMMANDS.items():
        command = commands.add_parser(name, help=(module.__doc__ or "").rstrip("."))
        module.options(command)
        command.set_defaults(command=module.run)
    return parser
