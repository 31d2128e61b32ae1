"""Output folders and files, written under a temporary name and then renamed.

A folder is replaced only if skinwave wrote every file in it, which its record.json lists.
"""

import hashlib
import json
import os
import secrets
import shlex
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from skinwave.results import record

FILES = "files"  # key in record.json: path below its folder -> SHA-256


@contextmanager
def output_folder(
    out: Path, *, overwrite: bool = False, inputs: Iterable[str | Path] = ()
) -> Iterator[Path]:
    """Yield a temporary folder, which is renamed to `out` at the end.

    Raises a ValueError if `out` exists and may not be replaced, or contains one of the `inputs`. An
    error removes the temporary folder and leaves `out` untouched. An interrupt keeps it if it
    contains finished runs, and prints its name.
    """
    out = Path(os.path.realpath(out))  # a link stays a link to the result
    _check_replaceable(out, overwrite, inputs)
    out.parent.mkdir(parents=True, exist_ok=True)
    partial, is_kept = temporary_path(out, "partial"), False
    partial.mkdir()
    try:
        yield partial
        seal(partial)
        is_kept = True  # a complete result is not lost, even if the target has changed meanwhile
        _put_in_place(partial, out, overwrite)
    except KeyboardInterrupt:
        is_kept = any(partial.rglob(record.FILE))
        if not is_kept:
            raise
        command = shlex.join(["skinwave", "report", str(partial)])
        raise KeyboardInterrupt(
            f"finished runs are kept in {partial}; {command} makes a page of them"
        ) from None
    finally:
        if not is_kept:
            shutil.rmtree(partial, ignore_errors=True)


@contextmanager
def output_path(
    out: Path, *, overwrite: bool = False, inputs: Iterable[str | Path] = ()
) -> Iterator[Path]:
    """Yield a temporary path with the same suffix, which is renamed to `out` at the end. After an
    error there is no file. Raises a ValueError if `out` may not be overwritten or is one of the
    `inputs`.
    """
    out = Path(os.path.realpath(out))
    if out.is_dir():
        raise ValueError(f"{out} is a folder. Give the name of a file")
    if os.path.lexists(out) and not overwrite:
        raise ValueError(f"{out} exists. Give --overwrite to replace it, or another name")
    if any(os.path.exists(path) and os.path.samefile(path, out) for path in inputs if out.exists()):
        raise ValueError(f"{out} is an input of this command. Give another name")
    partial = temporary_path(out, "partial")
    partial = partial.with_name(partial.name + out.suffix)
    try:
        yield partial
        os.replace(partial, out)
    finally:
        partial.unlink(missing_ok=True)


@contextmanager
def output_file(
    out: Path, *, overwrite: bool = False, inputs: Iterable[str | Path] = ()
) -> Iterator[IO[bytes]]:
    """Yield a file opened for writing; like `output_path` in other respects."""
    with output_path(out, overwrite=overwrite, inputs=inputs) as path, open(path, "xb") as file:
        yield file


def temporary_path(out: Path, kind: str) -> Path:
    """Return an unused path in the folder of `out`."""
    longest_prefix = 50  # characters of the target's name in a temporary name
    return out.with_name(f"{out.name[:longest_prefix]}.{kind}-{secrets.token_hex(4)}")


def seal(folder: Path) -> None:
    """List every file below a folder in its record.json."""
    listed = {
        path.relative_to(folder).as_posix(): digest(path)
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path != folder / record.FILE
    }
    content = record.read(folder) | {FILES: listed}
    (folder / record.FILE).write_text(json.dumps(content, indent=1), encoding="utf-8")


def digest(path: Path) -> str:
    """Return the SHA-256 of a file."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def listed_files(folder: Path) -> dict[str, str] | None:
    """Return the SHA-256 of a result's files by path, or None if the folder is not a result."""
    try:
        listed = record.read(folder).get(FILES)
    except ValueError:
        return None
    return listed if isinstance(listed, dict) else None


def foreign_file(folder: Path) -> Path | None:
    """Return the first file below a folder that was added or changed after skinwave wrote it. A
    report within the folder has a list of its own.
    """
    records, listed = set[Path](), dict[Path, str]()
    report = "report"  # folder that the command `report` makes within a result
    for home in (folder, folder / report):
        if (digests := listed_files(home)) is not None:
            records.add(home / record.FILE)
            listed |= {home / name: sha for name, sha in digests.items()}
    system_files = (".DS_Store", "Thumbs.db", "desktop.ini")  # written by file browsers
    for path in sorted(folder.rglob("*")):
        ours = path.name in system_files or path in records or is_unchanged(path, listed.get(path))
        if not ours and (path.is_symlink() or not path.is_dir()):
            return path
    return None


def is_unchanged(path: Path, sha: object) -> bool:
    """Whether a path is a regular file, not a link, with this SHA-256."""
    return path.is_file() and not path.is_symlink() and digest(path) == sha


def _check_replaceable(out: Path, overwrite: bool, inputs: Iterable[str | Path]) -> None:
    """Raise a ValueError if a target exists, unless it is skinwave's own and may be replaced."""
    try:
        out.lstat()  # raises an OSError now if the name is too long
    except FileNotFoundError:
        return
    if not overwrite:
        raise ValueError(f"{out} exists. Give --overwrite to replace it, or another --out")
    if not out.is_dir():
        raise ValueError(f"{out} is a file. Give a folder with --out")
    for used in (Path.cwd(), *(path for path in inputs if path)):
        real = Path(os.path.realpath(used))
        if real.exists() and any(parent.samefile(out) for parent in (real, *real.parents)):
            raise ValueError(f"{out} contains {used}, which is in use. Give another --out")
    if any(out.iterdir()) and listed_files(out) is None:
        raise ValueError(
            f"{out} was not written by skinwave (no {record.FILE} lists its files). Remove it, or "
            "give another --out"
        )
    if (path := foreign_file(out)) is not None:
        raise ValueError(
            f"{out} contains {path.relative_to(out)}, which skinwave did not write or which was "
            "changed. Move the file, or give another --out"
        )


def _put_in_place(partial: Path, out: Path, overwrite: bool) -> None:
    """Rename a folder to `out`; an old `out` is removed if it may be replaced."""
    old = temporary_path(out, "replaced")
    try:
        _check_replaceable(out, overwrite, ())
        if out.exists():
            out.rename(old)
        partial.rename(out)
    except (OSError, ValueError) as error:
        if old.exists() and not os.path.lexists(out):
            old.rename(out)
        raise ValueError(
            f"{out} cannot be replaced ({error}). The result was kept in {partial}"
        ) from None
    shutil.rmtree(old, ignore_errors=True)
