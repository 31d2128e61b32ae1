"""Recordings of named arrays, as .npz and .mat files have them.

Times, places, the drive and words are found by their names; the motion by --variable, by its name,
or as the only other array that fits.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from simple_model.typing import Floats
from skinwave.measure import units
from skinwave.measure.headers import NAMES, TIME, column
from skinwave.measure.recording import Given, Recording, nowhere
from skinwave.measure.references import aligned
from skinwave.measure.table import rises

TIMES = ("t", "time", "times", "t_s", "time_s")
FREQUENCIES = ("f", "freq", "frequency", "frequencies", "frequency_hz", "f_hz")
RATES = (
    "fs", "rate", "sampling_rate", "sample_rate", "samplerate", "sampling_frequency", "rate_hz",
)  # fmt: skip
STARTS = ("t0", "t_start", "tstart", "start_time", "x0")
INTERVALS = ("dt", "sampling_interval")
PLACES = ("places", "points", "probes", "xy", "xyz", "positions", "coordinates", "locations")
MILLIMETRES = tuple(f"{name}_mm" for name in PLACES)
FARTHEST = 5.0  # m, of a place: beyond it the unit is another one
DRIVES = ("drive", "ref", "reference", "r", "trigger")
WORDS = ("quantity", "unit", "name")
MOTION = {name: kind for kind in units.MOTION for name in NAMES[kind]} | dict.fromkeys(
    ("values", "y", "data", "signal", "signals"), ""
)
KNOWN = (*TIMES, *FREQUENCIES, *RATES, *INTERVALS, *STARTS, *PLACES, *MILLIMETRES, *DRIVES, *WORDS)


def recording(arrays: Mapping[str, Any], given: Given) -> Recording:
    """The recording that named arrays hold.

    Parameters
    ----------
    arrays : arrays of numbers and texts, by name; of a structure as "structure.name"
    given : Given, whose variable is the array of motion

    Returns
    -------
    Recording

    Raises
    ------
    ValueError
        If no array, or more than one, can be the motion, or the shapes do not fit.
    """
    short = {name.rpartition(".")[2].lower(): array for name, array in arrays.items()}
    times, frequencies = _times(short), vector(short, FREQUENCIES)
    name = given.variable or _motion(arrays)
    if name not in arrays:
        raise ValueError(f"no array is named '{name[:40]}'; give --variable as {_list(arrays)}")
    values = np.asarray(arrays[name])
    if values.dtype.kind not in "fiuc" or not values.size:
        raise ValueError(f"the array '{name[:40]}' holds no numbers; give another --variable")
    if len(times) and len(frequencies):
        times, frequencies = (times, np.empty(0)) if values.dtype.kind != "c" else (
            np.empty(0), frequencies)  # fmt: skip
    axis = times if len(times) else frequencies
    places = _places(short) if given.places is None else given.places
    ordered, said = in_order(values, len(axis), len(places), name)
    first = [float(short[key].ravel()[0]) for key in STARTS if np.size(short.get(key, ())) == 1
             and np.asarray(short[key]).dtype.kind in "fiu"]  # fmt: skip
    if first and not len(axis) and not np.isnan(rate(short)):
        times = axis = first[0] + np.arange(ordered.shape[1]) / rate(short)
    if not len(axis):
        times, ordered, found = _times_within(ordered, name, given)
        said += found
    drive = vector(short, DRIVES)
    each = next((short[key] for key in DRIVES if np.shape(short.get(key, 0)) == values.shape), None)
    if each is not None and not len(frequencies):
        every = in_order(np.asarray(each), len(axis), len(places), name)[0]
        ordered, drive, more = aligned(_real(ordered, name), _real(every, name))
        times, said = times[: ordered.shape[1]], [*said, more]
    return Recording(
        values=ordered if len(frequencies) else _real(ordered, name),
        times=times, frequencies=frequencies, rate=rate(short),
        quantity=_word(short, "quantity") or MOTION.get(name.rpartition(".")[2].lower(), ""),
        unit=_word(short, "unit"), name=_word(short, "name"),
        places=places if len(places) == ordered.shape[2] else nowhere(ordered.shape[2]),
        drive=drive if len(drive) == ordered.shape[1] else np.empty(0), remarks=tuple(said),
    )  # fmt: skip


def in_order(
    values: np.ndarray, samples: int, places: int, name: str
) -> tuple[np.ndarray, list[str]]:
    """Values (r, n, p), whatever the order of the axes of an array, and what was assumed.

    Parameters
    ----------
    values : array of one to three axes that are longer than 1
    samples, places : how many times or frequencies and places there are; 0 if not known
    name : of the array

    Returns
    -------
    values (r, n, p), and sentences

    Raises
    ------
    ValueError
        If no axis has as many samples, or it has more than three axes.
    """
    kept = values if values.ndim <= 3 else values.squeeze()
    if kept.ndim > 3 or kept.ndim == 0:
        raise ValueError(f"'{name[:40]}' has the shape {values.shape}; give samples and places")
    sizes = list(kept.shape)
    free = [k for k, size in enumerate(sizes) if size != places or sizes.count(places) > 1]
    along = [k for k, size in enumerate(sizes) if size == samples] if samples else [
        max(free or range(kept.ndim), key=lambda k: sizes[k])]  # fmt: skip
    if not along:
        raise ValueError(
            f"'{name[:40]}' has the shape {kept.shape}, and there are {samples} times or "
            "frequencies; give an array with as many"
        )
    said = [] if samples or kept.ndim == 1 else [
        f"the axis of {sizes[along[0]]} of '{name[:40]}' is taken as time"]  # fmt: skip
    time = 1 if kept.ndim == 3 and 1 in along else along[0]
    rest = [k for k in range(kept.ndim) if k != time]
    across = [k for k in rest if sizes[k] == places] if places else []
    spot = across[0] if across else max(rest, key=lambda k: sizes[k], default=-1)
    again = [k for k in rest if k != spot]
    order = [*again, time, *([spot] if spot >= 0 else [])]
    moved = np.transpose(kept, order)
    moved = moved if spot >= 0 else moved[..., None]
    return moved if moved.ndim == 3 else moved[None], said


def _motion(arrays: Mapping[str, Any]) -> str:
    """Name of the array that is the motion."""
    large = [
        name for name, array in arrays.items()
        if np.asarray(array).dtype.kind in "fiuc" and np.size(array) > 1
    ]  # fmt: skip
    ends = {name: name.rpartition(".")[2].lower() for name in large}
    named = [name for name in large if ends[name] in MOTION and ends[name] not in KNOWN]
    other = named or [name for name in large if ends[name] not in KNOWN]
    if len(other) == 1:
        return other[0]
    if not other:
        raise ValueError(f"no array is of motion, only {_list(arrays)}; give --variable")
    raise ValueError(f"several arrays may be of motion; give --variable as {_list(other)}")


def _list(names: Any) -> str:
    shown = [str(name)[:40] for name in names]
    return ", ".join(shown[:12]) + (f" and {len(shown) - 12} more" if len(shown) > 12 else "")


def vector(arrays: Mapping[str, Any], names: tuple[str, ...]) -> np.ndarray:
    """The first array of one axis by these names, or of copies of one; empty if there is none.

    Raises
    ------
    ValueError
        If places have times of their own.
    """
    for name in names:
        if name in arrays and np.asarray(arrays[name]).dtype.kind in "fiuc":
            array = np.asarray(arrays[name])
            if array.size > 1 and array.size == max(array.shape):
                return array.ravel()
            if names is TIMES and array.ndim == 2:
                rows = array if np.diff(array, axis=1).min(initial=1.0) > 0 else array.T
                first = rows[np.argmax(np.isfinite(rows).sum(axis=1))]
                if not (np.isnan(rows) | np.isclose(rows, first, rtol=1e-9, atol=0)).all():
                    raise ValueError(
                        f"the times '{name}' differ from place to place; save signals of the same "
                        "times, or a reference of each"
                    )
                return first
    return np.empty(0)


def _times(arrays: Mapping[str, Any]) -> np.ndarray:
    """Times in s, of an array "t" or "time", or one whose name ends in its unit: "t_ms"."""
    found = vector(arrays, TIMES).real
    for name in () if len(found) else arrays:
        one = column(name)
        if one.role == TIME and one.unit and len(array := vector(arrays, (name,))):
            found = units.in_si(array, units.scale(one.unit, units.TIMES, "time"))
    return found


def _times_within(
    values: np.ndarray, name: str, given: Given
) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Times of a column of a matrix that rises evenly, the other columns, and a sentence."""
    count = values.shape[2]
    rising = [p for p in range(count) if np.isrealobj(values) and rises(values[0, :, p])]
    if not rising or count < 2:
        return np.empty(0), values, []
    if given.rate is None:
        raise ValueError(
            f"column {rising[0] + 1} of '{name[:40]}' rises evenly as times do; give --rate in Hz, "
            "or save the times as an array 't' in s"
        )
    said = f"column {rising[0] + 1} of '{name[:40]}' rises evenly and is taken as time"
    return values[0, :, rising[0]].astype(float), np.delete(values, rising[0], axis=2), [said]


def rate(arrays: Mapping[str, Any]) -> float:
    """Sampling rate in Hz by its usual names; nan if there is none."""
    for names, power in ((RATES, 1), (INTERVALS, -1)):
        for name in names:
            found = np.asarray(arrays.get(name, ""))
            if found.dtype.kind in "fiu" and found.size == 1 and found.ravel()[0] > 0:
                return float(found.ravel()[0]) ** power
    return float("nan")


def _places(arrays: Mapping[str, Any]) -> Floats:
    """Places (p, 2) in metre, of the first two coordinates; (0, 2) if there are none."""
    for name in (*PLACES, *MILLIMETRES):
        found = np.asarray(arrays.get(name, ""))
        if found.dtype.kind in "fiu" and found.ndim == 2 and {2, 3} & set(found.shape):
            points = (found if found.shape[1] in (2, 3) else found.T)[:, :2].astype(np.float64)
            points = points / 1e3 if name in MILLIMETRES else points
            if np.nanmax(np.abs(points), initial=0.0) > FARTHEST:
                raise ValueError(
                    f"'{name}' reaches {np.nanmax(np.abs(points)):g} m; name an array in "
                    "millimetre 'places_mm', or give --places"
                )
            return points
    return np.empty((0, 2))


def _word(arrays: Mapping[str, Any], name: str) -> str:
    found = np.asarray(arrays.get(name, ""))
    return str(found.ravel()[0]).strip()[:80] if found.dtype.kind == "U" and found.size else ""


def _real(values: np.ndarray, name: str) -> np.ndarray:
    if np.iscomplexobj(values):
        raise ValueError(
            f"'{name[:40]}' is complex and there are no frequencies; add an array 'frequencies' "
            "in Hz"
        )
    return values.astype(np.float64)
