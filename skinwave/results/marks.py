"""Marks of result folders: a record.json that lists the files written beside it.

What is not listed there, or has other content since, is the user's and is never removed.
"""

import hashlib
import json
import os
from collections.abc import Iterable, Iterator
from pathlib import Path

from skinwave.results import record

FILES = "files"  # key in record.json: path below its folder -> SHA-256; once, size in bytes
REPORT = "report"  # the command, and the folder that it makes within a result
DEEPEST = 100  # levels of folders below a result; none that is written has as many
OF_SYSTEM = (".DS_Store", "Thumbs.db", "desktop.ini")  # which file browsers leave anywhere


def seal(folder: Path) -> None:
    """Enter every file below a folder in its record.json, once all is written.

    Raises
    ------
    ValueError
        If the folder has no record.
    """
    listed = {
        path.relative_to(folder).as_posix(): digest(path)
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path != folder / record.FILE
    }
    kept = record.read(folder) | {FILES: listed}
    (folder / record.FILE).write_text(json.dumps(kept, indent=1), encoding="utf-8")


def digest(path: Path) -> str:
    """SHA-256 of a file's content."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def listed(folder: Path) -> dict[str, str | int] | None:
    """SHA-256 by path of the files that a folder was written with, or the size in bytes that
    was listed before; None without a mark.
    """
    try:
        found = record.read(folder).get(FILES)
    except ValueError:
        return None
    return found if isinstance(found, dict) else None


def foreign(folder: Path) -> Path | None:
    """The first file below a marked folder that was added or changed since; None if all are as
    they were written. Another result within it is such an addition, but for a report of it, which
    has a list of its own.
    """
    return next(_foreign(folder), None)


def is_as_listed(path: Path, entry: object) -> bool:
    """Whether a path is a regular file, no link, with the content that its entry in a list has."""
    if path.is_symlink() or not path.is_file():
        return False
    try:
        found = path.stat().st_size if isinstance(entry, int) else digest(path)
    except OSError:  # what cannot be read is not known to be as it was
        return False
    return found == entry


def _foreign(folder: Path) -> Iterator[Path]:
    waiting = [(folder, folder, listed(folder) or {})]
    while waiting:
        place, marked, known = waiting.pop()
        for path in sorted(place.iterdir()):
            name = path.relative_to(marked).as_posix()
            if path.is_dir() and not path.is_symlink():
                own = _list_of_report(path) if (place / record.FILE).exists() else None
                waiting.append((path, marked, known) if own is None else (path, path, own))
                if name.count("/") >= DEEPEST:
                    yield path
            elif (
                path.name not in OF_SYSTEM
                and name != record.FILE
                and not is_as_listed(path, known.get(name))
            ):
                yield path


def _list_of_report(folder: Path) -> dict[str, str | int] | None:
    """The list of a report drawn of the result it lies in; one of a scene holds runs, too."""
    if folder.name != REPORT or (own := listed(folder)) is None:
        return None
    found = record.read(folder)
    return own if found["command"]["name"] == REPORT and found["scene"] is None else None


def refuse_unmarked(out: Path, inputs: Iterable[str | Path] = ()) -> None:
    """Refuse to replace a folder unless it is empty or wholly written by this program.

    Raises
    ------
    ValueError
        If it carries no mark, holds a file of the user's, or one of the `inputs` of the command.
    """
    for path in inputs:
        if path and within(path, out):
            raise ValueError(f"{out} holds {path}, which this command reads; choose another --out")
    if not any(out.iterdir()):
        return
    if listed(out) is None:
        raise ValueError(
            f"{out} was not written by skinwave (it has no {record.FILE} that lists its files); "
            "remove it yourself or choose another --out"
        )
    if (found := foreign(out)) is not None:
        raise ValueError(
            f"{out} holds {found.relative_to(out)}, which was added or changed since skinwave "
            "wrote it; move that elsewhere or choose another --out"
        )


def within(path: str | Path, folder: Path) -> bool:
    """Whether something that exists is a folder or lies below it, whatever either is called."""
    real = Path(os.path.realpath(path))
    both = real.exists() and folder.exists()
    return both and any(p.samefile(folder) for p in (real, *real.parents))
