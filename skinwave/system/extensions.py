"""Modules that add body kinds and models from outside: here, and in the processes that this starts.

A module registers when it is imported. Its name is kept in the environment, where processes that
are started later find it. The command line takes what the modules add that `SKINWAVE_EXTENSIONS`
names, with commas between them.
"""

import os
from collections.abc import Callable
from importlib import import_module
from typing import Any, TypeVar

VARIABLE = "SKINWAVE_EXTENSIONS"
T = TypeVar("T")


def load() -> None:
    """Import the modules that the environment names.

    Raises
    ------
    ValueError
        If one cannot be found.
    """
    for name in _named():
        try:
            import_module(name)
        except ImportError as error:
            raise ValueError(
                f"{VARIABLE} names the module '{name}', which cannot be imported ({error}); put "
                "it where Python finds modules"
            ) from None


def add(registry: dict[str, T], name: str, record: T, made_by: Callable[..., Any] | None) -> None:
    """Add a record to a registry, and the module of a function of it to the environment.

    Raises
    ------
    ValueError
        If there is a record of that name.
    """
    if name in registry:
        raise ValueError(f"'{name}' is registered already; choose another name")
    registry[name] = record
    module = getattr(made_by, "__module__", None) or "skinwave"
    if module.split(".")[0] != "skinwave" and module not in {*_named(), "__main__"}:
        os.environ[VARIABLE] = ",".join([*_named(), module])


def _named() -> list[str]:
    return [name for name in os.environ.get(VARIABLE, "").split(",") if name]
