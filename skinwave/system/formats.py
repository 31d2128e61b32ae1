"""Formats of files by suffix: the module of a function that reads or writes one registers it.

This module imports nothing that loads numpy, because the command line lists the suffixes.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from skinwave.system import extensions
from skinwave.system.extensions import Registry


@dataclass(frozen=True, kw_only=True)
class Format:
    """Format of a registry.

    Parameters
    ----------
    function : of `MEASUREMENTS`, (path, `Given`) -> `Recording`; of `PATTERN_READERS`, (content,
        `Options`, scene that receives the pattern) -> `Pattern`; of `PATTERN_WRITERS`, (scene,
        `Options`) -> content and notes. It raises a ValueError if the file is malformed, or if the
        format cannot express the scene
    name : of measurements, in messages
    choices : those of `variable`, `columns` and `direction` that a reader of measurements uses
    largest : bytes of a pattern file
    """

    function: Callable[..., Any]
    name: str = ""
    choices: tuple[str, ...] = ()
    largest: int = 16_000_000


def _registry(what: str, room: str, **modules: str) -> Registry[Format]:
    """Return the registry of modules and their suffixes."""
    built_in = {suffix: f"skinwave.{room}.{module}"
                for module, suffixes in modules.items() for suffix in suffixes.split()}  # fmt: skip
    return Registry(what=what, built_in=built_in)


MEASUREMENTS = _registry(
    "format of a measurement", "measure", reading=".csv .tsv .txt .asc .dat .lvm .wav .f32",
    labview=".tdms", arrays=".npz .mat", universal=".uff .unv .uf .58",
)  # fmt: skip
PATTERN_READERS = _registry(
    "pattern format to read", "patterns", conversion=".toml", adaptics=".adaptics",
    focal_points=".csv", waveform=".wav",
)  # fmt: skip
PATTERN_WRITERS = _registry(
    "pattern format to write", "patterns", conversion=".toml", adaptics_out=".adaptics",
    focal_points=".csv", autd3=".py",
)  # fmt: skip


def register(
    registry: Registry[Format], *suffixes: str, function: Callable[..., Any], **how: Any
) -> None:
    """Register a `Format` for suffixes such as ".csv"; raise a ValueError if one is taken."""
    for suffix in suffixes:
        if not re.fullmatch(r"\.[a-z0-9_+-]+", suffix):
            raise ValueError(f"suffix '{suffix}' is not like '.csv'; use a dot and small letters")
        extensions.add(registry, suffix, Format(function=function, **how), function)


def format_of(registry: Registry[Format], path: Path) -> Format:
    """Return the format of a file by its suffix; raise a ValueError if it is unknown."""
    try:
        return extensions.find(registry, path.suffix.lower())
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def suffixes(registry: Registry[Format]) -> str:
    """Return all suffixes in one line."""
    return ", ".join(extensions.names(registry))
