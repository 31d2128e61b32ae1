"""Recordings of tables: which columns hold times or frequencies, motion, and the drive; wide tables
with a column a place, and long ones with a row a time and place.
"""

import re
from dataclasses import dataclass, replace

import numpy as np

from skinwave.measure.headers import (
    DRIVE,
    FREQUENCY,
    INDEX,
    REPETITION,
    TIME,
    Column,
    X,
    Y,
    Z,
)
from skinwave.measure.recording import Given, Recording
from skinwave.measure.units import (
    FREQUENCIES,
    LENGTHS,
    TIMES,
    in_si,
    per_reference,
    plain,
    quantity_of,
    scale,
)
from skinwave.typing import Floats

EXAMPLE = "t [s], v(0,0) [mm/s], v(5,0) [mm/s]"
LONG = "t [s], x [mm], y [mm], v [mm/s]"
OF_DRIVES = ("V", "mV", "N", "mN", "Pa", "kPa", "A", "mA")
DIRECTIONS = {"into the body": 1, "out of the body": -1}
STRAIGHT = 1e-2  # of its range: how far a column of rounded times may be from rising evenly
FEWEST = 4  # rows that show whether a column rises
# Notes above a table, in lower case.
_RATE = re.compile(r"sampl\w*[ _-]*(rate|freq\w*)|abtast(rate|frequenz)|fs|rate")
_INTERVAL = re.compile(
    r"(sampl\w*|time)[ _-]*(interval|increment|period)|increment|delta_x|dt|tinc"
)
_START = re.compile(r"start|x0|t0|trigger offset|first time")
_BAND = re.compile(r"(band[ _-]*|cent(er|re)[ _-]*)?(frequency|frequenz|fréquence)")
_AXIS_UNIT = re.compile(r"(horizontal|x|time)[ _-]*units?")
_UNIT = re.compile(r"(vertical|y)?[ _-]*(units?|einheit)")
_AXIS = re.compile(r"(?:^|[ _])([xyz])\s*(?:[\[(]|$)")


@dataclass(frozen=True, kw_only=True, eq=False)
class Table:
    """Columns, their numbers (n, c), and the notes above them."""

    columns: tuple[Column, ...]
    numbers: Floats
    notes: tuple[tuple[str, str], ...] = ()

    def of(self, role: str) -> int:
        """Number of the only column of a role; -1 if there is none."""
        found = [k for k, one in enumerate(self.columns) if one.role == role]
        if len(found) > 1:
            raise ValueError(f"{len(found)} columns are of {role}; leave one")
        return found[0] if found else -1

    def note(self, key: re.Pattern[str]) -> str:
        """The first value of the notes whose key is this; "" if there is none."""
        return next((value for name, value in self.notes if key.fullmatch(name) and value), "")

    def number(self, key: re.Pattern[str], units: dict[str, float]) -> float:
        """A number of the notes in SI; nan if it is missing or in another unit."""
        found = re.fullmatch(r"\D*?([-+.\deE,]+)\s*([^\d\s].*)?", self.note(key))
        if not found:
            return float("nan")
        unit = re.sub(r"^(k?)Sa?/s$", r"\1Hz", plain(found[2] or ""))
        unit = unit or (plain(self.note(_AXIS_UNIT)) if units is TIMES else "") or next(iter(units))
        try:
            return float(found[1].replace(",", ".")) / units[unit]
        except (KeyError, ValueError):
            return float("nan")


def recording(table: Table, given: Given) -> Recording:
    """The recording in a table: a column for each place and repetition or, if it has the columns x
    and y, a row for each time or frequency, place and perhaps repetition.

    Raises a ValueError if its columns do not make a measurement.
    """
    table, said = _with_roles(table, given)
    columns, numbers = table.columns, table.numbers
    where, of = (table.of(X), table.of(Y)), (table.of(TIME), table.of(FREQUENCY))
    motion, is_long = [k for k, one in enumerate(columns) if one.is_motion], max(where) >= 0
    if min(of) >= 0 and not is_long:
        raise ValueError("columns are of time and of frequency; export one of them")
    if is_long and (min(where) < 0 or not motion):
        raise ValueError(f"a table of a row a place needs the columns {LONG}; mend the header")
    times, frequencies = _axis(table, max(of), given, is_long)
    if not motion:
        raise ValueError(f"no column is of motion; write a header such as {EXAMPLE}")
    series = _series(columns, numbers, motion, len(frequencies) > 0)
    quantity, unit = _agreed([one for one, _ in series], given)
    drive = _drive(columns, numbers)
    if is_long:
        if len(series) > 1:
            raise ValueError(
                f"a table of a row a place has {len(series)} columns of motion; leave one"
            )
        axis, row = np.unique(times if len(times) else frequencies, return_inverse=True)
        times, frequencies = (axis, frequencies) if len(times) else (times, axis)
        places, spot = _distinct(in_metre(columns, numbers, where))
        again = table.of(REPETITION)
        run = np.unique(numbers[:, again], return_inverse=True)[1] if again >= 0 else 0 * row
        values = _filled(series[0][1], (run, row, spot))
        drive = _filled(drive, (run, row, spot))[0, :, 0] if len(drive) else drive
    else:
        values, places = _by_repetition(series)
    notes = {key: value for key, value in reversed(table.notes) if value}
    return Recording(
        values=values, times=times, frequencies=frequencies, quantity=quantity, unit=unit,
        places=places, drive=drive, sign=DIRECTIONS.get(notes.get("positive", ""), 0),
        name=notes.get("name", ""),
        remarks=(*(value for key, value in table.notes if key == "remark" and value), *said),
    )  # fmt: skip


def _with_roles(table: Table, given: Given) -> tuple[Table, list[str]]:
    """The table of the columns to keep, with the roles that their headings do not say, and remarks:
    those of motion are the chosen ones or, if none are, those in a unit of motion.
    """
    numbers, said = _rows(table), []
    columns = [replace(one, unit=per_reference(one.unit)[0]) for one in table.columns]
    if any(per_reference(one.unit)[1] for one in table.columns):
        said.append("values are per unit of the reference")
    roles = {one.role for one in columns}
    has_places = {X, Y} <= roles and any(
        one.role in (TIME, FREQUENCY) or plain(one.unit) in LENGTHS for one in columns
    )
    for k, one in enumerate(columns):
        is_lost = one.role in (X, Y, Z) and plain(one.unit) not in LENGTHS
        is_lost |= one.role == INDEX and not _counts(numbers[:, k])
        if is_lost and not has_places:
            columns[k] = replace(one, role="")
    chosen = _chosen(columns, given.columns)
    _check_directions(columns, chosen, has_places)
    has_axis = bool(roles & {TIME, FREQUENCY})
    for k, one in enumerate(columns) if len(columns) > 1 else ():
        if not one.is_motion or one.is_of_motion or k in chosen or not rises(numbers[:, k]):
            continue
        counts = _counts(numbers[:, k]) and numbers[0, k] in (0, 1)
        if counts or not has_axis:
            columns[k] = replace(one, role=INDEX if counts else TIME)
        kind = "a count of samples" if counts else "motion" if has_axis else "time"
        said.append(f"column {k + 1} rises evenly and is taken as {kind}")
    columns = _one_time(columns, numbers)
    kept = [k for k, one in enumerate(columns) if k in chosen or not one.is_motion]
    if not chosen:
        kept, more = _motion(columns, given)
        said += more
    of_axis, unit = table.note(_AXIS_UNIT), table.note(_UNIT)
    for k, one in enumerate(columns):
        if not one.unit and (one.role == TIME or (one.is_motion and quantity_of(unit))):
            columns[k] = replace(one, unit=of_axis if one.role == TIME else unit)
    found = replace(table, columns=tuple(columns[k] for k in kept), numbers=numbers[:, kept])
    return found, said


def _rows(table: Table) -> Floats:
    """Numbers without empty rows, if times tell which rows are missing."""
    numbers = table.numbers
    full = ~np.isnan(numbers).all(axis=1)
    has_times = any(one.role in (TIME, FREQUENCY) for one in table.columns) or any(
        rises(column) for column in numbers[full].T
    )
    return numbers[full] if has_times else numbers


def _counts(numbers: Floats) -> bool:
    """Whether numbers count rows, by ones."""
    return bool(len(numbers) > 1 and (np.diff(numbers) == 1).all())


def rises(numbers: Floats) -> bool:
    """Whether numbers rise as times do: in steps that are even up to rounding, or always."""
    if len(numbers) < FEWEST or not np.isfinite(numbers).all() or (np.diff(numbers) < 0).any():
        return False
    span = float(np.ptp(numbers))
    even = np.linspace(numbers[0], numbers[-1], len(numbers))
    straight = np.abs(numbers - even).max() <= STRAIGHT * span
    return span > 0 and bool(straight or (len(numbers) > 2 * FEWEST and np.diff(numbers).min() > 0))


def _one_time(columns: list[Column], numbers: Floats) -> list[Column]:
    """Columns with one of time: constants, such as dates, and copies are none."""
    found = [k for k, one in enumerate(columns) if one.role == TIME]
    if len(found) < 2:
        return columns
    kept = [k for k in found if len(numbers) == 1 or np.ptp(numbers[:, k])] or found[:1]
    kept = [k for k in kept if columns[k].unit] or kept
    for k in kept[1:]:
        if not np.array_equal(numbers[:, k], numbers[:, kept[0]]):
            raise ValueError(
                f"times '{columns[kept[0]].text}' and '{columns[k].text}' differ; export one"
            )
    return [replace(one, role=INDEX) if k in found and k != kept[0] else one
            for k, one in enumerate(columns)]  # fmt: skip


def _chosen(columns: list[Column], wanted: tuple[str, ...]) -> list[int]:
    """Numbers of the columns that a user names, by heading or by number from 1."""
    found = []
    for name in wanted:
        names = [one.text.lower() for one in columns]
        bare = [re.sub(r"\s*[\[(].*", "", text) for text in names]
        at = [k for k, text in enumerate(names) if name.lower() in (text, bare[k])]
        if not at and name.isdigit() and 1 <= int(name) <= len(columns):
            at = [int(name) - 1]
        if not at:
            known = ", ".join(one.text or str(k + 1) for k, one in enumerate(columns))
            raise ValueError(f"--columns has '{name[:40]}', and the columns are {known[:200]}")
        found += at
    return found


def _check_directions(columns: list[Column], chosen: list[int], has_places: bool) -> None:
    """Refuse columns along several axes, of which none is chosen."""
    found = [_AXIS.search(one.text.lower()) for one in columns if quantity_of(one.unit)]
    axes = {one[1] for one in found if one}
    if len(axes) > 1 and not (chosen or has_places):
        raise ValueError(
            f"columns are along {', '.join(sorted(axes))}; choose the normal one by --columns"
        )


def _motion(columns: list[Column], given: Given) -> tuple[list[int], list[str]]:
    """Numbers of the columns to keep: beside columns in units of motion, one in another unit is the
    drive and others are left out. Of several quantities the one that is wanted stays.
    """
    motion = [k for k, one in enumerate(columns) if one.is_motion]
    sure = [k for k in motion if quantity_of(columns[k].unit)]
    apart = [k for k in motion if k not in sure and np.isnan(columns[k].place[0])]
    names = ", ".join(columns[k].text or str(k + 1) for k in apart)
    said, other = [], []
    if len(apart) == len(motion) > 1 and given.places is None:
        if all(plain(columns[k].unit) in OF_DRIVES for k in apart):
            raise ValueError(
                f"columns {names} are channels in {columns[apart[0]].unit}, and one may be the "
                "drive; choose those of motion by --columns, or give the --places of all"
            )
        said.append(f"columns {names} are taken as places; if one is the drive, give --columns")
    if sure:
        other = [k for k in motion if k not in sure and columns[k].unit
                 and columns[k].part != "phase"]  # fmt: skip
        drives = [k for k in other if plain(columns[k].unit) in OF_DRIVES]
        if len(drives) == 1 and not any(one.role == DRIVE for one in columns):
            k = drives[0]
            columns[k] = replace(columns[k], role=DRIVE)
            other.remove(k)
            said.append(f"column '{columns[k].text}' in {columns[k].unit} is taken as the drive")
        if other:
            said.append(f"{len(other)} columns that are not in a unit of motion are left out")
        kinds = {k: quantity_of(columns[k].unit) for k in sure}
        if given.quantity in kinds.values():
            other += [k for k in sure if kinds[k] != given.quantity]
    return [k for k in range(len(columns)) if k not in other], said


def _axis(table: Table, at: int, given: Given, is_long: bool) -> tuple[Floats, Floats]:
    """Times in s and frequencies in Hz of the rows, one of them empty, by a column or the notes;
    both empty where the rate is given. With a rate that is given, times need no unit.
    """
    none, count = np.empty(0), len(table.numbers)
    if at < 0 and is_long:
        band = table.number(_BAND, FREQUENCIES)  # of an exported band
        if np.isnan(band):
            raise ValueError(f"a table of a row a place needs the columns {LONG}; mend the header")
        return none, np.full(count, band)
    if at < 0:
        start = table.number(_START, TIMES)
        rate, interval = table.number(_RATE, FREQUENCIES), table.number(_INTERVAL, TIMES)
        rate = rate if rate > 0 else 1 / interval if interval > 0 else np.nan
        if given.rate is None and np.isnan(rate):
            raise ValueError(
                f"no column is of time or frequency; write a header such as {EXAMPLE}, or give "
                "--rate, --quantity and --unit"
            )
        return (none if np.isnan(rate) else np.nan_to_num(start) + np.arange(count) / rate), none
    one, values = table.columns[at], table.numbers[:, at]
    is_time = one.role == TIME
    if is_time and given.rate is not None and not is_long and plain(one.unit) not in TIMES:
        return values, none
    if not one.unit:
        raise ValueError(
            f"the column '{one.text or at + 1}' has no unit; write "
            f"'{'t [s]' if is_time else 'f [Hz]'}'" + ", or give --rate" * is_time
        )
    known, what = (TIMES, "time") if is_time else (FREQUENCIES, "frequency")
    values = in_si(values, scale(one.unit, known, what))
    return (values, none) if is_time else (none, values)


def _series(
    columns: tuple[Column, ...], numbers: Floats, motion: list[int], is_complex: bool
) -> list[tuple[Column, np.ndarray]]:
    """Columns of motion with their values, real and imaginary parts together."""
    if not is_complex:
        if parts := [columns[k].text for k in motion if columns[k].part]:
            raise ValueError(f"the column '{parts[0]}' is of a spectrum; give the column 'f [Hz]'")
        return [(columns[k], numbers[:, k]) for k in motion]
    if len(motion) % 2:
        raise ValueError(
            "a spectrum needs two columns a place, re and im or magnitude and phase; choose these"
        )
    pairs = zip(motion[::2], motion[1::2], strict=True)
    return [(columns[k], _complex_of(columns, numbers, k, other)) for k, other in pairs]


def _complex_of(
    columns: tuple[Column, ...], numbers: Floats, first: int, second: int
) -> np.ndarray:
    """Complex amplitudes of two columns, the two parts of one."""
    one, other = columns[first], columns[second]
    a, b = numbers[:, first], numbers[:, second]
    same = one.repetition == other.repetition and str(one.place) == str(other.place)
    if same and (one.part, other.part) == ("re", "im"):
        return a + 1j * b
    if same and one.part in ("", "abs") and other.part == "phase":
        if (unit := plain(other.unit)) not in ("deg", "rad"):
            raise ValueError(f"the phase '{other.text}' needs a unit; give [deg] or [rad]")
        return np.asarray(a * np.exp(1j * (np.deg2rad(b) if unit == "deg" else b)))
    raise ValueError(
        f"'{one.text}' and '{other.text}' are no complex amplitude; name them 're v', 'im v', or "
        "'abs v', 'phase v'"
    )


def _agreed(columns: list[Column], given: Given) -> tuple[str, str]:
    """The one quantity and unit of columns of motion; "" where none says, or an option replaces."""
    found = []
    for what, replaced in (("role", given.quantity), ("unit", given.unit)):
        said = {getattr(one, what) for one in columns} - {""}
        mixed = what == "unit" and not all(map(quantity_of, said))
        if len(said) > 1 and (mixed or not replaced):
            raise ValueError(
                f"columns differ in {'quantity' if what == 'role' else what}: "
                f"{', '.join(sorted(said))[:80]}; choose some by --columns or --quantity"
            )
        found.append(said.pop() if len(said) == 1 else "")
    return found[0], found[1]


def _by_repetition(series: list[tuple[Column, np.ndarray]]) -> tuple[np.ndarray, Floats]:
    """Values (r, n, p) and places (p, 2); every repetition has the same places."""
    groups: dict[int, list[tuple[Column, np.ndarray]]] = {}
    for one, values in series:
        groups.setdefault(one.repetition, []).append((one, values))
    places = [[one.place for one, _ in group] for group in groups.values()]
    if len(set(map(str, places))) > 1:
        raise ValueError("repetitions have not the same places in the same order; mend the header")
    each = [np.column_stack([v for _, v in group]) for group in groups.values()]
    return np.array(each), np.array(places[0])


def _drive(columns: tuple[Column, ...], numbers: Floats) -> np.ndarray:
    found = [k for k, one in enumerate(columns) if one.role == DRIVE]
    if len(found) > 2:
        raise ValueError(f"{len(found)} columns are of the drive; leave one")
    if len(found) == 2:
        return _complex_of(columns, numbers, *found)
    return numbers[:, found[0]] if found else np.empty(0)


def in_metre(columns: tuple[Column, ...], numbers: Floats, where: tuple[int, int]) -> Floats:
    """Places (p, 2) in metre of two columns; each has a unit."""
    for k in where:
        if not columns[k].unit:
            raise ValueError(f"the column '{columns[k].text}' has no unit; write 'x [mm]'")
    return np.column_stack([
        in_si(numbers[:, k], scale(columns[k].unit, LENGTHS, "length")) for k in where
    ])  # fmt: skip


def _distinct(points: Floats) -> tuple[Floats, np.ndarray]:
    """Distinct places (p, 2) in the order that they appear, and which one each row has."""
    _, first, inverse = np.unique(points, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    return points[first[order]], np.argsort(order)[inverse.ravel()]


def _filled(values: np.ndarray, at: tuple[np.ndarray, ...]) -> np.ndarray:
    """Values (r, n, p) of rows, each of which has one of these numbers."""
    shape = tuple(int(k.max()) + 1 for k in at)
    total = int(np.prod(shape, dtype=object))
    flat, row = np.unique(np.ravel_multi_index(at, shape), return_index=True)
    if len(flat) < len(values):
        twice = int(np.setdiff1d(np.arange(len(values)), row)[0])
        raise ValueError(f"row {twice + 1} has a time and place that another row has; leave one")
    if total != len(values):
        raise ValueError(
            f"{len(values)} rows are not {total}, one a repetition, time and place; complete them"
        )
    return np.asarray(values[row].reshape(shape))
