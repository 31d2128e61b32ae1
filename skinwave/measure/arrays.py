"""Recordings in named arrays: NumPy archives and MATLAB files.

Times, places, drive and texts are identified by their names; the motion by --variable, by its name,
or as the only suitable array. One published set has a form of its own: Reardon et al., Sci. Adv. 9,
eadf2037 (2023), doi 10.1126/sciadv.adf2037, record 10.5281/zenodo.7686560. Its y (N, M, 2) is the
velocity along the laser in m/s at N places, M times, 2 repetitions, each with a reference r.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from meshes import reading, subprocess_call
from meshes.tetmesh import MeshError
from simple_model.numbers import first_few
from simple_model.quantities import QUANTITIES
from skinwave.measure import universal
from skinwave.measure.delays import align_by_references
from skinwave.measure.matlab import DAMAGED, read_arrays
from skinwave.measure.recording import Given, Recording, factors_in, unknown_places
from skinwave.measure.table import NOTES, rate_in, rises
from skinwave.models import named, names
from skinwave.system import units
from skinwave.system.formats import MEASUREMENTS, register
from skinwave.system.headings import AXES, MOTION_NAMES, parse_heading
from skinwave.typing import Floats

FORMAT = "skinwave measurement 1"
PLACES = ("places", "points", "probes", "xy", "xyz", "positions", "coordinates", "locations")
DRIVES = (*AXES["drive"], "r")
Arrays = Mapping[str, np.ndarray]


def read_npz(path: Path, given: Given) -> Recording:
    """Return the recording in an .npz file of skinwave or another program."""
    with reading.open_regular(path):
        pass
    try:
        arrays = reading.load_arrays(path)
    except ValueError as error:
        kind = ", because it holds objects of Python" if "Object" in str(error) else ""
        raise ValueError(f"the file cannot be read as .npz{kind}; save arrays of numbers") from None
    if str(arrays.get("format", "")) == FORMAT:
        return _own(arrays)
    if functions := sdynpy_functions(arrays):
        return universal.recording_of(given, functions)
    arrays = dict(_flat(arrays))
    if quantity := _response_quantity(arrays):
        kept = {name: arrays[name] for name in ("t", "probes", quantity)}
        recording = recording_of(kept, replace(given, variable=""))
        return replace(recording, unit=QUANTITIES[quantity].unit, sign=1)
    return recording_of(arrays, given)


def _flat(arrays: Arrays) -> Iterator[tuple[str, np.ndarray]]:
    """Yield arrays, and the fields of structured ones as "array.field"."""
    for name, array in arrays.items():
        fields = array.dtype.names or ()
        yield from _flat({f"{name}.{field}": array[field] for field in fields})
        if not fields:
            yield name, array


def sdynpy_functions(arrays: Arrays) -> list[universal.Function]:
    """Return the functions in a file of SDynPy's NDDataArray.save; none for other files."""
    data, kind = arrays.get("data", np.empty(0)), int(arrays.get("function_type", -1))
    names = data.dtype.names or ()
    if not {"ordinate", "coordinate"} <= {*names} or kind < 0:
        return []
    functions = []
    for one in data.ravel():
        at, *by = [(int(end["node"]), int(end["direction"])) for end in one["coordinate"].ravel()]
        x, y = (np.asarray(one[name] if name in names else 0) for name in ("abscissa", "ordinate"))
        if "abscissa" not in names:
            x = arrays["abscissa_start"] + arrays["abscissa_step"] * np.arange(len(y))
        functions.append(universal.Function(
            type=kind, names=("", str(one["comment1"])), at=at, x=x, y=y,
            by=by[0] if by and kind == universal.RESPONSE else (0, 0),
            is_in_time=kind == universal.IN_TIME,
        ))  # fmt: skip
    return functions


def read_mat(path: Path, given: Given, largest: int = 2_000_000_000) -> Recording:
    """Return the recording in a MATLAB file of at most `largest` bytes."""
    with reading.open_regular(path, largest) as file:
        if not file.read(1):
            raise ValueError("the file is empty; download or export it again")
    try:
        arrays = subprocess_call.call_reader(read_arrays, path)
    except MeshError as error:
        raise ValueError(DAMAGED) from error
    if not arrays:
        raise ValueError("the file has no arrays of numbers; save the signals as arrays")
    return recording_of(arrays, given)


def _own(arrays: Arrays) -> Recording:
    if missing := {"quantity", "unit", "values", "places", "times", "frequencies"} - arrays.keys():
        raise ValueError(f"the array '{min(missing)}' is missing; write the measurement again")
    if arrays["values"].ndim != 3 or arrays["values"].dtype.kind not in "fc":
        raise ValueError(f"values have shape {arrays['values'].shape}; write them again")
    return Recording(
        quantity=str(arrays["quantity"]), unit=str(arrays["unit"]), places=arrays["places"],
        times=arrays["times"], frequencies=arrays["frequencies"], values=arrays["values"],
        drive=arrays.get("drive", np.empty(0)), sign=1, name=str(arrays.get("name", "")),
        remarks=tuple(map(str, arrays.get("remarks", ()))),
    )  # fmt: skip


def _response_quantity(arrays: Arrays) -> str:
    """Return the quantity of the responses in a file of results; "" for other files."""
    quantities = [name for name in arrays if name in QUANTITIES]
    models = arrays.keys() - {"t", "probes", *quantities}
    if not {"t", "probes"} <= arrays.keys() or len(quantities) != 1 or not models <= set(names()):
        return ""
    if not QUANTITIES[quantities[0]].of_body or not all(named(name).needs_body for name in models):
        raise ValueError("the file holds a pressure, not motion; give the response of a body")
    return quantities[0]


def recording_of(arrays: Arrays, given: Given) -> Recording:
    """Return the recording in arrays by name, "structure.name" for fields of structures."""
    if given.direction:
        raise ValueError("--direction has no effect on arrays by name; choose with --variable")
    name = given.variable or _motion(arrays)
    if name not in arrays:
        raise ValueError(f"no array is named '{name[:40]}'; give --variable as {_list(arrays)}")
    short = _beside(arrays, name)
    times, frequencies = _axis(short, "time"), _axis(short, "frequency")
    values = np.asarray(arrays[name])
    if values.dtype.kind not in "fiuc" or not values.size:
        raise ValueError(f"the array '{name[:40]}' has no numbers; give another --variable")
    units.check_linear(_word(short, "unit"), name)
    if len(times) and len(frequencies):
        if values.dtype.kind == "c":
            times = np.empty(0)
        else:
            frequencies = np.empty(0)
    count = len(times) or len(frequencies)
    places = given.places if given.places is not None else _places(short)
    references = next((short[key] for key in DRIVES if key in short), np.empty(0))
    is_zigzag = values.ndim == 3 and values.shape[2] == 2 and _last(name) == "y" and "r" in short
    if is_zigzag and references.shape == values.shape[:2]:
        references = np.repeat(references[..., None], 2, axis=2)
    remarks: list[str] = []

    def ordered(array: np.ndarray) -> np.ndarray:
        if is_zigzag:
            return np.transpose(array, (2, 1, 0))
        return _in_order(array, count, len(places), name, remarks)

    moved, start, rate = ordered(values), _number(short, "start"), rate_in(partial(_number, short))
    if not (count or np.isnan(start + rate)):
        times = start + np.arange(moved.shape[1]) / rate
    elif not (count or is_zigzag):
        times, moved = _times_within(moved, name, given, remarks)
    drive = next((one for key in DRIVES if len(one := _vector(short, key))), np.empty(0))
    if not len(frequencies):
        moved = _real(moved, name)
        if references.shape == values.shape:
            moved, drive, remark = align_by_references(moved, _real(ordered(references), name))
            times, remarks = times[: moved.shape[1]], [*remarks, remark]
    if is_zigzag:
        remarks.append("velocity along the laser, taken as normal to the skin")
    word = {key: _word(short, key) for key in ("quantity", "unit", "name")}
    heading = parse_heading(_last(name))
    quantity = heading.role if heading.role in units.MOTION else ""
    if not word["unit"] and units.quantity_of(heading.unit) in ("", quantity):
        word["unit"] = heading.unit
    word["unit"] = f"{word['unit']} {heading.level}".strip()
    if len(frequencies) and not np.iscomplexobj(values):
        raise ValueError(f"the spectrum '{name[:40]}' has no phase; save complex amplitudes")
    numbers = {key: x for key, x in short.items() if x.size and x.dtype.kind in "fiu"}
    factors = factors_in({key: x.ravel()[0] for key, x in numbers.items()})
    several = [key for key in factors if numbers[key].size > 1]
    if several and np.array_equal(values, np.rint(values.real)):
        raise ValueError(f"'{several[0]}' has several factors; save the values multiplied by them")
    has_places = len(places) == moved.shape[2]
    return Recording(
        values=moved, times=times, frequencies=frequencies, rate=rate,
        quantity=word["quantity"] or ("velocity" if is_zigzag else quantity),
        factors=factors,
        unit=word["unit"] or "m/s" * is_zigzag, name=word["name"],
        places=places if has_places else unknown_places(moved.shape[2]),
        drive=drive if len(drive) == moved.shape[1] else np.empty(0), remarks=tuple(remarks),
    )  # fmt: skip


def _beside(arrays: Arrays, name: str) -> Arrays:
    """Return arrays by their last names; those nearest to the structure of `name` win.

    An array is empty if other structures have different ones of this name.
    """

    def closeness(other: str) -> int:
        structure = other[: other.rfind(".") + 1]
        return len(structure) if name.startswith(structure) else -1

    nearest: dict[str, np.ndarray] = {}
    for other in sorted(arrays, key=closeness):
        short = _last(other)
        is_unclear = closeness(other) < 0 and short in nearest
        is_unclear &= not np.array_equal(nearest.get(short, ()), arrays[other])
        nearest[short] = np.empty(0) if is_unclear else arrays[other]
    return nearest


def _last(name: str) -> str:
    """Return the name of an array in lower case, without that of its structure."""
    return name.rpartition(".")[2].lower()


def _in_order(
    values: np.ndarray, samples: int, places: int, name: str, remarks: list[str]
) -> np.ndarray:
    """Return values (r, n, p) from any order of axes, given the numbers of samples and places."""
    values = values if values.ndim <= 3 else values.squeeze()
    sizes = values.shape
    if not 1 <= values.ndim <= 3:
        raise ValueError(f"'{name[:40]}' has shape {sizes}; give samples and places")
    along = [k for k, size in enumerate(sizes) if size == samples]
    if samples and not along:
        raise ValueError(f"'{name[:40]}' has shape {sizes}; give an array of {samples} times")
    if not samples:
        free = [k for k, size in enumerate(sizes) if size != places or sizes.count(places) > 1]
        along = [max(free or range(values.ndim), key=lambda k: sizes[k])]
        if values.ndim > 1:
            remarks.append(f"the axis of {sizes[along[0]]} of '{name[:40]}' is taken as time")
    time = 1 if values.ndim == 3 and 1 in along else along[0]
    rest = [k for k in range(values.ndim) if k != time]
    if not rest:
        return values[None, :, None]
    spot = max(rest, key=lambda k: (sizes[k] == places, sizes[k], -k))
    moved = np.transpose(values, [*(k for k in rest if k != spot), time, spot])
    return moved if moved.ndim == 3 else moved[None]


def _motion(arrays: Arrays) -> str:
    """Return the name of the array of motion."""
    others = {*AXES["time"], *AXES["frequency"], *DRIVES, *PLACES, "quantity", "unit", "name"}
    numbers = [name for name, array in arrays.items()
               if array.dtype.kind in "fiuc" and array.size > 1]  # fmt: skip
    candidates = [name for name in numbers if _stem(name) not in others
                  and not any(key.fullmatch(_last(name)) for key in NOTES.values())]  # fmt: skip
    motion = {name for names in MOTION_NAMES.values() for name in names}
    motion |= {"values", "y", "data", "signal", "signals"}
    candidates = [name for name in candidates if _last(name) in motion] or candidates
    if not candidates:
        raise ValueError(f"no array is motion, only {_list(arrays)}; give --variable")
    if len(candidates) > 1:
        raise ValueError(f"several arrays may be motion; give --variable as {_list(candidates)}")
    return candidates[0]


def _list(names: Iterable[str]) -> str:
    return first_few([name[:40] for name in names], 12)


def _stem(name: str) -> str:
    """Return the last name without a unit of time, frequency or length."""
    return re.sub("_(s|ms|us|ns|hz|khz|mm)$", "", _last(name))


def _axis(arrays: Arrays, role: str) -> np.ndarray:
    """Return times in s, or frequencies in Hz, by a name such as "t" or "t_ms"; else an empty one.

    Times may have an axis of places, along which they must be equal.
    """
    for name in sorted(arrays, key=len):
        array, unit = arrays[name], parse_heading(name).unit
        if _stem(name) not in AXES[role] or array.dtype.kind not in "fiuc":
            continue
        if role == "time" and array.ndim == 2 and 1 not in array.shape:
            rows = array if np.diff(array, axis=1).min(initial=1.0) > 0 else array.T
            array = rows[np.argmax(np.isfinite(rows).sum(axis=1))]
            if not (np.isnan(rows) | np.isclose(rows, array, rtol=1e-9, atol=0)).all():
                raise ValueError(f"times '{name}' differ from place to place; save common times")
        if len(vector := _vector({name: array}, name)):
            return units.in_si(vector.real, units.divisor(unit, role) if unit else 1.0)
    return np.empty(0)


def _vector(arrays: Arrays, name: str) -> np.ndarray:
    """Return the numbers of a vector; empty if there is no such vector."""
    array = arrays.get(name, np.empty(0))
    is_vector = array.dtype.kind in "fiuc" and array.size == max(array.shape, default=0) > 1
    return array.ravel() if is_vector else np.empty(0)


def _times_within(
    values: np.ndarray, name: str, given: Given, remarks: list[str]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the evenly rising column as times, and the other columns."""
    count = values.shape[2]
    rising = [p for p in range(count) if np.isrealobj(values) and rises(values[0, :, p])]
    if not rising or count < 2:
        return np.empty(0), values
    column = f"column {rising[0] + 1} of '{name[:40]}' rises evenly"
    if given.rate is None:
        raise ValueError(f"{column} like times; give --rate, or save times as an array 't' in s")
    remarks.append(f"{column} and is taken as time")
    return values[0, :, rising[0]].astype(float), np.delete(values, rising[0], axis=2)


def _number(arrays: Arrays, note: str) -> float:
    """Return the first single number whose name is that of one of the `NOTES`, or nan."""
    for name, array in arrays.items():
        if NOTES[note].fullmatch(name) and array.dtype.kind in "fiu" and array.size == 1:
            return float(array.ravel()[0])
    return float("nan")


def _places(arrays: Arrays, farthest: float = 5.0) -> Floats:
    """Return places (p, 2) in m from the first two coordinates. Without places, p is 0.

    Beyond a distance `farthest` in m, the unit is not the metre.
    """
    for name in (*PLACES, *(f"{name}_mm" for name in PLACES)):
        array = arrays.get(name, np.empty(0))
        if array.dtype.kind not in "fiu" or array.ndim != 2 or not {2, 3} & set(array.shape):
            continue
        points = (array if array.shape[1] in (2, 3) else array.T)[:, :2].astype(np.float64)
        points = points / 1e3 if name.endswith("_mm") else points
        if (largest := np.nanmax(np.abs(points), initial=0.0)) > farthest:
            raise ValueError(
                f"'{name}' reaches {largest:g} m; name it 'places_mm', or give --places"
            )
        return points
    return np.empty((0, 2))


def _word(arrays: Arrays, name: str) -> str:
    array = arrays.get(name, np.empty(0))
    return str(array.ravel()[0]).strip()[:80] if array.dtype.kind == "U" and array.size else ""


def _real(values: np.ndarray, name: str) -> np.ndarray:
    if np.iscomplexobj(values):
        raise ValueError(f"'{name[:40]}' is complex; add an array 'frequencies' in Hz")
    return values.astype(np.float64)


register(MEASUREMENTS, ".npz", function=read_npz, name="NumPy", choices=("variable", "direction"))
register(MEASUREMENTS, ".mat", function=read_mat, name="MATLAB", choices=("variable",))
