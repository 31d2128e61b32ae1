"""Text tables as instruments and programs export them.

The last rows of a file show the delimiter, the decimal sign and the columns of numbers. The table
begins at the first row with numbers in these columns. The line above has names, or units below
another line with names. Other lines above, and cells outside these columns, are notes. Lines that
begin with # or % below are comments.
"""

import csv
import io
import re
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import datetime, time
from itertools import zip_longest

import numpy as np

from skinwave.system.headings import Column, parse_heading
from skinwave.system.plain_text import number_in
from skinwave.system.units import dimension_of, quantity_of, split_level
from skinwave.typing import Floats

Notes = list[tuple[str, str]]
SAMPLE_ROWS = 100  # at the end of a file, which show the layout


@dataclass(frozen=True, kw_only=True, eq=False)
class Table:
    """Columns, their numbers (n, c), and the notes above them: pairs of key and value."""

    columns: tuple[Column, ...]
    numbers: Floats
    notes: tuple[tuple[str, str], ...] = ()

    def index(self, role: str) -> int:
        """Return the index of the only column with a role, or -1."""
        at = [k for k, column in enumerate(self.columns) if column.role == role]
        if len(at) > 1:
            raise ValueError(f"{len(at)} columns hold the {role}; export one of them")
        return at[0] if at else -1

    def note(self, key: re.Pattern[str]) -> str:
        """Return the first value, if not empty, of a note whose key matches, or ""."""
        return next((value for name, value in self.notes if key.fullmatch(name) and value), "")


@dataclass(frozen=True)
class _Layout:
    """Delimiter, whether commas are decimal, indices of columns of numbers, cells per row."""

    delimiter: str
    has_commas: bool
    numeric: tuple[int, ...]
    width: int

    def cells(self, line: str) -> list[str]:
        return _cells(line, self.delimiter, self.has_commas)

    def is_row(self, line: str) -> bool:
        """Whether a line has values in all columns of numbers, and at least one number."""
        cells = self.cells(line)
        if not self.numeric[-1] < len(cells) <= self.width:
            return False
        values = [_value(cells[k]) for k in self.numeric]
        return None not in values and any(_is_number(cells[k]) for k in self.numeric)


def parse_table(
    text: str, example: str, heading: Callable[[str, str], Column] = parse_heading
) -> Table:
    """Return the table in a text.

    `example` shows a header in messages; `heading` returns the column of a heading and a unit.
    Raises a ValueError with the number of the first wrong line.
    """
    lines = text.rstrip().splitlines()
    last = [line for line in lines[-4 * SAMPLE_ROWS :] if not _is_comment(line)][-SAMPLE_ROWS:]
    if all(map(_is_comment, lines)):
        raise ValueError(f"the file has no table; give a header such as {example}, and numbers")
    problems = []
    for layout in _layouts(last):
        first = next((k for k, line in enumerate(lines) if layout.is_row(line)), -1)
        if first < 0:
            continue
        try:
            names, units, notes = _header(lines[:first], layout)
        except ValueError as error:
            problems.append(str(error))
            continue
        row = layout.cells(lines[first])
        layout = _with_shorter(layout, lines[first : first + SAMPLE_ROWS], names)
        columns = _columns(names, units, layout, row, notes, heading)
        numbers = _numbers(lines, first, layout, names, notes)
        for k, cell in enumerate(row[c] for c in layout.numeric):
            if _clock_seconds(cell) is not None:
                numbers[:, k] -= numbers[0, k]
                columns[k] = replace(columns[k], role="time", unit="s")
        return Table(columns=tuple(columns), numbers=numbers, notes=tuple(notes))
    problem = "the file has a header but no numbers; export it again"
    if len(last) > 1:
        cells = re.split(r"[\t;, ]+", last[-1].strip())
        word = next((cell for cell in cells if number_in(cell) is None), cells[0])
        problem = f"line {len(lines)} has '{word[:40]}', which is not a number; correct it"
    raise ValueError([*problems, problem][0])


def _is_comment(line: str) -> bool:
    """Whether a line is empty or a comment."""
    return line.strip()[:1] in ("", "#", "%")


def _layouts(rows: list[str]) -> Iterator[_Layout]:
    """Yield the layouts that fit most of the last rows of a file."""
    for delimiter in "\t;, ":
        if delimiter != " " and not any(delimiter in line for line in rows):
            continue
        has_commas = any(
            _with_point(cell) != cell
            for line in rows if "," in line for cell in _cells(line, delimiter)
        )  # fmt: skip
        split = [_cells(line, delimiter, has_commas) for line in rows]
        widths = [len(cells) for cells in split[-3:]]
        width = max(widths, key=widths.count)
        alike = [cells for cells in split if len(cells) == width]
        alike = alike[len(alike) // 2 :]  # without the header of a short table
        full = [k for k in range(width) if any(cells[k] for cells in alike)]
        counts = {k: sum(_value(cells[k]) is not None for cells in alike) for k in full}
        numeric = [k for k in full if 2 * counts[k] >= len(alike)]
        is_table = any(_is_number(cells[k]) for cells in alike for k in numeric)
        if is_table and (delimiter != " " or numeric == full):
            yield _Layout(delimiter, has_commas, tuple(numeric), width)


def _with_shorter(layout: _Layout, rows: list[str], names: list[str]) -> _Layout:
    """Return the layout with named columns of numbers that end before the others."""
    columns = zip_longest(*(layout.cells(line) for line in rows), fillvalue="")
    counts = [sum(map(_is_number, column)) for column in columns]
    more = {k for k, name in enumerate(names[: len(counts)]) if name and 2 * counts[k] > len(rows)}
    return replace(layout, numeric=tuple(sorted({*layout.numeric, *more})))


def _cells(line: str, delimiter: str, has_commas: bool = False) -> list[str]:
    """Split a line; delimiters within quotes or brackets, as in v(0,0), do not count."""
    if delimiter == " ":
        joined = re.sub(r"\s+(?=[^\[\]]*\])|\s+(?=[\[(#])", "", line.strip()).replace('"', "")
        cells = joined.split()
    elif '"' in line:
        cells = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))
    elif re.search(r"[(\[]", line):
        cells = re.split(rf"{delimiter}(?![^(\[]*[)\]])", line)
    else:
        cells = line.split(delimiter)
    cells = [cell.strip().replace("\u2212", "-") for cell in cells]
    return [_with_point(cell) for cell in cells] if has_commas else cells


def _with_point(cell: str) -> str:
    """Return a number with its decimal comma replaced by a point, and other cells unchanged."""
    pointed = cell.replace(",", ".")
    return pointed if "." not in cell and number_in(pointed) is not None else cell


def _is_number(cell: str) -> bool:
    value = _value(cell)
    return value is not None and bool(np.isfinite(value))


def _value(cell: str) -> complex | None:
    """Return the number in a cell: nan if missing, inf if overloaded, None if it is text."""
    number = number_in(cell)
    if number is not None:
        return number
    if cell.endswith(("i", "j")) and cell[0] in "+-.0123456789":
        with suppress(ValueError):
            return complex(cell.replace("i", "j"))
    missing = (
        "", "-", "--", "---", "na", "n/a", "#n/a", "null", "none", "nan", "1.#qnan", "-1.#ind",
        "1.#ind", "missing", "invalid",
    )  # fmt: skip
    if cell.lower() in missing:
        return np.nan
    overload = ("∞", "+∞", "1.#inf", "overload", "over")
    return np.inf if cell.lower().lstrip("-") in overload else _clock_seconds(cell)


def _clock_seconds(cell: str) -> float | None:
    """Return the seconds of an ISO date, a time of day, or both."""
    if not ("-" in cell or ":" in cell) or not cell[:1].isdigit():
        return None
    for parse in (datetime.fromisoformat, time.fromisoformat):
        with suppress(ValueError):
            at = parse(cell)
            days = at.toordinal() % 100 if isinstance(at, datetime) else 0  # keeps digits
            seconds = 86400.0 * days + 3600 * at.hour + 60 * at.minute + at.second
            return seconds + at.microsecond / 1e6
    return None


def _header(above: list[str], layout: _Layout) -> tuple[list[str], list[str], Notes]:
    """Return names and units of columns, and notes, from the lines above a table."""
    numeric, width = layout.numeric, layout.width
    at = [k for k, line in enumerate(above) if line.strip()]
    notes = [_note(above[k]) for k in at]
    rows = [_heading_cells(above[k], layout.delimiter) for k in at]
    if rows:  # Rigol's "t0 = -0.01, tInc = 1e-4" behind names
        notes += [_note(cell) for cell in rows[-1] if "=" in cell]
        rows[-1] = [cell for cell in rows[-1] if "=" not in cell]
    names: list[str] = []
    units: list[str] = []
    if rows and not _is_title(rows[-1], len(numeric)):
        names = rows.pop()
    if names and _are_units([names[k] for k in numeric if k < len(names)]):
        units, names = names, (rows.pop() if rows and len(rows[-1]) > numeric[-1] else [])
    elif any(number_in(cell) is not None for cell in names):
        if rows and len(rows[-1]) == len(names) and not any(map(number_in, rows[-1])):
            cell = next((cell for cell in names if number_in(cell) is None), "")
            raise ValueError(f"line {at[-1] + 1} has '{cell[:40]}', not a number; correct it")
        names = names if parse_heading(names[0]).role else []
    count = len(names) or (0 if units else width)
    delimiter_names = {"\t": "tabs", " ": "white space", ",": "commas", ";": "semicolons"}
    if count and (count <= numeric[-1] or (count > width and not units)):
        cells = f"{width} cells separated by {delimiter_names[layout.delimiter]}"
        raise ValueError(
            f"line {at[-1] + 2} has {cells}, but the header has {count}; name each column"
        )
    names, units = names + [""] * width, units + [""] * width
    notes += [
        (names[k].lower(), units[k])
        for k in range(min(len(names), len(units)))
        if k not in numeric and names[k] and units[k]
    ]
    return names[: max(width, count)], units, notes


def _columns(
    names: list[str],
    units: list[str],
    layout: _Layout,
    first: list[str],
    notes: Notes,
    heading: Callable[[str, str], Column],
) -> list[Column]:
    """Return the columns of numbers; skip text, but refuse it if the heading implies numbers."""
    for k, cell in enumerate(first[: len(names)]):
        if k in layout.numeric or not (names[k] and cell) or _is_number(cell):
            continue
        column = heading(names[k], units[k])
        if column.role or quantity_of(column.unit):
            raise ValueError(f"the column '{names[k][:40]}' has text, '{cell[:40]}'; use numbers")
        notes.append(("remark", f"the column '{names[k][:40]}' holds text and is left out"))
    return [heading(names[k], units[k]) for k in layout.numeric]


def _is_title(cells: list[str], count: int) -> bool:
    """Whether the cells above a table of `count` columns are a title, not names."""
    if len(cells) == 1 and count > 1:
        column = parse_heading(cells[0])
        return not (column.role or column.unit)
    return not cells


def _heading_cells(line: str, delimiter: str) -> list[str]:
    """Return cells that may be names or units; none for a note such as "# key: value"."""
    comment = "#%;/!"  # first letters of lines with notes
    is_comment = line.lstrip()[0] in comment
    if is_comment and ":" in line:
        return []
    cells = _cells(line.lstrip(comment + " ") if is_comment else line, delimiter)
    while cells and not cells[-1]:
        cells.pop()
    return cells


def _are_units(cells: list[str]) -> bool:
    return any(cells) and all(
        dimension_of(split_level(cell)[0]) or re.fullmatch(r"[\[(].*[\])]", cell) for cell in cells
    )


def _note(line: str) -> tuple[str, str]:
    """Return key and value of a line such as "Sample rate (kHz): 20" or "Unit;mm/s"."""
    bare = re.sub(r"^[\s#%;/!]+", "", line).replace('"', "")
    key, value = [*re.split(r"[:,;\t=]+", bare, maxsplit=1), ""][:2]
    name, _, unit = key.strip(" )]").replace("[", "(").partition("(")
    return name.strip().lower(), f"{value.strip(' ,;' + chr(9))} {unit}".strip()


def _numbers(
    lines: list[str], first: int, layout: _Layout, names: list[str], notes: Notes
) -> Floats:
    """Return the numbers (n, c) from line `first` on; other cells are added to the notes."""
    width, delimiter = len(names), layout.delimiter
    rows = [(k, line) for k, line in enumerate(lines[first:], first + 1)
            if not line.startswith(("#", "%"))]  # fmt: skip
    leading_zero = re.compile(r",0\d+(?=,|$)")
    if delimiter == "," and any(leading_zero.search(line) for _, line in rows[:SAMPLE_ROWS]):
        raise ValueError(f"line {first + 1} has decimal commas between commas; use semicolons")
    text = "\n".join(line for _, line in rows)
    if len(layout.numeric) == width > 1 and not (layout.has_commas and "." in text):
        with suppress(ValueError):  # ten times faster, if all cells are plain numbers
            table = np.loadtxt(
                io.StringIO(text.replace(",", ".") if layout.has_commas else text),
                ndmin=2, comments=None, delimiter=None if delimiter == " " else delimiter,
            )  # fmt: skip
            if table.shape[1] == width:
                return table
    return np.array(
        [_row(line, k, layout, names, notes) for k, line in rows if line.strip() or width == 1]
    )


def _row(line: str, number: int, layout: _Layout, names: list[str], notes: Notes) -> list[complex]:
    """Return the numbers of a line, and add its other cells to the notes."""

    def refuse(cell: str, problem: str) -> ValueError:
        return ValueError(f"line {number} has '{cell[:40]}', which {problem}")

    pointed = [c for c in _cells(line, layout.delimiter) if "." in c] if layout.has_commas else []
    if pointed and ":" not in line:
        raise refuse(pointed[0], "has a point in a file with decimal commas; leave it out")
    cells = layout.cells(line) or [""]
    if not layout.numeric[-1] < len(cells) <= len(names):
        raise ValueError(f"line {number} has {len(cells)} cells instead of {len(names)}")
    values = []
    for cell in (cells[k] for k in layout.numeric):
        value = _value(cell)
        if value is None:
            raise refuse(cell, "is not a number; correct it")
        values.append(value)
    others = [k for k, cell in enumerate(cells) if cell and k not in layout.numeric]
    for k in others:
        if names[k] and _is_number(cells[k]):
            raise refuse(cells[k], f"is in the column '{names[k][:40]}', which is not complete")
    if others and not any(names[k] for k in others):
        notes.append((cells[others[0]].lower(), " ".join(cells[k] for k in others[1:])))
    return values
