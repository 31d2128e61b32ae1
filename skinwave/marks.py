"""Marks of result folders: a record.json that lists the files written beside it.

What is not listed there, or has another size since, is the user's and is never removed.
"""

import json
import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from skinwave import record

FILES = "files"  # key in record.json: path below its folder -> size in bytes
OF_SYSTEM = (".DS_Store", "Thumbs.db", "desktop.ini")  # which file browsers leave anywhere


def seal(folder: Path) -> None:
    """Enter every file below a folder in its record.json, once all is written.

    Raises
    ------
    ValueError
        If the folder has no record.
    """
    listed = {
        path.relative_to(folder).as_posix(): path.stat().st_size
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path != folder / record.FILE
    }
    kept = record.read(folder) | {FILES: listed}
    (folder / record.FILE).write_text(json.dumps(kept, indent=1), encoding="utf-8")


def listed(folder: Path) -> dict[str, int] | None:
    """Size in bytes by path of the files that a folder was written with; None without a mark."""
    try:
        found = record.read(folder).get(FILES)
    except ValueError:
        return None
    return found if isinstance(found, dict) else None


def foreign(folder: Path) -> Path | None:
    """The first file below a marked folder that was added or changed since; None if all are as
    they were written. A marked folder within it, such as its report, has a list of its own.
    """
    return next(_foreign(folder, folder, {}), None)


def _foreign(folder: Path, marked: Path, known: Mapping[str, int]) -> Iterator[Path]:
    own = listed(folder)
    if own is not None:
        marked, known = folder, own
    for path in sorted(folder.iterdir()):
        if path.is_dir() and not path.is_symlink():
            yield from _foreign(path, marked, known)
        elif path.name not in OF_SYSTEM and not (own is not None and path.name == record.FILE):
            size = known.get(path.relative_to(marked).as_posix())
            if path.is_symlink() or size != path.stat().st_size:
                yield path


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
