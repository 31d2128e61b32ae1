"""Rows of a sweep on disk: small Parquet files in one folder, read as one table.

Each file is written aside and renamed, so that what is there is whole; nothing is ever rewritten.
"""

import csv
import io
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from skinwave.files import output_file
from skinwave.plain_text import cell

ROWS = "rows"  # the folder of the files within that of a sweep
KEY, INDEX = "key", "index"  # the columns that name a row and that order rows

Row = Mapping[str, Any]


def open_folder(out: Path) -> Path:
    """The folder of a sweep, made if it is new.

    Raises
    ------
    ValueError
        If it is something else, or cannot be made.
    """
    if out.exists() and not (out / ROWS).is_dir() and (not out.is_dir() or any(out.iterdir())):
        raise ValueError(f"{out} exists and holds no sweep; choose another --out")
    try:
        (out / ROWS).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ValueError(
            f"{out} cannot be written ({error.strerror}); choose another --out"
        ) from None
    return out


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
    place = out / ROWS / f"part-{rows[0][KEY]}.parquet"
    aside = place.with_name(f".{place.name}.partial")  # readers of folders pass over dots
    pq.write_table(table, aside)
    os.replace(aside, place)


def read(out: Path) -> list[dict[str, Any]]:
    """All rows, each once, in the order of the design, with the columns of all of them.

    Raises
    ------
    ValueError
        If there are none, or they cannot be read.
    """
    rows = list({row[KEY]: row for row in _table(out, None).to_pylist()}.values())
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
    text = io.StringIO()
    lines = csv.DictWriter(text, columns)
    lines.writeheader()
    lines.writerows({name: cell(value) for name, value in row.items()} for row in flat)
    with output_file(out / "rows.csv", overwrite=True) as file:
        file.write(text.getvalue().encode())


def _cells(name: str, value: Any) -> Iterable[tuple[str, Any]]:
    if isinstance(value, list):
        return [(f"{name}[{k}]", x) for k, x in enumerate(value)]
    return [(name, value)]


def _table(out: Path, columns: list[str] | None) -> Any:
    import pyarrow as pa
    import pyarrow.parquet as pq

    parts = sorted((out / ROWS).glob("part-*.parquet"))
    try:
        tables = [
            pq.ParquetFile(pa.BufferReader(part.read_bytes())).read(columns) for part in parts
        ]
        return pa.concat_tables(tables, promote_options="permissive") if tables else pa.table({})
    except (OSError, pa.ArrowException) as error:
        raise ValueError(f"{out} cannot be read ({' '.join(str(error).split())})") from None
