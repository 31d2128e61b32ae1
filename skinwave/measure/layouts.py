"""Recordings of text tables: wide, a column a place, and long, a row a time and place."""

from dataclasses import replace

import numpy as np

from simple_model.typing import Floats
from skinwave.measure import headers
from skinwave.measure.headers import Column
from skinwave.measure.recording import Given, Recording
from skinwave.measure.table import (
    Table,
    agreed,
    axis_of,
    complex_of,
    noted,
    noted_axis,
    noted_frequency,
    with_roles,
)
from skinwave.measure.units import LENGTHS, in_si, scale

EXAMPLE = "t [s], v(0,0) [mm/s], v(5,0) [mm/s]"
LONG = "t [s], x [mm], y [mm], v [mm/s]"


def recording(table: Table, given: Given) -> Recording:
    """The recording in a table, of a row for each place and time if it has the columns x and y.

    Raises
    ------
    ValueError
        If its columns do not make a measurement.
    """
    table, said = with_roles(table, given)
    is_long = table.of(headers.X) >= 0 or table.of(headers.Y) >= 0
    found = _long(table, given) if is_long else _wide(table, given)
    return replace(found, remarks=(*found.remarks, *said))


def _wide(table: Table, given: Given) -> Recording:
    """The recording in columns, one a place and repetition.

    Raises
    ------
    ValueError
        If no column is of time or frequency, or none of motion, or they do not fit together.
    """
    columns, numbers = table.columns, table.numbers
    at = max(table.of(headers.TIME), table.of(headers.FREQUENCY))
    if min(table.of(headers.TIME), table.of(headers.FREQUENCY)) >= 0:
        raise ValueError("columns are of time and of frequency; export one of them")
    times, frequencies = axis_of(table, at, given.rate is not None)
    rate, start = noted_axis(table)
    if at < 0 and given.rate is None and np.isnan(rate):
        raise ValueError(
            f"no column is of time or frequency; write a header such as {EXAMPLE}, or give --rate, "
            "--quantity and --unit"
        )
    if at < 0 and not np.isnan(rate):
        times = start + np.arange(len(numbers)) / rate
    motion = [k for k, one in enumerate(columns) if one.is_motion]
    if not motion:
        raise ValueError(f"no column is of motion; write a header such as {EXAMPLE}")
    series, quantity, unit = _series(columns, numbers, motion, len(frequencies) > 0, given)
    values, places = _by_repetition(series)
    name, sign, remarks = noted(table)
    return Recording(
        values=values, times=times, frequencies=frequencies, quantity=quantity, unit=unit,
        places=places, drive=_drive(columns, numbers), sign=sign, name=name, remarks=remarks,
    )  # fmt: skip


def _series(
    columns: tuple[Column, ...], numbers: Floats, motion: list[int], complex_: bool, given: Given
) -> tuple[list[tuple[Column, np.ndarray]], str, str]:
    """Columns with their values, real and imaginary parts together."""
    if not complex_:
        if parts := [columns[k].text for k in motion if columns[k].part]:
            raise ValueError(f"the column '{parts[0]}' is of a spectrum; give the column 'f [Hz]'")
        found = [(columns[k], numbers[:, k]) for k in motion]
        return found, *agreed([one for one, _ in found], given)
    if len(motion) % 2:
        raise ValueError(
            "a spectrum needs two columns a place: 're v(0,0)', 'im v(0,0)', or magnitude and "
            "phase; choose them by --columns"
        )
    pairs = zip(motion[::2], motion[1::2], strict=True)
    found = [(columns[k], complex_of(columns, numbers, k, other)) for k, other in pairs]
    return found, *agreed([one for one, _ in found], given)


def _by_repetition(series: list[tuple[Column, np.ndarray]]) -> tuple[np.ndarray, Floats]:
    """Values (r, n, p) and places (p, 2); every repetition has the same places."""
    groups: dict[int, list[tuple[Column, np.ndarray]]] = {}
    for one, values in series:
        groups.setdefault(one.repetition, []).append((one, values))
    places = [str([one.place for one, _ in group]) for group in groups.values()]
    if len(set(places)) > 1:
        raise ValueError("repetitions have not the same places in the same order; mend the header")
    values = np.array([np.column_stack([v for _, v in group]) for group in groups.values()])
    return values, np.array([one.place for one, _ in next(iter(groups.values()))])


def _drive(columns: tuple[Column, ...], numbers: Floats) -> np.ndarray:
    found = [k for k, one in enumerate(columns) if one.role == headers.DRIVE]
    if len(found) == 2:
        return complex_of(columns, numbers, *found)
    if len(found) > 2:
        raise ValueError(f"{len(found)} columns are of the drive; leave one")
    return numbers[:, found[0]] if found else np.empty(0)


def _long(table: Table, given: Given) -> Recording:
    """The recording in rows of a time or frequency, a place, and perhaps a repetition.

    Raises
    ------
    ValueError
        If a column is missing, or not every place has a value at every time once.
    """
    columns, numbers = table.columns, table.numbers
    at = max(table.of(headers.TIME), table.of(headers.FREQUENCY))
    where = table.of(headers.X), table.of(headers.Y)
    motion = [k for k, one in enumerate(columns) if one.is_motion]
    band = noted_frequency(table)
    if (at < 0 and np.isnan(band)) or min(where) < 0 or not motion:
        raise ValueError(f"a table of a row a place needs the columns {LONG}; mend the header")
    times, frequencies = axis_of(table, at, False)
    if at < 0:
        frequencies = np.full(len(numbers), band)
    series, quantity, unit = _series(columns, numbers, motion, len(frequencies) > 0, given)
    if len(series) > 1:
        raise ValueError(f"a table of a row a place has {len(series)} columns of motion; leave one")
    axis, row = np.unique(times if len(times) else frequencies, return_inverse=True)
    places, spot = _distinct(in_metre(columns, numbers, where))
    again, run = table.of(headers.REPETITION), np.zeros(len(row), int)
    if again >= 0:
        run = np.unique(numbers[:, again], return_inverse=True)[1]
    values = _filled(series[0][1], (run, row, spot))
    name, sign, remarks = noted(table)
    driven = _drive(columns, numbers)
    return Recording(
        values=values, quantity=quantity, unit=unit, places=places, sign=sign, name=name,
        drive=_filled(driven, (run, row, spot))[0, :, 0] if len(driven) else driven,
        remarks=remarks, times=axis if len(times) else times,
        frequencies=frequencies if len(times) else axis,
    )  # fmt: skip


def in_metre(columns: tuple[Column, ...], numbers: Floats, where: tuple[int, int]) -> Floats:
    """Places (p, 2) in metre of two columns; each has a unit."""
    found = []
    for k in where:
        unit = columns[k].unit
        if not unit:
            raise ValueError(f"the column '{columns[k].text}' has no unit; write 'x [mm]'")
        found.append(in_si(numbers[:, k], scale(unit, LENGTHS, "length")))
    return np.column_stack(found)


def _distinct(points: Floats) -> tuple[Floats, np.ndarray]:
    """Distinct places (p, 2) in the order that they appear, and which one each row has."""
    _, first, inverse = np.unique(points, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty(len(order), int)
    rank[order] = np.arange(len(order))
    return points[first[order]], rank[inverse.ravel()]


def _filled(values: np.ndarray, at: tuple[np.ndarray, ...]) -> np.ndarray:
    """Values (r, n, p) of rows, each of which has one of these numbers."""
    shape = tuple(int(k.max()) + 1 for k in at)
    total = int(np.prod(shape, dtype=object))
    if total != len(values):
        raise ValueError(
            f"{len(values)} rows are not one for each of {shape[0]} repetitions, {shape[1]} times "
            f"or frequencies and {shape[2]} places, {total}; complete them"
        )
    flat = np.ravel_multi_index(at, shape)
    if len(np.unique(flat)) != total:
        twice = int(np.argmax(np.bincount(flat)))
        row = int(np.flatnonzero(flat == twice)[1])
        raise ValueError(f"row {row + 1} has a time and place that another row has; leave one")
    found = np.empty(total, values.dtype)
    found[flat] = values
    return found.reshape(shape)
