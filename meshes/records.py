"""Records (dataclasses of arrays and plain values) as a structure for JSON and named arrays."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from importlib import import_module
from typing import Any

import numpy as np


def encode(value: Any, arrays: dict[str, np.ndarray]) -> Any:
    """Return a value as a structure for JSON, and add its arrays to `arrays`; raise a TypeError for
    values such as functions.
    """
    if isinstance(value, np.ndarray | np.generic):
        name = f"array_{len(arrays)}"
        arrays[name] = np.asarray(value)
        return {"array": name}
    if is_dataclass(value) and not isinstance(value, type):
        kind = type(value)
        content = {each.name: getattr(value, each.name) for each in fields(value) if each.init}
        return {"record": f"{kind.__module__}:{kind.__qualname__}", **encode(content, arrays)}
    if isinstance(value, dict):
        return {"items": [[encode(each, arrays) for each in item] for item in value.items()]}
    if isinstance(value, tuple | list):
        return {type(value).__name__: [encode(each, arrays) for each in value]}
    if isinstance(value, complex):
        return {"complex": [value.real, value.imag]}
    if value is None or isinstance(value, bool | int | float | str):
        return value
    raise TypeError(f"a {type(value).__name__} cannot be stored in a record")


def decode(value: Any, arrays: Mapping[str, np.ndarray]) -> Any:
    """Return the value that `encode` stored; raise a ValueError for unknown dataclasses."""
    if not isinstance(value, dict):
        return value
    if "array" in value:
        array = arrays[value["array"]]
        return array if array.ndim else array[()]
    if "items" in value:
        content = {decode(k, arrays): decode(v, arrays) for k, v in value["items"]}
        return _kind(value["record"])(**content) if "record" in value else content
    if "complex" in value:
        return complex(*value["complex"])
    ((kind, items),) = value.items()
    return {"tuple": tuple, "list": list}[kind](decode(each, arrays) for each in items)


def _kind(name: str) -> type:
    module, _, kind = name.partition(":")
    found: Any = None
    packages = ("fem", "meshes", "simple_model", "skinwave")  # whose dataclasses are read
    if module.partition(".")[0] in packages:
        found = getattr(import_module(module), kind, None)
    if not (isinstance(found, type) and is_dataclass(found)):
        raise ValueError(f"{name} is not a dataclass of {', '.join(packages)}")
    return found
