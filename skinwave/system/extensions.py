"""Registries, and the modules from outside that add to them in this process and its workers.

A module registers what it adds when it is imported: body kinds, models, formats of measurements and
patterns, columns of sweeps. Entry points of installed packages in the group "skinwave" name such
modules, and so does the environment variable `SKINWAVE_EXTENSIONS`, separated by commas.
"""

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from typing import Any, Generic, TypeVar

VARIABLE = "SKINWAVE_EXTENSIONS"
T = TypeVar("T")


@dataclass(frozen=True, kw_only=True)
class Registry(Generic[T]):
    """Records by name.

    Parameters
    ----------
    what : str, kind of the records in messages, such as "model"
    built_in : mapping from a name to the module that registers its record when it is first imported
    records : dict, registered so far
    """

    what: str
    built_in: Mapping[str, str] = field(default_factory=dict)
    records: dict[str, T] = field(default_factory=dict)


def add(registry: Registry[T], name: str, record: T, made_by: Callable[..., Any] | None) -> None:
    """Register a record, and add the module of its function `made_by` to the environment variable.

    Raises a ValueError if the name is taken.
    """
    module = getattr(made_by, "__module__", None) or "skinwave"
    is_own = module.split(".")[0] == "skinwave"
    if name in registry.records or (name in registry.built_in and not is_own):
        raise ValueError(f"{registry.what} '{name}' is registered already; choose another name")
    registry.records[name] = record
    if not is_own and module not in {*_module_names(), "__main__"}:
        os.environ[VARIABLE] = ",".join([*_module_names(), module])


def names(registry: Registry[T]) -> tuple[str, ...]:
    """Return the names of all records, the built-in ones first."""
    return tuple(dict.fromkeys([*registry.built_in, *registry.records]))


def find(registry: Registry[T], name: str) -> T:
    """Return the record with a name; raise a ValueError if it is unknown."""
    if name not in registry.records:
        from simple_model.choices import choose

        if name in registry.built_in:
            import_module(registry.built_in[name])
        else:
            load()
        choose(registry.what, name, names(registry))
    return registry.records[name]


def load() -> None:
    """Import the extension modules; raise a ValueError if one cannot be imported."""
    for name, package in [*((name, "") for name in _module_names()), *_installed()]:
        try:
            import_module(name)
        except Exception as error:  # whatever a module from outside raises
            where, cure = f"in {VARIABLE}", "correct it, or remove it there"
            if package:
                where, cure = f"of the package {package}", f"update or uninstall {package}"
            elif isinstance(error, ModuleNotFoundError) and error.name == name:
                cure = "add its folder to PYTHONPATH"
            raise ValueError(
                f"the module '{name}' {where} cannot be imported ({error}); {cure}"
            ) from error


def _module_names() -> list[str]:
    return [name for name in os.environ.get(VARIABLE, "").split(",") if name]


@cache
def _installed() -> list[tuple[str, str]]:
    """Return the module and the package of each entry point."""
    from importlib.metadata import entry_points

    return [(point.module, point.dist.name if point.dist else point.name)
            for point in entry_points(group="skinwave")]  # fmt: skip
