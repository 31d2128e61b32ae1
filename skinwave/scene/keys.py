"""The keys of a scene file: each with its unit, what it may hold, and the attribute behind it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from functools import partial
from math import inf, isfinite, nextafter, pi
from typing import Any

from simple_model import DRIVES, DriveLaw, Material, ModulusTable, PronyTerm, Rhythm, Signal
from simple_model.choices import choose, meant
from simple_model.layers.modulus_laws import COLUMNS
from simple_model.load.focus import FOCI, FocalSpot
from simple_model.load.trajectory import Points
from skinwave.scene.material_file import material_of, values_of, written_table
from skinwave.scene.scene import Layer, Mounting, Phalanx, Relief, Sides
from skinwave.scene.support_motion import SupportMotion
from skinwave.system.plain_text import number_in

# Typical depths of receptors in the glabrous skin of a hand in metre, rounded: Merkel's cells at
# the base of the epidermis, Meissner's corpuscles in the papillae beside them, Pacini's in the deep
# dermis and below. A place and a person may differ by half: give a number where it is known.
RECEPTORS = {"surface": 0.0, "meissner": 0.7e-3, "merkel": 0.75e-3, "pacini": 2e-3}


@dataclass(frozen=True)
class SceneKey:
    """A key of the file: the attribute behind it and how it is read and written."""

    name: str
    read: Callable[[str, Any], Any]
    write: Callable[[Any], Any]


Keys = Mapping[str, SceneKey]


def written(keys: Keys, record: Any) -> dict[str, Any]:
    """The table of a record, by the keys of a file, without what is None."""
    values = ((key, field, getattr(record, field.name)) for key, field in keys.items())
    return {key: field.write(value) for key, field, value in values if value is not None}


def _wrong(key: str, value: Any, must: str) -> ValueError:
    text = repr(value)
    return ValueError(f"{key} = {text if len(text) <= 60 else f'{text[:57]}...'} must be {must}")


def _number(key: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise _wrong(key, value, "a number")
    try:
        return float(value)
    except OverflowError:
        raise ValueError(f"{key} is too large a number; give one below 1e308") from None


def as_text(key: str, value: Any) -> str:
    """The text itself; an error for anything else."""
    if not isinstance(value, str):
        raise _wrong(key, value, "a text in quotes")
    return value


def as_table(key: str, value: Any) -> dict[str, Any]:
    """The table itself; an error for anything else."""
    if not isinstance(value, dict):
        raise _wrong(key, value, f"a table, [{key}]")
    return value


def _list(key: str, value: Any, of: str) -> list[Any]:
    if not isinstance(value, list):
        raise _wrong(key, value, f"a list of {of}")
    return value


def _switch(key: str, value: Any) -> bool:
    if not isinstance(value, bool):
        raise _wrong(key, value, "true or false")
    return value


def _numbers(key: str, value: Any) -> tuple[float, ...]:
    return tuple(_number(key, x) for x in _list(key, value, "numbers"))


def _words(key: str, value: Any) -> tuple[str, ...]:
    return tuple(as_text(key, word) for word in _list(key, value, 'words, such as ["left"]'))


def _pair(key: str, value: Any) -> tuple[float, float]:
    if not isinstance(value, list) or len(value) != 2:
        raise _wrong(key, value, "a pair of numbers, such as [1.0, 0.0]")
    return _number(key, value[0]), _number(key, value[1])


def _pair_in_mm(key: str, value: Any) -> tuple[float, float]:
    x, y = _pair(key, value)
    if not (isfinite(x) and isfinite(y)):
        raise ValueError(f"{key} has the point [{x}, {y}]; coordinates must be finite")
    return x / 1e3, y / 1e3


def _points(key: str, value: Any) -> Points:
    pairs = _list(key, value, "pairs, such as [[0, 0], [5, 0]]")
    return tuple(_pair_in_mm(key, pair) for pair in pairs)


def _write_pair(pair: tuple[float, float]) -> list[float]:
    return [_in_units(x, 1e3) for x in pair]


def _write_points(points: Points) -> list[list[float]]:
    return [_write_pair(point) for point in points]


def _record(
    section: str, name: str, make: Callable[..., Any], keys: Keys, required: int = 0
) -> SceneKey:
    """A table within a section, of a record, of whose keys so many, from the first, are required;
    numbers that are None are not written.
    """

    def read(key: str, value: Any) -> Any:
        where = f"{section}.{key}"
        return make(**_checked_all(f"[{where}]", as_table(where, value), keys, required))

    return SceneKey(name, read, partial(written, keys))


def _records(where: str, make: Callable[..., Any], keys: Keys) -> SceneKey:
    """Tables under [[where]], of records, all of whose keys are required."""

    def read(key: str, value: Any) -> Any:
        tables = (as_table(where, t) for t in _list(key, value, f"tables, each under [[{where}]]"))
        return tuple(make(**_checked_all(f"[[{where}]]", t, keys, len(keys))) for t in tables)

    name = where.rpartition(".")[2]
    return SceneKey(name, read, lambda records: [written(keys, record) for record in records])


def _checked_all(where: str, table: dict[str, Any], keys: Keys, required: int) -> dict[str, Any]:
    values = checked(where, table, keys)
    if missing := [k for k in list(keys)[:required] if keys[k].name not in values]:
        raise ValueError(f"{where} lacks {' and '.join(missing)}; give it")
    return values


def _material(key: str, value: Any) -> str | Material:
    if isinstance(value, str):
        return value
    where = f"[body.{key}]"
    values = checked(where, as_table(key, value), MATERIAL)
    return material_of(values, where, {field.name: own for own, field in MATERIAL.items()})


def write_material(material: str | Material) -> Any:
    """The name of a material, or its table."""
    if isinstance(material, str):
        return material
    values = values_of(material)
    return {k: key.write(values[key.name]) for k, key in MATERIAL.items() if key.name in values}


def _table(key: str, value: Any) -> ModulusTable:
    if isinstance(value, str):
        raise ValueError(
            f"{key} = {value!r} names a file, which is looked for beside a scene file, and this "
            f"scene is none; give its numbers, {key}.{', '.join(COLUMNS)}"
        )
    where, columns = f"[body.material.{key}]", {n: SceneKey(n, _numbers, list) for n in COLUMNS}
    found = _checked_all(where, as_table(key, value), columns, len(columns))
    frequencies, storage, loss = (found[name] for name in COLUMNS)
    if not len(frequencies) == len(storage) == len(loss):
        raise ValueError(
            f"{where} has {len(frequencies)} frequencies, {len(storage)} storage and {len(loss)} "
            "loss moduli; give as many of each"
        )
    moduli = tuple(complex(*each) for each in zip(storage, loss, strict=True))
    return ModulusTable(frequencies=frequencies, moduli=moduli)


def _write_drive(drive: str | DriveLaw) -> str:
    if isinstance(drive, DriveLaw) and DRIVES.get(drive.name) is not drive:
        raise ValueError(
            f"drive law '{drive}' is a Python function, which a scene file cannot hold; take one "
            f"of {', '.join(DRIVES)}, register it in DRIVES, or simulate it from Python"
        )
    return str(drive)


def _write_profile(profile: str | FocalSpot) -> str:
    if not isinstance(profile, str):
        raise ValueError(
            "the focus profile is a map or a Python function, which a scene file cannot hold; take "
            f"one of {', '.join(FOCI)}, or simulate it from Python"
        )
    return profile


def _regions(key: str, value: Any) -> tuple[tuple[str, str | Material], ...]:
    table = as_table(f"body.{key}", value)
    return tuple((name, _material(f"{key}.{name}", of)) for name, of in table.items())


def _mounting(**values: Any) -> Mounting:
    """Clips hold the sheet alone, unless edges are named, too."""
    return Mounting(**({"edges": ()} if values.get("clips") else {}) | values)


def _sides(key: str, value: Any) -> str | Sides:
    if isinstance(value, str):
        return value
    return _record("body", "sides", Sides, SIDES).read(key, value)


def _direction(key: str, value: Any) -> str | tuple[float, ...]:
    return value if isinstance(value, str) else _numbers(key, value)


def _write_direction(direction: str | tuple[float, ...]) -> str | list[float]:
    return direction if isinstance(direction, str) else list(direction)


def _contact_in_mm(key: str, value: Any) -> float:
    if not (width := _number(key, value)):
        raise ValueError(f"{key} = 0 is no contact; give its width, or leave it out for 2 mm")
    return width / 1e3


def _scaled(name: str, per_unit: float = 1.0) -> SceneKey:
    """A number whose unit in the file is `per_unit` times smaller than inside."""
    return SceneKey(
        name,
        lambda key, value: _number(key, value) / per_unit,
        lambda value: _in_units(value, per_unit),
    )


def _in_units(value: float, per_unit: float) -> float:
    """The number for a file, the shortest that is read as the value itself if there is one."""
    near = value * per_unit
    beside = [nextafter(near, way) for way in (-inf, inf)]
    further = [nextafter(x, way) for x, way in zip(beside, (-inf, inf), strict=True)]
    nearest = [*(round(near, digits) for digits in (9, 12)), near, *beside, *further]
    return next((x for x in nearest if x / per_unit == value), near)


def _word(name: str) -> SceneKey:
    return SceneKey(name, as_text, str)


def _depth(key: str, value: Any) -> float | tuple[float, ...]:
    if isinstance(value, list):
        return tuple(_one_depth(key, each) for each in value)
    return _one_depth(key, value)


def _one_depth(key: str, value: Any) -> float:
    if isinstance(value, str):
        return RECEPTORS[choose(key, value, RECEPTORS)]
    return _number(key, value) / 1e3


def depth_of(word: str) -> float:
    """Depth in metre of a word on the command line: a number in mm, or a receptor.

    Raises
    ------
    ValueError
        If it is neither.
    """
    number = number_in(word)
    return _one_depth("--depth", word if number is None else number)


def _write_depth(depth: float | tuple[float, ...]) -> float | list[float]:
    if isinstance(depth, tuple):
        return [_in_units(z, 1e3) for z in depth]
    return _in_units(depth, 1e3)


PRONY = {"modulus_pa": _scaled("modulus"), "time_s": _scaled("time")}
MODULI, LOSSES = "modulus_scale", "loss_scale"  # of a material, beside its keys; 1 is as it is
SCALES = {MODULI: "modulus", LOSSES: "loss"}  # arguments of `Material.scaled`
MATERIAL = {
    "density_kg_m3": _scaled("density"),
    "shear_modulus_pa": _scaled("shear_modulus"),
    "young_modulus_pa": _scaled("young"),
    "poisson": _scaled("poisson"),
    "young_x_pa": _scaled("young_x"),
    "young_y_pa": _scaled("young_y"),
    "poisson_xy": _scaled("poisson_xy"),
    "shear_xy_pa": _scaled("shear_xy"),
    "viscosity_pa_s": _scaled("viscosity"),
    "loss_factor": _scaled("loss_factor"),
    "law": _word("law"),
    "fast_modulus_pa": _scaled("fast_modulus"),
    "exponent": _scaled("exponent"),
    "time_s": _scaled("time"),
    "table": SceneKey("table", _table, written_table),
    "prony": _records("body.material.prony", PronyTerm, PRONY),
}
INSTEAD = {  # keys of a material of which one is computed from the other
    "young_modulus_pa": "shear_modulus_pa",
    "shear_modulus_pa": "young_modulus_pa",
}
MOUNTING = {
    "edges": SceneKey("edges", _words, list),
    "support": _word("support"),
    "clips_mm": SceneKey("clips", _points, _write_points),
    "clip_radius_mm": _scaled("clip_radius", 1e3),
    "tension_x_n_per_m": _scaled("tension_x"),
    "tension_y_n_per_m": _scaled("tension_y"),
    "curl_x_mm": _scaled("curl_x", 1e3),
    "curl_y_mm": _scaled("curl_y", 1e3),
}
BONE = {f"{length.name}_mm": _scaled(length.name, 1e3) for length in fields(Phalanx)}
RELIEF = {f"{height.name}_mm": _scaled(height.name, 1e3) for height in fields(Relief)}
LAYER = {
    "thickness_mm": _scaled("thickness", 1e3),
    "material": SceneKey("material", _material, write_material),
}
SIDES = {side.name: _word(side.name) for side in fields(Sides)}
PULSES = {"pulses_ms": SceneKey("pulses", _points, _write_points), "ramp_ms": _scaled("ramp", 1e3)}
SIGNAL = {
    "rate_hz": _scaled("rate"),
    "samples": SceneKey("samples", _numbers, list),
    "role": _word("role"),
}
SUPPORT_MOTION = {
    "amplitude_um": _scaled("amplitude", 1e6),
    "frequency_hz": _scaled("frequency"),
    "direction": SceneKey("direction", _direction, _write_direction),
}
PATH = ("shape", "size", "speed", "sweep", "centre", "points", "times", "levels", "hold")
SECTIONS = {
    "tacton": {
        "amplitude_percent": _scaled("amplitude", 100),
        "am_frequency_hz": _scaled("am_frequency"),
        "second_am_frequency_hz": _scaled("second_am_frequency"),
        "superposition": SceneKey("superposition", _pair, list),
        "envelope_frequency_hz": _scaled("envelope_frequency"),
        "duration_s": _scaled("duration"),
        "shape": _word("shape"),
        "size_mm": _scaled("size", 1e3),
        "speed_m_per_s": _scaled("speed"),
        "sweep": _word("sweep"),
        "centre_mm": SceneKey("centre", _pair_in_mm, _write_pair),
        "points_mm": SceneKey("points", _points, _write_points),
        "times_s": SceneKey("times", _numbers, list),
        "levels": SceneKey("levels", _numbers, list),
        "hold": SceneKey("hold", _switch, bool),
        "foci": SceneKey("foci", _numbers, lambda phases: [float(phase) for phase in phases]),
        "sharing": _word("sharing"),
        "rhythm": _record("tacton", "rhythm", Rhythm, PULSES, 1),
        "signal": _record("tacton", "signal", Signal, SIGNAL, 2),
    },
    "focus": {
        "height_mm": _scaled("height", 1e3),
        "drive": SceneKey("drive", as_text, _write_drive),
        "depth_of_modulation": _scaled("depth_of_modulation"),
        "peak_pressure_pa": _scaled("peak_pressure"),
        "profile": SceneKey("profile", as_text, _write_profile),
    },
    "body": {
        "kind": _word("kind"),
        "material": SceneKey("material", _material, write_material),
        "size_x_mm": _scaled("width", 1e3),
        "size_y_mm": _scaled("height", 1e3),
        "thickness_mm": _scaled("depth", 1e3),
        "base": _word("base"),
        "sides": SceneKey("sides", _sides, lambda x: x if isinstance(x, str) else x.by_name),
        "base_stiffness_n_per_m3": _scaled("base_stiffness"),
        "layers": _records("body.layers", Layer, LAYER),
        "relief": _record("body", "relief", Relief, RELIEF),
        "bone": _record("body", "bone", Phalanx, BONE),
        "file": _word("file"),
        "unit": _word("unit"),
        "up": _word("up"),
        "regions": SceneKey(
            "regions", _regions, lambda named: {name: write_material(of) for name, of in named}
        ),
        "air": SceneKey("air", _switch, bool),
        "mounting": _record("body", "mounting", _mounting, MOUNTING),
        "grammage_g_m2": _scaled("grammage", 1e3),
    },
    "load": {
        "kind": _word("kind"),
        "direction": SceneKey("direction", _direction, _write_direction),
        "force_n": _scaled("force"),
        "width_mm": replace(_scaled("width", 1e3), read=_contact_in_mm),
        "gravity_m_per_s2": _scaled("gravity"),
        "support_motion": _record("load", "support_motion", SupportMotion, SUPPORT_MOTION, 2),
    },
    "placement": {
        "tilt_x_deg": _scaled("tilt_x", 180 / pi),
        "tilt_y_deg": _scaled("tilt_y", 180 / pi),
        "offset_mm": SceneKey("offset", _pair_in_mm, _write_pair),
        "lift_mm": _scaled("lift", 1e3),
    },
    "probes": {
        "points_mm": SceneKey("probes", _points, _write_points),
        "depth_mm": SceneKey("depth", _depth, _write_depth),
        "quantity": _word("quantity"),
    },
}


# Keys that others are computed from, and that no file is written with.
DERIVED = {"grammage_g_m2"}


def with_key(table: Mapping[str, Any], key: str, value: Any) -> dict[str, Any]:
    """A table with another value of a key, and without the key that it stands instead of."""
    return {name: x for name, x in table.items() if name != INSTEAD.get(key)} | {key: value}


def checked(where: str, table: dict[str, Any], keys: Mapping[str, Any]) -> dict[str, Any]:
    """Values by attribute name, each read by its field; an error names keys for a wrong one."""
    values = {}
    for key, value in table.items():
        if key not in keys:
            others = [f"[{name}]" for name, known in SECTIONS.items() if key in known]
            hint = f"; it belongs to {' or '.join(others)}" if others else meant(key, keys)
            hint = hint or f"; it may have {', '.join(keys)}"
            raise ValueError(f"{where} has the unknown key {key[:60]!r}{hint}")
        field = keys[key]
        if isinstance(field, SceneKey):
            values[field.name] = field.read(key, value)
        else:
            values[key] = field(key, value)
    return values
