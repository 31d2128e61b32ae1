"""Subcommands of `skinwave`: a module each, with `options(parser)` and `run(options)`.

The one line of a module is its help. Slow imports are made in `run`.
"""

from skinwave.commands import (
    cache,
    compare,
    convert,
    doctor,
    film,
    mesh,
    plan,
    plot,
    relax,
    report,
    rerun,
    run,
    same,
    sweep,
    tradeoff,
    verify,
    web,
)

COMMANDS = {
    "run": run,
    "compare": compare,
    "tradeoff": tradeoff,
    "relax": relax,
    "plan": plan,
    "sweep": sweep,
    "plot": plot,
    "mesh": mesh,
    "convert": convert,
    "verify": verify,
    "report": report,
    "film": film,
    "web": web,
    "rerun": rerun,
    "same": same,
    "doctor": doctor,
    "cache": cache,
}
