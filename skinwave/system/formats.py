"""Formats of files by suffix: the module that reads or writes one registers it when it is imported.

This module imports nothing that loads numpy, because the command line lists the suffixes.
"""

import re
from collections.abc import Callable, Mapping
from typing import Any

from skinwave.system import extensions
from skinwave.system.extensions import Registry


def _by_suffix(room: str, modules: Mapping[str, str]) -> dict[str, str]:
    return {suffix: f"skinwave.{room}.{module}"
            for module, suffixes in modules.items() for suffix in suffixes.split()}  # fmt: skip


MEASUREMENTS = Registry[Any](what="format of a measurement", built_in=_by_suffix("measure", {
    "text": ".csv .tsv .txt .asc .dat .lvm", "labview": ".tdms", "arrays": ".npz .mat",
    "universal": ".uff .unv .uf .58", "reading": ".wav .f32",
}))  # fmt: skip
PATTERN_READERS = Registry[Any](what="pattern format to read", built_in=_by_suffix("patterns", {
    "conversion": ".toml", "adaptics": ".adaptics", "focal_points": ".csv", "waveform": ".wav",
}))  # fmt: skip
PATTERN_WRITERS = Registry[Any](what="pattern format to write", built_in=_by_suffix("patterns", {
    "conversion": ".toml", "adaptics_out": ".adaptics", "focal_points": ".csv", "autd3": ".py",
}))  # fmt: skip


def add(registry: Registry[Any], suffix: str, record: Any, made_by: Callable[..., Any]) -> None:
    """Register the format of a suffix such as ".csv"; raise a ValueError if it is taken."""
    if not re.fullmatch(r"\.[a-z0-9_+-]+", suffix):
        raise ValueError(f"the suffix '{suffix}' is not like '.csv'; use a dot and small letters")
    extensions.add(registry, suffix, record, made_by)


def suffixes(registry: Registry[Any]) -> str:
    """Return all suffixes in one line."""
    return ", ".join(extensions.names(registry))
