"""Meshes and prepared bodies on disk, so that each is made once per machine.

One file an entry, named by a hash of everything that it depends on. Entries are written aside
and renamed, so that two processes cannot spoil each other's. Each holds a digest of its name and
contents: an entry that cannot be read, was altered or bears another's name is a miss, and rebuilt.
`SKINWAVE_CACHE` names another folder, or nothing at all to keep none.
"""

import contextlib
import hashlib
import json
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np


def folder() -> Path | None:
    """Where entries are kept; None if they are not."""
    if (named := os.environ.get("SKINWAVE_CACHE")) is not None:
        return Path(named) if named else None
    base = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA")
    try:
        return Path(base or Path.home() / ".cache") / "skinwave"
    except RuntimeError:  # nobody has a home here
        return None


def key(*parts: object) -> str:
    """A name for everything that an entry depends on; arrays count by type, shape and bytes."""
    return digest(*parts)[:32]


def digest(*parts: object) -> str:
    """SHA-256 in hexadecimal of arrays, by type, shape and bytes, and of the repr of all else."""
    found = hashlib.sha256()
    for part in parts:
        if isinstance(part, np.ndarray):
            found.update(f"{part.dtype.str}{part.shape}".encode())
            found.update(np.ascontiguousarray(part).data)
        else:
            found.update(repr(part).encode())
        found.update(b"\0")
    return found.hexdigest()


def load(name: str) -> dict[str, Any] | None:
    """The arrays of an entry, `meta` as what was stored; None if there is no sound one."""
    home = folder()
    if home is None:
        return None
    try:
        with open(home / f"{name}.npz", "rb") as file, np.load(file) as entry:
            arrays = {field: entry[field] for field in entry.files}
        record = json.loads(str(arrays.pop("meta")))
        if record.pop("digest") != _contents(name, record["meta"], arrays):
            return None
        return arrays | {"meta": record["meta"]}
    except Exception:  # whatever zip files, array headers or JSON make of spoilt bytes
        return None


def store(name: str, meta: Mapping[str, Any], **arrays: np.ndarray) -> None:
    """Keep an entry; a folder that cannot be written is no error, only slower next time."""
    home = folder()
    if home is None or not all(np.isfinite(array).all() for array in arrays.values()):
        return
    meta = json.loads(json.dumps(meta))  # as it will be read
    record = json.dumps({"digest": _contents(name, meta, arrays), "meta": meta})
    with contextlib.suppress(OSError):
        home.mkdir(parents=True, exist_ok=True)
        handle, aside = tempfile.mkstemp(dir=home, suffix=".part")
        try:
            with os.fdopen(handle, "wb") as file:
                np.savez(file, meta=np.array(record), **arrays)  # type: ignore[arg-type]
            os.replace(aside, home / f"{name}.npz")
        except OSError:
            os.unlink(aside)


def _contents(name: str, meta: object, arrays: Mapping[str, np.ndarray]) -> str:
    """Digest of an entry: its name, what goes with it, and its arrays by name."""
    named = (part for field in sorted(arrays) for part in (field, arrays[field]))
    return digest(name, json.dumps(meta, sort_keys=True), *named)
