"""Reading of users' files: regular files of limited size, with any content."""

import codecs
import json
import os
import re
import stat
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, BinaryIO

import numpy as np

from meshes.typing import Array

LARGEST_TEXT = 16_000_000  # bytes

_CONTROL = re.compile(r"[\x00-\x08\x0e-\x1f\x7f]")  # characters that text files do not have

_SIGNATURES = {  # first bytes of files that users take for text
    b"\x89PNG": "a PNG picture", b"\xff\xd8\xff": "a JPEG picture", b"GIF8": "a GIF picture",
    b"%PDF": "a PDF document", b"PK": "a ZIP archive, as of Excel or NumPy", b"RIFF": "a WAV file",
    b"\x1f\x8b": "a gzip archive", b"\x89HDF": "an HDF5 file", b"MATLAB 5": "a MATLAB file",
    b"\x93NUMPY": "a NumPy array", b"TDSm": "a TDMS file", b"glTF": "a glTF surface",
}  # fmt: skip

PathLike = str | os.PathLike[str]


@contextmanager
def naming(path: PathLike) -> Iterator[None]:
    """Raise a ValueError again with its message on one line, after the path unless it has it."""
    try:
        yield
    except ValueError as error:
        text = " ".join(str(error).split())
        raise ValueError(text if text.startswith(str(path)) else f"{path}: {text}") from None


@contextmanager
def open_regular(path: PathLike, limit: float = np.inf) -> Iterator[BinaryIO]:
    """Open a regular file of at most `limit` bytes, or raise a ValueError."""
    binary = getattr(os, "O_BINARY", 0)
    try:  # without blocking, because a pipe may have no writer
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | binary)
    except (OSError, ValueError) as error:
        raise ValueError(f"{path}: cannot be read ({_reason(error)}); check the path") from None
    status = os.fstat(handle)
    if not stat.S_ISREG(status.st_mode):
        os.close(handle)
        raise ValueError(f"{path}: cannot be read (it is not a regular file); check the path")
    with os.fdopen(handle, "rb") as file:
        if status.st_size > limit:
            raise ValueError(
                f"{path}: the file exceeds the limit of {limit / 1e6:g} MB; check the path"
            )
        yield file


def read_bytes(path: PathLike, limit: int) -> bytes:
    """Return the bytes of a regular file of at most `limit` bytes."""
    with open_regular(path, limit) as file:
        try:
            return file.read(limit + 1)
        except OSError as error:
            raise ValueError(f"{path}: cannot be read ({_reason(error)}); check it") from None


def read_text(path: PathLike, must: str = "text in UTF-8") -> str:
    """Return the UTF-8 text of a file; see `decode`."""
    content = read_bytes(path, LARGEST_TEXT)
    with naming(path):
        return decode(content, must)


def decode(content: bytes, must: str = "text in UTF-8") -> str:
    """Return UTF-8 text without a byte order mark; raise a ValueError for other content, which says
    what the file is if it is binary, and what it `must` be.
    """
    with suppress(UnicodeDecodeError):
        if "\0" not in (decoded := content.decode("utf-8-sig")):
            return decoded
    start = content[:1000].decode("latin-1").replace("\0", "")  # UTF-16 has zeros
    is_binary = _CONTROL.search(start) is not None
    kinds = (kind for signature, kind in _SIGNATURES.items() if content.startswith(signature))
    if kind := next(kinds, "a binary file" if is_binary else ""):
        raise ValueError(f"the file is {kind}, not {must}; check the path")
    raise ValueError("the file is not UTF-8 text; save it as UTF-8")


def read_exported_text(path: PathLike, limit: int = LARGEST_TEXT) -> str:
    """Return the text of an exported file, in UTF-8, UTF-16, or the Latin-1 of Windows."""
    raw = read_bytes(path, limit)
    encodings = ["utf-8-sig", "cp1252", "latin-1"]
    if raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        encodings = ["utf-16"]
    elif b"\0" in raw[:2000] and not len(raw) % 2:
        encodings = ["utf-16-le" if raw[1:2] == b"\0" else "utf-16-be"]
    for encoding in encodings:
        try:
            decoded = raw.decode(encoding)
        except UnicodeDecodeError:
            continue
        if not _CONTROL.search(decoded):
            return decoded
        break
    raise ValueError(f"{path}: the file is not text; export it as UTF-8 text, or give its format")


def load_arrays(path: PathLike, most: int = 500_000_000) -> dict[str, Array]:
    """Return the arrays of an .npz file by name; raise a ValueError if it unpacks to more than
    `most` bytes and to eight times its size.
    """
    with open_regular(path) as file:
        try:
            limit = max(most, 8 * os.fstat(file.fileno()).st_size)
            with zipfile.ZipFile(file) as archive:
                size = sum(member.file_size for member in archive.infolist())
            if size > limit:
                raise ValueError(
                    f"unpacks to {size / 1e6:,.0f} MB, more than {limit / 1e6:,.0f} MB"
                )
            file.seek(0)
            with np.load(file, allow_pickle=False) as archive:
                return {name: archive[name] for name in archive.files}
        except Exception as error:  # damaged archives raise many types
            raise ValueError(f"{path}: cannot be read ({_reason(error)}); write it again") from None


def load_json(path: PathLike) -> Any:
    """Return the content of a JSON file; raise a ValueError if it is not valid JSON."""
    try:
        return json.loads(read_text(path))
    except (ValueError, RecursionError) as error:
        raise ValueError(
            f"{path}: not valid JSON ({_reason(error)}); compute the result again"
        ) from None


def _reason(error: BaseException) -> str:
    text = getattr(error, "strerror", None) or " ".join(str(error).split())
    return text[:200] or type(error).__name__
