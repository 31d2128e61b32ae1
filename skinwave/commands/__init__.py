"""Subcommands of `skinwave`: each is a module with `options(parser)` and `run(options)`.

The docstring of a module is the help of its command. Slow imports are made in `run`.
"""

from skinwave.commands import (
    compare,
    convert,
    dispersion,
    fit,
    live,
    mesh,
    plan,
    relax,
    report,
    run,
    sweep,
    verify,
    web,
)

MODULES = (
    run, compare, relax, dispersion, plan, sweep, mesh, convert, verify, report,
    live, web, fit,
)  # fmt: skip
COMMANDS = {module.__name__.rpartition(".")[2]: module for module in MODULES}
