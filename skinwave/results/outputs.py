"""Output folders and files: written under another name beside the target, then renamed.

A folder is replaced only if this program wrote it and everything in it: its record.json lists the
files that were written beside it.
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
REPORT = "report"  # the folder that the command of that name makes within a result
OF_SYSTEM = (".DS_Store", "Thumbs.db", "desktop.ini")  # written by file browsers
LONGEST = 50  # characters of a name that a temporary one begins with


@contextmanager
def output_folder(
    out: Path, *, overwrite: bool = False, inputs: Iterable[str | Path] = ()
) -> Iterator[Path]:
    """Yield a folder to write in, which becomes `out` when all is written; a ValueError if that
    exists and may not be replaced. `inputs`, which the command reads, are never replaced.

    Until then its name is `<out>.partial-` and eight digits. An error removes it and leaves `out`
    untouched. An interrupt keeps it if it holds finished runs, and says so.
    """
    out = Path(os.path.realpath(out))  # a link remains one, and points to what is written
    _refuse_folder(out, overwrite, inputs)
    out.parent.mkdir(parents=True, exist_ok=True)
    aside, kept = beside(out, "partial"), False
    aside.mkdir()
    try:
        yield aside
        seal(aside)
        kept = True  # a whole result is not lost, whatever happened to the target meanwhile
        _put_in_place(aside, out, overwrite)
    except KeyboardInterrupt:
        kept = any(aside.rglob(record.FILE))
        if not kept:
            raise
        command = shlex.join(["skinwave", "report", str(aside)])
        raise KeyboardInterrupt(
            f"the runs that were finished are kept in {aside}; {command} makes a page of them"
        ) from None
    finally:
        if not kept:
            shutil.rmtree(aside, ignore_errors=True)


@contextmanager
def output_path(
    out: Path, *, overwrite: bool = False, inputs: Iterable[str | Path] = ()
) -> Iterator[Path]:
    """Yield a path of the same suffix; what is written there becomes `out`, or leaves no trace. A
    ValueError if `out` exists and may not be overwritten, or is one of the command's `inputs`.
    """
    out = Path(os.path.realpath(out))
    if out.is_dir():
        raise ValueError(f"{out} is a folder; name a file")
    if os.path.lexists(out) and not overwrite:
        raise ValueError(f"{out} exists and is kept; pass --overwrite or choose another")
    if any(os.path.exists(path) and os.path.samefile(path, out) for path in inputs if out.exists()):
        raise ValueError(f"{out} is read by this command; choose another")
    aside = beside(out, "partial").with_suffix(out.suffix)
    try:
        yield aside
        os.replace(aside, out)
    finally:
        aside.unlink(missing_ok=True)


@contextmanager
def output_file(
    out: Path, *, overwrite: bool = False, inputs: Iterable[str | Path] = ()
) -> Iterator[IO[bytes]]:
    """Yield a file to write to, which becomes `out` as that of `output_path` does."""
    with output_path(out, overwrite=overwrite, inputs=inputs) as aside, open(aside, "xb") as file:
        yield file


def beside(out: Path, what: str) -> Path:
    """Return a new path in the folder of `out`, which no other process has."""
    return out.with_name(f"{out.name[:LONGEST]}.{what}-{secrets.token_hex(4)}")


def seal(folder: Path) -> None:
    """Enter every file below a folder in its record.json, once all is written."""
    listed = {
        path.relative_to(folder).as_posix(): digest(path)
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path != folder / record.FILE
    }
    content = record.read(folder) | {FILES: listed}
    (folder / record.FILE).write_text(json.dumps(content, indent=1), encoding="utf-8")


def digest(path: Path) -> str:
    """SHA-256 of a file's content."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def listed_files(folder: Path) -> dict[str, str] | None:
    """SHA-256 by path of the files that a folder was written with; None if it is no result."""
    try:
        found = record.read(folder).get(FILES)
    except ValueError:
        return None
    return found if isinstance(found, dict) else None


def foreign_file(folder: Path) -> Path | None:
    """The first file below a folder that was added or changed since this program wrote it.

    A report within it has a list of its own.
    """
    records, listed = set[Path](), dict[Path, str]()
    for home in (folder, folder / REPORT):
        if (known := listed_files(home)) is not None:
            records.add(home / record.FILE)
            listed |= {home / name: found for name, found in known.items()}
    for path in sorted(folder.rglob("*")):
        ours = path.name in OF_SYSTEM or path in records or is_as_listed(path, listed.get(path))
        if not ours and (path.is_symlink() or not path.is_dir()):
            return path
    return None


def is_as_listed(path: Path, entry: object) -> bool:
    """Whether a path is a regular file, no link, with the content that its entry in a list has."""
    return path.is_file() and not path.is_symlink() and digest(path) == entry


def _refuse_folder(out: Path, overwrite: bool, inputs: Iterable[str | Path]) -> None:
    """Refuse a target that exists, unless it may be replaced and holds nothing of the user's."""
    try:
        out.lstat()  # refuses a name that is too long now, not when all is computed
    except FileNotFoundError:
        return
    if not overwrite:
        raise ValueError(f"{out} exists and is kept; pass --overwrite or another --out")
    if not out.is_dir():
        raise ValueError(f"{out} is a file; choose a folder with --out")
    for used in (Path.cwd(), *(path for path in inputs if path)):
        real = Path(os.path.realpath(used))
        if real.exists() and any(parent.samefile(out) for parent in (real, *real.parents)):
            raise ValueError(f"{out} holds {used}, which is in use; choose another --out")
    if any(out.iterdir()) and listed_files(out) is None:
        raise ValueError(
            f"{out} was not written by skinwave (it has no {record.FILE} that lists its files); "
            "remove it yourself or choose another --out"
        )
    if (path := foreign_file(out)) is not None:
        raise ValueError(
            f"{out} holds {path.relative_to(out)}, which was added or changed since skinwave "
            "wrote it; move that elsewhere or choose another --out"
        )


def _put_in_place(aside: Path, out: Path, overwrite: bool) -> None:
    """Give a folder its name; what had the name is removed, if it is still wholly ours."""
    old = beside(out, "replaced")
    try:
        _refuse_folder(out, overwrite, ())
        if out.exists():
            out.rename(old)
        aside.rename(out)
    except (OSError, ValueError) as error:
        if old.exists() and not os.path.lexists(out):
            old.rename(out)
        raise ValueError(
            f"{out} cannot be replaced ({error}); this result is {aside}, rename it as you like"
        ) from None
    shutil.rmtree(old, ignore_errors=True)
