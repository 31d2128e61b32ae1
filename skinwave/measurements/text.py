"""Text in columns, wide (a column a place) or long (a row a place): CSV, TSV, semicolons."""

import io
from pathlib import Path

import numpy as np

from meshes import reading
from simple_model.trajectory import Floats
from skinwave.measurements import headers
from skinwave.measurements.headers import (
    FREQUENCY,
    TIME,
    Column,
    X,
    Y,
    column,
    delimiter_of,
    is_unit,
    split,
)
from skinwave.measurements.layouts import EXAMPLE, in_metre, long, wide
from skinwave.measurements.recording import Given, Recording
from skinwave.measurements.table import Table
from skinwave.plain_text import number_in

LARGEST = 256_000_000  # bytes
MOST_ABOVE = 100  # lines about the measurement
AXES = (TIME, FREQUENCY)


def read(path: Path, given: Given) -> Recording:
    """The recording in a text file.

    Raises
    ------
    ValueError
        If it is no table of numbers below a header, or its columns do not make a measurement.
    """
    table = _table(reading.exported_text(path, LARGEST), given)
    if table.of(headers.X) >= 0 or table.of(headers.Y) >= 0:
        return long(table)
    return wide(table, given)


def places(path: Path) -> Floats:
    """Places (p, 2) in metre of a text file with the columns x and y, or of two columns in mm.

    Raises
    ------
    ValueError
        If it has no such columns, or they are no numbers.
    """
    lines = [line for line in reading.exported_text(path, LARGEST).splitlines() if line.strip()]
    delimiter = delimiter_of(lines[0]) if lines else ","
    head = split(lines[0], delimiter) if lines else []
    bare = len(head) == 2 and _are_numbers(head)
    columns = tuple(map(column, ("x [mm]", "y [mm]") if bare else head))
    where = [[k for k, one in enumerate(columns) if one.role == role] for role in (X, Y)]
    if not all(len(found) == 1 for found in where):
        raise ValueError(f"{path}: a file of places needs the columns x [mm], y [mm]; add these")
    numbers = _numbers(lines[1 - bare :], delimiter, columns, 1 - bare)
    return in_metre(columns, numbers, (where[0][0], where[1][0]))


def _table(text: str, given: Given) -> Table:
    lines = text.splitlines()
    notes, at = [], 0
    while at < len(lines) and (not lines[at].strip() or lines[at].lstrip().startswith("#")):
        key, _, value = lines[at].lstrip("# ").partition(":")
        notes.append((key.strip().lower(), value.strip()))
        at += 1
    if at == len(lines):
        raise ValueError(f"the file has no table; give a header such as {EXAMPLE}, and numbers")
    columns, below, delimiter = _header(lines, at, given)
    numbers = _numbers(lines[below:], delimiter, columns, below)
    return Table(columns=columns, numbers=numbers, notes=tuple(notes))


def _header(lines: list[str], at: int, given: Given) -> tuple[tuple[Column, ...], int, str]:
    """Columns, the number of the first line below them, and what separates cells.

    The header is the first line or, below lines about the measurement, the last one above numbers;
    the units may stand in a line of their own below the names.
    """
    delimiter = delimiter_of(lines[at])
    head = split(lines[at], delimiter)
    if _are_numbers(head):
        _refuse_no_header(given)
        return tuple(column(f"column {k + 1}") for k in range(len(head))), at, delimiter
    if not any(column(cell).role in AXES for cell in head):
        at = _last_above_numbers(lines, at)
        delimiter = delimiter_of(lines[at])
        head = split(lines[at], delimiter)
    below = split(lines[at + 1], delimiter) if at + 1 < len(lines) else []
    if len(below) == len(head) and all(map(is_unit, below)):
        bare = (cell.strip("[]() ") for cell in below)
        head = [f"{name} [{unit}]" for name, unit in zip(head, bare, strict=True)]
        at += 1
    return tuple(map(column, head)), at + 1, delimiter


def _are_numbers(found: list[str]) -> bool:
    return all(number_in(cell.replace(",", ".")) is not None for cell in found)


def _last_above_numbers(lines: list[str], first: int) -> int:
    """Number of the line of names above the first numbers; the first line if there are none."""
    for k in range(first + 1, min(first + MOST_ABOVE, len(lines))):
        if lines[k].strip() and _are_numbers(split(lines[k], delimiter_of(lines[k]))):
            above = [n for n in range(first, k) if lines[n].strip()]
            delimiter = delimiter_of(lines[k])
            is_units = all(map(is_unit, split(lines[above[-1]], delimiter)))
            return above[-2] if is_units and len(above) > 1 else above[-1]
    return first


def _refuse_no_header(given: Given) -> None:
    """Columns of numbers alone are all of motion, and the rest has been told."""
    if given.rate is None or not given.unit:
        raise ValueError(
            f"the first line has no header; write one such as {EXAMPLE}, or give --rate, "
            "--quantity and --unit if every column is a place"
        )


def _numbers(lines: list[str], delimiter: str, columns: tuple[Column, ...], above: int) -> Floats:
    """Numbers (n, c) below a header, as 1.5 or, between semicolons or tabs, 1,5."""
    while lines and not lines[-1].strip():
        lines = lines[:-1]
    if not lines:
        raise ValueError("the file has a header and no numbers; export it anew")
    if delimiter != "," and any("," in line for line in lines[:10]):
        for k, line in enumerate(lines):
            if "." in line:
                cell = next(cell for cell in split(line, delimiter) if "." in cell)
                raise ValueError(
                    f"line {above + k + 1} has '{cell.strip()[:40]}' with a dot, and the file has "
                    "decimal commas; leave out separators of thousands"
                )
        lines = [line.replace(",", ".") for line in lines]
    if '"' in lines[0]:
        lines = [line.replace('"', "") for line in lines]
    try:
        found = np.loadtxt(
            io.StringIO("\n".join(lines)), ndmin=2, comments=None,
            delimiter=None if delimiter == " " else delimiter,
        )  # fmt: skip
    except ValueError:
        raise ValueError(_first_wrong(lines, delimiter, len(columns), above)) from None
    if found.shape[1] != len(columns):
        raise ValueError(_first_wrong(lines, delimiter, len(columns), above))
    if not np.isfinite(found).all():
        row, k = np.argwhere(~np.isfinite(found))[0]
        raise ValueError(
            f"line {above + row + 1} has {found[row, k]:g} in the column '{columns[k].text}'; "
            "leave out what was not measured"
        )
    return found


def _first_wrong(lines: list[str], delimiter: str, count: int, above: int) -> str:
    """Sentence on the first line that is no row of numbers."""
    for k, line in enumerate(lines):
        row = line.split(None if delimiter == " " else delimiter)
        if len(row) != count:
            word = {"\t": "tabs", " ": "white space"}.get(delimiter, f"'{delimiter}'")
            return (
                f"line {above + k + 1} has {len(row)} cells between {word} and the header "
                f"{count}; mend it"
            )
        for cell in row:
            if number_in(cell) is None:
                return (
                    f"line {above + k + 1} has '{cell.strip()[:40]}', which is no number; mend it"
                )
    return "the file is no table of numbers; export it anew"
