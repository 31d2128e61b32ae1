"""Headings of columns: quantity, place, repetition and unit of the values below.

skinwave's own headings are `t [s]`, `v(0,0) [mm/s]`, `v(5,0)#2 [mm/s]`, `re u(0,0) [um]`,
`phase u(0,0) [deg]`, `drive`, or end in the unit: `t_s`, `x_mm`, `velocity_mm_s`. Headings of other
programs and languages are identified by their units and a few words.
"""

import re
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass, replace

from simple_model.quantities import QUANTITIES
from skinwave.system import units
from skinwave.system.units import LENGTHS, MOTION, canonical, dimension_of, quantity_of

AXES = {  # roles of columns that are not motion, and their names in headings and files
    "time": (
        "t", "time", "times", "zeit", "temps", "tempo", "tiempo", "x value", "timestamp",
        "time stamp", "elapsed time", "uhrzeit", "clock", "datetime", "x-axis", "x axis",
    ),
    "frequency": ("f", "freq", "frequency", "frequencies", "frequenz", "fréquence"),
    "x": ("x", "probe x"),
    "y": ("y", "probe y"),
    "z": ("z", "probe z"),
    "repetition": ("rep", "repetition", "run", "trial", "repeat"),
    "drive": ("drive", "ref", "ref1", "reference", "referenz", "référence", "trigger", "trig"),
    "index": ("index", "no", "no.", "nr", "nr.", "n", "#", "sample", "samples", "point index"),
}  # fmt: skip
MOTION_NAMES = {
    "displacement": ("u", "d", "disp", "displacement"),
    "velocity": ("v", "vel", "velocity"),
    "acceleration": ("a", "acc", "accel", "acceleration"),
}
ROLES = {name: role for role, names in (AXES | MOTION_NAMES).items() for name in names} | {
    name.replace("_", " "): name for name, record in QUANTITIES.items() if record.of_body
}
COMPLEX_PARTS = {
    word: part
    for part, words in {
        "re": "re real realteil réel", "im": "im imag imaginary imaginärteil imaginaire",
        "abs": "abs", "phase": "phase phasenwinkel",
    }.items()
    for word in words.split()
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Column:
    """Column of a table.

    Parameters
    ----------
    text : its heading
    role : a key of `AXES`, a quantity, or another role that a reader knows; "" if unknown
    part : "re", "im", "abs" or "phase" of a complex amplitude; "" for real values
    place : m; nan if unknown
    repetition : from 1
    unit, level : unit without a level, and the level, one of `units.LEVELS`; "" if not given
    """

    text: str
    role: str
    part: str = ""
    place: tuple[float, float] = (float("nan"), float("nan"))
    repetition: int = 1
    unit: str = ""
    level: str = ""

    @property
    def may_be_motion(self) -> bool:
        """Whether the column may hold measured motion."""
        return self.role not in AXES

    @property
    def is_motion(self) -> bool:
        """Whether the name or the unit identifies the column as motion."""
        return self.may_be_motion and bool(self.role or self.part or quantity_of(self.unit))

    def with_level(self, level: str) -> "Column":
        """Return the column with the level of its values, such as "RMS", if it may have one."""
        has_level = bool(self.level or units.split_level(self.unit)[1])
        may_have = self.may_be_motion and self.part != "phase" and not has_level
        may_have &= bool(quantity_of(units.per_reference(self.unit)[0]) or not self.unit)
        return replace(self, level=level) if may_have else self


def parse_heading(text: str, unit: str = "", roles: Mapping[str, str] = ROLES) -> Column:
    """Return the column with this heading, and with the unit below it, if any.

    `roles` are by name, in lower case, with spaces for underscores.
    """
    text = " ".join(unicodedata.normalize("NFKC", text).split())
    (heading, level), (unit, below) = units.split_level(text), units.split_level(unit)
    known_part = "|".join(COMPLEX_PARTS)
    part_of = re.match(rf"({known_part})\s?\((\w+)\)", heading, re.IGNORECASE)  # as in Re(p)
    if part_of and _named(part_of[2].lower(), roles):
        heading = f"{part_of[1]} {part_of[2]}{heading[part_of.end() :]}"
    split = re.fullmatch(r"(.+?)(?:\s+/\s*|\s*/\s+|,\s+|\s+in\s+)(\S+)", heading)
    if split and dimension_of(split[2]):
        heading = f"{split[1]} [{split[2]}]"
    pattern = re.compile(
        r"(?P<name>[^()\[\]#]*?)\s*"
        r"(?:\((?P<place>[^()a-zA-Z]*,[^()]*)\))?\s*(?:\#(?P<repetition>\d{1,9}))?\s*"
        r"(?:\[(?P<unit>[^\]]*)\]|\((?P<round>(?:[^(),]|\([^()]*\))*)\))?"
    )
    match = pattern.fullmatch(heading)  # or without words such as "H1(palm,shaker)"
    match = match or pattern.fullmatch(re.sub(r"\([^()]*\)", "", heading, count=1))
    if not match:
        last = re.fullmatch(r".*[\[(]([^\[\]()]*)[\])]", heading)
        unit = (unit or (last[1] if last else "")).strip("[]() ")
        return Column(text=heading, role=_role("", unit, roles), unit=unit)
    words = match["name"].strip().lower()
    unit = (unit or match["unit"] or match["round"] or "").strip("[]() ")
    if not (unit or _named(words, roles)):
        words, unit = _split_suffix(words)
    parts = re.fullmatch(rf"(?:({known_part})(?:[ _.]+|$))?(.*?)(?:[ _.]+({known_part}))?", words)
    name, part = words, ""
    if parts:
        name, part = parts[2], COMPLEX_PARTS.get(parts[1] or parts[3] or "", "")
    return Column(
        text=text if level else heading,
        role=_named(name, roles) if match["place"] else _role(name, unit, roles),
        part=part or ("phase" if dimension_of(unit) == "angle" else ""),
        place=_place(match["place"]) if match["place"] else Column.place,
        repetition=int(match["repetition"] or 1),
        unit=unit,
    ).with_level(level or below)


def _named(name: str, roles: Mapping[str, str]) -> str:
    return roles.get(name.replace("_", " "), "")


def _role(name: str, unit: str, roles: Mapping[str, str]) -> str:
    """Return the role of a heading without a place. If name and unit differ, the unit counts."""
    dimension, quantity = dimension_of(unit), quantity_of(unit)
    by_unit = {"time": "time", "frequency": "frequency", "count": "index"}
    if dimension in by_unit:
        return by_unit[dimension]
    if _named(re.sub(r"[ _]?\d+$", "", name), roles) == "time":
        return "time"
    role = _named(name, roles)
    differs = (
        (role in ("frequency", "index") and unit and dimension)
        or (role in ("x", "y", "z") and quantity and dimension != "length")
        or (len(name) == 1 and role in MOTION and quantity not in ("", role))
    )
    return "" if differs else role


def _split_suffix(name: str) -> tuple[str, str]:
    """Split a name such as "velocity_mm_s" into name and unit, the longest possible."""
    parts = name.split("_")
    known = {unit for each in units.UNITS.values() for unit in each}
    known -= {"in", "MPa", "mPa"}  # as in "signal_in"; mpa is milli or mega
    suffixes = {unit.replace("/", "_").lower(): unit for unit in known}
    for k in range(1, len(parts)):
        if unit := suffixes.get("_".join(parts[k:]), ""):
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
