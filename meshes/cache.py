"""Disk cache of meshes and reduced bodies, so that each is computed once per machine.

One file an entry, named by a hash of everything that it depends on, and written aside and renamed.
An entry that cannot be read is a cache miss. Above `LIMIT` the least recently used entries are
removed, and never a file whose name is not of the cache. It is in the platform's folder of caches;
`SKINWAVE_CACHE` names another, and empty turns the cache off.
"""

import contextlib
import hashlib
import json
import os
import re
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from meshes import reading

LIMIT = 5 * 2**30  # bytes of all entries
OURS = re.compile(r"[0-9a-f]{32}(\.npz|\.\w+\.part)")  # entries, and what is being written
ABANDONED = 86_400.0  # s after which what was being written no longer is


def folder() -> Path | None:
    """Folder of the cache; None if the cache is off."""
    if (named := os.environ.get("SKINWAVE_CACHE")) is not None:
        return Path(named) if named else None
    from platformdirs import user_cache_path

    try:
        found = user_cache_path("skinwave", appauthor=False)
    except RuntimeError:  # nobody has a home here
        return None
    return found if found.is_absolute() else None  # the same, of older platformdirs


def key(*parts: object) -> str:
    """Cache key of everything that an entry depends on; arrays count by type, shape and bytes."""
    return digest(*parts)[:32]


def digest(*parts: object) -> str:
    """SHA-256 in hexadecimal of arrays, by type, shape and bytes, and of the repr of all else."""
    found = hashlib.sha256()
    for part in parts:
        if isinstance(part, np.ndarray):
            found.update(f"{part.dtype.str}{part.shape}".encode())
            found.update(np.ascontiguousarray(part).data)
        else:
            text = repr(part)
            # A function has no name that lasts: what depends on one is never found again.
            found.update(text.encode() + (os.urandom(16) if " at 0x" in text else b""))
        found.update(b"\0")
    return found.hexdigest()


def load(name: str) -> dict[str, Any] | None:
    """Arrays of an entry, and `meta` as it was stored; None on a cache miss."""
    home = folder()
    if home is None:
        return None
    path = home / f"{name}.npz"
    try:
        with reading.open_regular(path) as file, np.load(file) as entry:
            arrays: dict[str, Any] = {field: entry[field] for field in entry.files}
        meta = json.loads(str(arrays.pop("meta")))["meta"]
    except Exception:  # whatever zip files, array headers or JSON make of spoilt bytes
        return None
    with contextlib.suppress(OSError):  # not ours to change
        os.utime(path)  # used now
    return arrays | {"meta": meta}


def store(name: str, meta: Any, **arrays: np.ndarray) -> None:
    """Store an entry; a folder that cannot be written is no error, only a miss next time."""
    home = folder()
    if home is None or not all(np.isfinite(array).all() for array in arrays.values()):
        return
    record = np.array(json.dumps({"meta": meta}))
    with contextlib.suppress(OSError):
        home.mkdir(parents=True, exist_ok=True)
        handle, aside = tempfile.mkstemp(dir=home, prefix=f"{name}.", suffix=".part")
        try:
            with os.fdopen(handle, "wb") as file:
                np.savez(file, meta=record, **arrays)  # type: ignore[arg-type]
            os.replace(aside, home / f"{name}.npz")
        except BaseException:
            os.unlink(aside)
            raise
        _keep_within(LIMIT, home, f"{name}.npz")


def _keep_within(limit: int, home: Path, newest: str) -> None:
    """Evict the least recently used entries until the rest is within a limit; the newest stays."""
    found = {}
    for path in home.iterdir():
        if OURS.fullmatch(path.name) and path.is_file() and not path.is_symlink():
            with contextlib.suppress(FileNotFoundError):  # removed by another process meanwhile
                found[path] = path.lstat()
    size = sum(status.st_size for status in found.values())
    for path, status in sorted(found.items(), key=lambda each: each[1].st_mtime_ns):
        abandoned = path.suffix == ".part" and time.time() - status.st_mtime > ABANDONED
        if abandoned or (size > limit and path.suffix == ".npz" and path.name != newest):
            path.unlink(missing_ok=True)
            size -= status.st_size
