"""The sheets that come nearest to what was measured, side by side."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import islice

from skinwave.inference.assess import CLAIMED
from skinwave.inference.design import PARAMETERS, Parameter, used
from skinwave.inference.knowledge import Row, holds, value_words
from skinwave.inference.ranking import PLAUSIBLE, is_plausible, nearest
from skinwave.system.numbers import decibel, significant

SHEETS = 3  # that are shown


def sheets(rows: Sequence[Row]) -> list[Row]:
    """The nearest plausible sheets, each of another size or support."""
    return list(islice(distinct(rows), SHEETS))


def distinct(rows: Sequence[Row], wanted: Callable[[Row], bool] = bool) -> Iterator[Row]:
    """The plausible sheets that are wanted, nearest first, each of another size or support."""
    there = set[tuple[str, str]]()
    for row in filter(is_plausible, nearest(rows)):
        if (kind := (row["size"], row["support"])) not in there and wanted(row):
            there.add(kind)
            yield row


def heading(rows: Sequence[Row]) -> str:
    """Heading of the table."""
    best = sheets(rows)
    full = sum(holds(best, "all")) if best else 0
    if best and full == len(best):
        return "Sheets that show all five"
    return "The sheets that come nearest" if not full else "Sheets that show all five, or nearly"


def left_out(rows: Sequence[Row]) -> str:
    """Sentence on the sheets that are not among them."""
    sagging = [row for row in rows if not is_plausible(row)]
    return (
        f"Sheets that sag by {PLAUSIBLE:g} thicknesses and more are not among them: "
        f"{len(sagging):,} of {len(rows):,}, which nobody would have measured."
    )


def sheet_table(rows: Sequence[Row]) -> tuple[list[str], list[list[str]]]:
    """The nearest sheets side by side: what they show, and their parameters."""
    best = sheets(rows)

    def line(words: str, of: Callable[[Row], str]) -> list[str]:
        return [words, *map(of, best)]

    lines = [
        line("shows", lambda r: ", ".join(c for c in CLAIMED if r[f"{c}_holds"])),
        line("strongest rival of f_AM", lambda r: f"{r['rival_line']}, {rival_level(r)} dB"),
        line("under", lambda r: r["rival_tacton"]),
        line("first mode, Hz", lambda r: significant(r["first_mode_hz"])),
        line("linear static deflection, thicknesses",
             lambda r: significant(r["sag_over_thickness"])),
    ]  # fmt: skip
    lines += [
        line(f"{p.words}{f', {p.unit}' if p.unit else ''}", partial(_value, p)) for p in PARAMETERS
    ]
    return ["sheet", *(str(k) for k in range(1, len(best) + 1))], lines


def rival_level(row: Row) -> str:
    """Level of the strongest rival of f_AM, dB."""
    return decibel(float(row["M4_value"]), signed=True)


def _value(p: Parameter, row: Row) -> str:
    if p.key not in used(row):
        return "-"
    return value_words(row[p.key]) if p.bounds is None else significant(row[p.key])
