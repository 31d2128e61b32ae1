"""Headings of columns: what a column holds, where, of which repetition, in which unit.

`t [s]`, `v(0,0) [mm/s]`, `v(5,0)#2 [mm/s]`, `re u(0,0) [um]`, `phase u(0,0) [deg]`, `drive`, or
with the unit as in skinwave's own tables: `t_s`, `x_mm`, `velocity_mm_s`. Headings of other
programs and languages follow from their units, or from a few words.
"""

import re
import unicodedata
from dataclasses import dataclass

from simple_model.quantities import QUANTITIES
from skinwave.measure.units import (
    ANGLES,
    FREQUENCIES,
    LENGTHS,
    MOTION,
    TIMES,
    length,
    plain,
    quantity_of,
)

TIME, FREQUENCY, X, Y, Z = "time", "frequency", "x", "y", "z"
REPETITION, DRIVE, INDEX = "repetition", "drive", "index"
AROUND = (TIME, FREQUENCY, X, Y, Z, REPETITION, DRIVE, INDEX)  # what is no motion
SEQUENCE = "Sequence"  # the unit of a count
NAMES = {
    TIME: (
        "t", "time", "times", "zeit", "temps", "tempo", "tiempo", "x_value", "timestamp",
        "time stamp", "elapsed time", "uhrzeit", "clock", "datetime", "x-axis", "x axis",
    ),
    FREQUENCY: ("f", "freq", "frequency", "frequencies", "frequenz", "fréquence"),
    X: ("x", "probe_x"),
    Y: ("y", "probe_y"),
    Z: ("z", "probe_z"),
    REPETITION: ("rep", "repetition", "run", "trial", "repeat"),
    DRIVE: ("drive", "ref", "ref1", "reference", "referenz", "référence", "trigger", "trig"),
    INDEX: ("index", "no", "no.", "nr", "nr.", "n", "#", "sample", "samples", "point index"),
    "displacement": ("u", "d", "disp", "displacement"),
    "velocity": ("v", "vel", "velocity"),
    "acceleration": ("a", "acc", "accel", "acceleration"),
}  # fmt: skip
ROLE = {name: role for role, names in NAMES.items() for name in names} | {
    name: name for name, record in QUANTITIES.items() if record.of_body
}
PARTS = {
    word: part
    for part, words in {
        "re": "re real realteil réel", "im": "im imag imaginary imaginärteil imaginaire",
        "abs": "abs", "phase": "phase phasenwinkel",
    }.items()
    for word in words.split()
}  # fmt: skip
_PART = "|".join(PARTS)
_COLUMN = re.compile(
    r"(?P<name>[^()\[\]#]*?)\s*"
    r"(?:\((?P<place>[^()]*,[^()]*)\))?\s*(?:\#(?P<rep>\d{1,9}))?\s*"
    r"(?:\[(?P<unit>[^\]]*)\]|\((?P<round>(?:[^(),]|\([^()]*\))*)\))?"
)
_SUFFIXES = {
    unit.replace("/", "_"): unit
    for units in (TIMES, FREQUENCIES, *MOTION.values(), ANGLES)
    for unit in units
}
UNITS = {plain(unit) for unit in _SUFFIXES.values()} | {
    "V", "mV", "uV", "N", "mN", "Pa", "kPa", "A", "mA", "%", "EU", "a.u.", SEQUENCE, "dB", "",
}  # fmt: skip


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
        return self.role not in AROUND

    @property
    def is_of_motion(self) -> bool:
        """Whether its name or unit says that it is motion."""
        return self.is_motion and bool(self.role or self.part or quantity_of(self.unit))


def column(text: str, unit: str = "") -> Column:
    """The column that a heading describes, with the unit below it; raises a ValueError if its place
    is no pair of numbers.
    """
    said = " ".join(unicodedata.normalize("NFKC", text).split())
    apart = re.fullmatch(r"(.+?)(?:\s+/\s*|\s*/\s+|,\s+|\s+in\s+)(\S+)", said)
    if apart and plain(apart[2]) in UNITS:
        said = f"{apart[1]} [{apart[2]}]"
    found = _COLUMN.fullmatch(said)
    if not found:
        last = re.fullmatch(r".*[\[(]([^\[\]()]*)[\])]", said)
        unit = (unit or (last[1] if last else "")).strip("[]() ")
        return Column(text=said, role=_role("", unit), unit=unit)
    words = found["name"].strip().lower()
    unit = (unit or found["unit"] or found["round"] or "").strip("[]() ")
    if words not in ROLE and not unit:
        words, unit = _suffixed(words)
    parted = re.fullmatch(rf"(?:({_PART})(?:[ _.]+|$))?(.*?)(?:[ _.]+({_PART}))?", words)
    name, part = (parted[2], PARTS.get(parted[1] or parted[3] or "", "")) if parted else (words, "")
    return Column(
        text=said,
        role=ROLE.get(name, "") if found["place"] else _role(name, unit),
        part=part or ("phase" if plain(unit) in ANGLES else ""),
        place=_place(found["place"]) if found["place"] else Column.place,
        repetition=int(found["rep"] or 1),
        unit=unit,
    )


def _role(name: str, unit: str) -> str:
    """Role of a name without a place. The unit decides where it says another one."""
    role, of = ROLE.get(name, ""), plain(unit)
    if ROLE.get(re.sub(r"[ _]?\d+$", "", name)) == TIME:
        role = TIME
    if of in TIMES or of in FREQUENCIES:
        return TIME if of in TIMES else FREQUENCY
    if of == SEQUENCE:
        return INDEX
    if role in (FREQUENCY, INDEX) and of in UNITS - {""}:
        return ""
    if role in (X, Y, Z) and quantity_of(unit) and of not in LENGTHS:
        return ""
    return "" if len(name) == 1 and role in MOTION and quantity_of(unit) not in ("", role) else role


def _suffixed(name: str) -> tuple[str, str]:
    """Name and unit of one such as "velocity_mm_s"; the longest unit that its end is."""
    parts = name.split("_")
    for k in range(1, len(parts)):
        end = "_".join(parts[k:])
        if unit := next((u for s, u in _SUFFIXES.items() if s.lower() == end), ""):
            return "_".join(parts[:k]), unit
    return name, ""


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
