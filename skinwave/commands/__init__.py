"""Subcommands of `skinwave`: each is a module with `options(parser)` and `run(options)`.

The docstring of a module is the help of its command. Slow imports are made in `run`.
"""

from importlib import import_module

COMMANDS = {
    name: import_module(f"skinwave.commands.{name}")
    for name in (
        "run", "compare", "relax", "dispersion", "plan", "sweep", "mesh", "convert", "verify",
        "report", "live", "web", "fit",
    )
}  # fmt: skip
