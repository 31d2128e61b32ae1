"""Disk cache of meshes and reduced bodies, so that each is computed once per machine.

One file an entry, named by a hash of everything that it depends on. Entries are written to a
temporary file and renamed, so that two processes cannot corrupt each other's. Each contains a
digest of its name and contents: an entry that cannot be read, was altered or has another's name is
a cache miss, and rebuilt. Above `LIMIT` the least recently used entries are removed; a file whose
name is not of the cache never is. It is in the platform's folder of caches, on Linux
`$XDG_CACHE_HOME/skinwave`; `SKINWAVE_CACHE` names another, and empty turns the cache off. It is in
this package because meshes are the lowest that need it: all that is cached elsewhere is above.
"""

import contextlib
import hashlib
import json
import os
import re
import stat
import tempfile
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from meshes import reading

LIMIT = 5 * 2**30  # bytes of all entries
OURS = re.compile(r"[0-9a-f]{32}(\.npz|\.\w+\.part)")  # entries, and what is being written
ABANDONED = 86_400.0  # s after which what was being written no longer is


@dataclass(frozen=True, kw_only=True)
class Contents:
    """Number of entries in a folder, and their size in bytes."""

    folder: Path
    entries: int
    size: int


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
    """SHA-256 in hexadecimal of arrays, by type, shape and bytes, and of the repr of all else.

    That has to be of all that it is, which those of scenes, responses, plans and meshes are not.
    """
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
    try:
        with reading.opened(home / f"{name}.npz") as file:
            reading.check_unpacked(file, os.fstat(file.fileno()).st_size)  # none is compressed
            with np.load(file) as entry:
                arrays = {field: entry[field] for field in entry.files}
        record = json.loads(str(arrays.pop("meta")))
        if record.pop("digest") != _contents(name, record["meta"], arrays):
            return None
    except Exception:  # whatever zip files, array headers or JSON make of spoilt bytes
        return None
    with contextlib.suppress(OSError):  # not ours to change
        os.utime(home / f"{name}.npz")  # used now
    return arrays | {"meta": record["meta"]}


def store(name: str, meta: Mapping[str, Any], **arrays: np.ndarray) -> None:
    """Store an entry; a folder that cannot be written is no error, only a miss next time."""
    home = folder()
    if home is None or not all(np.isfinite(array).all() for array in arrays.values()):
        return
    meta = json.loads(json.dumps(meta))  # as it will be read
    record = json.dumps({"digest": _contents(name, meta, arrays), "meta": meta})
    with contextlib.suppress(OSError):
        home.mkdir(parents=True, exist_ok=True)
        handle, aside = tempfile.mkstemp(dir=home, prefix=f"{name}.", suffix=".part")
        try:
            with os.fdopen(handle, "wb") as file:
                np.savez(file, meta=np.array(record), **arrays)  # type: ignore[arg-type]
            os.replace(aside, home / f"{name}.npz")
        except BaseException:
            os.unlink(aside)
            raise
        _keep_within(LIMIT, home, f"{name}.npz")


def contents() -> Contents | None:
    """Contents of the cache, and its folder; None if the cache is off.

    Raises
    ------
    ValueError
        If the folder cannot be read.
    """
    home = folder()
    return None if home is None else _summed(home, _ours(home))


def clear() -> Contents | None:
    """Remove all entries; the contents that there were.

    Raises
    ------
    ValueError
        If the folder cannot be read, or an entry cannot be removed.
    """
    home = folder()
    if home is None:
        return None
    found = _ours(home)
    try:
        for path in found:
            path.unlink(missing_ok=True)  # another process may do the same
    except OSError as error:
        raise ValueError(
            f"{home} cannot be cleared ({error.strerror}); make it writable or remove it yourself"
        ) from error
    return _summed(home, found)


def _keep_within(limit: int, home: Path, newest: str) -> None:
    """Evict the least recently used entries until the rest is within a limit; the newest stays."""
    found = sorted(_statuses(home), key=lambda each: each[1].st_mtime_ns)
    size = sum(status.st_size for _, status in found)
    for path, status in found:
        abandoned = path.suffix == ".part" and time.time() - status.st_mtime > ABANDONED
        if abandoned or (size > limit and path.suffix == ".npz" and path.name != newest):
            path.unlink(missing_ok=True)
            size -= status.st_size


def _ours(home: Path) -> dict[Path, os.stat_result]:
    """Files of the cache, by their names, and what is known of each; no links, no folders."""
    try:
        return dict(_statuses(home))
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise ValueError(
            f"the cache {home} cannot be read ({error.strerror}); name another with SKINWAVE_CACHE"
        ) from error


def _statuses(home: Path) -> Iterator[tuple[Path, os.stat_result]]:
    for path in home.iterdir():
        if OURS.fullmatch(path.name):
            with contextlib.suppress(FileNotFoundError):  # removed by another process meanwhile
                status = path.lstat()
                if stat.S_ISREG(status.st_mode):
                    yield path, status


def _summed(home: Path, found: Mapping[Path, os.stat_result]) -> Contents:
    entries = [status.st_size for path, status in found.items() if path.suffix == ".npz"]
    size = sum(status.st_size for status in found.values())
    return Contents(folder=home, entries=len(entries), size=size)


def _contents(name: str, meta: object, arrays: Mapping[str, np.ndarray]) -> str:
    """Digest of an entry: its name, its `meta`, and its arrays by name."""
    named = (part for field in sorted(arrays) for part in (field, arrays[field]))
    return digest(name, json.dumps(meta, sort_keys=True), *named)
