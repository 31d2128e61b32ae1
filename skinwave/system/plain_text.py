"""Text from users' files, made safe for terminals and spreadsheets; tables in CSV."""

import csv
import io
import sys
from collections.abc import Iterable
from typing import TextIO

FORMULA = ("=", "+", "-", "@", "\t", "\r")  # first characters of formulas in spreadsheets


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
    is_formula = isinstance(value, str) and value.startswith(FORMULA) and number_in(value) is None
    return f"'{value}" if is_formula else value


def csv_table(
    header: Iterable[str], rows: Iterable[Iterable[object]], newline: str = "\r\n"
) -> bytes:
    """Return a table as CSV in UTF-8, with an empty cell for None."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator=newline)
    writer.writerow(map(cell, header))
    writer.writerows(map(cell, row) for row in rows)
    return text.getvalue().encode()


def as_utf_8(content: bytes) -> str:
    """Decode a file as UTF-8, without a byte order mark; raise a ValueError if it is not UTF-8."""
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise ValueError("the file is not text in UTF-8; save it as UTF-8") from None
    if "\0" in text:
        raise ValueError("the file is not text in UTF-8, but binary or UTF-16; save it as UTF-8")
    return text


def number_in(text: str) -> float | None:
    """Return the number in a text, or None."""
    try:
        return float(text)
    except ValueError:
        return None
