"""Disk cache of meshes and reduced bodies, so that each is computed once per machine.

The name of each file is a hash of everything that its content depends on. Unreadable entries are
misses. When all entries exceed 5 GiB, the least recently used are removed. The folder is that of
the platform; `SKINWAVE_CACHE` names another, and an empty value disables the cache.
"""

import contextlib
import hashlib
import json
import os
import re
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from meshes import reading

ENTRY = re.compile(r"[0-9a-f]{32}(\.npz|\.\w+\.part)")  # names of entries and unfinished ones


def folder() -> Path | None:
    """Return the folder of the cache, or None if the cache is off."""
    if (named := os.environ.get("SKINWAVE_CACHE")) is not None:
        return Path(named) if named else None
    from platformdirs import user_cache_path

    try:
        path = user_cache_path("skinwave", appauthor=False)
    except RuntimeError:  # no home directory
        return None
    return path if path.is_absolute() else None  # older platformdirs without a home directory


def key(*parts: object) -> str:
    """Return the cache key of everything that an entry depends on."""
    return digest(*parts)[:32]


def digest(*parts: object) -> str:
    """Return a SHA-256 hash of arrays (type, shape, bytes) and of other objects (their repr)."""
    sha = hashlib.sha256()
    for part in parts:
        if isinstance(part, np.ndarray):
            sha.update(f"{part.dtype.str}{part.shape}".encode())
            sha.update(np.ascontiguousarray(part).data)
        else:
            text = repr(part)
            # The repr of a function has an address: a random key makes it a miss every time.
            sha.update(text.encode() + (os.urandom(16) if " at 0x" in text else b""))
        sha.update(b"\0")
    return sha.hexdigest()


def load(name: str) -> dict[str, Any] | None:
    """Return the arrays and `meta` of an entry, or None on a cache miss."""
    home = folder()
    if home is None:
        return None
    path = home / f"{name}.npz"
    try:
        with reading.open_regular(path) as file, np.load(file) as entry:
            arrays: dict[str, Any] = {field: entry[field] for field in entry.files}
        meta = json.loads(str(arrays.pop("meta")))["meta"]
    except Exception:  # damaged files raise many types
        return None
    with contextlib.suppress(OSError):  # a read-only cache
        os.utime(path)
    return arrays | {"meta": meta}


def store(name: str, meta: Any, arrays: Mapping[str, np.ndarray], limit: int = 5 * 2**30) -> None:
    """Store an entry, unless the folder cannot be written or a number is not finite. All entries
    together take at most `limit` bytes, or the newest one alone.
    """
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
        _keep_within(limit, home, f"{name}.npz")


def _keep_within(limit: int, home: Path, newest: str) -> None:
    """Remove the least recently used entries, except the newest, until the rest fit a limit."""
    entries = {}
    for path in home.iterdir():
        if ENTRY.fullmatch(path.name) and path.is_file() and not path.is_symlink():
            with contextlib.suppress(FileNotFoundError):  # removed by another process
                entries[path] = path.lstat()
    size = sum(status.st_size for status in entries.values())
    abandoned_after = 86_400.0  # s, of unfinished entries
    for path, status in sorted(entries.items(), key=lambda each: each[1].st_mtime_ns):
        abandoned = path.suffix == ".part" and time.time() - status.st_mtime > abandoned_after
        if abandoned or (size > limit and path.suffix == ".npz" and path.name != newest):
            path.unlink(missing_ok=True)
            size -= status.st_size
