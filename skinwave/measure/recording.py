"""A file's recording as it stands, what a user adds to it, and the measurement that both make."""

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from simple_model.choices import choose
from simple_model.quantities import QUANTITIES
from simple_model.typing import Floats
from skinwave.measure import sampling, units
from skinwave.measure.measurement import UNEVEN, Measurement

LARGEST = 1e100  # of any value in SI: squares of larger ones may overflow
SLOWEST = 40.0  # Hz of samples: half of it is below all vibrations that are felt
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
    columns : headings or numbers from 1 of the columns or channels of motion; all if empty
    direction : "x", "y" or "z", of the motion in a file of several; "z" if ""
    """

    quantity: str = ""
    unit: str = ""
    places: Floats | None = None
    sign: int | None = None
    rate: float | None = None
    variable: str = ""
    columns: tuple[str, ...] = ()
    direction: str = ""


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
    places, placed = _places(found, given)
    found, missing = _measured(replace(found, places=places))
    axis, found, filled = _sampled(found, given)
    if len(axis) > 1 and (rate := 1 / (axis[1] - axis[0])) < SLOWEST:
        filled.append(
            f"samples at {rate:.3g} Hz show no vibration that is felt; check the times, or give "
            "--rate"
        )
    values = sign * units.in_si(found.values, units.per_unit(unit, quantity))
    if values.size and not np.abs(values).max() < LARGEST:
        raise ValueError(
            f"values reach {np.abs(values).max():g} in SI; leave out nan and inf, and check --unit"
        )
    return Measurement(
        quantity=quantity,
        places=found.places,
        times=axis,
        frequencies=found.frequencies,
        values=values,
        drive=found.drive,
        name=found.name or path.stem,
        source=path.name,
        remarks=tuple(
            dict.fromkeys((*found.remarks, *missing, *filled, *placed, *_constant(values), *said))
        ),
    )


def _constant(values: np.ndarray) -> list[str]:
    """Sentence on places (r, n, p) at which nothing varies."""
    still = np.flatnonzero((values == values[:, :1]).all(axis=(0, 1)))
    if not len(still) or values.shape[1] < 2:
        return []
    listed = ", ".join(str(k + 1) for k in still[:8])
    return [
        f"place {listed} has the same value throughout, as without a signal; choose others by "
        "--columns"
    ]


def _measured(found: Recording) -> tuple[Recording, list[str]]:
    """The recording without places and frequencies of which nothing was measured, and sentences."""
    gone = np.isnan(found.values)
    if not gone.any():
        return found, []
    place = ~gone.all(axis=(0, 1))
    if not place.any():
        raise ValueError("no place has a value; export the measured values")
    said = [f"{(~place).sum()} of {len(place)} places have no value and are left out"] * int(
        not place.all()
    )
    found = replace(found, values=found.values[:, :, place], places=found.places[place])
    if len(found.frequencies):
        at = ~np.isnan(found.values).any(axis=(0, 2))
        if 2 * at.sum() < len(at):
            raise ValueError(f"only {at.sum()} of {len(at)} frequencies have values of all places")
        said += [f"{(~at).sum()} frequencies without values are left out"] * int(not at.all())
        drive = found.drive[at] if len(found.drive) else found.drive
        found = replace(
            found, values=found.values[:, at], frequencies=found.frequencies[at], drive=drive
        )
    return found, said


def _quantity(found: Recording, given: Given) -> tuple[str, str]:
    """Quantity and unit."""
    unit = given.unit or found.unit
    of_unit = units.quantity_of(unit)
    quantity = given.quantity or (of_unit if given.unit else "") or found.quantity or of_unit
    if not unit:
        missing = "the unit" if quantity else "what was measured, and its unit"
        option = f"--unit {_usual(quantity)}" if quantity else EXAMPLE
        raise ValueError(f"{missing} is not in the file; give {option}")
    if not given.unit and not quantity and "dB" not in unit:
        raise ValueError(
            f"the values are in {unit[:40]}, and how much motion that is is not in the file; give "
            f'--unit "20 mm/s" if 1 {unit[:40]} stands for 20 mm/s'
        )
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


def _sampled(found: Recording, given: Given) -> tuple[Floats, Recording, list[str]]:
    """Even times, the recording at each of them, and sentences on what was filled or replaced."""
    if len(found.frequencies):
        if found.frequencies.min() < 0:
            raise ValueError("frequencies fall below 0 Hz; export the one-sided spectrum")
        return np.empty(0), found, []
    times, index, said = _times(found, given)
    together = found.values
    if len(found.drive) == together.shape[1]:
        drive = np.broadcast_to(found.drive[:, None], (len(together), len(found.drive), 1))
        together = np.concatenate([together, drive], axis=2)
    full, part, more = sampling.complete(np.moveaxis(together, 1, 2), index, len(times))
    full = np.moveaxis(full, 2, 1)
    count = found.values.shape[2]
    drive = full[0, :, count] if full.shape[2] > count else found.drive
    return times[part], replace(found, values=full[..., :count], drive=drive), [*said, *more]


def _times(found: Recording, given: Given) -> tuple[Floats, np.ndarray, list[str]]:
    """Times of samples, the number of each sample of the file, and sentences. A rate that is given
    replaces steps; the first sample stays as many steps from zero.
    """
    count = found.values.shape[1]
    rate = found.rate if given.rate is None else given.rate
    if given.rate is None and len(found.times):
        return *sampling.even(found.times), []
    if np.isnan(rate):
        raise ValueError("the sampling rate is not in the file; give --rate in Hz")
    if not 0 < rate < np.inf:
        raise ValueError(f"the rate of {rate:g} Hz must be above 0 and finite; give --rate in Hz")
    if len(found.times) < 2:
        return np.arange(count) / rate, np.arange(count), []
    try:
        times, index = sampling.even(found.times)
    except ValueError:
        span = float(found.times[-1] - found.times[0])
        steps = np.diff(found.times)
        if not (
            span > 0 and steps.max() <= max(3 * steps.mean(), 1.5 * np.median(steps[steps > 0]))
        ):
            raise
        times, index = found.times[0] + span * np.linspace(0, 1, count), np.arange(count)
    step = float(times[-1] - times[0]) / (len(times) - 1)
    start, said = float(times[0]), []
    if not np.isclose(step * rate, 1, rtol=UNEVEN):
        start /= step * rate
        said.append(f"the file's steps of {step:g} are replaced by 1/{rate:g} s")
    return start + np.arange(len(times)) / rate, index, said


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
