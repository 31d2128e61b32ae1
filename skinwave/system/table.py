"""A table of a result: one definition for pages, CSV files and JSON."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

from markupsafe import Markup

from simple_model.numbers import significant
from skinwave.system.plain_text import csv_table
from skinwave.system.templates import part


@dataclass(frozen=True)
class Column:
    """A column: its `name` in CSV and JSON, such as "frequency_hz". Pages show its `heading`, which
    is the name by default, its unit, and a number of significant digits.
    """

    name: str
    heading: str = ""
    unit: str = ""
    digits: int = 3

    @property
    def title(self) -> str:
        """Heading on pages, with the unit."""
        return ", ".join(filter(None, (self.heading or self.name, self.unit)))


@dataclass(frozen=True, init=False)
class Table:
    """Columns, each a `Column` or a name, and rows of text, `Markup`, numbers or None (no value).

    A table with a `name` is also written next to the page as a CSV file, whose numbers have
    `stored` significant digits.

    >>> table = Table([Column("f_hz", "frequency", "Hz"), "line"], [(127.38, "f_d"), (None, "2 f")])
    >>> table.to_csv()
    b'f_hz,line\\r\\n127.38,f_d\\r\\n,2 f\\r\\n'
    """

    columns: tuple[Column, ...]
    rows: tuple[tuple[Any, ...], ...]
    name: str
    stored: int

    def __init__(
        self, columns: Iterable[Column | str], rows: Iterable[Sequence[Any]], name: str = "",
        stored: int = 6,
    ) -> None:  # fmt: skip
        known = tuple(c if isinstance(c, Column) else Column(c) for c in columns)
        vars(self).update(columns=known, rows=tuple(map(tuple, rows)), name=name, stored=stored)

    def only(self, *names: str, most: int | None = None) -> "Table":
        """Return a table with the named columns and at most `most` rows."""
        at = [[column.name for column in self.columns].index(name) for name in names]
        rows = ([row[k] for k in at] for row in self.rows[:most])
        return Table([self.columns[k] for k in at], rows)

    def to_csv(self) -> bytes:
        """Return a CSV file in UTF-8; a cell without a value is empty."""

        def stored(value: Any) -> Any:
            return f"{value:.{self.stored}g}" if isinstance(value, float) else value

        rows = ([stored(v) if _is_known(v) else None for v in row] for row in self.rows)
        return csv_table((column.name for column in self.columns), rows)

    def records(self) -> list[dict[str, Any]]:
        """Return each row by the names of the columns, for JSON; None for no value."""
        names = [column.name for column in self.columns]
        rows = ([value if _is_known(value) else None for value in row] for row in self.rows)
        return [dict(zip(names, row, strict=True)) for row in rows]

    def html(self) -> Markup:
        """Return the table for a page; "-" where there is no value."""
        digits = [column.digits for column in self.columns]
        rows = [[cell_text(v, n) for v, n in zip(row, digits, strict=True)] for row in self.rows]
        titles = [column.title for column in self.columns]
        filled = [{row[k] for row in rows} - {"-", ""} for k in range(len(titles))]
        numeric = [
            bool(cells) and all(re.sub("[,+.e-]", "", cell).isdigit() for cell in cells)
            for cells in filled
        ]
        return part("table", titles, rows, numeric)


def cell_text(value: Any, digits: int = 3) -> str:
    """Return a cell as text: numbers with significant digits, "-" for no value."""
    if isinstance(value, str):
        return value
    if not _is_known(value):
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:,}" if isinstance(value, int) else significant(float(value), digits)


def _is_known(value: Any) -> bool:
    return value is not None and (not isinstance(value, float) or isfinite(value))
