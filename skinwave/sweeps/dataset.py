"""Rows of a sweep on disk: a folder of Parquet files of one schema, read as one table.

Rows that a worker returns are a file in the folder of pieces until `merge` adds them to the table.
Each file is written elsewhere and then renamed, so that it is complete. A piece is removed after
its rows are in the table, and rows are known by their key, so that none is lost or counted twice
however a sweep ends. One sweep at a time writes into a folder.
"""

import json
import os
import secrets
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from itertools import chain, count
from pathlib import Path
from typing import IO, Any

import numpy as np

from meshes import reading
from skinwave.results import outputs, record
from skinwave.results.outputs import output_file
from skinwave.system.plain_text import csv_table

# In the folder of a sweep: those of the table, of pieces, and of waveforms with these two; the CSV.
ROWS, PIECES, WAVEFORMS, CSV = "rows", "pieces", "waveforms", "rows.csv"
KEY, INDEX = "key", "index"  # columns: a row's name, and its place in the design
OUTCOME = (INDEX, KEY, "status", "error")
WAVEFORM = "waveform_"  # start of a column; files have these and those above even if all are alike
CONSTANTS = b"constants"  # in the metadata of a file: JSON of the other columns with one value

Row = Mapping[str, Any]


def open_folder(out: Path, command: Mapping[str, Any] | None = None) -> Path:
    """Return the folder of a sweep; make it, with a record of the `command`, if it is new.

    Raises a ValueError if the folder exists and contains something else.
    """
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        check_folder(out)
        return out
    (out / ROWS).mkdir(parents=True)
    record.write(out, command or {"typed": "", "name": "sweep", "options": {}})
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
    with open(out / ROWS / ".lock", "ab") as file:
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


def _same(columns: Mapping[str, Sequence[Any]]) -> dict[str, Any]:
    """Return the value of each column whose values are alike and which files may leave out."""
    return {
        name: cells[0] for name, cells in columns.items()
        if name not in OUTCOME and not name.startswith(WAVEFORM)
        and all(cell == cells[0] for cell in cells)
    }  # fmt: skip


def append(out: Path, rows: Sequence[Row]) -> None:
    """Write rows as a piece; cells may be missing."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    names = dict.fromkeys(name for row in rows for name in row)
    cells = {name: [row.get(name) for row in rows] for name in names}
    same = _same(cells)
    table = pa.table({name: column for name, column in cells.items() if name not in same})
    table = table.replace_schema_metadata({CONSTANTS: json.dumps(same, default=float)})
    (out / PIECES).mkdir(parents=True, exist_ok=True)
    name = f"piece-{rows[0][KEY]}-{secrets.token_hex(4)}.parquet"
    with _complete_file(out / PIECES / name) as file:
        pq.write_table(table, file, compression="zstd")


@contextmanager
def _complete_file(path: Path) -> Iterator[IO[bytes]]:
    """Yield a file that is in its folder only when it is complete, however the process ends."""
    beside = path.parents[1] / path.name
    with output_file(beside, overwrite=True) as file:
        yield file
        file.flush()
        os.fsync(file.fileno())
    os.replace(beside, path)


def merge(out: Path, *, all_columns: bool = False, most_bytes: int = 64_000_000) -> None:
    """Add the pieces of a folder to its table, in files of about `most_bytes`.

    All files have the same columns. Those with one value in all rows are only in the metadata of
    each file, unless `all_columns`. A file is rewritten if its columns change, and the last one to
    add rows; each file has its earlier rows at any time.
    """
    files, pieces = _files(out)
    (out / ROWS).mkdir(exist_ok=True)
    with _readable(out):
        schema = _common_schema([*files, *pieces], all_columns)
        known = {row[KEY] for row in _rows(files, (KEY,))}
        added = chain.from_iterable(_tables(path, schema) for path in pieces)
        size = most_bytes // 4
        new = _row_groups(added, known, size)
        for path in files:
            extended = pieces and path == files[-1] and path.stat().st_size < most_bytes
            if extended or not _open(path).schema_arrow.equals(schema, check_metadata=True):
                own = _row_groups(_tables(path, schema), set(), size)
                _write(path, own, new if extended else iter(()), most_bytes)
        free = (out / ROWS / f"part-{k:05}.parquet" for k in count())
        for group in new:
            _write(next(path for path in free if not path.exists()), [group], new, most_bytes)
    for path in pieces:
        path.unlink()
    with suppress(OSError):  # there is none, or it has a file that is not skinwave's
        (out / PIECES).rmdir()


def _write(path: Path, own: Iterable[Any], more: Iterator[Any], most_bytes: int) -> None:
    """Write row groups, and more of them up to a size, to a file of the table."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    first = next(own := iter(own), None) or next(more)
    words = [
        field.name for field in first.schema
        if pa.types.is_string(field.type) and field.name not in (KEY, "scene")
    ]  # fmt: skip
    how = {"compression": "zstd", "use_dictionary": words}
    with _complete_file(path) as file, pq.ParquetWriter(file, first.schema, **how) as writer:
        for group in chain([first], own):
            writer.write_table(group)
        while file.tell() < most_bytes and (group := next(more, None)):
            writer.write_table(group)


def _row_groups(tables: Iterable[Any], known: set[str], most_bytes: int) -> Iterator[Any]:
    """Yield the rows of tables whose key is not yet known, in tables of about `most_bytes`."""
    import pyarrow as pa

    held, size = list[Any](), 0
    for table in tables:
        keys = table[KEY].to_pylist()
        held.append(table.filter([key not in known for key in keys]))
        known.update(keys)
        size += held[-1].nbytes
        if size >= most_bytes:
            yield pa.concat_tables(held).sort_by(INDEX)
            held, size = [], 0
    if size:
        yield pa.concat_tables(held).sort_by(INDEX)


def _common_schema(paths: Sequence[Path], all_columns: bool) -> Any:
    """Return the columns of files, and in its metadata those with the same value in all rows."""
    import pyarrow as pa

    schemas, values = [pa.schema([])], list[dict[str, Any]]()  # by column, nan if they differ
    for path in paths:
        file = _open(path)
        same = _constants(file)
        schemas += [file.schema_arrow.remove_metadata(), pa.Table.from_pylist([same]).schema]
        values.append(dict.fromkeys(file.schema_arrow.names, np.nan) | same)
    schema = pa.unify_schemas(schemas, promote_options="permissive")
    constants = _same({name: [each.get(name) for each in values] for name in schema.names})
    kept = [field for field in schema if all_columns or field.name not in constants]
    return pa.schema(kept, {CONSTANTS: json.dumps(constants).encode()})


def _constants(file: Any) -> dict[str, Any]:
    """Return the columns with one value, which are in the metadata of a file."""
    found = json.loads((file.schema_arrow.metadata or {}).get(CONSTANTS, b"{}"))
    if not isinstance(found, dict):
        raise ValueError("its constant columns are not a table")
    return found


def _tables(path: Path, schema: Any) -> Iterator[Any]:
    """Yield the row groups of a file with the columns of a schema."""
    import pyarrow as pa

    file = _open(path)
    same = _constants(file)
    for k in range(file.num_row_groups):
        group = file.read_row_group(k)
        for field in schema:
            if field.name not in group.column_names:
                cells = pa.array([same.get(field.name)] * len(group), field.type)
                group = group.append_column(field, cells)
        yield group.select(schema.names).cast(schema)


def read(out: Path, columns: Sequence[str] = ()) -> list[dict[str, Any]]:
    """Return all rows once, in the order of the design, with all columns or those asked for.

    Raises a ValueError if there are none.
    """
    rows = _by_key(out, columns)
    if not rows:
        raise ValueError(f"{out} contains no rows of a sweep; name the folder of a sweep")
    every = columns or dict.fromkeys(chain((INDEX, KEY), *rows.values()))
    ordered = sorted(rows.values(), key=lambda row: row[INDEX])
    return [{name: row.get(name) for name in every} for row in ordered]


def _by_key(out: Path, columns: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Return the rows of a folder by key, also while a sweep in another process merges them."""
    files = _files(out)
    try:
        with _readable(out):
            return {row[KEY]: row for row in _rows(chain(*files), columns)}
    except ValueError:
        if all(map(os.path.lexists, chain(*files))):
            raise
    return _by_key(out, columns)  # a piece was removed, after its rows were in the table


def _rows(paths: Iterable[Path], columns: Sequence[str]) -> Iterator[dict[str, Any]]:
    """Yield the rows of files, with all columns or those asked for."""
    for path in paths:
        file = _open(path)
        same, names = _constants(file), file.schema_arrow.names
        names = [name for name in names if not columns or name in columns]
        for row in file.read(names).to_pylist():
            yield same | row


def failures_of(rows: Iterable[Row]) -> dict[str, str]:
    """Return the reason of each failed run."""
    return {f"run {row['index']}": row["error"] for row in rows if row["status"] == "failed"}


def names(out: Path) -> dict[str, int]:
    """Return the index of each row by its name."""
    return {key: row[INDEX] for key, row in _by_key(out, (KEY, INDEX)).items()}


def number_rows(wanted: Iterable[str], earlier: Mapping[str, int]) -> dict[str, int]:
    """Return the index of each wanted row: its place in the design, after rows of other designs."""
    places = {name: k for k, name in enumerate(wanted)}
    if all(places.get(name) == index for name, index in earlier.items()):
        return places
    first = 1 + max(earlier.values())
    return {name: first + k for k, name in enumerate(n for n in places if n not in earlier)}


def _files(out: Path) -> tuple[list[Path], list[Path]]:
    """Return the files of the table, and the pieces that are not yet in it."""
    # Pieces first: those that a merge removes after this are in the table.
    pieces = sorted((out / PIECES).glob("piece-*.parquet"))
    return sorted((out / ROWS).glob("part-*.parquet")), pieces


@contextmanager
def _readable(out: Path) -> Iterator[None]:
    """Raise a ValueError in place of an error of a block that reads files of rows."""
    import pyarrow as pa

    try:
        yield
    except (KeyError, ValueError, pa.ArrowException) as error:
        cause = " ".join(str(error).split())[:200]
        raise ValueError(f"{out} cannot be read ({cause}); name the folder of a sweep") from None


def _open(path: Path, most_bytes: int = 500_000_000, most_rows: int = 1_000_000) -> Any:
    import pyarrow as pa
    import pyarrow.parquet as pq

    file = pq.ParquetFile(pa.BufferReader(reading.read_bytes(path, most_bytes)))
    if file.metadata.num_rows > most_rows:
        raise ValueError(
            f"{path.name} has {file.metadata.num_rows:,} rows; a sweep writes at most {most_rows:,}"
        )
    key, index = (file.schema_arrow.field(name).type for name in (KEY, INDEX))
    if not (pa.types.is_string(key) and pa.types.is_integer(index)):
        raise ValueError(f"a row of {path.name} has no {KEY} or no {INDEX}")
    return file


def csv_of(rows: Iterable[Row]) -> bytes:
    """Return rows as CSV; a list becomes one column for each probe."""
    flat = []
    for row in rows:
        cells: dict[str, Any] = {}
        for name, value in row.items():
            is_list = isinstance(value, list)
            cells |= {f"{name}[{k}]": x for k, x in enumerate(value)} if is_list else {name: value}
        flat.append(cells)
    columns = list(dict.fromkeys(name for row in flat for name in row))
    return csv_table(columns, ([row.get(name) for name in columns] for row in flat))


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
                f"{path} was added or changed after skinwave wrote it, and is not replaced; move "
                "it elsewhere"
            )
