"""Reading of users' files: regular files of a limited size, whatever their contents claim."""

import codecs
import json
import os
import re
import stat
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, BinaryIO

import numpy as np

from meshes.typing import Array

LARGEST_TEXT = 16_000_000  # bytes
UNPACKED, GROWTH = 500_000_000, 8  # bytes that an archive may unpack to, or times its own size

_BINARY = getattr(os, "O_BINARY", 0)
_CONTROL = re.compile(r"[\x00-\x08\x0e-\x1f\x7f]")  # letters that no text has

PathLike = str | os.PathLike[str]


@contextmanager
def open_regular(path: PathLike, limit: float = np.inf) -> Iterator[BinaryIO]:
    """Open a regular file of at most `limit` bytes for reading; a ValueError if it cannot be
    opened, is a pipe, a device or a folder, or is larger.
    """
    try:  # a pipe without a writer would be waited for
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | _BINARY)
    except (OSError, ValueError) as error:
        raise ValueError(f"{path}: cannot be read ({_reason(error)}); check the path") from None
    status = os.fstat(handle)
    if not stat.S_ISREG(status.st_mode):
        os.close(handle)
        raise ValueError(f"{path}: cannot be read (it is no regular file); check the path")
    with os.fdopen(handle, "rb") as file:
        if status.st_size > limit:
            raise ValueError(
                f"{path}: {status.st_size / 1e6:,.0f} MB exceed the limit of {limit / 1e6:g} MB; "
                "check the path"
            )
        yield file


def read_bytes(path: PathLike, limit: int) -> bytes:
    """Return all bytes of a regular file of at most `limit`; raises what `open_regular` does."""
    with open_regular(path, limit) as file:
        try:
            return file.read(limit + 1)
        except OSError as error:
            raise ValueError(f"{path}: cannot be read ({_reason(error)}); check it") from None


def read_text(path: PathLike, limit: int = LARGEST_TEXT) -> str:
    """Return the UTF-8 text of a file of at most `limit` bytes; raises what `open_regular` does."""
    try:
        return read_bytes(path, limit).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: no UTF-8 text ({error.reason}); save it as such") from None


def read_exported_text(path: PathLike, limit: int = LARGEST_TEXT) -> str:
    """Return the text of a file as programs export it: UTF-8, UTF-16, or Windows' Latin-1; raises a
    ValueError if it is no text, or as `open_regular` does.
    """
    found = read_bytes(path, limit)
    encodings = ["utf-8-sig", "cp1252", "latin-1"]
    if found.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        encodings = ["utf-16"]
    elif b"\0" in found[:2000] and not len(found) % 2:
        encodings = ["utf-16-le" if found[1:2] == b"\0" else "utf-16-be"]
    for encoding in encodings:
        try:
            decoded = found.decode(encoding)
        except UnicodeDecodeError:
            continue
        if not _CONTROL.search(decoded):
            return decoded
        break
    raise ValueError(f"{path}: no text; export it as text in UTF-8, or name it by its format")


def load_arrays(path: PathLike) -> dict[str, Array]:
    """Return the arrays of an .npz file, by name; a ValueError if it is none, or unpacks to more
    than `UNPACKED` bytes and `GROWTH` times its size.
    """
    with open_regular(path) as file:
        try:
            limit = max(UNPACKED, GROWTH * os.fstat(file.fileno()).st_size)
            with zipfile.ZipFile(file) as archive:
                size = sum(member.file_size for member in archive.infolist())
            if size > limit:
                raise ValueError(
                    f"unpacks to {size / 1e6:,.0f} MB, the limit is {limit / 1e6:,.0f} MB"
                )
            file.seek(0)
            with np.load(file, allow_pickle=False) as archive:
                return {name: archive[name] for name in archive.files}
        except Exception as error:  # whatever archives and headers make of spoilt bytes
            raise ValueError(
                f"{path}: cannot be read ({_reason(error)}); make the result anew"
            ) from None


def load_json(path: PathLike) -> Any:
    """Return the parsed content of a JSON file; a ValueError if it is no JSON."""
    found = read_text(path)
    try:
        return json.loads(found)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path}: no JSON ({_reason(error)}); make the result anew") from None


def _reason(error: BaseException) -> str:
    said = getattr(error, "strerror", None) or " ".join(str(error).split())
    return said[:200] or type(error).__name__
