"""Focal spots in files: maps of a hydrophone scan or of a simulated array, as CSV, .npz or .vti.

The names of the columns or arrays say what they hold and in which unit: `x [mm]`, `p_rms (kPa)` or
`y_mm`. Radiation pressure is proportional to |p|^2. On a wall that reflects fully, a sound pressure
of amplitude |p| or of intensity I exerts |p|^2/(rho c^2) or 2 I/c.
"""

import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from meshes import reading, subprocess_call
from meshes.tetmesh import MeshError
from simple_model import MovingPressure
from simple_model.choices import choose
from simple_model.layers.compliance import AIR_DENSITY
from simple_model.load.focus import FOCI, SPEED_OF_SOUND
from simple_model.load.spot_map import SpotMap, spot_map
from skinwave.system import units
from skinwave.system.headings import Column, parse_heading
from skinwave.system.text_table import parse_table
from skinwave.typing import Floats

NAMES = {axis: axis for axis in "xyz"} | {
    name: kind
    for kind, names in {
        "radiation pressure": ("radiation pressure", "acoustic radiation pressure", "arp"),
        "intensity": ("i", "intensity", "sound intensity", "acoustic intensity"),
        "sound pressure": ("pressure", "sound pressure", "acoustic pressure",
                           "total acoustic pressure", "level"),
        "sound pressure level": ("spl", "lp", "sound pressure level"),
    }.items()
    for name in names
}  # fmt: skip
MUST = (
    "name them x [mm], y [mm] and p_rms [Pa], p_amplitude [Pa], p_re [Pa] with p_im [Pa], spl [dB],"
    " intensity [W/m2] or radiation_pressure [Pa]"
)
Columns = list[tuple[Column, np.ndarray]]


def read_spot(path: str | Path, unit: str = "", *, needs_peak: bool = False) -> SpotMap:
    """Return the focal spot in a file; `unit` is that of lengths without one.

    Raises a ValueError if it is no map of a focal spot or, if its peak is needed, if its pressure
    may be an RMS value or an amplitude.
    """
    path = Path(path)
    with reading.open_regular(path) as file:
        written = os.fstat(file.fileno())
    with reading.naming(path):
        return _read_spot(path, written.st_mtime_ns, written.st_size, unit, needs_peak)


@lru_cache(maxsize=4)  # the scenes of a sweep read the same file
def _read_spot(path: Path, modified: int, size: int, unit: str, needs_peak: bool) -> SpotMap:
    """Read a file that was modified at a time in ns and has a size in bytes."""
    return _spot(list(_read(path)), str(path), unit, needs_peak)


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


def _read(path: Path) -> Iterator[tuple[Column, np.ndarray]]:
    """Yield columns and arrays of one shape, at least those of a map."""
    if path.suffix.lower() in (".npz", ".vti", ".vtr"):
        is_image = path.suffix.lower() != ".npz"
        arrays = (subprocess_call.call_reader(read_image, path) if is_image
                  else _on_grid(reading.load_arrays(path)))  # fmt: skip
        yield from ((_heading(name), values) for name, values in arrays.items())
        return
    table = parse_table(reading.read_exported_text(path), "x [mm],y [mm],p_rms [Pa]", _heading)
    if not any(column.text for column in table.columns):
        raise ValueError(f"the file has no header above its numbers; {MUST}")
    yield from zip(table.columns, table.numbers.T, strict=True)


def _heading(text: str, unit: str = "") -> Column:
    """Return the column of a heading such as "p_rms [kPa]", "abs(p) (Pa)", "Re p" or "x_mm"."""
    synonyms = {"p": "pressure", "amplitude|amp|max": "peak", "mag(nitude)?": "abs"}
    for words, known in synonyms.items():
        text = re.sub(rf"(?<![a-z])({words})(?![a-z])", known, text, count=1, flags=re.IGNORECASE)
    (text, level), (unit, below) = units.split_level(text), units.split_level(unit)
    return replace(parse_heading(text, unit, NAMES), level=level or below)


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
    return dict(zip("xyz", np.asarray(places, np.float64).T, strict=True)) | own


def _on_grid(arrays: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return arrays of one shape (n,); coordinates (nx,) and (ny,) are repeated for maps."""
    arrays = {name: np.squeeze(a) for name, a in arrays.items()}
    shape = max((a.shape for a in arrays.values() if a.ndim == 2), key=np.prod, default=())
    lines = {name: a.ravel() for name, a in arrays.items()
             if shape and a.size in shape and a.size < np.prod(shape)}  # fmt: skip
    axes = {_heading(name).role: name for name in lines}
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


def _spot(columns: Columns, file: str, unit: str, needs_peak: bool) -> SpotMap:
    """Return the focal spot of the columns of a map."""
    x, y = (_metres(*_one(columns, axis), unit) for axis in "xy")
    for z in (values.real for column, values in columns if column.role == "z"):
        if np.ptp(z) > 1e-6 * np.abs(z).max():
            raise ValueError("the map has several values of z; give the plane through the focus")
    known = {column.role for column, _ in columns} - {*"xyz"}
    kind = next((kind for kind in NAMES.values() if kind in known), "")
    if not kind:
        raise ValueError(f"no column has a known name; {MUST}")
    values, per_value, source = _pressures(columns, kind)
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


def _one(columns: Columns, kind: str, part: str | None = None) -> tuple[Column, np.ndarray]:
    own = [(c, x) for c, x in columns if c.role == kind and part in (None, c.part)]
    if len(own) != 1:
        of = {"re": "real part of ", "im": "imaginary part of "}.get(part or "", "")
        raise ValueError(f"{len(own)} columns hold the {of}{kind}, not one; {MUST}")
    return own[0]


def _metres(column: Column, values: np.ndarray, unit: str) -> Floats:
    """Return coordinates (n,) in m."""
    if bool(unit) == bool(column.unit):
        both = f"is in {column.unit}, and [focus] has unit = {unit!r}; remove that"
        none = 'has no unit; add it to its name, or write unit = "mm" below [focus]'
        raise ValueError(f"{column.role} {both if unit else none}")
    return units.in_si(values.real, units.divisor(unit or column.unit, "length"))


def _pressures(columns: Columns, kind: str) -> tuple[Floats, float, str]:
    """Return values (n,) proportional to the radiation pressure of columns of one quantity, Pa of
    each, and what the columns hold. Pa are 0 for relative values, nan if the statistic is unknown.
    """
    is_split = {c.part for c, _ in columns if c.role == kind} & {"re", "im"}
    parts = [_one(columns, kind, part) for part in (("re", "im") if is_split else (None,))]
    first = parts[0][0]
    stored = parts[0][1] + (1j * parts[1][1] if is_split else 0.0)
    is_complex, values = bool(is_split or np.imag(stored).any()), np.real(stored)
    unit, dimension = first.unit, "intensity" if kind == "intensity" else "pressure"
    is_absolute = units.dimension_of(unit) == dimension
    scale = 1 / units.divisor(unit, dimension) if is_absolute else 0.0
    if kind == "sound pressure level" or unit.lower().startswith("db"):
        reference = 20e-6  # Pa, RMS
        per_value = 2 * reference**2 * (kind == "sound pressure level" and values.max() > 0)
        per_value *= 10 ** (values.max() / 10) / (AIR_DENSITY * SPEED_OF_SOUND**2)
        return 10 ** ((values - values.max()) / 10), per_value, f"{kind} in dB"
    if kind == "radiation pressure":
        return values, scale, kind
    if kind == "intensity":
        return values, 2 * scale / SPEED_OF_SOUND, kind
    if not is_complex and values.min() < 0:
        raise ValueError(
            "the sound pressure has negative values, as at one instant; give its amplitude, or "
            "real and imaginary parts, p_re and p_im"
        )
    level = first.level or ("peak" if is_complex else "")
    factor = units.amplitude(level) if level or not scale else np.nan
    words = f"{'complex ' * is_complex}sound pressure" + f" ({level})" * bool(level)
    per_value = (factor * scale) ** 2 / (AIR_DENSITY * SPEED_OF_SOUND**2)
    return np.abs(stored) ** 2, per_value, f"{words} squared"


def _lines(places: Floats, jitter: float = 0.05) -> tuple[Floats, np.ndarray]:
    """Return the distinct coordinates (k,) in m, ascending, and the index (n,) of each place.

    Equal coordinates of a scan differ by less than a fraction `jitter` of the largest step.
    """
    order = np.argsort(places, kind="stable")
    apart = np.diff(places[order], prepend=places[order[:1]])
    number = np.cumsum(apart > jitter * apart.max())
    index = np.empty(len(places), int)
    index[order] = number
    return np.bincount(index, places) / np.bincount(index), index
