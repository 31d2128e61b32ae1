"""Safe reading of users' files: regular files of a limited size, whatever their contents claim."""

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
from numpy.typing import NDArray

LARGEST_TEXT = 16_000_000  # bytes of JSON, and of other text
UNPACKED = 500_000_000  # bytes that any archive of arrays may unpack to,
GROWTH = 8  # or so many times what it takes on the disk
MOST_ARRAYS = 1000  # of an archive; reading each takes its time, however small it is

CONTROL = re.compile(rb"[\x00-\x08\x0e-\x1f\x7f]")  # bytes that no text has

PathLike = str | os.PathLike[str]


@contextmanager
def opened(path: PathLike, limit: float = np.inf) -> Iterator[BinaryIO]:
    """A regular file of at most `limit` bytes, open for reading.

    Raises
    ------
    ValueError
        If it cannot be opened, is a pipe, a device or a folder, or is larger.
    """
    try:  # a pipe without a writer would be waited for
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | _BINARY)
    except (OSError, ValueError) as error:
        raise ValueError(f"{path}: cannot be read ({_reason(error)}); check the path") from None
    if not stat.S_ISREG(os.fstat(handle).st_mode):
        os.close(handle)
        raise ValueError(f"{path}: cannot be read (it is no regular file); check the path")
    with os.fdopen(handle, "rb") as file:
        size = os.fstat(handle).st_size
        if size > limit:
            raise ValueError(
                f"{path}: larger ({size / 1e6:,.0f} MB) than the limit of {limit / 1e6:g} MB; "
                "check the path"
            )
        yield file


def content(path: PathLike, limit: int) -> bytes:
    """All bytes of a regular file of at most `limit`; raises what `opened` does."""
    with opened(path, limit) as file:
        try:
            return file.read(limit + 1)
        except OSError as error:
            raise ValueError(f"{path}: cannot be read ({_reason(error)}); check it") from None


def text(path: PathLike, limit: int = LARGEST_TEXT) -> str:
    """The UTF-8 text of a regular file of at most `limit` bytes; raises what `opened` does."""
    try:
        return content(path, limit).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: no UTF-8 text ({error.reason}); save it as such") from None


def exported_text(path: PathLike, limit: int = LARGEST_TEXT) -> str:
    """The text of a regular file as other programs export it: UTF-8, UTF-16, or else Windows'
    Latin-1.

    Raises
    ------
    ValueError
        What `opened` raises, and if the file is no text.
    """
    found = content(path, limit)
    encodings = ["utf-8-sig", "cp1252", "latin-1"]
    if found.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        encodings = ["utf-16"]
    elif b"\0" in found[:2000] and not len(found) % 2:
        encodings = ["utf-16-le" if found[1:2] == b"\0" else "utf-16-be"]
    for encoding in encodings:
        try:
            text = found.decode(encoding)
        except UnicodeDecodeError:
            continue
        if not CONTROL.search(text.encode()):
            return text
        break
    raise ValueError(f"{path}: no text; save it as text in UTF-8")


def on_disk(path: PathLike) -> int:
    """Bytes that a file takes on the disk: none where it is sparse."""
    found = os.stat(path)
    return min(found.st_size, 512 * getattr(found, "st_blocks", found.st_size))


def arrays(path: PathLike) -> dict[str, NDArray[Any]]:
    """The arrays of an .npz file, by name.

    Raises
    ------
    ValueError
        If it is none, has more than `MOST_ARRAYS` arrays, or unpacks to more than `UNPACKED` bytes
        and `GROWTH` times its size.
    """
    with opened(path) as file:
        try:
            check_unpacked(file, max(UNPACKED, GROWTH * on_disk(path)))
            with np.load(file, allow_pickle=False) as archive:
                return {name: archive[name] for name in archive.files}
        except Exception as error:  # whatever archives and headers make of spoilt bytes
            raise ValueError(
                f"{path}: cannot be read ({_reason(error)}); make the result anew"
            ) from None


def parsed(path: PathLike) -> Any:
    """Parsed content of a JSON file.

    Raises
    ------
    ValueError
        If it is no JSON.
    """
    found = text(path)
    try:
        return json.loads(found)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path}: no JSON ({_reason(error)}); make the result anew") from None


_BINARY = getattr(os, "O_BINARY", 0)


def check_unpacked(file: BinaryIO, limit: float) -> None:
    """Refuse an archive whose members are too many, or unpack to more than `limit` bytes, and
    members that are shorter than the arrays that their headers tell of.

    Raises
    ------
    ValueError
        If it is such a one; other exceptions if it is no archive of arrays.
    """
    with zipfile.ZipFile(file) as archive:
        members = archive.infolist()
        if len(members) > MOST_ARRAYS:
            raise ValueError(f"holds {len(members):,} arrays, the limit is {MOST_ARRAYS:,}")
        total = sum(member.file_size for member in members)
        if total > limit:  # before any header is read, which may be as long as its member
            raise ValueError(
                f"unpacks to {total / 1e6:,.0f} MB, the limit is {limit / 1e6:,.0f} MB"
            )
        for member in members:
            with archive.open(member) as start:
                version = np.lib.format.read_magic(start)
                read = getattr(np.lib.format, f"read_array_header_{version[0]}_0")
                shape, _, kind = read(start)
            told = kind.itemsize * int(np.prod(shape, dtype=object))
            if told > member.file_size:
                raise ValueError(f"'{member.filename}' is shorter than its header tells")
    file.seek(0)


def _reason(error: BaseException) -> str:
    said = getattr(error, "strerror", None) or " ".join(str(error).split())
    return said[:200] or type(error).__name__
