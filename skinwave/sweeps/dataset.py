"""Rows of a sweep on disk: small Parquet files in one folder, read as one table.

Each file is written aside and renamed, so that what is there is whole, and none is ever rewritten.
One sweep at a time writes into a folder. A folder with other files among the rows is refused.
"""

import json
import os
import secrets
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from meshes import reading
from skinwave.results import outputs, record
from skinwave.results.outputs import output_file
from skinwave.system.plain_text import csv_table

LOCK = ".lock"  # among the rows, of the sweep that writes them
ROWS, CSV = "rows", "rows.csv"  # the folder of the files within that of a sweep; its table
OWN = (ROWS, CSV, "figures", record.FILE)  # what a sweep's folder holds
UNKNOWN = {"typed": "", "name": "sweep", "options": {}}  # the command of a folder without record
LARGEST = 500_000_000  # bytes of one file
UNPACKED = 250_000_000  # bytes of the columns that are read, of all files
BATCH = 1000  # rows that are decoded at once
WIDTHS = {"DOUBLE": 8, "INT64": 8, "BOOLEAN": 1 / 8}  # bytes of a value, decoded; others 4
MOST_ROWS, MOST_COLUMNS = 1_000_000, 1000  # of one file
KEY, INDEX, STATUS = "key", "index", "status"  # columns: a row's name, its place, how it ended

Row = Mapping[str, Any]


def open_folder(out: Path, command: Mapping[str, Any] | None = None) -> Path:
    """The folder of a sweep, made if it is new, with a record of the `command`.

    Raises
    ------
    ValueError
        If it is something else, holds files of others among its rows, or cannot be made.
    """
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        _refuse_foreign(out)
    (out / ROWS).mkdir(parents=True, exist_ok=True)
    if not _is_recorded(out):
        record.write(out, command or UNKNOWN)
    return out


@contextmanager
def locked(out: Path) -> Iterator[None]:
    """Hold the rows of a folder of `open_folder`, which the system releases when a process ends,
    however it ends.

    Raises
    ------
    ValueError
        If another sweep holds them.
    """
    path = out / ROWS / LOCK
    try:
        file = _held(path)
    except (BlockingIOError, PermissionError):
        raise ValueError(
            f"another sweep writes into {out}; wait for its end, or choose another --out"
        ) from None
    try:
        yield
    finally:
        if sys.platform != "win32":  # where no open file can be removed
            path.unlink(missing_ok=True)
        file.close()


def _held(path: Path) -> IO[bytes]:
    """A file that this process alone has locked; an OSError if another has."""
    while True:
        file = open(path, "ab")  # noqa: SIM115, closed by who holds it
        try:
            _lock(file.fileno())
            if os.path.exists(path) and os.path.samestat(os.fstat(file.fileno()), path.stat()):
                return file
        except OSError:
            file.close()
            raise
        file.close()  # of one that has just been removed by who held it


def _lock(descriptor: int) -> None:
    if sys.platform == "win32":
        import msvcrt

        msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
    else:
        import fcntl

        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _refuse_foreign(out: Path) -> None:
    """Refuse a folder that is not that of a sweep, or whose rows are not all of sweeps."""
    if not (out / ROWS).is_dir() or not (_is_recorded(out) or _visible(out) <= {*OWN}):
        raise ValueError(f"{out} exists and holds no sweep; choose another --out")
    files = [out / ROWS / name for name in sorted(_visible(out / ROWS))]
    wrong = [p for p in files if not (p.match("part-*.parquet") and {KEY, STATUS} <= _columns(p))]
    if os.path.lexists(out / CSV) and KEY not in _header(out / CSV):
        wrong.append(out / CSV)
    if wrong:
        raise ValueError(
            f"{wrong[0]} holds no rows of a sweep; move it elsewhere or choose another --out"
        )


def _is_recorded(out: Path) -> bool:
    try:
        return bool(record.read(out)["command"]["name"] == "sweep")
    except (ValueError, KeyError):
        return False


def _visible(folder: Path) -> set[str]:
    """Names in a folder, but for what systems and killed processes leave."""
    hidden = outputs.OF_SYSTEM
    return {p.name for p in folder.iterdir() if p.name[0] != "." and p.name not in hidden}


def _header(path: Path) -> list[str]:
    """Names of the columns of a table in CSV; none of what is no regular file."""
    if not path.is_file():
        return []
    with open(path, encoding="utf-8", errors="replace") as file:
        return file.readline(10_000).strip().split(",")


def _columns(path: Path) -> set[str]:
    """Names of a Parquet file's columns; none of what is no such file."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    if not path.is_file():
        return set()
    try:
        with open(path, "rb") as file:
            return set(pq.read_schema(file).names)
    except (OSError, pa.ArrowException):
        return set()


def append(out: Path, rows: Sequence[Row], columns: Mapping[str, str]) -> None:
    """Add rows as a file of their own, all or none.

    `columns` by name are "text", "whole", "number" or, one at each probe, "numbers"; cells may be
    missing.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    types = {
        "text": pa.string(),
        "whole": pa.int64(),
        "number": pa.float64(),
        "numbers": pa.list_(pa.float64()),
    }
    schema = pa.schema([(name, types[kind]) for name, kind in columns.items()])
    table = pa.Table.from_pylist([dict(row) for row in rows], schema=schema)
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink)
    # Another sweep into the same folder may hold other rows after the same first one.
    with output_file(out / ROWS / f"part-{rows[0][KEY]}-{secrets.token_hex(4)}.parquet") as file:
        file.write(sink.getvalue())


def read(out: Path, columns: Sequence[str] = ()) -> list[dict[str, Any]]:
    """All rows, each once, in the order of the design, with the columns of all of them, or only
    those given.

    Raises
    ------
    ValueError
        If there are none, or they cannot be read.
    """
    wanted = [KEY, INDEX, *columns] if columns else None
    rows = list({row[KEY]: row for row in _table(out, wanted).to_pylist()}.values())
    if not rows:
        raise ValueError(f"{out} holds no rows of a sweep; name the folder of one")
    last = len(rows)  # rows of releases up to 0.2 have no index
    return sorted(rows, key=lambda row: last if row.get(INDEX) is None else row[INDEX])


def names(out: Path) -> dict[str, int | None]:
    """The names of the rows that are there, and the index of each."""
    if not any((out / ROWS).glob("part-*.parquet")):
        return {}
    table = _table(out, [KEY, INDEX])
    indices = table[INDEX].to_pylist() if INDEX in table.column_names else [None] * len(table)
    return dict(zip(table[KEY].to_pylist(), indices, strict=True))


def numbered(wanted: Sequence[str], there: Mapping[str, int | None]) -> dict[str, int]:
    """The index of each wanted row, its place in the design; what is added to the rows of another
    design comes after these.
    """
    places = {name: k for k, name in enumerate(wanted)}
    if all(places.get(name) == index for name, index in there.items()):
        return places
    first = 1 + max([len(there) - 1, *(index for index in there.values() if index is not None)])
    return {name: first + k for k, name in enumerate(n for n in wanted if n not in there)}


def write_csv(out: Path, rows: Iterable[Row]) -> None:
    """rows.csv: as read, but one column for each probe of what is told at all of them."""
    flat = [dict(each for name, value in row.items() for each in _cells(name, value))
            for row in rows]  # fmt: skip
    columns = list(dict.fromkeys(name for row in flat for name in row))
    table = csv_table(columns, ([row.get(name) for name in columns] for row in flat))
    refuse_changed(out, CSV)
    with output_file(out / CSV, overwrite=True) as file:
        file.write(table)
    enter(out, CSV)


def refuse_changed(out: Path, name: str) -> None:
    """Refuse to replace a file in a sweep's folder but as this program wrote it.

    Raises
    ------
    ValueError
        If it, its folder or the record is a link, or the record does not list it as it is.
    """
    path = out / name
    links = [p for p in (out / record.FILE, path.parent, path) if p != out and p.is_symlink()]
    if links:
        raise ValueError(f"{links[0]} is a link, which is not written through; remove it")
    known = outputs.listed_files(out) or {}
    if os.path.lexists(path) and not outputs.is_as_listed(path, known.get(name)):
        raise ValueError(
            f"{path} was added or changed since skinwave wrote it and is kept; move it elsewhere"
        )


def enter(out: Path, name: str) -> None:
    """List a file, as it is now, in the record of a sweep's folder."""
    listed = (outputs.listed_files(out) or {}) | {name: outputs.digest(out / name)}
    kept = record.read(out) | {outputs.FILES: listed}
    with output_file(out / record.FILE, overwrite=True) as file:
        file.write(json.dumps(kept, indent=1).encode())


def _cells(name: str, value: Any) -> Iterable[tuple[str, Any]]:
    if isinstance(value, list):
        return [(f"{name}[{k}]", x) for k, x in enumerate(value)]
    return [(name, value)]


def _table(out: Path, columns: list[str] | None) -> Any:
    import pyarrow as pa

    parts = sorted((out / ROWS).glob("part-*.parquet"))
    try:
        tables = _parts(parts, columns)
        found = pa.concat_tables(tables, promote_options="permissive") if tables else pa.table({})
    except (OSError, KeyError, pa.ArrowException) as error:
        said = " ".join(str(error).split())[:200]
        raise ValueError(f"{out} cannot be read ({said}); choose another folder") from None
    if tables:
        _check_columns(out, found)
    return found


def _parts(parts: Iterable[Path], columns: list[str] | None) -> list[Any]:
    """The tables in files, of `UNPACKED` bytes in all."""
    tables, left = [], UNPACKED
    for part in parts:
        tables.append(_part(reading.content(part, LARGEST), columns, left))
        left -= tables[-1].nbytes
    return tables


def _part(content: bytes, columns: list[str] | None, limit: int) -> Any:
    """The table in one file, of at most `limit` bytes."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    file = pq.ParquetFile(pa.BufferReader(content))
    told = file.metadata
    unpacked = sum(told.row_group(k).total_byte_size for k in range(told.num_row_groups))
    if told.num_rows > MOST_ROWS or unpacked > LARGEST or told.num_columns > MOST_COLUMNS:
        raise OSError(f"{told.num_rows:,} rows of {unpacked / 1e6:,.0f} MB are no part of a sweep")
    known = file.schema_arrow.names
    if len(set(known)) < len(known):
        raise OSError("columns have the same name")
    return _decoded(file, [name for name in known if not columns or name in columns], limit)


def _decoded(file: Any, columns: list[str], limit: int) -> Any:
    """The columns of a Parquet file, which may take far more than the file says: a text that is
    there once, in a dictionary, may be in each row.
    """
    import pyarrow as pa

    arrow = file.schema_arrow  # which is made anew each time that it is asked for
    schema = pa.schema([arrow.field(name) for name in columns])
    if wrong := [field.name for field in schema if not _is_cell(field.type)]:
        raise OSError(f"'{wrong[0][:40]}' is of a type that no sweep has")
    said = f"unpacks to more than {UNPACKED / 1e6:,.0f} MB"
    if _least(file.metadata, columns) > limit:
        raise OSError(said)
    batches, size = [], 0
    for batch in file.iter_batches(BATCH, columns=columns):
        size += batch.nbytes
        if size > limit:
            raise OSError(said)
        batches.append(batch)
    return pa.Table.from_batches(batches, schema)


def _least(told: Any, columns: Sequence[str]) -> float:
    """Bytes that columns take at least, each value of a list counted: one row may have millions."""
    groups = [told.row_group(k) for k in range(told.num_row_groups)]
    found = [group.column(k) for group in groups for k in range(group.num_columns)]
    return sum(
        WIDTHS.get(c.physical_type, 4) * c.num_values
        for c in found
        if c.path_in_schema.partition(".list")[0] in columns
    )


def _check_columns(out: Path, table: Any) -> None:
    """Refuse a table that is no sweep's."""
    import pyarrow as pa

    kinds = {KEY: pa.types.is_string, INDEX: pa.types.is_integer}
    known = set(table.column_names)
    wrong = [name for name, fits in kinds.items() if name in known and not fits(table[name].type)]
    if KEY not in known or wrong or table[KEY].null_count:
        what = (wrong or [KEY])[0]
        raise ValueError(
            f"{out} holds a table without '{what}' as a sweep has it; choose the folder of a sweep"
        )


def _is_cell(kind: Any) -> bool:
    """Whether a column is of a type that `append` writes, or releases before did."""
    from pyarrow import types

    if types.is_list(kind):
        return bool(types.is_floating(kind.value_type))
    plain = (types.is_string, types.is_integer, types.is_floating, types.is_boolean, types.is_null)
    return any(fits(kind) for fits in plain)
