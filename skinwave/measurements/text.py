"""Text in columns, wide (a column a place) or long (a row a place): CSV, TSV, semicolons."""

import io
from pathlib import Path

import numpy as np

from meshes import reading
from simple_model.trajectory import Floats
from skinwave.measurements import headers
from skinwave.measurements.headers import Column, cells, column, delimiter_of
from skinwave.measurements.layouts import EXAMPLE, long, wide
from skinwave.measurements.recording import Given, Recording
from skinwave.measurements.table import Table
from skinwave.plain_text import number_in

LARGEST = 256_000_000  # bytes


def read(path: Path, given: Given) -> Recording:
    """The recording in a text file.

    Raises
    ------
    ValueError
        If it is no table of numbers below a header, or its columns do not make a measurement.
    """
    table = _table(reading.text(path, LARGEST), given)
    if table.of(headers.X) >= 0 or table.of(headers.Y) >= 0:
        return long(table)
    return wide(table, given)


def _table(text: str, given: Given) -> Table:
    lines = text.splitlines()
    notes, at = [], 0
    while at < len(lines) and (not lines[at].strip() or lines[at].lstrip().startswith("#")):
        key, _, value = lines[at].lstrip("# ").partition(":")
        notes.append((key.strip().lower(), value.strip()))
        at += 1
    if at == len(lines):
        raise ValueError(f"the file has no table; give a header such as {EXAMPLE}, and numbers")
    delimiter = delimiter_of(lines[at])
    head = lines[at].split() if delimiter == " " else cells(lines[at], delimiter)
    if delimiter == " " and len(head) == 2 and head[1].startswith("["):
        head = [lines[at]]
    if all(number_in(cell) is not None for cell in head):
        _refuse_no_header(given)
        columns = tuple(column(f"column {k + 1}") for k in range(len(head)))
    else:
        columns, at = tuple(map(column, head)), at + 1
    numbers = _numbers(lines[at:], delimiter, columns, at)
    return Table(columns=columns, numbers=numbers, notes=tuple(notes))


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
