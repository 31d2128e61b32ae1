"""Table of a text file, and what its columns hold: times or frequencies, amplitudes, notes."""

from dataclasses import dataclass

import numpy as np

from simple_model.trajectory import Floats
from skinwave.measurements import headers
from skinwave.measurements.headers import Column
from skinwave.measurements.units import FREQUENCIES, TIMES, in_si, scale

DIRECTIONS = {"into the body": 1, "out of the body": -1}


@dataclass(frozen=True, kw_only=True, eq=False)
class Table:
    """Columns, their numbers (n, c), and the notes above them."""

    columns: tuple[Column, ...]
    numbers: Floats
    notes: tuple[tuple[str, str], ...]

    def of(self, role: str) -> int:
        """Number of the only column of a role; -1 if there is none.

        Raises
        ------
        ValueError
            If there are several.
        """
        found = [k for k, one in enumerate(self.columns) if one.role == role]
        if len(found) > 1:
            raise ValueError(f"{len(found)} columns are of {role}; leave one")
        return found[0] if found else -1


def noted(table: Table) -> tuple[str, int, tuple[str, ...]]:
    """Name, sign (0 if it is not told) and remarks in the notes above a table."""
    named = [value for key, value in table.notes if key == "name" and value]
    signs = [DIRECTIONS.get(value, 0) for key, value in table.notes if key == "positive"]
    remarks = tuple(value for key, value in table.notes if key == "remark" and value)
    return named[0] if named else "", signs[0] if signs else 0, remarks


def axis_of(columns: tuple[Column, ...], numbers: Floats, k: int) -> tuple[Floats, Floats]:
    """Times in s and frequencies in Hz of a column; one of them is empty."""
    if k < 0:
        return np.empty(0), np.empty(0)
    unit, is_time = columns[k].unit, columns[k].role == headers.TIME
    if not unit:
        raise ValueError(f"the column '{columns[k].text}' has no unit; write 't [s]' or 'f [Hz]'")
    known, what = (TIMES, "time") if is_time else (FREQUENCIES, "frequency")
    values = in_si(numbers[:, k], scale(unit, known, what))
    return (values, np.empty(0)) if is_time else (np.empty(0), values)


def agreed(columns: list[Column]) -> tuple[str, str]:
    """The one quantity and unit of columns of motion; "" where none says."""
    found = []
    for what in ("role", "unit"):
        said = {getattr(one, what) for one in columns} - {""}
        if len(said) > 1:
            raise ValueError(
                f"columns differ in {'quantity' if what == 'role' else what}: "
                f"{', '.join(sorted(said))[:80]}; leave columns of one"
            )
        found.append(said.pop() if said else "")
    return found[0], found[1]


def complex_of(columns: tuple[Column, ...], numbers: Floats, first: int, second: int) -> np.ndarray:
    """Complex amplitudes of two columns.

    Raises
    ------
    ValueError
        If they are not the two parts of one, or a phase has no unit.
    """
    one, other = columns[first], columns[second]
    a, b = numbers[:, first], numbers[:, second]
    same = one.repetition == other.repetition and str(one.place) == str(other.place)
    if same and (one.part, other.part) == ("re", "im"):
        return a + 1j * b
    if same and (one.part, other.part) == ("abs", "phase"):
        if other.unit not in ("deg", "rad"):
            raise ValueError(f"'{other.text}' has the unit '{other.unit}'; give [deg] or [rad]")
        return np.asarray(a * np.exp(1j * (np.deg2rad(b) if other.unit == "deg" else b)))
    raise ValueError(
        f"'{one.text}' and '{other.text}' are no complex amplitude; name them 're v(0,0) [mm/s]', "
        "'im v(0,0) [mm/s]', or 'abs' and 'phase'"
    )
