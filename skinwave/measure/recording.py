"""A file's recording as it stands, what a user adds to it, and the measurement that both make: in
SI, positive into the body, at even times without gaps.
"""

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from simple_model.choices import choose
from simple_model.quantities import QUANTITIES
from skinwave.measure import units
from skinwave.measure.measurement import UNEVEN, Measurement
from skinwave.typing import Floats

LARGEST = 1e100  # of any value in SI: squares of larger ones may overflow
SLOWEST = 40.0  # Hz of samples: half of it is below all vibrations that are felt
EXAMPLE = "--quantity velocity --unit mm/s"
CLOCK = 1e8  # s: later times are counted from an epoch, and become those from the first
DIGITS = 7  # of times as programs round them
COARSEST = 0.25  # of a sampling interval: what rounding may leave
LARGEST_GAPS = 0.1  # of the samples
LARGEST_ERROR = 0.1  # of the RMS: what interpolation may be wrong by
TRIALS = 16  # places in a record at which it is tried
BESIDE = 8  # samples on both sides of each


@dataclass(frozen=True, kw_only=True, eq=False)
class Given:
    """Options of a user, as `reading.read` has them: each replaces what the file says, None or ""
    leaves it.
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
    """The measurement in SI, positive into the body; raises a ValueError with the option that says
    what neither the file nor the user do.
    """
    said = list(found.remarks)
    quantity, unit = _quantity(found, given)
    if given.sign not in (None, 1, -1):
        raise ValueError(f"sign = {given.sign} must be 1, into the body, or -1, out of it")
    found = _measured(replace(found, places=_places(found, given)), said)
    times, found = _sampled(found, given, said)
    values = (given.sign or found.sign or 1) * units.in_si(
        found.values, units.per_unit(unit, quantity)
    )
    if values.size and not np.abs(values).max() < LARGEST:
        raise ValueError(
            f"values reach {np.abs(values).max():g} in SI; leave out nan and inf, and check --unit"
        )
    if lost := int(np.isnan(found.places).any(axis=1).sum()):
        said.append(f"of {lost} of {len(found.places)} places the position is not in the file; "
                    "give --places")  # fmt: skip
    still = np.flatnonzero((values == values[:, :1]).all(axis=(0, 1)))
    if len(still) and values.shape[1] > 1:
        said.append(f"place {', '.join(str(k + 1) for k in still[:8])} has the same value "
                    "throughout, as without a signal; choose others by --columns")  # fmt: skip
    if not (given.sign or found.sign):
        said.append("the file gives no sign: positive is taken as into the body; use "
                    "--positive out to flip it")  # fmt: skip
    return Measurement(
        quantity=quantity, places=found.places, times=times, frequencies=found.frequencies,
        values=values, drive=found.drive, name=found.name or path.stem, source=path.name,
        remarks=tuple(dict.fromkeys(said)),
    )  # fmt: skip


def _quantity(found: Recording, given: Given) -> tuple[str, str]:
    """Quantity and unit."""
    unit = given.unit or found.unit
    of_unit = units.quantity_of(unit)
    quantity = given.quantity or (of_unit if given.unit else "") or found.quantity or of_unit
    if not unit:
        if not quantity:
            raise ValueError(f"what was measured, and its unit, is not in the file; give {EXAMPLE}")
        known = QUANTITIES.get(quantity)
        usual = units.plain(known.shown) if known and quantity in units.MOTION else "UNIT"
        raise ValueError(f"the unit is not in the file; give --unit {usual}")
    if not given.unit and not quantity and "dB" not in unit:
        raise ValueError(
            f"the values are in {unit[:40]}, and how much motion that is is not in the file; give "
            f'--unit "20 mm/s" if 1 {unit[:40]} stands for 20 mm/s'
        )
    if not quantity:
        units.per_unit(unit, "displacement")  # whose sentence names what is wrong with it
    return choose("quantity", quantity, [name for name, q in QUANTITIES.items() if q.of_body]), unit


def _places(found: Recording, given: Given) -> Floats:
    count = found.values.shape[2]
    places = found.places if given.places is None else np.atleast_2d(given.places).astype(float)
    if places.shape != (count, 2):
        raise ValueError(
            f"--places has {len(places)} places, and the file has {count}; give one for each"
        )
    return places


def _measured(found: Recording, said: list[str]) -> Recording:
    """The recording without places and frequencies of which nothing was measured."""
    gone = np.isnan(found.values)
    place = ~gone.all(axis=(0, 1))
    if not place.any():
        raise ValueError("no place has a value; export the measured values")
    if not place.all():
        said.append(f"{(~place).sum()} of {len(place)} places have no value and are left out")
        found = replace(found, values=found.values[:, :, place], places=found.places[place])
    at = ~gone[:, :, place].any(axis=(0, 2))
    if not len(found.frequencies) or at.all():
        return found
    if 2 * at.sum() < len(at):
        raise ValueError(f"only {at.sum()} of {len(at)} frequencies have values of all places")
    said.append(f"{(~at).sum()} frequencies without values are left out")
    drive = found.drive[at] if len(found.drive) else found.drive
    return replace(
        found, values=found.values[:, at], frequencies=found.frequencies[at], drive=drive
    )


def _sampled(found: Recording, given: Given, said: list[str]) -> tuple[Floats, Recording]:
    """Even times, and the recording at each of them; samples at the start and the end at which a
    place has no value are cut off, and others that are missing interpolated.
    """
    if len(found.frequencies):
        if found.frequencies.min() < 0:
            raise ValueError("frequencies fall below 0 Hz; export the one-sided spectrum")
        return np.empty(0), found
    times, index = _times(found, given, said)
    runs, samples, count = found.values.shape
    has_drive = len(found.drive) == samples
    full = np.full((runs, len(times), count + has_drive), np.nan)
    full[:, index, :count] = found.values
    if has_drive:
        full[:, index, count] = found.drive
    if np.isnan(full).any():
        part = _known_part(full)
        if cut := len(times) - (part.stop - part.start):
            said.append(f"{cut} samples at the start or the end without a value are left out")
        times, full = times[part], full[:, part]
        _interpolate(full, said)
    if len(times) > 1 and (rate := 1 / (times[1] - times[0])) < SLOWEST:
        said.append(f"samples at {rate:.3g} Hz show no vibration that is felt; check the times, or "
                    "give --rate")  # fmt: skip
    drive = full[0, :, count] if has_drive else found.drive
    return times, replace(found, values=full[..., :count], drive=drive)


def _times(found: Recording, given: Given, said: list[str]) -> tuple[Floats, np.ndarray]:
    """Times of samples, and the number of each sample of the file. A rate that is given replaces
    steps; the first sample stays as many steps from zero.
    """
    count = found.values.shape[1]
    rate = found.rate if given.rate is None else given.rate
    if given.rate is None and len(found.times):
        return _even(found.times)
    if np.isnan(rate):
        raise ValueError("the sampling rate is not in the file; give --rate in Hz")
    if not 0 < rate < np.inf:
        raise ValueError(f"the rate of {rate:g} Hz must be above 0 and finite; give --rate in Hz")
    if len(found.times) < 2:
        return np.arange(count) / rate, np.arange(count)
    try:
        times, index = _even(found.times)
    except ValueError:
        span, steps = float(found.times[-1] - found.times[0]), np.diff(found.times)
        if not span > 0 or steps.max() > max(3 * steps.mean(), 1.5 * np.median(steps[steps > 0])):
            raise
        times, index = found.times[0] + span * np.linspace(0, 1, count), np.arange(count)
    step, start = float(times[-1] - times[0]) / (len(times) - 1), float(times[0])
    if not np.isclose(step * rate, 1, rtol=UNEVEN):
        start /= step * rate
        said.append(f"the file's steps of {step:g} are replaced by 1/{rate:g} s")
    return start + np.arange(len(times)) / rate, index


def _even(times: Floats) -> tuple[Floats, np.ndarray]:
    """Even times (n,) in s of rounded ones with missing rows, and the number (t,) of each.

    Times that are even within `UNEVEN` come back as they are.
    """
    largest = float(np.abs(times).max(initial=0.0))
    if largest > CLOCK:
        times = times - times[0]
    steps, index = np.diff(times), np.arange(len(times))
    if not np.isfinite(times).all():
        raise ValueError("a time is missing or not finite; complete the times, or give --rate")
    if len(times) < 2:
        return times, index
    if not steps.min() > 0:
        raise ValueError("times must rise; sort them, or give --rate if they are rounded")
    if np.abs(steps - steps.mean()).max() <= UNEVEN * steps.mean():
        return times, index
    step = float(np.median(steps))
    index = np.concatenate([[0], np.cumsum(np.rint(steps / step).astype(int))])
    step, start = np.polyfit(index, times, 1)
    away = float(np.abs(times - start - step * index).max())
    rounding = 0.51 * 10.0 ** (np.floor(np.log10(largest)) + 1 - DIGITS)
    if np.diff(index).min() < 1 or away > max(UNEVEN * step, min(rounding, COARSEST * step)):
        raise ValueError(
            f"times of a measurement must rise in equal steps, and theirs are {steps.min():g} to "
            f"{steps.max():g} s; sample it evenly, or give --rate"
        )
    if (missing := index[-1] + 1 - len(index)) > LARGEST_GAPS * len(index):
        raise ValueError(
            f"{missing} rows are missing between {len(index)} in equal steps; give a complete part"
        )
    full = start + step * np.arange(index[-1] + 1)
    if away <= UNEVEN * step:
        full[index] = times
    return full, index


def _known_part(values: Floats) -> slice:
    """Samples between the first and the last value of every place of values (r, n, p)."""
    known, count = ~np.isnan(values), values.shape[1]
    if not known.any(axis=1).all():
        raise ValueError("a repetition of a place has no value; choose others by --columns")
    part = slice(int(known.argmax(axis=1).max()), count - int(known[:, ::-1].argmax(axis=1).max()))
    if part.stop - part.start < (1 - LARGEST_GAPS) * count:
        raise ValueError(
            f"of {count} samples only {max(part.stop - part.start, 0)} lie between the first and "
            "the last value of every place; give the part, or the --columns, with values"
        )
    return part


def _interpolate(values: Floats, said: list[str]) -> None:
    """Fill the gaps of values (r, n, p) by cubic splines, and say how wrong these are."""
    gaps = np.isnan(values)
    if not gaps.any():
        return
    worst = max(
        _fill(values[r, :, p], gaps[r, :, p]) for r, p in np.argwhere(gaps.any(axis=1)).tolist()
    )
    said.append(
        f"{int(gaps.any(axis=(0, 2)).sum())} samples are missing and interpolated, with an error "
        f"of about {100 * worst:.2g} % of the RMS"
    )


def _fill(row: Floats, gap: np.ndarray) -> float:
    """Fill the gaps of a row; the error of gaps as long elsewhere, as a fraction of the RMS."""
    from scipy.interpolate import CubicSpline  # only where it is needed: it takes a while

    known = np.flatnonzero(~gap)
    longest = int(np.diff(known).max()) - 1
    width = longest + 2 * BESIDE
    free = np.flatnonzero(np.convolve(gap, np.ones(width), "valid") == 0)
    size, error = float(row[known].std()), np.inf
    if len(free) >= TRIALS and gap.sum() <= LARGEST_GAPS * len(row):
        hidden, wrong = slice(BESIDE, BESIDE + longest), []
        for first in free[np.linspace(0, len(free) - 1, TRIALS).astype(int)]:
            at = np.arange(first, first + width)
            beside = np.delete(at, hidden)
            wrong.append(CubicSpline(beside, row[beside])(at[hidden]) - row[at[hidden]])
        error = float(np.sqrt(np.mean(np.square(wrong)))) / size if size > 0 else 0.0
    if not error <= LARGEST_ERROR:
        raise ValueError(
            f"{int(gap.sum())} samples are missing, up to {longest} in a row, which is too long to "
            "interpolate; give the part without them, or leave out that place by --columns"
        )
    row[gap] = CubicSpline(known, row[known])(np.flatnonzero(gap))
    return error
