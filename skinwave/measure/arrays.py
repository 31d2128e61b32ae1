"""Recordings of named arrays: NumPy archives, skinwave's own and others, and MATLAB files.

Times, places, the drive and words are found by their names; the motion by --variable, by its name,
or as the only other array that fits.

One published set has a form of its own: Reardon et al., Sci. Adv. 9, eadf2037 (2023), doi
10.1126/sciadv.adf2037, record 10.5281/zenodo.7686560, skin velocity under a focus that draws a
zigzag along the hand. Its y (N, M, 2) is the velocity along the laser in m/s at N places, M times,
2 repetitions; places are measured one after the other, and the reference r tells when each began.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from meshes import reading, subprocess_call
from meshes.tetmesh import MeshError
from simple_model.quantities import QUANTITIES
from skinwave.measure import units
from skinwave.measure.delays import aligned
from skinwave.measure.headers import NAMES, TIME, column
from skinwave.measure.matlab import DAMAGED, read_arrays
from skinwave.measure.recording import Given, Recording, nowhere
from skinwave.measure.table import rises
from skinwave.models import named, names
from skinwave.typing import Floats

FORMAT = "skinwave measurement 1"
LARGEST = 2_000_000_000  # bytes of a MATLAB file
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
MOTION = {name: kind for kind in units.MOTION for name in NAMES[kind]} | dict.fromkeys(
    ("values", "y", "data", "signal", "signals"), ""
)
KNOWN = (*TIMES, *FREQUENCIES, *RATES, *INTERVALS, *STARTS, *PLACES, *MILLIMETRES, *DRIVES,
         "quantity", "unit", "name")  # fmt: skip
Arrays = Mapping[str, np.ndarray]


def read_npz(path: Path, given: Given) -> Recording:
    """The recording in an .npz file; of skinwave's own everything is in SI. Raises a ValueError if
    it is none, or its arrays do not make a measurement.
    """
    with reading.open_regular(path):
        pass
    try:
        found = reading.load_arrays(path)
    except ValueError:
        raise ValueError(
            "the file cannot be read as .npz; save arrays of numbers by numpy.savez"
        ) from None
    if str(found.get("format", "")) == FORMAT:
        return _own(found)
    if quantity := _of_response(found):
        alone = {name: found[name] for name in ("t", "probes", quantity)}
        read = recording(alone, replace(given, variable=""))
        return replace(read, unit=QUANTITIES[quantity].unit, sign=1)
    return recording(found, given)


def read_mat(path: Path, given: Given) -> Recording:
    """The recording in a MATLAB file; raises what `read_npz` does."""
    with reading.open_regular(path, LARGEST) as file:
        if not file.read(1):
            raise ValueError("the file is empty; download or export it anew")
    try:
        found = subprocess_call.call_reader(read_arrays, path)
    except MeshError as error:
        raise ValueError(DAMAGED) from error
    if not found:
        raise ValueError("the file has no arrays of numbers; save the signals as such")
    return recording(found, given)


def _own(found: Arrays) -> Recording:
    if missing := {"quantity", "unit", "values", "places", "times", "frequencies"} - found.keys():
        raise ValueError(f"the array '{min(missing)}' is missing; write the measurement anew")
    if found["values"].ndim != 3 or found["values"].dtype.kind not in "fc":
        raise ValueError(f"values have the shape {found['values'].shape}; write them anew")
    return Recording(
        quantity=str(found["quantity"]), unit=str(found["unit"]), places=found["places"],
        times=found["times"], frequencies=found["frequencies"], values=found["values"],
        drive=found.get("drive", np.empty(0)), sign=1, name=str(found.get("name", "")),
        remarks=tuple(map(str, found.get("remarks", ()))),
    )  # fmt: skip


def _of_response(found: Arrays) -> str:
    """Quantity of the responses that a file of skinwave's holds; "" if it is none."""
    own = [name for name in found if name in QUANTITIES]
    models = found.keys() - {"t", "probes", *own}
    if not {"t", "probes"} <= found.keys() or len(own) != 1 or not models <= set(names()):
        return ""
    if not QUANTITIES[own[0]].of_body or not all(named(name).needs_body for name in models):
        raise ValueError(
            "the file holds a pressure, which is no motion; give the response of a body"
        )
    return own[0]


def recording(arrays: Arrays, given: Given) -> Recording:
    """The recording that arrays of numbers and texts hold by name, of a structure by
    "structure.name"; the motion is the variable that is given.

    Raises a ValueError if no array, or more than one, can be the motion, or shapes do not fit.
    """
    short = {_last(name): array for name, array in arrays.items()}
    times, frequencies = _times(short), _vector(short, FREQUENCIES)
    name = given.variable or _motion(arrays)
    if name not in arrays:
        raise ValueError(f"no array is named '{name[:40]}'; give --variable as {_list(arrays)}")
    values = np.asarray(arrays[name])
    if values.dtype.kind not in "fiuc" or not values.size:
        raise ValueError(f"the array '{name[:40]}' holds no numbers; give another --variable")
    if len(times) and len(frequencies):
        times, frequencies = (
            (np.empty(0), frequencies) if values.dtype.kind == "c" else (times, np.empty(0))
        )
    axis = times if len(times) else frequencies
    places = given.places if given.places is not None else _places(short)
    each = next((short[key] for key in DRIVES if key in short), np.empty(0))
    is_zigzag = values.ndim == 3 and values.shape[2] == 2 and _last(name) == "y" and "r" in short
    if is_zigzag and each.shape == values.shape[:2]:
        each = np.repeat(each[..., None], 2, axis=2)
    said: list[str] = []

    def ordered(array: np.ndarray) -> np.ndarray:
        if is_zigzag:
            return np.transpose(array, (2, 1, 0))
        return _in_order(array, len(axis), len(places), name, said)

    moved, rate, start = ordered(values), _rate(short), _scalar(short, STARTS)
    if not (len(axis) or np.isnan(start + rate)):
        times = start + np.arange(moved.shape[1]) / rate
    elif not (len(axis) or is_zigzag):
        times, moved = _times_within(moved, name, given, said)
    drive = _vector(short, DRIVES)
    if not len(frequencies):
        moved = _real(moved, name)
        if each.shape == values.shape:
            moved, drive, more = aligned(moved, _real(ordered(each), name))
            times, said = times[: moved.shape[1]], [*said, more]
    if is_zigzag:
        said.append("velocity along the laser, taken as normal to the skin")
    word = {key: _word(short, key) for key in ("quantity", "unit", "name")}
    return Recording(
        values=moved, times=times, frequencies=frequencies, rate=rate,
        quantity=word["quantity"] or ("velocity" if is_zigzag else MOTION.get(_last(name), "")),
        unit=word["unit"] or "m/s" * is_zigzag, name=word["name"],
        places=places if len(places) == moved.shape[2] else nowhere(moved.shape[2]),
        drive=drive if len(drive) == moved.shape[1] else np.empty(0), remarks=tuple(said),
    )  # fmt: skip


def _last(name: str) -> str:
    """Name of an array in lower case, without that of its structure."""
    return name.rpartition(".")[2].lower()


def _in_order(
    values: np.ndarray, samples: int, places: int, name: str, said: list[str]
) -> np.ndarray:
    """Values (r, n, p), whatever the order of the one to three axes of an array, by the numbers of
    times or frequencies and of places, 0 where not known; what is assumed is said.
    """
    kept = values if values.ndim <= 3 else values.squeeze()
    if kept.ndim > 3 or kept.ndim == 0:
        raise ValueError(f"'{name[:40]}' has the shape {values.shape}; give samples and places")
    sizes = list(kept.shape)
    along = [k for k, size in enumerate(sizes) if size == samples]
    if samples and not along:
        raise ValueError(
            f"'{name[:40]}' has the shape {kept.shape}; give an array of {samples} times or values"
        )
    if not samples:
        free = [k for k, size in enumerate(sizes) if size != places or sizes.count(places) > 1]
        along = [max(free or range(kept.ndim), key=lambda k: sizes[k])]
        if kept.ndim > 1:
            said.append(f"the axis of {sizes[along[0]]} of '{name[:40]}' is taken as time")
    time = 1 if kept.ndim == 3 and 1 in along else along[0]
    rest = [k for k in range(kept.ndim) if k != time]
    spot = max(rest, key=lambda k: (sizes[k] == places, sizes[k], -k), default=None)
    if spot is None:
        return kept[None, :, None]
    moved = np.transpose(kept, [*(k for k in rest if k != spot), time, spot])
    return moved if moved.ndim == 3 else moved[None]


def _motion(arrays: Arrays) -> str:
    """Name of the array that is the motion."""
    other = [
        name for name, array in arrays.items()
        if array.dtype.kind in "fiuc" and array.size > 1 and _last(name) not in KNOWN
    ]  # fmt: skip
    other = [name for name in other if _last(name) in MOTION] or other
    if len(other) == 1:
        return other[0]
    if not other:
        raise ValueError(f"no array is of motion, only {_list(arrays)}; give --variable")
    raise ValueError(f"several arrays may be of motion; give --variable as {_list(other)}")


def _list(names: Iterable[str]) -> str:
    shown = [str(name)[:40] for name in names]
    return ", ".join(shown[:12]) + (f" and {len(shown) - 12} more" if len(shown) > 12 else "")


def _vector(arrays: Arrays, names: tuple[str, ...]) -> np.ndarray:
    """The first array of one axis by these names, or of copies of one; empty if there is none."""
    for name in names:
        array = arrays.get(name, np.empty(0))
        if array.dtype.kind not in "fiuc" or array.size < 2:
            continue
        if array.size == max(array.shape):
            return array.ravel()
        if names is TIMES and array.ndim == 2:
            rows = array if np.diff(array, axis=1).min(initial=1.0) > 0 else array.T
            first = rows[np.argmax(np.isfinite(rows).sum(axis=1))]
            if not (np.isnan(rows) | np.isclose(rows, first, rtol=1e-9, atol=0)).all():
                raise ValueError(
                    f"times '{name}' differ from place to place; save signals of the same times"
                )
            return first
    return np.empty(0)


def _times(arrays: Arrays) -> np.ndarray:
    """Times in s, of an array "t" or "time", or one whose name ends in its unit: "t_ms"."""
    found = _vector(arrays, TIMES).real
    for name in () if len(found) else arrays:
        one = column(name)
        if one.role == TIME and one.unit and len(array := _vector(arrays, (name,))):
            found = units.in_si(array, units.scale(one.unit, units.TIMES, "time"))
    return found


def _times_within(
    values: np.ndarray, name: str, given: Given, said: list[str]
) -> tuple[np.ndarray, np.ndarray]:
    """Times of a column of a matrix that rises evenly, and the other columns."""
    count = values.shape[2]
    rising = [p for p in range(count) if np.isrealobj(values) and rises(values[0, :, p])]
    if not rising or count < 2:
        return np.empty(0), values
    if given.rate is None:
        raise ValueError(
            f"column {rising[0] + 1} of '{name[:40]}' rises evenly as times do; give --rate in Hz, "
            "or save the times as an array 't' in s"
        )
    said.append(f"column {rising[0] + 1} of '{name[:40]}' rises evenly and is taken as time")
    return values[0, :, rising[0]].astype(float), np.delete(values, rising[0], axis=2)


def _scalar(arrays: Arrays, names: tuple[str, ...]) -> float:
    """The first single number by these names; nan if there is none."""
    found = (arrays[name] for name in names if name in arrays)
    numbers = (one.ravel()[0] for one in found if one.dtype.kind in "fiu" and one.size == 1)
    return float(next(numbers, np.nan))


def _rate(arrays: Arrays) -> float:
    """Sampling rate in Hz by its usual names; nan if there is none."""
    rate, interval = _scalar(arrays, RATES), _scalar(arrays, INTERVALS)
    return rate if rate > 0 else 1 / interval if interval > 0 else np.nan


def _places(arrays: Arrays) -> Floats:
    """Places (p, 2) in metre, of the first two coordinates; (0, 2) if there are none."""
    for name in (*PLACES, *MILLIMETRES):
        found = arrays.get(name, np.empty(0))
        if found.dtype.kind not in "fiu" or found.ndim != 2 or not {2, 3} & set(found.shape):
            continue
        points = (found if found.shape[1] in (2, 3) else found.T)[:, :2].astype(np.float64)
        points = points / 1e3 if name in MILLIMETRES else points
        if (largest := np.nanmax(np.abs(points), initial=0.0)) > FARTHEST:
            raise ValueError(
                f"'{name}' reaches {largest:g} m; call an array in mm 'places_mm', or give --places"
            )
        return points
    return np.empty((0, 2))


def _word(arrays: Arrays, name: str) -> str:
    found = arrays.get(name, np.empty(0))
    return str(found.ravel()[0]).strip()[:80] if found.dtype.kind == "U" and found.size else ""


def _real(values: np.ndarray, name: str) -> np.ndarray:
    if np.iscomplexobj(values):
        raise ValueError(f"'{name[:40]}' is complex; add an array 'frequencies' in Hz")
    return values.astype(np.float64)
