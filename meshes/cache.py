"""Meshes and prepared bodies on disk, so that each is made once per machine.

One file an entry, named by a hash of everything that it depends on. Entries are written aside
and renamed, so that two processes cannot spoil each other's; one that cannot be read is rebuilt.
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
    return Path(base or Path.home() / ".cache") / "skinwave"


def key(*parts: object) -> str:
    """A name for everything that an entry depends on; arrays count by their bytes."""
    digest = hashlib.sha256()
    for part in parts:
        digest.update(part.tobytes() if isinstance(part, np.ndarray) else repr(part).encode())
        digest.update(b"\0")
    return digest.hexdigest()[:32]


def load(name: str) -> dict[str, Any] | None:
    """The arrays of an entry, `meta` as what was stored; None if there is no readable one."""
    home = folder()
    if home is None:
        return None
    try:
        with open(home / f"{name}.npz", "rb") as file, np.load(file) as entry:
            arrays = {field: entry[field] for field in entry.files}
        record = json.loads(str(arrays["meta"]))
        return {field: arrays[field] for field in record["arrays"]} | {"meta": record["meta"]}
    except Exception:  # whatever zip files, array headers or JSON make of spoilt bytes
        return None


def store(name: str, meta: Mapping[str, Any], **arrays: np.ndarray) -> None:
    """Keep an entry; a folder that cannot be written is no error, only slower next time."""
    home = folder()
    if home is None:
        return
    record = json.dumps({"arrays": list(arrays), "meta": meta})  # of which none may be missing
    with contextlib.suppress(OSError):
        home.mkdir(parents=True, exist_ok=True)
        handle, aside = tempfile.mkstemp(dir=home, suffix=".part")
        try:
            with os.fdopen(handle, "wb") as file:
                np.savez(file, meta=np.array(record), **arrays)  # type: ignore[arg-type]
            os.replace(aside, home / f"{name}.npz")
        except OSError:
            os.unlink(aside)
