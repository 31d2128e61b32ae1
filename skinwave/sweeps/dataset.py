"""Rows of a sweep on disk: small Parquet files in one folder, read as one table.

Each file is written aside and renamed, so that what is there is whole, and none is ever rewritten.
One sweep at a time writes into a folder.
"""

import json
import os
import secrets
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from meshes import reading
from skinwave.results import outputs, record
from skinwave.results.outputs import output_file
from skinwave.system.plain_text import csv_table

ROWS, CSV = "rows", "rows.csv"  # the folder of the files within that of a sweep; its table
LOCK = ".lock"  # among the rows, of the sweep that writes them
FROM_PYTHON = {"typed": "", "name": "sweep", "options": {}}  # the command of a sweep without one
LARGEST = 500_000_000  # bytes of one file
MOST_ROWS = 1_000_000  # of one file
KEY, INDEX = "key", "index"  # columns: a row's name, and its place in the design

Row = Mapping[str, Any]


def open_folder(out: Path, command: Mapping[str, Any] | None = None) -> Path:
    """The folder of a sweep, made if it is new, with a record of the `command`; a ValueError if it
    is something else.
    """
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        check_folder(out)
        return out
    (out / ROWS).mkdir(parents=True)
    record.write(out, command or FROM_PYTHON)
    return out


def check_folder(out: Path) -> None:
    """Refuse a folder that is not that of a sweep; raises a ValueError."""
    try:
        name = record.read(out)["command"]["name"]
    except (ValueError, KeyError):
        name = ""
    if name != "sweep" or not (out / ROWS).is_dir():
        raise ValueError(f"{out} exists and holds no sweep; choose another folder")


@contextmanager
def locked(out: Path) -> Iterator[None]:
    """Hold the rows of a folder; the system releases them however the process ends. Raises a
    ValueError if another sweep holds them.
    """
    with open(out / ROWS / LOCK, "ab") as file:
        try:
            _lock(file.fileno())
        except OSError:
            raise ValueError(
                f"another sweep writes into {out}; wait for its end, or choose another --out"
            ) from None
        yield


def _lock(descriptor: int) -> None:
    if sys.platform == "win32":
        import msvcrt

        msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
    else:
        import fcntl

        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


def append(out: Path, rows: Sequence[Row]) -> None:
    """Add rows as a file of their own, all or none; cells may be missing."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    names = dict.fromkeys(name for row in rows for name in row)
    table = pa.table({name: [row.get(name) for row in rows] for name in names})
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink)
    # Another sweep into the same folder may hold other rows after the same first one.
    with output_file(out / ROWS / f"part-{rows[0][KEY]}-{secrets.token_hex(4)}.parquet") as file:
        file.write(sink.getvalue())


def read(out: Path) -> list[dict[str, Any]]:
    """All rows, each once, in the order of the design, with the columns of all of them.

    Raises
    ------
    ValueError
        If there are none, or they cannot be read.
    """
    rows = list({row[KEY]: row for row in _table(out).to_pylist()}.values())
    if not rows:
        raise ValueError(f"{out} holds no rows of a sweep; name the folder of one")
    return sorted(rows, key=lambda row: row[INDEX])


def names(out: Path) -> dict[str, int]:
    """The names of the rows that are there, and the index of each."""
    table = _table(out).select([KEY, INDEX])
    return dict(zip(table[KEY].to_pylist(), table[INDEX].to_pylist(), strict=True))


def numbered(wanted: Iterable[str], there: Mapping[str, int]) -> dict[str, int]:
    """The index of each wanted row, its place in the design; what is added to the rows of another
    design comes after these.
    """
    places = {name: k for k, name in enumerate(wanted)}
    if all(places.get(name) == index for name, index in there.items()):
        return places
    first = 1 + max(there.values())
    return {name: first + k for k, name in enumerate(n for n in places if n not in there)}


def _table(out: Path) -> Any:
    """The rows of all files; a ValueError if they are no table of a sweep."""
    import pyarrow as pa

    empty = pa.table({KEY: pa.array([], pa.string()), INDEX: pa.array([], pa.int64())})
    try:
        parts = [_part(part) for part in sorted((out / ROWS).glob("part-*.parquet"))]
        return pa.concat_tables([empty, *parts], promote_options="permissive")
    except (OSError, KeyError, ValueError, pa.ArrowException) as error:
        said = " ".join(str(error).split())[:200]
        raise ValueError(f"{out} cannot be read ({said}); choose the folder of a sweep") from None


def _part(path: Path) -> Any:
    import pyarrow as pa
    import pyarrow.parquet as pq

    file = pq.ParquetFile(pa.BufferReader(reading.read_bytes(path, LARGEST)))
    if file.metadata.num_rows > MOST_ROWS:
        raise ValueError(f"{path.name} has {file.metadata.num_rows:,} rows, as no sweep writes")
    table = file.read()
    is_named = pa.types.is_string(table[KEY].type) and pa.types.is_integer(table[INDEX].type)
    if not is_named or table[KEY].null_count or table[INDEX].null_count:
        raise ValueError(f"a row has no {KEY} or no {INDEX}")
    return table


def csv_of(rows: Iterable[Row]) -> bytes:
    """Rows as CSV: as read, but one column for each probe of what is told at all of them."""
    flat = [dict(each for name, value in row.items() for each in _cells(name, value))
            for row in rows]  # fmt: skip
    columns = list(dict.fromkeys(name for row in flat for name in row))
    return csv_table(columns, ([row.get(name) for name in columns] for row in flat))


def _cells(name: str, value: Any) -> Iterable[tuple[str, Any]]:
    if isinstance(value, list):
        return [(f"{name}[{k}]", x) for k, x in enumerate(value)]
    return [(name, value)]


def write_beside(out: Path, files: Mapping[str, bytes]) -> None:
    """Write files beside the rows, and list them in the folder's record; raises a ValueError as
    `refuse_changed` does.
    """
    refuse_changed(out, files)
    for name, content in files.items():
        (out / name).parent.mkdir(exist_ok=True)
        with output_file(out / name, overwrite=True) as file:
            file.write(content)
    digests = {name: outputs.digest(out / name) for name in files}
    listed = (outputs.listed_files(out) or {}) | digests
    with output_file(out / record.FILE, overwrite=True) as file:
        file.write(json.dumps(record.read(out) | {outputs.FILES: listed}, indent=1).encode())


def refuse_changed(out: Path, names: Iterable[str]) -> None:
    """Refuse to replace files that are not as this program wrote them; raises a ValueError."""
    known = outputs.listed_files(out) or {}
    for name in names:
        path = out / name
        if os.path.lexists(path) and not outputs.is_as_listed(path, known.get(name)):
            raise ValueError(
                f"{path} was added or changed since skinwave wrote it and is kept; move it "
                "elsewhere"
            )
