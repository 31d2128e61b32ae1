"""Text of a user's file or name where a terminal or spreadsheet could obey it, not show it."""

import csv
import io
import sys
from collections.abc import Iterable
from typing import TextIO

FORMULA = ("=", "+", "-", "@", "\t", "\r")  # what a spreadsheet takes for the start of one


def printable(text: str, keep: str = "\n") -> str:
    """The text with control, bidirectional and other invisible characters as escapes of JSON."""
    codes = {ord(c) for c in text if not (c.isprintable() or c in keep)}
    return text.translate({n: f"\\u{n:04x}" if n < 0x10000 else f"\\U{n:08x}" for n in codes})


def say(text: str, file: TextIO | None = None) -> None:
    """Print a text so that a terminal shows it, and never obeys it or fails at a letter."""
    file = file or sys.stdout
    code = getattr(file, "encoding", None) or "utf-8"
    shown = printable(text).encode(code, "backslashreplace").decode(code)
    print(shown, file=file, flush=True)


def cell(value: object) -> object:
    """A value of a CSV row; text that a spreadsheet would compute gets an apostrophe before it."""
    is_formula = isinstance(value, str) and value.startswith(FORMULA) and number_in(value) is None
    return f"'{value}" if is_formula else value


def csv_table(
    header: Iterable[str], rows: Iterable[Iterable[object]], newline: str = "\r\n"
) -> bytes:
    """A table in CSV, UTF-8, each value as its `cell`; None is an empty one."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator=newline)
    writer.writerow(map(cell, header))
    writer.writerows(map(cell, row) for row in rows)
    return text.getvalue().encode()


def as_utf_8(content: bytes) -> str:
    """The text of a file's content, without a byte order mark.

    Raises
    ------
    ValueError
        If it is no text in UTF-8.
    """
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise ValueError("no text in UTF-8; save it as UTF-8") from None
    if "\0" in text:
        raise ValueError("no text, or one in UTF-16; save it as UTF-8")
    return text


def number_in(text: str) -> float | None:
    """The number that a text is, as Python reads it, if it is one."""
    try:
        return float(text)
    except ValueError:
        return None
