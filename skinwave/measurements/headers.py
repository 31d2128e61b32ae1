"""Column headers of text files: what a column is, where, of which repetition, in which unit.

`t [s]`, `v(0,0) [mm/s]`, `v(5,0)#2 [mm/s]`, `re u(0,0) [um]`, `phase u(0,0) [deg]`, `drive`, or
with the unit as skinwave's own tables have it: `t_s`, `x_mm`, `velocity_mm_s`.
"""

import re
from dataclasses import dataclass

from simple_model.quantities import QUANTITIES
from skinwave.measurements.units import (
    FREQUENCIES,
    LENGTHS,
    MOTION,
    TIMES,
    length,
    plain,
    quantity_of,
)

TIME, FREQUENCY, X, Y, REPETITION, DRIVE = "time", "frequency", "x", "y", "repetition", "drive"
NAMES = {
    TIME: ("t", "time", "times"),
    FREQUENCY: ("f", "freq", "frequency", "frequencies"),
    X: ("x", "probe_x"),
    Y: ("y", "probe_y"),
    REPETITION: ("rep", "repetition", "run", "trial", "repeat"),
    DRIVE: ("drive", "ref", "reference", "trigger"),
    "displacement": ("u", "d", "disp", "displacement"),
    "velocity": ("v", "vel", "velocity"),
    "acceleration": ("a", "acc", "accel", "acceleration"),
}
PARTS = ("re", "im", "abs", "phase")  # of a complex amplitude
ROLE = {name: role for role, names in NAMES.items() for name in names} | {
    name: name for name, record in QUANTITIES.items() if record.of_body
}
_COLUMN = re.compile(
    r"(?:(?P<part>re|im|abs|phase)[ _.]+)?(?P<name>[^()\[\]#]*?)\s*"
    r"(?:\((?P<place>[^()]*,[^()]*)\))?\s*(?:\#(?P<rep>\d{1,9}))?\s*"
    r"(?:\[(?P<unit>[^\]]*)\]|\((?P<round>[^(),]*)\))?",
    re.IGNORECASE,
)
_SUFFIXES = {
    unit.replace("/", "_"): unit
    for units in (TIMES, FREQUENCIES, *MOTION.values(), {"deg": 1.0, "rad": 1.0})
    for unit in units
}


@dataclass(frozen=True, kw_only=True)
class Column:
    """A column: its `text` as written, `role` ("" if its name says none), `part` of a complex
    amplitude ("" of real values), `place` in metre (nan where it has none), `repetition` from 1,
    and `unit`.
    """

    text: str
    role: str
    part: str = ""
    place: tuple[float, float] = (float("nan"), float("nan"))
    repetition: int = 1
    unit: str = ""

    @property
    def is_motion(self) -> bool:
        """Whether it has measured values, not what they are at, or the drive."""
        return self.role not in (TIME, FREQUENCY, X, Y, REPETITION, DRIVE)


def column(text: str) -> Column:
    """The column that a header cell describes.

    Raises
    ------
    ValueError
        If its place is no pair of numbers.
    """
    said = " ".join(text.split())
    found = _COLUMN.fullmatch(said)
    if not found:
        return Column(text=said, role="")
    name, unit = found["name"].strip().lower(), found["unit"] or found["round"] or ""
    if name not in ROLE and not unit:
        name, unit = _suffixed(found["name"].strip())
    return Column(
        text=said,
        role=ROLE.get(name, "") if found["place"] else _role(name, unit),
        part=(found["part"] or "").lower(),
        place=_place(found["place"]) if found["place"] else Column.place,
        repetition=int(found["rep"] or 1),
        unit=unit.strip(),
    )


def _role(name: str, unit: str) -> str:
    """Role of a name without a place; one letter may be a channel whose unit says what it is."""
    role = ROLE.get(name, "")
    return "" if len(name) == 1 and role in MOTION and quantity_of(unit) not in ("", role) else role


def _suffixed(name: str) -> tuple[str, str]:
    """Name and unit of one such as "velocity_mm_s"; the longest unit that its end is."""
    parts = name.split("_")
    for k in range(1, len(parts)):
        end = "_".join(parts[k:])
        unit = next((u for s, u in _SUFFIXES.items() if s.lower() == end.lower()), "")
        if unit:
            return "_".join(parts[:k]).lower(), unit
    return name.lower(), ""


def _place(text: str) -> tuple[float, float]:
    """Place in metre of "5,0", in mm unless a unit of length ends it: "0.005,0 m"."""
    body, _, unit = text.strip().rpartition(" ")
    if plain(unit) not in LENGTHS:
        body, unit = text, "mm"
    parts = body.split(",")
    if len(parts) != 2:
        raise ValueError(f"the place ({text[:40]}) of a column is no pair x,y; write (5,0)")
    x, y = (length(part, unit) for part in parts)
    return x, y


def cells(line: str, delimiter: str) -> list[str]:
    """Cells of a line; a delimiter within quotes or brackets is none, as in v(0,0)."""
    found, cell, depth, quoted = [], "", 0, False
    for letter in line:
        if letter == '"':
            quoted = not quoted
            continue
        if letter == delimiter and not quoted and depth <= 0:
            found.append(cell.strip())
            cell = ""
            continue
        if not quoted:
            depth += (letter in "([") - (letter in ")]")
        cell += letter
    return [*found, cell.strip()]


def split(line: str, delimiter: str) -> list[str]:
    """Cells of a line between a delimiter, or between white space outside of brackets."""
    if delimiter != " ":
        return cells(line, delimiter)
    joined = re.sub(r"\s+(?=[^\[\]]*\])|\s+(?=[\[#])", "", line.strip())
    return joined.split()


def is_unit(cell: str) -> bool:
    """Whether a cell is a unit and nothing else, be it in brackets."""
    return plain(cell) in {plain(unit) for unit in _SUFFIXES.values()}


def delimiter_of(line: str) -> str:
    """Tab, semicolon or comma, whichever a line has first in this order outside of brackets and
    quotes; else white space.
    """
    bare = re.sub(r"\([^()]*\)|\[[^\[\]]*\]|\"[^\"]*\"", "", line)
    return next((letter for letter in "\t;," if letter in bare), " ")
