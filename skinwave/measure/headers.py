"""Headings of columns: quantity, place, repetition and unit of the values below.

skinwave's own headings are `t [s]`, `v(0,0) [mm/s]`, `v(5,0)#2 [mm/s]`, `re u(0,0) [um]`,
`phase u(0,0) [deg]`, `drive`, or end in the unit: `t_s`, `x_mm`, `velocity_mm_s`. Headings of other
programs and languages are identified by their units and a few words.
"""

import re
import unicodedata
from dataclasses import dataclass, replace

from simple_model.quantities import QUANTITIES
from skinwave.measure import units
from skinwave.measure.units import ANGLES, LENGTHS, MOTION, TIMES, canonical, quantity_of

TIME, FREQUENCY, X, Y, Z = "time", "frequency", "x", "y", "z"
REPETITION, DRIVE, INDEX = "repetition", "drive", "index"
COUNT_UNIT = "Sequence"  # Rigol's unit of a row number
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
ROLES = {name: role for role, names in NAMES.items() for name in names} | {
    name: name for name, record in QUANTITIES.items() if record.of_body
}
COMPLEX_PARTS = {
    word: part
    for part, words in {
        "re": "re real realteil réel", "im": "im imag imaginary imaginärteil imaginaire",
        "abs": "abs", "phase": "phase phasenwinkel",
    }.items()
    for word in words.split()
}  # fmt: skip
_PART = "|".join(COMPLEX_PARTS)
_HEADING = re.compile(
    r"(?P<name>[^()\[\]#]*?)\s*"
    r"(?:\((?P<place>[^()a-zA-Z]*,[^()]*)\))?\s*(?:\#(?P<repetition>\d{1,9}))?\s*"
    r"(?:\[(?P<unit>[^\]]*)\]|\((?P<round>(?:[^(),]|\([^()]*\))*)\))?"
)
UNITS = {unit for known in (TIMES, units.FREQUENCIES, *MOTION.values(), ANGLES) for unit in known}
UNITS |= {canonical(unit) for unit in UNITS} | {
    "V", "mV", "uV", "N", "mN", "Pa", "kPa", "A", "mA", "%", "EU", "a.u.", COUNT_UNIT, "dB", "",
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Column:
    """Column of a table: its heading `text`, `role` ("" if unknown), `part` of a complex amplitude
    ("" for real values), `place` in m (nan if unknown), `repetition` from 1, and `unit`.
    """

    text: str
    role: str
    part: str = ""
    place: tuple[float, float] = (float("nan"), float("nan"))
    repetition: int = 1
    unit: str = ""

    @property
    def may_be_motion(self) -> bool:
        """Whether the column may hold measured motion."""
        return self.role not in (TIME, FREQUENCY, X, Y, Z, REPETITION, DRIVE, INDEX)

    @property
    def is_motion(self) -> bool:
        """Whether the name or the unit identifies the column as motion."""
        return self.may_be_motion and bool(self.role or self.part or quantity_of(self.unit))

    def with_level(self, level: str) -> "Column":
        """Return the column with a level in its unit, such as "mm/s RMS", if it may have one."""
        is_level = (
            self.may_be_motion and self.part != "phase" and not units.split_level(self.unit)[1]
        )
        is_level &= bool(quantity_of(units.per_reference(self.unit)[0]) or not self.unit)
        return replace(self, unit=f"{self.unit} {level}".strip()) if level and is_level else self


def parse_heading(text: str, unit: str = "") -> Column:
    """Return the column with this heading, and with the unit below it, if any."""
    text = " ".join(unicodedata.normalize("NFKC", text).split())
    (heading, level), (unit, below) = units.split_level(text), units.split_level(unit)
    split = re.fullmatch(r"(.+?)(?:\s+/\s*|\s*/\s+|,\s+|\s+in\s+)(\S+)", heading)
    if split and canonical(split[2]) in UNITS:
        heading = f"{split[1]} [{split[2]}]"
    match = _HEADING.fullmatch(heading)  # or without words such as "H1(palm,shaker)"
    match = match or _HEADING.fullmatch(re.sub(r"\([^()]*\)", "", heading, count=1))
    if not match:
        last = re.fullmatch(r".*[\[(]([^\[\]()]*)[\])]", heading)
        unit = (unit or (last[1] if last else "")).strip("[]() ")
        return Column(text=heading, role=_role("", unit), unit=unit)
    words = match["name"].strip().lower()
    unit = (unit or match["unit"] or match["round"] or "").strip("[]() ")
    if words not in ROLES and not unit:
        words, unit = _split_suffix(words)
    parts = re.fullmatch(rf"(?:({_PART})(?:[ _.]+|$))?(.*?)(?:[ _.]+({_PART}))?", words)
    name, part = words, ""
    if parts:
        name, part = parts[2], COMPLEX_PARTS.get(parts[1] or parts[3] or "", "")
    column = Column(
        text=text if level else heading,
        role=ROLES.get(name, "") if match["place"] else _role(name, unit),
        part=part or ("phase" if canonical(unit) in ANGLES else ""),
        place=_place(match["place"]) if match["place"] else Column.place,
        repetition=int(match["repetition"] or 1),
        unit=unit,
    )
    return column.with_level(level or below)


def _role(name: str, unit: str) -> str:
    """Return the role of a heading without a place. Where name and unit differ, the unit counts."""
    role, known_unit = ROLES.get(name, ""), canonical(unit)
    if ROLES.get(re.sub(r"[ _]?\d+$", "", name)) == TIME:
        role = TIME
    if known_unit in TIMES:
        return TIME
    if known_unit in units.FREQUENCIES:
        return FREQUENCY
    if known_unit == COUNT_UNIT:
        return INDEX
    quantity = quantity_of(unit)
    differs = (
        (role in (FREQUENCY, INDEX) and known_unit in UNITS - {""})
        or (role in (X, Y, Z) and quantity and known_unit not in LENGTHS)
        or (len(name) == 1 and role in MOTION and quantity not in ("", role))
    )
    return "" if differs else role


def _split_suffix(name: str) -> tuple[str, str]:
    """Split a name such as "velocity_mm_s" into name and unit, the longest possible."""
    parts = name.split("_")
    suffixes = {unit.replace("/", "_"): unit for unit in UNITS - {"in"}}  # as in "signal_in"
    for k in range(1, len(parts)):
        suffix = "_".join(parts[k:])
        if unit := next((u for s, u in suffixes.items() if s.lower() == suffix), ""):
            return "_".join(parts[:k]), unit
    return name, ""


def _place(text: str) -> tuple[float, float]:
    """Return the place in m of "5,0", in mm unless a unit follows: "0.005,0 m"."""
    coordinates, _, unit = text.strip().rpartition(" ")
    if canonical(unit) not in LENGTHS:
        coordinates, unit = text, "mm"
    pair = coordinates.split(",")
    if len(pair) != 2:
        raise ValueError(f"the place ({text[:40]}) of a column is not a pair x,y; write (5,0)")
    return units.metres(pair[0], unit), units.metres(pair[1], unit)
