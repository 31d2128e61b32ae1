"""Extension modules, which add body kinds and models in this process and in its workers.

A module registers them when it is imported. The environment variable `SKINWAVE_EXTENSIONS` lists
the modules, separated by commas, for the command line and for worker processes.
"""

import os
from collections.abc import Callable
from importlib import import_module
from typing import Any, TypeVar

VARIABLE = "SKINWAVE_EXTENSIONS"
T = TypeVar("T")


def load() -> None:
    """Import the extension modules; raise a ValueError if one cannot be imported."""
    for name in _module_names():
        try:
            import_module(name)
        except ImportError as error:
            raise ValueError(
                f"the module '{name}' in {VARIABLE} cannot be imported ({error}); add its "
                "folder to PYTHONPATH"
            ) from None


def add(registry: dict[str, T], name: str, record: T, made_by: Callable[..., Any] | None) -> None:
    """Register a record, and add the module of its function `made_by` to the environment variable;
    raise a ValueError if the name is taken.
    """
    if name in registry:
        raise ValueError(f"'{name}' is registered already; choose another name")
    registry[name] = record
    module = getattr(made_by, "__module__", None) or "skinwave"
    if module.split(".")[0] != "skinwave" and module not in {*_module_names(), "__main__"}:
        os.environ[VARIABLE] = ",".join([*_module_names(), module])


def _module_names() -> list[str]:
    return [name for name in os.environ.get(VARIABLE, "").split(",") if name]
