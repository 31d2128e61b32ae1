"""Text in columns as programs export it: encoding, delimiter, decimal sign, header, and numbers.

The rows at the end of a file show what separates its cells and which columns hold numbers. Its
table begins at the first line with numbers in these columns. The line above has the names, or the
units below a line of names. Everything above, and cells beside the numbers, are notes.
"""

import io
import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import datetime, time
from pathlib import Path

import numpy as np

from meshes.reading import read_exported_text
from skinwave.measure.headers import TIME, UNITS, Column, X, Y, column
from skinwave.measure.labview import lvm_table
from skinwave.measure.recording import Given, Recording
from skinwave.measure.table import EXAMPLE, Table, in_metre, recording
from skinwave.measure.units import plain, quantity_of
from skinwave.system.plain_text import number_in
from skinwave.typing import Floats

LARGEST = 256_000_000  # bytes
FIRST_LINE = "LabVIEW Measurement"  # of .lvm files, whatever they are called
SHOWN = 100  # rows at the end that show what separates cells
NO_VALUE = (
    "", "-", "--", "---", "na", "n/a", "#n/a", "null", "none", "nan", "1.#qnan", "-1.#ind",
    "1.#ind", "missing", "invalid",
)  # fmt: skip
BEYOND = ("∞", "+∞", "1.#inf", "overload", "over")  # the range of an instrument
MARK = "#%;/!"  # before lines about the measurement
_LEADING_ZERO = re.compile(r",0\d+(?=,|$)")
Notes = list[tuple[str, str]]


def read(path: Path, given: Given) -> Recording:
    """The recording in a text file; raises a ValueError if it is no table of numbers, or its
    columns do not make a measurement.
    """
    text = read_exported_text(path, LARGEST)
    return recording(lvm_table(text) if text.startswith(FIRST_LINE) else table(text), given)


def places(path: Path) -> Floats:
    """Places (p, 2) in metre of a text file with the columns x and y, or of two columns in mm;
    raises a ValueError if it has none.
    """
    found = table(read_exported_text(path, LARGEST))
    columns = found.columns
    if len(columns) == 2 and not any(one.text for one in columns):
        columns = (column("x [mm]"), column("y [mm]"))
    where = [[k for k, one in enumerate(columns) if one.role == role] for role in (X, Y)]
    if not all(len(of) == 1 for of in where):
        raise ValueError(f"{path}: a file of places needs the columns x [mm], y [mm]; add these")
    return in_metre(columns, found.numbers, (where[0][0], where[1][0]))


@dataclass(frozen=True)
class _Layout:
    """How rows of a table are written: what separates cells, whether decimal signs are commas, the
    columns of numbers, and how many cells a row has.
    """

    delimiter: str
    comma: bool
    kept: tuple[int, ...]
    width: int

    def cells(self, line: str) -> list[str]:
        """Cells of a line, with decimal points."""
        return _cells(line, self.delimiter, self.comma)

    def is_row(self, line: str) -> bool:
        """Whether a line is a row: values in the columns of numbers, and one number at least."""
        cells = self.cells(line)
        if not self.kept[-1] < len(cells) <= self.width:
            return False
        found = [_value(cells[k]) for k in self.kept]
        return None not in found and any(_is_number(cells[k]) for k in self.kept)


def table(text: str) -> Table:
    """The table in a text: columns, numbers, and notes above it; raises a ValueError if there is
    none, or with the number of a line in it that is no row of numbers.
    """
    lines = text.rstrip().splitlines()
    last = [line for line in lines[-4 * SHOWN :] if line.strip()][-SHOWN:]
    if not any(line.strip() and line.lstrip()[0] not in "#%" for line in lines):
        raise ValueError(f"the file has no table; give a header such as {EXAMPLE}, and numbers")
    misfits = []
    for layout in _layouts(last):
        first = next((k for k, line in enumerate(lines) if layout.is_row(line)), -1)
        if first < 0:
            continue
        try:
            names, units, notes = _header(lines[:first], layout)
        except ValueError as error:
            misfits.append(str(error))
            continue
        row = layout.cells(lines[first])
        columns = _columns(names, units, layout, row, notes)
        numbers = _numbers(lines, first, layout, names, notes)
        for k, cell in enumerate(row[c] for c in layout.kept):
            if _clock(cell) is not None:
                numbers[:, k] -= numbers[0, k]
                columns[k] = replace(columns[k], role=TIME, unit="s")
        return Table(columns=tuple(columns), numbers=numbers, notes=tuple(notes))
    wrong = "the file has a header and no numbers; export it anew"
    if len(last) > 1:
        cells = re.split(r"[\t;, ]+", last[-1].strip())
        word = next((cell for cell in cells if number_in(cell) is None), cells[0])
        wrong = f"line {len(lines)} has '{word[:40]}', which is no number; mend it"
    raise ValueError([*misfits, wrong][0])


def _layouts(rows: list[str]) -> Iterator[_Layout]:
    """Layouts by which most rows at the end of a file are alike."""
    for delimiter in "\t;, ":
        if delimiter != " " and not any(delimiter in line for line in rows):
            continue
        comma = any(
            _with_point(cell) != cell
            for line in rows if "," in line and line.lstrip()[0] not in "#%"
            for cell in _cells(line, delimiter)
        )  # fmt: skip
        split = [_cells(line, delimiter, comma) for line in rows]
        widths = [len(cells) for cells in split[-3:]]
        width = max(widths, key=widths.count)
        alike = [cells for cells in split if len(cells) == width]
        alike = alike[len(alike) // 2 :]  # without the header of a short table
        full = [k for k in range(width) if any(cells[k] for cells in alike)]
        values = [sum(_value(cells[k]) is not None for cells in alike) for k in full]
        kept = [k for k, count in zip(full, values, strict=True) if 2 * count >= len(alike)]
        is_table = any(_is_number(cells[k]) for cells in alike for k in kept)
        if is_table and (delimiter != " " or kept == full):
            yield _Layout(delimiter, comma, tuple(kept), width)


def _cells(line: str, delimiter: str, comma: bool = False) -> list[str]:
    """Cells of a line; a delimiter within quotes or brackets is none, as in v(0,0)."""
    if delimiter == " ":
        joined = re.sub(r"\s+(?=[^\[\]]*\])|\s+(?=[\[(#])", "", line.strip()).replace('"', "")
        found = joined.split()
    elif not re.search(r'["(\[]', line):
        found = line.split(delimiter)
    else:
        found, cell, depth, quoted = [], "", 0, False
        for letter in line + delimiter:
            if letter == '"':
                quoted = not quoted
            elif letter == delimiter and not quoted and depth <= 0:
                found.append(cell)
                cell = ""
            else:
                depth += 0 if quoted else (letter in "([") - (letter in ")]")
                cell += letter
    found = [cell.strip().replace("\u2212", "-") for cell in found]
    return [_with_point(cell) for cell in found] if comma else found


def _with_point(cell: str) -> str:
    """A number with a decimal comma as one with a point; other cells as they are."""
    pointed = cell.replace(",", ".")
    return pointed if "." not in cell and number_in(pointed) is not None else cell


def _is_number(cell: str) -> bool:
    value = _value(cell)
    return value is not None and bool(np.isfinite(value))


def _value(cell: str) -> float | None:
    """Number of a cell: nan of one that was not measured, inf beyond the range, s of a clock."""
    number = number_in(cell)
    if number is not None:
        return number
    if cell.lower() in NO_VALUE:
        return np.nan
    return np.inf if cell.lower().lstrip("-") in BEYOND else _clock(cell)


def _clock(cell: str) -> float | None:
    """Seconds of an ISO date, a time of day, or both."""
    if not ("-" in cell or ":" in cell) or not cell[:1].isdigit():
        return None
    for parse in (datetime.fromisoformat, time.fromisoformat):
        with suppress(ValueError):
            at = parse(cell)
            day = at.toordinal() % 100 if isinstance(at, datetime) else 0  # leaves digits
            return (
                86400.0 * day + 3600 * at.hour + 60 * at.minute + at.second + at.microsecond / 1e6
            )
    return None


def _header(above: list[str], layout: _Layout) -> tuple[list[str], list[str], Notes]:
    """Names and units of columns, and notes, of the lines above a table; raises a ValueError if the
    line of names does not fit the columns.
    """
    delimiter, kept, width = layout.delimiter, layout.kept, layout.width
    at = [k for k, line in enumerate(above) if line.strip()]
    notes = [_note(above[k]) for k in at]
    rows = [_heading(above[k], delimiter) for k in at]
    if rows:  # Rigol's "t0 = -0.01, tInc = 1e-4" behind names
        notes += [_note(cell) for cell in rows[-1] if "=" in cell]
        rows[-1] = [cell for cell in rows[-1] if "=" not in cell]
    found = [rows.pop()] if rows and not _is_title(rows[-1], len(kept)) else []
    if found and _are_units([found[0][k] for k in kept if k < len(found[0])]):
        found = [rows.pop() if rows and len(rows[-1]) > kept[-1] else [], *found]
    elif found and any(number_in(cell) is not None for cell in found[0]):
        if rows and len(rows[-1]) == len(found[0]) and not any(map(number_in, rows[-1])):
            cell = next((cell for cell in found[0] if number_in(cell) is None), "")
            raise ValueError(f"line {at[-1] + 1} has '{cell[:40]}', which is no number; mend it")
        found = found if column(found[0][0]).role else []
    count = len(found[0]) if found else width
    if count and (count <= kept[-1] or (count > width and len(found) == 1)):
        word = {"\t": "tabs", " ": "white space"}.get(delimiter, f"'{delimiter}'")
        raise ValueError(
            f"line {at[-1] + 2} has {width} cells between {word} and the header {count}; give a "
            "name for each column, and columns with decimal commas between semicolons"
        )
    names, units = ([*cells, *[""] * width] for cells in [*found, [], []][:2])
    notes += [(name.lower(), unit) for k, (name, unit) in enumerate(zip(names, units, strict=False))
              if k not in kept and name and unit]  # fmt: skip
    return names[: max(width, count)], units, notes


def _columns(
    names: list[str], units: list[str], layout: _Layout, cells: list[str], notes: Notes
) -> list[Column]:
    """Columns of numbers. Of text a note says that it is left out; it is refused if its heading is
    that of numbers.
    """
    for k, cell in enumerate(cells[: len(names)]):
        if k in layout.kept or not (names[k] and cell) or _is_number(cell):
            continue
        if (one := column(names[k], units[k])).role or quantity_of(one.unit):
            raise ValueError(
                f"the column '{names[k][:40]}' holds text such as '{cell[:40]}'; export numbers"
            )
        notes.append(("remark", f"the column '{names[k][:40]}' holds text and is left out"))
    return [column(names[k], units[k]) for k in layout.kept]


def _is_title(cells: list[str], count: int) -> bool:
    """Whether the cells above a table are no names of its columns."""
    if len(cells) == 1 and count > 1:
        one = column(cells[0])
        return not (one.role or one.unit)
    return not cells


def _heading(line: str, delimiter: str) -> list[str]:
    """Cells of a line that may be names or units; none of a note such as "key: value"."""
    marked = line.lstrip()[0] in MARK
    if marked and ":" in line:
        return []
    cells = _cells(line.lstrip(MARK + " ") if marked else line, delimiter)
    while cells and not cells[-1]:
        cells.pop()
    return cells


def _are_units(cells: list[str]) -> bool:
    """Whether cells are units and nothing else, be they in brackets."""
    return any(cells) and all(
        plain(cell) in UNITS or re.fullmatch(r"[\[(].*[\])]", cell) is not None for cell in cells
    )


def _note(line: str) -> tuple[str, str]:
    """Key and value of a line such as "Sample rate (kHz): 20" or "Unit;mm/s"."""
    bare = re.sub(r"^[\s#%;/!]+", "", line).replace('"', "")
    key, value = [*re.split(r"[:,;\t=]+", bare, maxsplit=1), ""][:2]
    name, _, unit = key.strip(" )]").replace("[", "(").partition("(")
    return name.strip().lower(), f"{value.strip(' ,;' + chr(9))} {unit}".strip()


def _numbers(
    lines: list[str], first: int, layout: _Layout, names: list[str], notes: Notes
) -> Floats:
    """Numbers (n, c) of the lines from the first on; notes from cells beside them are added."""
    rows, width, delimiter = lines[first:], len(names), layout.delimiter
    if delimiter == "," and any(_LEADING_ZERO.search(line) for line in rows[:SHOWN]):
        raise ValueError(
            f"line {first + 1} has decimal commas between commas; export semicolons or tabs"
        )
    text = "\n".join(rows)
    if len(layout.kept) == width > 1 and not (layout.comma and "." in text):  # 10 times faster
        with suppress(ValueError):
            found = np.loadtxt(
                io.StringIO(text.replace(",", ".") if layout.comma else text), ndmin=2,
                comments=None, delimiter=None if delimiter == " " else delimiter,
            )  # fmt: skip
            if found.shape[1] == width and not np.isinf(found).any():
                return found
    return np.array([
        _row(line, k, layout, names, notes)
        for k, line in enumerate(rows, first + 1) if line.strip() or width == 1
    ])  # fmt: skip


def _row(line: str, number: int, layout: _Layout, names: list[str], notes: Notes) -> list[float]:
    """Numbers of a line; its other cells are notes."""
    cells, kept = layout.cells(line) or [""], layout.kept
    wrong, cure = "", "has a dot, and the file has decimal commas; leave out other separators"
    if layout.comma and "." in line and ":" not in line:
        wrong = next((c for c in _cells(line, layout.delimiter) if "." in c), "")
    elif not kept[-1] < len(cells) <= len(names):
        raise ValueError(
            f"line {number} has {len(cells)} cells and rows above {len(names)}; complete it"
        )
    values = [] if wrong else [_value(cells[k]) for k in kept]
    for k, value in zip(kept, values, strict=False):
        if value is None:
            wrong, cure = cells[k], "is no number; mend it"
        elif np.isinf(value):
            wrong = cells[k]
            cure = "is beyond the range of the instrument; measure with a larger range"
    aside = {k: cell for k, cell in enumerate(cells) if cell and k not in kept}
    for k, cell in aside.items() if not wrong else ():
        if names[k] and _is_number(cell):
            wrong = cell
            cure = f"is in the column '{names[k][:40]}', which ends early; leave it out"
    if wrong:
        raise ValueError(f"line {number} has '{wrong[:40]}', which {cure}")
    if aside and not any(names[k] for k in aside):
        notes.append((next(iter(aside.values())).lower(), " ".join([*aside.values()][1:])))
    return [float("nan") if value is None else value for value in values]
