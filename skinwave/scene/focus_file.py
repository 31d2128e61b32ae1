"""Focal spots in files: maps of a hydrophone scan or of a simulated array, as CSV, .npz or .vti.

The names of the columns or arrays say what they hold and in which unit: `x [mm]`, `p_rms (kPa)` or
`y_mm`. Radiation pressure is proportional to |p|^2. On a wall that reflects fully, a sound pressure
of amplitude |p| or of intensity I exerts |p|^2/(rho c^2) or 2 I/c.
"""

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from meshes import reading, subprocess_call
from meshes.files.mesh_files import UNITS
from meshes.tetmesh import MeshError
from simple_model import MovingPressure
from simple_model.choices import choose
from simple_model.layers.compliance import AIR_DENSITY
from simple_model.load.focus import FOCI, SPEED_OF_SOUND
from simple_model.load.spot_map import SpotMap, spot_map
from skinwave.typing import Floats

AXES = ("x", "y", "z")
SOUND, LEVEL = "sound pressure", "sound pressure level"
INTENSITY, RADIATION = "intensity", "radiation pressure"
NAMES = {
    **{axis: axis for axis in AXES},
    **dict.fromkeys(
        (
            "p",
            "pressure",
            "sound_pressure",
            "acoustic_pressure",
            "total_acoustic_pressure",
            "level",
        ),
        SOUND,
    ),
    **dict.fromkeys(("spl", "lp", "sound_pressure_level"), LEVEL),
    **dict.fromkeys(("i", "intensity", "sound_intensity", "acoustic_intensity"), INTENSITY),
    **dict.fromkeys(("radiation_pressure", "acoustic_radiation_pressure", "arp"), RADIATION),
}
PASCALS = {"Pa": 1.0, "hPa": 1e2, "kPa": 1e3, "MPa": 1e6, "mPa": 1e-3, "N/m2": 1.0, "bar": 1e5}
SCALES = {
    **dict.fromkeys(AXES, UNITS), SOUND: PASCALS, RADIATION: PASCALS, LEVEL: {"dB": 1.0},
    INTENSITY: {"W/m2": 1.0, "mW/m2": 1e-3, "W/cm2": 1e4, "mW/cm2": 10.0},
}  # fmt: skip
AMPLITUDES = {  # of the statistics of a sinusoid
    "RMS": (2**0.5, "rms eff"), "amplitude": (1.0, "amplitude amp peak pk max"),
    "peak to peak": (0.5, "pp pk_pk p_p peak_to_peak"),
}  # fmt: skip
STATISTICS = {word: name for name, (_, words) in AMPLITUDES.items() for word in words.split()}
PARTS = {"re": 1.0, "real": 1.0, "im": 1j, "imag": 1j, "abs": 0.0, "mag": 0.0, "magnitude": 0.0}
REFERENCE = 20e-6  # Pa, RMS, of a sound pressure level
SUFFIXES = {  # of names, such as p_rms_pa; mpa is milli or mega
    re.sub(r"\W", "_", unit).lower(): unit
    for scale in SCALES.values() for unit in scale if unit.lower() != "mpa"
}  # fmt: skip
MUST = (
    "name them x [mm], y [mm] and p_rms [Pa], p_amplitude [Pa], p_re [Pa] with p_im [Pa], spl [dB],"
    " intensity [W/m2] or radiation_pressure [Pa]"
)
IMAGES = (".vti", ".vtr")
T = TypeVar("T")


@dataclass(frozen=True, kw_only=True)
class _Column:
    """What a heading says: an axis or a quantity, "" for others, and the values below."""

    kind: str
    unit: str
    statistic: str
    part: complex
    values: np.ndarray


def read_spot(path: str | Path, unit: str = "", *, needs_peak: bool = False) -> SpotMap:
    """Return the focal spot in a file; `unit` is that of lengths without one.

    Raises a ValueError if it is no map of a focal spot or, if its peak is needed, if its pressure
    may be an RMS value or an amplitude.
    """
    path = Path(path)
    with reading.open_regular(path) as file:
        written = os.fstat(file.fileno())
    try:
        return _read_spot(path, written.st_mtime_ns, written.st_size, unit, needs_peak)
    except ValueError as error:
        said = str(error)
        raise ValueError(said if said.startswith(str(path)) else f"{path}: {said}") from None


@lru_cache(maxsize=4)  # the scenes of a sweep read the same file
def _read_spot(path: Path, modified: int, size: int, unit: str, needs_peak: bool) -> SpotMap:
    """The same for a file that was modified at a time in ns and has a size in bytes."""
    columns = [_column(name, values) for name, values in _read(path).items()]
    return _spot(columns, str(path), unit, needs_peak)


def with_spot(values: dict[str, Any]) -> dict[str, Any]:
    """Return the values of [focus] with the focal spot in the place of its file and unit."""
    rest = {name: value for name, value in values.items() if name not in ("file", "unit")}
    if choose("profile", rest.get("profile", FOCI[0]), (*FOCI, "file")) != "file":
        if given := [name for name in ("file", "unit") if name in values]:
            raise ValueError(f'[focus] has {given[0]}; set profile = "file" too, or remove it')
        return rest
    if not values.get("file"):
        raise ValueError('[focus] has profile = "file" without file; name the map of the focus')
    if "height" in values:
        raise ValueError(
            "height_mm does not apply to the map of a focus, which belongs to one height; remove it"
        )
    has_peak = "peak_pressure" in rest
    spot = read_spot(values["file"], values.get("unit", ""), needs_peak=not has_peak)
    is_given = has_peak or not spot.peak
    return rest | {"profile": spot} | ({} if is_given else {"peak_pressure": spot.peak})


def focus_note(pressure: MovingPressure) -> str:
    """Return the source, width and force of the focal spot of a map in words; "" for others."""
    spot = pressure.profile
    if not isinstance(spot, SpotMap):
        return ""
    x, y = (1e3 * width for width in spot.half_widths)
    own = f" (the file gives {spot.peak:.3g} Pa)" if spot.peak > 0 else ""
    return (
        f"focal spot of {Path(spot.file).name or 'a map'}, {spot.source} over the largest value: "
        f"{x:.3g} mm by {y:.3g} mm at half of it, interpolated within {100 * spot.error:.1g} %, "
        f"{1e3 * spot.area * pressure.peak_pressure:.3g} mN at {pressure.peak_pressure:.3g} Pa{own}"
    )


def _read(path: Path) -> Mapping[str, np.ndarray]:
    """Return arrays of one shape by name, at least those of a map."""
    if path.suffix.lower() == ".npz":
        return _on_grid(reading.load_arrays(path))
    if path.suffix.lower() in IMAGES:
        return subprocess_call.call_reader(read_image, path)
    return _table(reading.read_exported_text(path))


def read_image(path: Path) -> dict[str, np.ndarray]:
    """Return coordinates and arrays (n,) of a VTK image; those of two components are complex."""
    try:
        import pyvista

        grid = pyvista.read(path)
        data = grid.point_data or grid.cell_data
        places = (grid if grid.point_data else grid.cell_centers()).points
        arrays = {name: np.asarray(data[name], np.float64) for name in data}
    except Exception:  # VTK raises many types
        arrays = {}
    if not arrays:  # VTK reads a file that is cut short as an empty one
        raise MeshError(f"{path} is damaged or no image with arrays; write it again")
    split = {name: a @ [1, 1j] if a.ndim == 2 and a.shape[1] == 2 else a
             for name, a in arrays.items()}  # fmt: skip
    own = {name: array for name, array in split.items() if array.ndim == 1}
    return dict(zip(AXES, np.asarray(places, np.float64).T, strict=True)) | own


def _on_grid(arrays: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return arrays of one shape (n,); coordinates (nx,) and (ny,) are repeated for maps."""
    arrays = {name: np.squeeze(a) for name, a in arrays.items()}
    shape = max((a.shape for a in arrays.values() if a.ndim == 2), key=np.prod, default=())
    lines = {name: a.ravel() for name, a in arrays.items()
             if shape and a.size in shape and a.size < np.prod(shape)}  # fmt: skip
    axes = {_column(name, line).kind: name for name, line in lines.items()}
    flat = {name: a.ravel() for name, a in arrays.items() if a.dtype.kind in "fciu"}
    if {"x", "y"} <= axes.keys():
        x, y = (lines[axes[axis]] for axis in "xy")
        if shape[0] == shape[1]:
            raise ValueError(
                f"the map has {shape[0]} x {shape[1]} values, so that x and y of this length do "
                "not say which axis is which; save x and y with the shape of the map"
            )
        is_x_first = shape == (len(x), len(y))
        at = np.meshgrid(x, y, indexing="ij" if is_x_first else "xy")
        flat |= {axes[axis]: each.ravel() for axis, each in zip("xy", at, strict=True)}
    length = int(np.prod(shape)) if shape else max(map(len, flat.values()), default=0)
    return {name: array for name, array in flat.items() if len(array) == length}


def _table(text: str) -> dict[str, np.ndarray]:
    """Return the columns of a table of text, whose last line before the numbers names them."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    first = next((k for k, line in enumerate(lines) if _numbers(line) is not None), 0)
    if not first:
        raise ValueError(f"the file has no line of names above its numbers; {MUST}")
    heading = lines[first - 1].lstrip("#% ")
    names = [name.strip(" \"'") for name in re.split(r"[;,\t]|\s{2,}", heading)]
    rows = [_numbers(line) for line in lines[first:] if line[0] not in "#%"]
    width = len(rows[0] or ())
    if len(names) != width:  # separated by single blanks
        names = re.sub(r"\s+(?=[\[(])", "", heading).split()
    for k, row in enumerate(rows):
        if row is None or len(row) != len(names):
            raise ValueError(f"row {k + 1} does not have {len(names)} numbers; complete it")
    return dict(zip(names, np.array(rows).T, strict=True))


def _numbers(line: str) -> list[complex] | None:
    """Return the numbers of a line, with decimal points or, between semicolons or tabs, commas."""
    if re.search(r"[;\t]", line) and "." not in line:
        line = line.replace(",", ".")
    try:
        return [complex(word.strip().replace("i", "j")) if "i" in word else complex(word)
                for word in re.split(r"[;,\t]\s*|\s+", line.strip())]  # fmt: skip
    except ValueError:
        return None


def _column(name: str, values: np.ndarray) -> _Column:
    """Return what a name says, such as "p_rms [kPa]", "abs(p) (Pa)", "Re p" or "x_mm"."""
    text = re.sub("[\u00b5\u03bc]", "u", name.replace("\u00b2", "2").replace("^", ""))
    match = re.fullmatch(r"(.*?)\s*[\[(]([^\[\]()]*)[\])]", text.strip())
    words, unit = (match[1], match[2]) if match and match[2].lower() not in NAMES else (text, "")
    unit, _, more = unit.strip().partition(" ")
    more = more.partition("re ")[0]  # the reference of a level
    rest = "_".join(re.findall("[a-z0-9]+", f"{words} {more}".lower()))

    def take(known: Mapping[str, T], end: str = "") -> T | None:
        """Remove the longest known word, at the end or anywhere, and return what it stands for."""
        nonlocal rest
        for word in sorted(known, key=len, reverse=True):
            if found := re.search(f"(^|_){word}(_|$){end}", rest):
                rest = (rest[: found.start()] + "_" + rest[found.end() :]).strip("_")
                return known[word]
        return None

    unit = unit or ("" if rest in NAMES else take(SUFFIXES, "$")) or ""
    part = take(PARTS)
    statistic = "" if rest in NAMES else take(STATISTICS) or ""
    return _Column(
        kind=NAMES.get(rest, ""), unit=unit, statistic=statistic, part=part or 0.0, values=values
    )


def _spot(columns: list[_Column], file: str, unit: str, needs_peak: bool) -> SpotMap:
    """Return the focal spot of the columns of a map."""
    x, y = (_metres(_one(columns, axis), unit) for axis in "xy")
    for z in (column.values.real for column in columns if column.kind == "z"):
        if np.ptp(z) > 1e-6 * np.abs(z).max():
            raise ValueError("the map has several values of z; give the plane through the focus")
    kinds = [k for k in (RADIATION, INTENSITY, SOUND, LEVEL) if k in {c.kind for c in columns}]
    if not kinds:
        raise ValueError(f"no column has a known name; {MUST}")
    values, per_value, source = _pressures([c for c in columns if c.kind == kinds[0]])
    if needs_peak and np.isnan(per_value):
        raise ValueError(
            "the sound pressure may be an RMS value or an amplitude; name its column p_rms or "
            "p_amplitude, or set peak_pressure_pa"
        )
    if not (np.isfinite(values).all() and np.isfinite([x, y]).all()):
        raise ValueError("the map has values that are not finite numbers; fill these gaps")
    (x, of_x), (y, of_y) = _lines(x), _lines(y)
    grid = np.full((len(x), len(y)), np.nan)
    grid[of_x, of_y] = values
    if len(values) != grid.size or np.isnan(grid).any():
        raise ValueError(
            f"the {len(values)} rows are no complete grid of {len(x)} values of x and {len(y)} of "
            "y; give each point once, or interpolate to such a grid"
        )
    return spot_map(x, y, grid, peak_per_value=per_value, file=file, unit=unit, source=source)


def _one(columns: list[_Column], kind: str, part: complex | None = None) -> _Column:
    own = [c for c in columns if c.kind == kind and part in (None, c.part)]
    if len(own) != 1:
        of = {1.0: "real part of ", 1j: "imaginary part of "}.get(part or 0.0, "")
        raise ValueError(f"{len(own)} columns hold the {of}{kind}, not one; {MUST}")
    return own[0]


def _metres(column: _Column, unit: str) -> Floats:
    """Return coordinates (n,) in m."""
    if bool(unit) == bool(column.unit):
        both = f"is in {column.unit}, and [focus] has unit = {unit!r}; remove that"
        none = 'has no unit; add it to its name, or write unit = "mm" below [focus]'
        raise ValueError(f"{column.kind} {both if unit else none}")
    if (given := unit or column.unit) not in UNITS:
        raise ValueError(f"{column.kind} is in {given[:20]}; use one of {', '.join(UNITS)}")
    return np.asarray(column.values.real * UNITS[given], np.float64)


def _pressures(columns: list[_Column]) -> tuple[Floats, float, str]:
    """Return values (n,) proportional to the radiation pressure of columns of one quantity, Pa of
    each, and what the columns hold. Pa are 0 for relative values, nan if the statistic is unknown.
    """
    kind = columns[0].kind
    is_split = {c.part for c in columns} & {1.0, 1j}
    parts = [_one(columns, kind, part) for part in ((1.0, 1j) if is_split else (None,))]
    first = parts[0]
    stored = np.sum([c.values * (c.part or 1.0) for c in parts], axis=0)
    is_complex, values = bool(is_split or np.imag(stored).any()), np.real(stored)
    unit, scale = first.unit, SCALES[kind].get(first.unit, 0.0)
    if kind == LEVEL or unit.lower().startswith("db"):
        is_absolute = kind == LEVEL and values.max() > 0
        per_value = 2 * REFERENCE**2 * is_absolute
        per_value *= 10 ** (values.max() / 10) / (AIR_DENSITY * SPEED_OF_SOUND**2)
        return 10 ** ((values - values.max()) / 10), per_value, f"{kind} in dB"
    if kind == RADIATION:
        return values, scale, kind
    if kind == INTENSITY:
        return values, 2 * scale / SPEED_OF_SOUND, kind
    if not is_complex and values.min() < 0:
        raise ValueError(
            "the sound pressure has negative values, as at one instant; give its amplitude, or "
            "real and imaginary parts, p_re and p_im"
        )
    statistic = first.statistic or ("amplitude" if is_complex else "")
    amplitude = scale * (AMPLITUDES[statistic][0] if statistic else np.nan if scale else 0.0)
    words = f"{'complex ' * is_complex}sound pressure" + f" ({statistic})" * bool(statistic)
    return np.abs(stored) ** 2, amplitude**2 / (AIR_DENSITY * SPEED_OF_SOUND**2), f"{words} squared"


def _lines(places: Floats, jitter: float = 0.05) -> tuple[Floats, np.ndarray]:
    """Return the distinct coordinates (k,) in m, ascending, and the index (n,) of each place; those
    of a scan differ by less than a fraction `jitter` of the largest step.
    """
    order = np.argsort(places, kind="stable")
    apart = np.diff(places[order], prepend=places[order[:1]])
    number = np.cumsum(apart > jitter * apart.max())
    index = np.empty(len(places), int)
    index[order] = number
    return np.bincount(index, places) / np.bincount(index), index
