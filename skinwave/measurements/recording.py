"""A file's recording as it stands, what a user adds to it, and the measurement that both make."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from simple_model.choices import choose
from simple_model.quantities import QUANTITIES
from simple_model.trajectory import Floats
from skinwave.measurements import units
from skinwave.measurements.measurement import Measurement

LARGEST = 1e100  # of any value in SI: squares of larger ones may overflow
EXAMPLE = "--quantity velocity --unit mm/s"


@dataclass(frozen=True, kw_only=True, eq=False)
class Given:
    """Options of a user: each replaces what the file says, None or "" leaves it.

    Parameters
    ----------
    quantity, unit : str
    places : (p, 2) float, metre, or None
    sign : 1 if positive values are into the body, -1 if out of it, None if not given
    rate : Hz, or None
    variable : str, the array of a file of several
    """

    quantity: str = ""
    unit: str = ""
    places: Floats | None = None
    sign: int | None = None
    rate: float | None = None
    variable: str = ""


@dataclass(frozen=True, kw_only=True, eq=False)
class Recording:
    """Content of a file.

    Parameters
    ----------
    values : (r, t, p) float or (r, f, p) complex, in the unit of the file
    times, frequencies : s and Hz; both empty of samples whose rate is to be given
    rate : Hz, of samples without times; nan if the file has none
    quantity, unit : str, "" where the file does not say
    places : (p, 2) float, metre, nan where unknown
    drive : (t,) or (f,), the reference signal; empty without
    sign : 1 or -1, of a direction that the file tells, into the body or out of it; 0 if it does not
    name, remarks : as of `Measurement`
    """

    values: np.ndarray
    times: Floats = field(default_factory=lambda: np.empty(0))
    frequencies: Floats = field(default_factory=lambda: np.empty(0))
    rate: float = float("nan")
    quantity: str = ""
    unit: str = ""
    places: Floats
    drive: np.ndarray = field(default_factory=lambda: np.empty(0))
    sign: int = 0
    name: str = ""
    remarks: tuple[str, ...] = ()


def nowhere(count: int) -> Floats:
    """Places (p, 2) that are not known."""
    return np.full((count, 2), np.nan)


def completed(found: Recording, given: Given, path: Path) -> Measurement:
    """The measurement in SI, positive into the body.

    Parameters
    ----------
    found : Recording
    given : Given
    path : of the file

    Returns
    -------
    Measurement

    Raises
    ------
    ValueError
        If neither the file nor the user say what is needed, with the option that says it.
    """
    quantity, unit = _quantity(found, given)
    sign, said = _sign(found, given)
    values = sign * units.in_si(found.values, units.per_unit(unit, quantity))
    if values.size and not np.abs(values).max() < LARGEST:
        raise ValueError(
            f"values reach {np.abs(values).max():g} in SI; leave out nan and inf, and check --unit"
        )
    times = _times(found, given)
    places, placed = _places(found, given)
    return Measurement(
        quantity=quantity,
        places=places,
        times=times,
        frequencies=found.frequencies,
        values=values,
        drive=found.drive,
        name=found.name or path.stem,
        source=path.name,
        remarks=tuple(dict.fromkeys((*found.remarks, *placed, *said))),
    )


def _quantity(found: Recording, given: Given) -> tuple[str, str]:
    """Quantity and unit."""
    unit = given.unit or found.unit
    quantity = given.quantity or found.quantity or units.quantity_of(unit)
    if not unit:
        missing = "the unit" if quantity else "what was measured, and its unit"
        option = f"--unit {_usual(quantity)}" if quantity else EXAMPLE
        raise ValueError(f"{missing} is not in the file; give {option}")
    if not quantity:
        units.per_unit(unit, "displacement")  # whose sentence names what is wrong with it
    return choose("quantity", quantity, [name for name, q in QUANTITIES.items() if q.of_body]), unit


def _usual(quantity: str) -> str:
    found = QUANTITIES.get(quantity)
    return units.plain(found.shown) if found and quantity in units.MOTION else "UNIT"


def _sign(found: Recording, given: Given) -> tuple[int, list[str]]:
    if given.sign is not None:
        if given.sign not in (1, -1):
            raise ValueError(f"sign = {given.sign} must be 1, into the body, or -1, out of it")
        return given.sign, []
    if found.sign:
        return found.sign, []
    return 1, ["its direction is not in the file and taken as positive into the body; "
               "--positive out turns it"]  # fmt: skip


def _times(found: Recording, given: Given) -> Floats:
    if len(found.frequencies):
        return np.empty(0)
    if given.rate is None and len(found.times):
        return found.times
    rate = found.rate if given.rate is None else given.rate
    if np.isnan(rate):
        raise ValueError("the sampling rate is not in the file; give --rate in Hz")
    if not 0 < rate < np.inf:
        raise ValueError(f"the rate of {rate:g} Hz must be above 0 and finite; give --rate in Hz")
    return np.arange(found.values.shape[1]) / rate


def _places(found: Recording, given: Given) -> tuple[Floats, list[str]]:
    count = found.values.shape[2]
    if given.places is None:
        lost = int(np.isnan(found.places).any(axis=1).sum())
        said = f"of {lost} of {count} places the position is not in the file; give --places"
        return found.places, [said] * bool(lost)
    places = np.atleast_2d(np.asarray(given.places, np.float64))
    if places.shape != (count, 2):
        raise ValueError(
            f"--places has {len(places)} places, and the file has {count}; give one for each, as "
            '--places "0,0 5,0" in mm'
        )
    return places, []
