"""Completion of a file's recording: SI units, positive into the body, even times, no gaps."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from simple_model.choices import choose
from simple_model.quantities import QUANTITIES
from skinwave.measure.measurement import UNEVEN, Measurement
from skinwave.system import units
from skinwave.system.plain_text import number_in
from skinwave.typing import Floats

FACTOR = re.compile(  # names of numbers that scale counts
    r"^(?!.*(vertical|horizontal|probe)).*(^|[ _.\[-])(scal(e|ing)|skalierung|fa[ck]tor|y?mult|cal|"
    r"calib(ration)?|sensitivity|empfindlichkeit|gain|lsb|slope|resolution|full_?scale|range|"
    r"counts?_per_\w+|units?_?per_?\w+|per_(count|bit|lsb))($|[ _.:=(\[-])",
    re.IGNORECASE,
)
LARGEST_GAPS = 0.1  # of the samples


@dataclass(frozen=True, kw_only=True, eq=False)
class Given:
    """Information from a user. Each value replaces that in the file, unless it is None or "".

    Parameters
    ----------
    quantity : "displacement", "velocity", "acceleration" or another of `QUANTITIES`
    unit : "mm/s", "um", "g", ...; "20 mm/s" if 1 in the file stands for 20 mm/s
    places : (p, 2) float, m
    sign : 1 if positive values are into the body, -1 if out of it
    rate : Hz, replaces the time step of the file; the first sample keeps its number of steps from 0
    variable : name of the array of motion in a file with several
    columns : headings or numbers, from 1, of the columns or channels of motion
    direction : "x", "y" or "z", the direction of motion in a Universal File
    """

    quantity: str = ""
    unit: str = ""
    places: Floats | None = None
    sign: int | None = None
    rate: float | None = None
    variable: str = ""
    columns: tuple[str, ...] = ()
    direction: str = ""

    def __post_init__(self) -> None:
        if self.sign not in (None, 1, -1):
            raise ValueError(f"sign = {self.sign} must be 1 (into the body) or -1 (out of it)")
        if self.places is not None:
            object.__setattr__(self, "places", np.atleast_2d(self.places).astype(float))


@dataclass(frozen=True, kw_only=True, eq=False)
class Recording:
    """Content of a file, in its own unit."""

    values: np.ndarray  # (r, t, p) float or (r, f, p) complex
    times: Floats = field(default_factory=lambda: np.empty(0))  # s
    frequencies: Floats = field(default_factory=lambda: np.empty(0))  # Hz
    rate: float = float("nan")  # Hz, of samples without times
    quantity: str = ""
    unit: str = ""
    places: Floats  # (p, 2) m, nan if unknown
    drive: np.ndarray = field(default_factory=lambda: np.empty(0))  # (t,) or (f,)
    sign: int = 0  # 1 into the body, -1 out of it, 0 unknown
    name: str = ""
    factors: Mapping[str, float] = field(default_factory=dict)  # that may not be applied
    remarks: tuple[str, ...] = ()


def unknown_places(count: int) -> Floats:
    """Return places (p, 2) of nan."""
    return np.full((count, 2), np.nan)


def complete(recording: Recording, given: Given, path: Path) -> Measurement:
    """Return the measurement in SI, positive into the body."""
    remarks = list(recording.remarks)
    factor = _amplitude(recording, given, remarks)
    quantity, unit = _quantity(recording, given)
    _check_counts(recording, given, unit, remarks)
    places, count = recording.places, recording.values.shape[2]
    places = places if given.places is None else given.places
    if places.shape != (count, 2):
        raise ValueError(f"--places has {len(places)} places, and the file has {count} signals")
    recording = _without_empty(replace(recording, places=places), remarks)
    times, recording = _sample_evenly(recording, given, remarks)
    sign = given.sign or recording.sign
    values = units.in_si(recording.values, units.motion_divisor(unit, quantity))
    values = values * ((sign or 1) * factor)
    largest_value = 1e100  # in SI; squares of larger values may overflow
    if values.size and not np.abs(values).max() < largest_value:
        raise ValueError(f"values reach {np.abs(values).max():g} in SI; check them and --unit")
    if missing := int(np.isnan(recording.places).any(axis=1).sum()):
        count = len(recording.places)
        remarks.append(f"{missing} of {count} places have no position; give --places")
    still = np.flatnonzero((values == values[:, :1]).all(axis=(0, 1))) + 1
    if len(still) and values.shape[1] > 1:
        remarks.append(f"place {', '.join(map(str, still[:8]))} has the same value throughout; "
                       "choose others with --columns")  # fmt: skip
    if not sign:
        remarks.append("the file gives no sign: positive is taken as into the body; use "
                       "--positive out to flip it")  # fmt: skip
    return Measurement(
        quantity=quantity, places=recording.places, times=times,
        frequencies=recording.frequencies, values=values, drive=recording.drive,
        name=recording.name or path.stem, source=path.name, remarks=tuple(dict.fromkeys(remarks)),
    )  # fmt: skip


def _amplitude(recording: Recording, given: Given, remarks: list[str]) -> float:
    """Return the amplitude of values whose level, such as RMS, is 1."""
    units.check_linear(recording.unit)
    level = units.split_level(given.unit)[1] or units.split_level(recording.unit)[1]
    factor = units.amplitude(level)
    if recording.frequencies.size:
        if factor != 1:
            remarks.append(f"{level} values are multiplied by {factor:.4g}, which gives amplitudes")
        return factor
    is_level = np.isrealobj(recording.values) and np.nanmin(recording.values, initial=0.0) >= 0
    if factor != 1 or (level and is_level and not given.unit):
        cure = 'export the waveform or, if it is one, give a unit such as --unit "mm/s peak"'
        raise ValueError(f"{level} values over time are a level, not a waveform; {cure}")
    return 1.0


def _check_counts(recording: Recording, given: Given, unit: str, remarks: list[str]) -> None:
    """Raise a ValueError for whole numbers beside a factor that is not applied.

    For other numbers, add a remark on the factor.
    """
    if re.match(r"[+-]?[\d.]", given.unit.strip()):
        return
    for name, factor in recording.factors.items():
        text = f"'{name[:40]}' = {factor:g}"
        values = recording.values[~np.isnan(recording.values)]
        if (values == np.rint(values.real)).all():
            of_count = r"(?<!full.)scal|fa[ck]tor|mult|cal|lsb|slope|(?<!counts)_per"
            number = factor if re.search(of_count, name, re.IGNORECASE) else 0.01
            cure = f'give the motion of 1, such as --unit "{number:g} {unit}"'
            raise ValueError(f"{text} seems to be the factor of whole numbers; {cure}")
        remarks.append(f"{text} is not applied; if values lack it, give a --unit that contains it")


def factors_in(texts: Mapping[str, object]) -> dict[str, float]:
    """Return the numbers other than 1 whose names say that they scale values."""
    named = {name: str(value) for name, value in texts.items() if FACTOR.match(name)}
    found = {name: number_in(f"{text} ".split(" ")[0]) for name, text in named.items()}
    return {n: x for n, x in found.items() if x not in (None, 0.0, 1.0) and "dB" not in named[n]}


def _quantity(recording: Recording, given: Given) -> tuple[str, str]:
    """Return quantity and unit."""
    unit = given.unit or units.split_level(recording.unit)[0]
    by_unit = units.quantity_of(unit)
    quantity = given.quantity or (given.unit and by_unit) or recording.quantity or by_unit
    if not unit:
        if not quantity:
            example = "--quantity velocity --unit mm/s"
            raise ValueError(f"the file gives neither quantity nor unit; give {example}")
        known = QUANTITIES.get(quantity)
        usual = units.canonical(known.shown) if known and quantity in units.MOTION else "UNIT"
        raise ValueError(f"the file gives no unit; give --unit {usual}")
    if not given.unit and not quantity:
        raise ValueError(f'give the motion that 1 {unit[:40]} stands for: --unit "20 mm/s"')
    if not quantity:
        units.motion_divisor(unit, "displacement")  # whose error names what is wrong
    return choose("quantity", quantity, [name for name, q in QUANTITIES.items() if q.of_body]), unit


def _without_empty(recording: Recording, remarks: list[str]) -> Recording:
    """Return the recording without empty places and frequencies."""
    missing = np.isnan(recording.values)
    place = ~missing.all(axis=(0, 1))
    if not place.any():
        raise ValueError("no place has a value; export the measured values")
    if not place.all():
        remarks.append(f"{(~place).sum()} of {len(place)} places have no value and are left out")
    recording = replace(
        recording, values=recording.values[:, :, place], places=recording.places[place]
    )
    at = ~missing[:, :, place].any(axis=(0, 2))
    if not len(recording.frequencies) or at.all():
        return recording
    if 2 * at.sum() < len(at):
        raise ValueError(f"only {at.sum()} of {len(at)} frequencies have values at all places")
    remarks.append(f"{(~at).sum()} frequencies without values are left out")
    drive = recording.drive[at] if len(recording.drive) else recording.drive
    frequencies, values = recording.frequencies[at], recording.values[:, at]
    return replace(recording, values=values, frequencies=frequencies, drive=drive)


def _sample_evenly(
    recording: Recording, given: Given, remarks: list[str]
) -> tuple[Floats, Recording]:  # fmt: skip
    """Return even times, and the recording at these times, with missing samples filled in."""
    if len(recording.frequencies):
        if recording.frequencies.min() < 0:
            raise ValueError("frequencies fall below 0 Hz; export the one-sided spectrum")
        return np.empty(0), recording
    times, index = _times(recording, given, remarks)
    runs, samples, count = recording.values.shape
    has_drive = len(recording.drive) == samples
    full = np.full((runs, len(times), count + has_drive), np.nan)
    full[:, index, :count] = recording.values
    if has_drive:
        full[:, index, count] = recording.drive
    if np.isnan(full).any():
        part = _complete_part(full)
        if cut := len(times) - (part.stop - part.start):
            remarks.append(f"{cut} samples at the start or the end have no value and are left out")
        times, full = times[part], full[:, part]
        _interpolate(full, remarks)
    lowest_rate = 40.0  # Hz; half of it is below all vibrations that are felt
    if len(times) > 1 and (rate := 1 / (times[1] - times[0])) < lowest_rate:
        remarks.append(f"samples at {rate:.3g} Hz show no vibration that is felt; check the times, "
                       "or give --rate")  # fmt: skip
    drive = full[0, :, count] if has_drive else recording.drive
    return times, replace(recording, values=full[..., :count], drive=drive)


def _times(recording: Recording, given: Given, remarks: list[str]) -> tuple[Floats, np.ndarray]:
    """Return even times, and the index of each sample of the file in them."""
    count = recording.values.shape[1]
    rate = recording.rate if given.rate is None else given.rate
    if given.rate is None and len(recording.times):
        return _even_times(recording.times)
    if np.isnan(rate):
        raise ValueError("the file gives no sampling rate; give --rate in Hz")
    if not 0 < rate < np.inf:
        raise ValueError(f"the rate of {rate:g} Hz must be above 0 and finite; give --rate in Hz")
    if len(recording.times) < 2:
        return np.arange(count) / rate, np.arange(count)
    try:
        times, index = _even_times(recording.times)
    except ValueError:
        span, steps = float(recording.times[-1] - recording.times[0]), np.diff(recording.times)
        if not span > 0 or steps.max() > max(3 * steps.mean(), 1.5 * np.median(steps[steps > 0])):
            raise
        times = recording.times[0] + span * np.linspace(0, 1, count)
        index = np.arange(count)
    step, start = float(times[-1] - times[0]) / (len(times) - 1), float(times[0])
    if not np.isclose(step * rate, 1, rtol=UNEVEN):
        start /= step * rate
        remarks.append(f"the file's steps of {step:g} s are replaced by 1/{rate:g} s")
    return start + np.arange(len(times)) / rate, index


def _even_times(times: Floats) -> tuple[Floats, np.ndarray]:
    """Return even times (n,) from rounded ones with missing rows, and indices (t,) of rows."""
    largest = float(np.abs(times).max(initial=0.0))
    largest_time = 1e8  # s; later times count from an epoch
    if largest > largest_time:
        times = times - times[0]
    steps, index = np.diff(times), np.arange(len(times))
    if not np.isfinite(times).all():
        raise ValueError("a time is missing or not finite; complete the times, or give --rate")
    if len(times) < 2:
        return times, index
    if not steps.min() > 0:
        raise ValueError("times must rise; sort them or, if they are rounded, give --rate")
    if np.abs(steps - steps.mean()).max() <= UNEVEN * steps.mean():
        return times, index
    step = float(np.median(steps))
    index = np.concatenate([[0], np.cumsum(np.rint(steps / step).astype(int))])
    step, start = np.polyfit(index, times, 1)
    away = float(np.abs(times - start - step * index).max())
    time_digits = 7  # to which programs round times
    rounding = 0.51 * 10.0 ** (np.floor(np.log10(largest)) + 1 - time_digits)
    largest_rounding = 0.25  # of a sampling interval
    allowed = max(UNEVEN * step, min(rounding, largest_rounding * step))
    if np.diff(index).min() < 1 or away > allowed:
        steps_s = f"{steps.min():g} to {steps.max():g} s"
        raise ValueError(f"times must rise in equal steps, not {steps_s}; if rounded, give --rate")
    if (missing := index[-1] + 1 - len(index)) > LARGEST_GAPS * len(index):
        raise ValueError(
            f"{missing} rows are missing between the {len(index)} that the file has; give a part "
            "without gaps"
        )
    full = start + step * np.arange(index[-1] + 1)
    if away <= UNEVEN * step:
        full[index] = times
    return full, index


def _complete_part(values: Floats) -> slice:
    """Return the samples between the first and last value that all places of (r, n, p) have."""
    known, count = ~np.isnan(values), values.shape[1]
    if not known.any(axis=1).all():
        raise ValueError("a repetition of a place has no value; choose others with --columns")
    part = slice(int(known.argmax(axis=1).max()), count - int(known[:, ::-1].argmax(axis=1).max()))
    if part.stop - part.start < (1 - LARGEST_GAPS) * count:
        common = max(part.stop - part.start, 0)
        raise ValueError(f"only {common} of {count} samples are common to all places; export these")
    return part


def _interpolate(values: Floats, remarks: list[str]) -> None:
    """Fill the gaps of values (r, n, p) by cubic splines."""
    gaps = np.isnan(values)
    if not gaps.any():
        return
    error = max(_fill(values[r, :, p], gaps[r, :, p]) for r, p in np.argwhere(gaps.any(axis=1)))
    remarks.append(
        f"{int(gaps.any(axis=(0, 2)).sum())} samples are missing and interpolated, with an error "
        f"of about {100 * error:.2g} % of the RMS"
    )


def _fill(row: Floats, gap: np.ndarray) -> float:
    """Fill the gaps of a row; return the relative error of filling equal gaps elsewhere."""
    from scipy.interpolate import CubicSpline  # slow to import

    known = np.flatnonzero(~gap)
    longest = int(np.diff(known).max()) - 1
    gap_margin = 8  # samples on both sides of each
    width = longest + 2 * gap_margin
    free = np.flatnonzero(np.convolve(gap, np.ones(width), "valid") == 0)
    size, error = float(row[known].std()), np.inf
    gap_trials = 16  # positions at which interpolation is tested
    if len(free) >= gap_trials and gap.sum() <= LARGEST_GAPS * len(row):
        hidden, away = slice(gap_margin, gap_margin + longest), []
        for first in free[np.linspace(0, len(free) - 1, gap_trials).astype(int)]:
            at = np.arange(first, first + width)
            others = np.delete(at, hidden)
            away.append(CubicSpline(others, row[others])(at[hidden]) - row[at[hidden]])
        error = float(np.sqrt(np.mean(np.square(away)))) / size if size > 0 else 0.0
    largest_gap_error = 0.1  # of the RMS
    if not error <= largest_gap_error:
        missing = f"{int(gap.sum())} samples are missing, up to {longest} in a row"
        raise ValueError(f"{missing}, too many to interpolate; choose --columns, or cut the rows")
    row[gap] = CubicSpline(known, row[known])(np.flatnonzero(gap))
    return error
