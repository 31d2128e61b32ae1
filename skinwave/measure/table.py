"""Recordings from tables: wide ones with a column per place, long ones with a row per place.

Headings say which columns are times, frequencies, motion and drive. Missing information is inferred
from the numbers, with a remark.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from skinwave.measure.recording import Given, Recording, factors_in
from skinwave.system import units
from skinwave.system.headings import Column
from skinwave.system.text_table import Table
from skinwave.system.units import canonical, dimension_of, is_of_reference, quantity_of
from skinwave.typing import Floats

EXAMPLE = "t [s], v(0,0) [mm/s], v(5,0) [mm/s]"
LONG_EXAMPLE = "t [s], x [mm], y [mm], v [mm/s]"
NOTES = {  # keys of notes, or names of numbers, in lower case
    name: re.compile(key)
    for name, key in {
        "rate": r"sampl\w*[ _-]*(rate|freq\w*)|abtast(rate|frequenz)|fs|rate(_hz)?",
        "interval":
            r"(sampl\w*|time)[ _-]*(interval|increment|period)|increment|delta_x|dt|tinc",
        "start": r"start(_time)?|t_?start|x0|t0|trigger offset|first time",
        "band": r"(band[ _-]*|cent(er|re)[ _-]*)?(frequency|frequenz|fréquence)",
        "axis unit": r"(horizontal|x|time)[ _-]*units?",
        "unit": r"(vertical|y)?[ _-]*(units?|einheit)",
    }.items()
}  # fmt: skip


def rate_in(number: Callable[[str], float]) -> float:
    """Return the sampling rate in Hz from the numbers of `NOTES`, or nan."""
    rate, interval = number("rate"), number("interval")
    return rate if rate > 0 else 1 / interval if interval > 0 else float("nan")


def _number(table: Table, name: str) -> float:
    """Return the number of a note of time or frequency in SI, or nan."""
    match = re.fullmatch(r"\D*?([-+.\deE,]+)\s*([^\d\s].*)?", table.note(NOTES[name]))
    if not match:
        return float("nan")
    dimension = "frequency" if name in ("rate", "band") else "time"
    unit = re.sub(r"^(k?)Sa?/s$", r"\1Hz", canonical(match[2] or ""))
    if not unit and dimension == "time":
        unit = table.note(NOTES["axis unit"])
    try:
        number = float(match[1].replace(",", "."))
        return number / units.divisor(unit, dimension) if unit else number
    except ValueError:
        return float("nan")


def recording_of(table: Table, given: Given) -> Recording:
    """Return the recording in a table. Raises a ValueError if its columns are not a measurement."""
    if np.iscomplexobj(table.numbers):
        raise ValueError("the table has complex numbers; export real and imaginary parts")
    table, remarks = _with_roles(table, given)
    columns, numbers = table.columns, table.numbers
    motion = [k for k, column in enumerate(columns) if column.may_be_motion]
    at_time, at_frequency = table.index("time"), table.index("frequency")
    is_long = max(table.index("x"), table.index("y")) >= 0
    if min(at_time, at_frequency) >= 0 and not is_long:
        raise ValueError("the table has times and frequencies; export one of them")
    if is_long and (min(table.index("x"), table.index("y")) < 0 or not motion):
        raise ValueError(f"a table with a row per place needs the columns {LONG_EXAMPLE}")
    times, frequencies = _axis(table, max(at_time, at_frequency), given, is_long)
    if not motion:
        raise ValueError(f"no column is motion; write a header such as {EXAMPLE}")
    series = _series(table, motion, len(frequencies) > 0)
    quantity, unit = _common(series, "role", given.quantity), _common(series, "unit", given.unit)
    drive = _drive(table)
    if is_long:
        if len(series) > 1:
            raise ValueError(f"the table has {len(series)} columns of motion; export one")
        axis, row = np.unique(times if len(times) else frequencies, return_inverse=True)
        times, frequencies = (axis, frequencies) if len(times) else (times, axis)
        places, spot = _distinct(coordinates(table))
        at = table.index("repetition")
        run = np.unique(numbers[:, at], return_inverse=True)[1] if at >= 0 else 0 * row
        values = _arrange(series[0][1], (run, row, spot))
        drive = _arrange(drive, (run, row, spot))[0, :, 0] if len(drive) else drive
    else:
        values, places = _by_repetition(series)
    notes = {key: value for key, value in reversed(table.notes) if value}
    remarks = [value for key, value in table.notes if key == "remark" and value] + remarks
    signs = {"into the body": 1, "out of the body": -1}
    sign = signs.get(notes.get("positive", ""), 0) or _sign([columns[k] for k in motion], given)
    return Recording(
        values=values, times=times, frequencies=frequencies, quantity=quantity, unit=unit,
        places=places, drive=drive, sign=sign, name=notes.get("name", ""),
        factors=factors_in(notes), remarks=tuple(remarks),
    )  # fmt: skip


def _sign(columns: list[Column], given: Given) -> int:
    """Return the sign of responses whose headings name two signed axes, such as "+Z/Force-Z".

    It is the product of both signs, because force and motion are both positive into the body.
    Returns 0 if no heading names both.
    """
    force = re.compile("force|kraft|hammer|shaker|excit|anreg", re.IGNORECASE)
    signed = re.compile(
        r"([-+])([xyz])(?![a-z])|(?<![a-z])([xyz])([-+])(?!\w)", re.IGNORECASE
    )  # fmt: skip
    signs = set()
    for column in columns:
        found = [(a + d, (b + c).lower()) for a, b, c, d in signed.findall(column.text)]
        if len(found) == 1 and force.search(column.text):
            found *= 1 if given.sign else 3  # the direction of the other is unknown
        if len(found) > 1:
            (sign, axis), (other, along) = found[:2]
            signs.add((1 if sign == other else -1) * (axis == along and len(found) == 2))
    if signs and (len(signs) > 1 or 0 in signs) and not given.sign:
        problem = "headings name different axes of motion and excitation, or only one of them"
        raise ValueError(f"{problem}; choose others with --columns, or give --positive")
    return signs.pop() if signs else 0


def _with_roles(table: Table, given: Given) -> tuple[Table, list[str]]:
    """Return the table of relevant columns, with roles inferred from their numbers, and remarks."""
    numbers, remarks = _rows(table), []
    ratios = [units.per_reference(column.unit) for column in table.columns]
    columns = [
        replace(column, unit=unit, level="") if is_ratio else column  # both have the level
        for column, (unit, is_ratio) in zip(table.columns, ratios, strict=True)
    ]
    if any(is_ratio for _, is_ratio in ratios):
        remarks.append("values are per unit of the reference")
    roles = {column.role for column in columns}
    scaling = re.compile(  # what amplitudes are; averages of a spectrum do not tell
        r"(?!.*(averag|mittel)).*(scal|skal|signal|amplitud|magnitud|spe[ck]t|type|detect)"
    )
    for key, value in table.notes if "frequency" in roles else ():
        level = units.split_level(f"{key} {value}")[1]
        if not level or any(column.level for column in columns):
            continue
        if not value or scaling.match(key):
            columns = [column.with_level(level) for column in columns]
        else:
            remarks.append(
                f"the file says '{key[:40]}: {value[:40]}'; values are taken as amplitudes, unless "
                f'a unit such as --unit "mm/s {level}" is given'
            )
    has_axis = bool(roles & {"time", "frequency"})
    has_lengths = any(dimension_of(column.unit) == "length" for column in columns)
    has_places = {"x", "y"} <= roles and (has_axis or has_lengths)
    for k, column in enumerate(columns) if not has_places else ():
        is_other = column.role in ("x", "y", "z") and dimension_of(column.unit) != "length"
        if is_other or (column.role == "index" and not _counts(numbers[:, k])):
            columns[k] = replace(column, role="")
    chosen = choose_columns(columns, given.columns)
    axis = re.compile(r"(?:^|[ _])([xyz])\s*(?:[\[(]|$)")
    found = [axis.search(column.text.lower()) for column in columns if quantity_of(column.unit)]
    axes = sorted({match[1] for match in found if match})
    if len(axes) > 1 and not (chosen or has_places):
        raise ValueError(f"columns are along {', '.join(axes)}; choose one with --columns")
    for k, column in enumerate(columns) if len(columns) > 1 else ():
        if not column.may_be_motion or column.is_motion or k in chosen or not rises(numbers[:, k]):
            continue
        counts = _counts(numbers[:, k]) and numbers[0, k] in (0, 1)
        if counts or not has_axis:
            columns[k] = replace(column, role="index" if counts else "time")
        kind = "a count of samples" if counts else "motion" if has_axis else "time"
        remarks.append(f"column {k + 1} rises evenly and is taken as {kind}")
    columns = _one_time(columns, numbers, chosen)
    kept = [k for k, column in enumerate(columns) if k in chosen or not column.may_be_motion]
    if not chosen:
        kept = _motion(columns, given, remarks)
    axis_unit, unit = table.note(NOTES["axis unit"]), table.note(NOTES["unit"])
    for k, column in enumerate(columns):
        if not column.unit and column.role == "time":
            columns[k] = replace(column, unit=axis_unit)
        elif not column.unit and column.may_be_motion and quantity_of(unit):
            columns[k] = replace(column, unit=unit)
    numbers = numbers[:, kept]
    columns = [columns[k] for k in kept]
    for row, k in np.argwhere(np.isinf(numbers))[:1]:
        name = f"row {row + 1} of column '{columns[k].text or k + 1}'"
        raise ValueError(f"{name} is an overload; measure with a larger range")
    if has_axis and chosen:  # tests beside each other may differ in length
        own = [column.role != "index" for column in columns]
        numbers = numbers[~np.isnan(numbers[:, own]).all(axis=1)]
    return replace(table, columns=tuple(columns), numbers=numbers), remarks


def _rows(table: Table) -> Floats:
    """Return the numbers without empty rows, if times show which rows are missing."""
    full = ~np.isnan(table.numbers).all(axis=1)
    has_axis = any(column.role in ("time", "frequency") for column in table.columns)
    has_axis = has_axis or any(map(rises, table.numbers[full].T))
    return table.numbers[full] if has_axis else table.numbers


def _counts(numbers: Floats) -> bool:
    return bool(len(numbers) > 1 and (np.diff(numbers) == 1).all())


def rises(numbers: Floats) -> bool:
    """Whether numbers rise like times: evenly except for rounding, or in every step."""
    fewest_rows = 4  # that show whether a column rises
    if len(numbers) < fewest_rows or not np.isfinite(numbers).all() or np.diff(numbers).min() < 0:
        return False
    span = float(np.ptp(numbers))
    even = np.linspace(numbers[0], numbers[-1], len(numbers))
    unevenness = 1e-2  # of the range: largest distance of rounded times from a straight line
    is_even = np.abs(numbers - even).max() <= unevenness * span
    rises_always = len(numbers) > 2 * fewest_rows and np.diff(numbers).min() > 0
    return span > 0 and bool(is_even or rises_always)


def _one_time(columns: list[Column], numbers: Floats, chosen: list[int]) -> list[Column]:
    """Return columns with one of times, that beside the chosen motion, and without dates."""
    times = [k for k, column in enumerate(columns) if column.role in ("time", "frequency")]
    if len(times) < 2:
        return columns
    varying = [k for k in times if len(numbers) == 1 or np.ptp(numbers[:, k])] or times[:1]
    varying = [k for k in varying if columns[k].unit] or varying
    leads = not any(column.may_be_motion for column in columns[: varying[0]])
    if leads:
        own = {max((k for k in varying if k < at), default=varying[0]) for at in chosen}
    else:
        own = {min((k for k in varying if k > at), default=varying[-1]) for at in chosen}
    first, *others = sorted(own) or varying
    for k in others:
        if not np.array_equal(numbers[:, k], numbers[:, first], equal_nan=True):
            names = f"'{columns[first].text}' and '{columns[k].text}'"
            raise ValueError(f"the columns {names} differ; choose motion with --columns")
    return [
        replace(column, role="index") if k in times and k != first else column
        for k, column in enumerate(columns)
    ]


def choose_columns(columns: Sequence[Column], wanted: tuple[str, ...]) -> list[int]:
    """Return indices of columns that a user names by heading or number, from 1."""
    chosen = []
    for name in wanted:
        names = [column.text.lower() for column in columns]
        bare = [re.sub(r"\s*[\[(].*", "", text) for text in names]
        at = [k for k, text in enumerate(names) if name.lower() in (text, bare[k])]
        if not at and name.isdigit() and 1 <= int(name) <= len(columns):
            at = [int(name) - 1]
        if not at:
            known = ", ".join(column.text or str(k + 1) for k, column in enumerate(columns))
            raise ValueError(f"--columns has '{name[:40]}'; the columns are {known[:200]}")
        chosen += at
    return chosen


def _motion(columns: list[Column], given: Given, remarks: list[str]) -> list[int]:
    """Return the relevant columns; a single one with a unit of another kind is the drive."""
    motion = [k for k, column in enumerate(columns) if column.may_be_motion]
    known = [k for k in motion if quantity_of(columns[k].unit)]
    bare = [k for k in motion if k not in known and np.isnan(columns[k].place[0])]
    names = ", ".join(columns[k].text or str(k + 1) for k in bare)
    if len(bare) == len(motion) > 1 and given.places is None:
        if all(is_of_reference(columns[k].unit) for k in bare):
            unit = columns[bare[0]].unit
            raise ValueError(f"columns {names} are in {unit}; give --columns or --places")
        remarks.append(f"columns {names} are taken as places; if one is the drive, give --columns")
    if not known:
        return list(range(len(columns)))
    left_out = [k for k in motion if k not in known and columns[k].unit
                and columns[k].part != "phase"]  # fmt: skip
    drives = [k for k in left_out if is_of_reference(columns[k].unit)]
    if len(drives) == 1 and not any(column.role == "drive" for column in columns):
        k = drives[0]
        columns[k] = replace(columns[k], role="drive")
        left_out.remove(k)
        remarks.append(f"column '{columns[k].text}' in {columns[k].unit} is taken as the drive")
    if left_out:
        remarks.append(f"{len(left_out)} columns without a unit of motion are left out")
    quantities = {k: quantity_of(columns[k].unit) for k in known}
    if given.quantity in quantities.values():
        left_out += [k for k in known if quantities[k] != given.quantity]
    return [k for k in range(len(columns)) if k not in left_out]


def _axis(table: Table, at: int, given: Given, is_long: bool) -> tuple[Floats, Floats]:
    """Return times in s and frequencies in Hz of the rows; one of them, or both, is empty."""
    empty, count = np.empty(0), len(table.numbers)
    if at < 0 and is_long:
        band = _number(table, "band")
        if np.isnan(band):
            raise ValueError(f"a table with a row per place needs the columns {LONG_EXAMPLE}")
        return empty, np.full(count, band)
    if at < 0:
        rate = rate_in(partial(_number, table))
        if np.isnan(rate):
            if given.rate is None:
                raise ValueError(f"no column has times; write {EXAMPLE} above, or give --rate")
            return empty, empty
        return np.nan_to_num(_number(table, "start")) + np.arange(count) / rate, empty
    column, values = table.columns[at], table.numbers[:, at]
    is_time = column.role == "time"
    is_in_units = dimension_of(column.unit) == "time"
    if is_time and given.rate is not None and not (is_long or is_in_units):
        return values, empty  # the rate replaces the unit
    if not column.unit:
        cure = "write 't [s]', or give --rate" if is_time else "write 'f [Hz]'"
        raise ValueError(f"the column '{column.text or at + 1}' has no unit; {cure}")
    values = units.in_si(values, units.divisor(column.unit, column.role))
    return (values, empty) if is_time else (empty, values)


Series = list[tuple[Column, np.ndarray]]


def _series(table: Table, motion: list[int], is_complex: bool) -> Series:
    """Return columns of motion with their values, two columns for each complex amplitude."""
    columns = table.columns
    for k in motion:
        units.check_linear(columns[k].unit, columns[k].text)
    if not is_complex:
        if parts := [columns[k].text for k in motion if columns[k].part]:
            raise ValueError(f"the column '{parts[0]}' is of a spectrum; add the column 'f [Hz]'")
        return [(columns[k], table.numbers[:, k]) for k in motion]
    if len(motion) % 2:
        names = ", ".join(columns[k].text or str(k + 1) for k in motion)[:80]
        problem = f"{names} are not two columns per place, re and im, or abs and phase"
        raise ValueError(f"{problem}; choose others with --columns")
    pairs = zip(motion[::2], motion[1::2], strict=True)
    return [(columns[k], _complex(table, k, other)) for k, other in pairs]


def _complex(table: Table, first: int, second: int) -> np.ndarray:
    """Return the complex amplitudes of two columns."""
    one, other = table.columns[first], table.columns[second]
    a, b = table.numbers[:, first], table.numbers[:, second]
    is_pair = one.repetition == other.repetition and str(one.place) == str(other.place)
    if is_pair and (one.part, other.part) == ("re", "im"):
        return a + 1j * b
    if is_pair and one.part in ("", "abs") and other.part == "phase":
        if not other.unit:
            raise ValueError(f"the phase '{other.text}' needs the unit [deg] or [rad]")
        return np.asarray(a * np.exp(1j * units.in_si(b, units.divisor(other.unit, "angle"))))
    names = f"'{one.text}' and '{other.text}'"
    raise ValueError(f"{names} are not a complex amplitude; name them 're v' and 'im v'")


def _common(series: Series, attribute: str, given: str) -> str:
    """Return the common role or unit of columns of motion; "" if unknown."""
    is_unit = attribute == "unit"
    values = {f"{c.unit} {c.level}".strip() if is_unit else c.role for c, _ in series} - {""}
    is_mixed = is_unit and not all(map(quantity_of, values))
    if len(values) > 1 and (is_mixed or not given):
        names = ", ".join(sorted(values))[:80]
        what = "unit" if is_unit else "quantity"
        raise ValueError(f"columns differ in {what}: {names}; use --columns or --quantity")
    return str(values.pop()) if len(values) == 1 else ""


def _by_repetition(series: Series) -> tuple[np.ndarray, Floats]:
    """Return values (r, n, p) and places (p, 2)."""
    groups: dict[int, Series] = {}
    for column, values in series:
        groups.setdefault(column.repetition, []).append((column, values))
    places = [[column.place for column, _ in group] for group in groups.values()]
    if len(set(map(str, places))) > 1:
        raise ValueError("repetitions differ in their places; correct the header")
    each = [np.column_stack([values for _, values in group]) for group in groups.values()]
    return np.array(each), np.array(places[0])


def _drive(table: Table) -> np.ndarray:
    at = [k for k, column in enumerate(table.columns) if column.role == "drive"]
    if len(at) > 2:
        raise ValueError(f"{len(at)} columns hold the drive; export one of them")
    if len(at) == 2:
        return _complex(table, *at)
    return table.numbers[:, at[0]] if at else np.empty(0)


def coordinates(table: Table) -> Floats:
    """Return the places (n, 2) in m of the columns x and y."""
    at = table.index("x"), table.index("y")
    for k in at:
        if not table.columns[k].unit:
            raise ValueError(f"the column '{table.columns[k].text}' has no unit; write 'x [mm]'")
    return np.column_stack([
        units.in_si(table.numbers[:, k], units.divisor(table.columns[k].unit, "length"))
        for k in at
    ])  # fmt: skip


def _distinct(points: Floats) -> tuple[Floats, np.ndarray]:
    """Return distinct places (p, 2) in their order, and the index of each row's place."""
    _, first, inverse = np.unique(points, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    return points[first[order]], np.argsort(order)[inverse.ravel()]


def _arrange(values: np.ndarray, at: tuple[np.ndarray, ...]) -> np.ndarray:
    """Return values (r, n, p) from rows with given indices."""
    shape = tuple(int(k.max()) + 1 for k in at)
    total = int(np.prod(shape, dtype=object))
    flat, row = np.unique(np.ravel_multi_index(at, shape), return_index=True)
    if len(flat) < len(values):
        twice = int(np.setdiff1d(np.arange(len(values)), row)[0])
        raise ValueError(f"row {twice + 1} repeats the time and place of another row; remove one")
    if total != len(values):
        raise ValueError(
            f"a row for each time, place and repetition makes {total} rows, but there are "
            f"{len(values)}; export all of them"
        )
    return np.asarray(values[row].reshape(shape))
