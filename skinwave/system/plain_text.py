"""Text from users' files, made safe for terminals and spreadsheets; tables in CSV."""

import csv
import io
import sys
from collections.abc import Iterable
from typing import TextIO


def printable(text: str, keep: str = "\n") -> str:
    """Escape control, bidirectional and other invisible characters in a text, like JSON."""
    codes = {ord(c) for c in text if not (c.isprintable() or c in keep)}
    return text.translate({n: f"\\u{n:04x}" if n < 0x10000 else f"\\U{n:08x}" for n in codes})


def say(text: str, file: TextIO | None = None) -> None:
    """Print a text without control characters; escape those that cannot be encoded."""
    file = file or sys.stdout
    code = getattr(file, "encoding", None) or "utf-8"
    shown = printable(text).encode(code, "backslashreplace").decode(code)
    print(shown, file=file, flush=True)


def cell(value: object) -> object:
    """Return a value of a CSV row; text that looks like a formula gets an apostrophe."""
    begins_formula = isinstance(value, str) and value.startswith(("=", "+", "-", "@", "\t", "\r"))
    return f"'{value}" if begins_formula and number_in(str(value)) is None else value


def csv_table(
    header: Iterable[str], rows: Iterable[Iterable[object]], newline: str = "\r\n"
) -> bytes:
    """Return a table as CSV in UTF-8, with an empty cell for None."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator=newline)
    writer.writerow(map(cell, header))
    writer.writerows(map(cell, row) for row in rows)
    return text.getvalue().encode()


def number_in(text: str) -> float | None:
    """Return the number in a text, or None."""
    try:
        return float(text)
    except ValueError:
        return None
