"""Rows of a sweep on disk: small Parquet files in one folder, read as one table.

Each file is written under another name and then renamed, so that it is complete; no file is
rewritten. One sweep at a time writes into a folder.
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

ROWS, CSV = "rows", "rows.csv"  # folder of the files, and the table as CSV, in that of a sweep
LOCK = ".lock"  # file in the folder of rows
FROM_PYTHON = {"typed": "", "name": "sweep", "options": {}}  # command of a sweep in Python
LARGEST_FILE = 500_000_000  # bytes
MOST_ROWS = 1_000_000  # of one file
KEY, INDEX = "key", "index"  # columns: a row's name, and its place in the design

Row = Mapping[str, Any]


def open_folder(out: Path, command: Mapping[str, Any] | None = None) -> Path:
    """Return the folder of a sweep; make it, with a record of the `command`, if it is new.

    Raises a ValueError if the folder exists and contains something else.
    """
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        check_folder(out)
        return out
    (out / ROWS).mkdir(parents=True)
    record.write(out, command or FROM_PYTHON)
    return out


def check_folder(out: Path) -> None:
    """Raise a ValueError if a folder is not that of a sweep."""
    try:
        name = record.read(out)["command"]["name"]
    except (ValueError, KeyError):
        name = ""
    if name != "sweep" or not (out / ROWS).is_dir():
        raise ValueError(f"{out} exists, but contains no sweep; choose another folder")


@contextmanager
def lock_rows(out: Path) -> Iterator[None]:
    """Lock the rows of a folder; raise a ValueError if another sweep has locked them.

    The operating system releases the lock however the process ends.
    """
    with open(out / ROWS / LOCK, "ab") as file:
        try:
            _lock(file.fileno())
        except OSError:
            raise ValueError(
                f"another sweep writes into {out}; wait until it ends, or choose another --out"
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
    """Write rows to a new file; cells may be missing."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    names = dict.fromkeys(name for row in rows for name in row)
    table = pa.table({name: [row.get(name) for row in rows] for name in names})
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink)
    # Another sweep into the same folder may write other rows after the same first one.
    with output_file(out / ROWS / f"part-{rows[0][KEY]}-{secrets.token_hex(4)}.parquet") as file:
        file.write(sink.getvalue())


def read(out: Path) -> list[dict[str, Any]]:
    """Return all rows once, in the order of the design; raise a ValueError if there are none."""
    rows = list({row[KEY]: row for row in _table(out).to_pylist()}.values())
    if not rows:
        raise ValueError(f"{out} contains no rows of a sweep; name the folder of a sweep")
    return sorted(rows, key=lambda row: row[INDEX])


def failures_of(rows: Iterable[Row]) -> dict[str, str]:
    """Return the reason of each failed run."""
    return {f"run {row['index']}": row["error"] for row in rows if row["status"] == "failed"}


def names(out: Path) -> dict[str, int]:
    """Return the index of each row by its name."""
    table = _table(out).select([KEY, INDEX])
    return dict(zip(table[KEY].to_pylist(), table[INDEX].to_pylist(), strict=True))


def number_rows(wanted: Iterable[str], earlier: Mapping[str, int]) -> dict[str, int]:
    """Return the index of each wanted row: its place in the design, after rows of other designs."""
    places = {name: k for k, name in enumerate(wanted)}
    if all(places.get(name) == index for name, index in earlier.items()):
        return places
    first = 1 + max(earlier.values())
    return {name: first + k for k, name in enumerate(n for n in places if n not in earlier)}


def _table(out: Path) -> Any:
    """Return the rows of all files; raise a ValueError if they are not rows of a sweep."""
    import pyarrow as pa

    empty = pa.table({KEY: pa.array([], pa.string()), INDEX: pa.array([], pa.int64())})
    try:
        parts = [_part(part) for part in sorted((out / ROWS).glob("part-*.parquet"))]
        return pa.concat_tables([empty, *parts], promote_options="permissive")
    except (OSError, KeyError, ValueError, pa.ArrowException) as error:
        cause = " ".join(str(error).split())[:200]
        raise ValueError(f"{out} cannot be read ({cause}); name the folder of a sweep") from None


def _part(path: Path) -> Any:
    import pyarrow as pa
    import pyarrow.parquet as pq

    file = pq.ParquetFile(pa.BufferReader(reading.read_bytes(path, LARGEST_FILE)))
    if file.metadata.num_rows > MOST_ROWS:
        raise ValueError(
            f"{path.name} has {file.metadata.num_rows:,} rows; a sweep writes at most {MOST_ROWS:,}"
        )
    table = file.read()
    is_named = pa.types.is_string(table[KEY].type) and pa.types.is_integer(table[INDEX].type)
    if not is_named or table[KEY].null_count or table[INDEX].null_count:
        raise ValueError(f"a row of {path.name} has no {KEY} or no {INDEX}")
    return table


def csv_of(rows: Iterable[Row]) -> bytes:
    """Return rows as CSV; a list becomes one column for each probe."""
    flat = [dict(each for name, value in row.items() for each in _cells(name, value))
            for row in rows]  # fmt: skip
    columns = list(dict.fromkeys(name for row in flat for name in row))
    return csv_table(columns, ([row.get(name) for name in columns] for row in flat))


def _cells(name: str, value: Any) -> Iterable[tuple[str, Any]]:
    if isinstance(value, list):
        return [(f"{name}[{k}]", x) for k, x in enumerate(value)]
    return [(name, value)]


def write_beside(out: Path, files: Mapping[str, bytes]) -> None:
    """Write files into the folder of a sweep and list them in its record; see `check_own_files`."""
    check_own_files(out, files)
    for name, content in files.items():
        (out / name).parent.mkdir(exist_ok=True)
        with output_file(out / name, overwrite=True) as file:
            file.write(content)
    digests = {name: outputs.digest(out / name) for name in files}
    listed = (outputs.listed_files(out) or {}) | digests
    with output_file(out / record.FILE, overwrite=True) as file:
        file.write(json.dumps(record.read(out) | {outputs.FILES: listed}, indent=1).encode())


def check_own_files(out: Path, names: Iterable[str]) -> None:
    """Raise a ValueError if a file to be replaced was not written by skinwave, or was changed."""
    known = outputs.listed_files(out) or {}
    for name in names:
        path = out / name
        if os.path.lexists(path) and not outputs.is_unchanged(path, known.get(name)):
            raise ValueError(
                f"{path} was added or changed since skinwave wrote it and is not replaced; move it "
                "elsewhere"
            )
