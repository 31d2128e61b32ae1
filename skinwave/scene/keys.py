"""The keys of a scene file: each with its unit, what it may hold, and the attribute behind it."""

import warnings
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


def written(keys: Mapping[str, SceneKey], record: Any) -> dict[str, Any]:
    """The table of a record, by the keys of a file."""
    return {key: field.write(getattr(record, field.name)) for key, field in keys.items()}


def _number(key: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"{key} = {_shown(value)} must be a number")
    try:
        return float(value)
    except OverflowError:
        raise ValueError(f"{key} is too large a number; give one below 1e308") from None


def _shown(value: Any) -> str:
    """A value as a message quotes it."""
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def as_text(key: str, value: Any) -> str:
    """The text itself; an error for anything else."""
    if not isinstance(value, str):
        raise ValueError(f"{key} = {_shown(value)} must be a text in quotes")
    return value


def as_table(key: str, value: Any) -> dict[str, Any]:
    """The table itself; an error for anything else."""
    if not isinstance(value, dict):
        raise ValueError(f"{key} = {_shown(value)} must be a table, [{key}]")
    return value


def _pair(key: str, value: Any) -> tuple[float, float]:
    if not isinstance(value, list) or len(value) != 2:
        raise ValueError(f"{key} = {_shown(value)} must be a pair of numbers, such as [1.0, 0.0]")
    return _number(key, value[0]), _number(key, value[1])


def _place(key: str, value: Any) -> tuple[float, float]:
    return _points(key, [value])[0]


def _points(key: str, value: Any) -> Points:
    if not isinstance(value, list):
        raise ValueError(
            f"{key} = {_shown(value)} must be a list of pairs, such as [[0, 0], [5, 0]]"
        )
    points = [_pair(key, point) for point in value]
    for x, y in points:
        if not (isfinite(x) and isfinite(y)):
            raise ValueError(f"{key} has the point [{x}, {y}]; coordinates must be finite")
    return tuple((x / 1e3, y / 1e3) for x, y in points)


def _write_pair(pair: tuple[float, float]) -> list[float]:
    return [_in_units(x, 1e3) for x in pair]


def _write_points(points: Points) -> list[list[float]]:
    return [_write_pair(point) for point in points]


def _numbers(key: str, value: Any) -> tuple[float, ...]:
    if not isinstance(value, list):
        raise ValueError(f"{key} = {_shown(value)} must be a list of numbers")
    return tuple(_number(key, x) for x in value)


def _words(key: str, value: Any) -> tuple[str, ...]:
    if not isinstance(value, list):
        raise ValueError(f'{key} = {_shown(value)} must be a list of words, such as ["left"]')
    return tuple(as_text(key, word) for word in value)


def _switch(key: str, value: Any) -> bool:
    if not isinstance(value, bool):
        raise ValueError(f"{key} = {_shown(value)} must be true or false")
    return value


def _pulses(key: str, value: Any) -> Points:
    if not isinstance(value, list):
        raise ValueError(
            f"{key} = {_shown(value)} must be a list of pulses and gaps, such as [[100, 50]]"
        )
    return tuple((on / 1e3, gap / 1e3) for on, gap in (_pair(key, pulse) for pulse in value))


def _inner(cls: type, keys: dict[str, SceneKey]) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """How a table within [tacton] is read as a record, and written."""

    def read(key: str, value: Any) -> Any:
        values = checked(f"[tacton.{key}]", as_table(key, value), keys)
        missing = [k for k in list(keys)[: REQUIRED[key]] if keys[k].name not in values]
        if missing:
            raise ValueError(f"[tacton.{key}] lacks {' and '.join(missing)}; give it")
        return cls(**values)

    return read, partial(written, keys)


def _material(key: str, value: Any) -> str | Material:
    if isinstance(value, str):
        return value
    table = dict(as_table(key, value))
    one = {new: table.pop(old) for old, new in MAXWELL_BRANCH.items() if old in table}
    values = checked(f"[body.{key}]", table, MATERIAL)
    if one:
        warnings.warn(
            f"{' and '.join(MAXWELL_BRANCH)} of [body.{key}] are now modulus_pa and time_s of "
            f"[[body.{key}.prony]]",
            FutureWarning,  # which is shown to who writes scenes, not only to who writes Python
            stacklevel=2,
        )
        if _number(key, one.get("modulus_pa", 0)):
            values["prony"] = (*values.get("prony", ()), *_prony("prony", [{"time_s": 0} | one]))
    return material_of(
        values, f"[body.{key}]", {field.name: own for own, field in MATERIAL.items()}
    )


def write_material(material: str | Material) -> Any:
    """The name of a material, or its table."""
    if isinstance(material, str):
        return material
    values = values_of(material)
    return {k: key.write(values[key.name]) for k, key in MATERIAL.items() if key.name in values}


def _table(key: str, value: Any) -> ModulusTable:
    if isinstance(value, str):
        raise ValueError(
            f"{key} = {_shown(value)} names a file, which is looked for beside a scene file, and "
            f"this scene is none; give its numbers, {key}.{', '.join(COLUMNS)}"
        )
    columns = {name: SceneKey(name, _numbers, list) for name in COLUMNS}
    found = checked(f"[body.material.{key}]", as_table(key, value), columns)
    if missing := [name for name in COLUMNS if name not in found]:
        raise ValueError(f"[body.material.{key}] lacks {' and '.join(missing)}; give it")
    frequencies, storage, loss = (found[name] for name in COLUMNS)
    if not len(frequencies) == len(storage) == len(loss):
        raise ValueError(
            f"[body.material.{key}] has {len(frequencies)} frequencies, {len(storage)} storage and "
            f"{len(loss)} loss moduli; give as many of each"
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


def _prony(key: str, value: Any) -> tuple[PronyTerm, ...]:
    return tuple(PronyTerm(**values) for values in _tables(f"body.material.{key}", value, PRONY))


def _tables(key: str, value: Any, keys: dict[str, SceneKey]) -> list[dict[str, Any]]:
    """Values of each of the tables under [[key]], all of whose keys are needed."""
    if not isinstance(value, list):
        raise ValueError(f"{key} = {_shown(value)} must be tables, each under [[{key}]]")
    found = [checked(f"[[{key}]]", as_table(key, table), keys) for table in value]
    for values in found:
        if missing := [k for k, field in keys.items() if field.name not in values]:
            raise ValueError(f"[[{key}]] lacks {' and '.join(missing)}; give it")
    return found


def _layers(key: str, value: Any) -> tuple[Layer, ...]:
    return tuple(Layer(**values) for values in _tables(f"body.{key}", value, LAYER))


def _regions(key: str, value: Any) -> tuple[tuple[str, str | Material], ...]:
    table = as_table(f"body.{key}", value)
    return tuple((name, _material(f"{key}.{name}", of)) for name, of in table.items())


def _relief(key: str, value: Any) -> Relief:
    return Relief(**checked(f"[body.{key}]", as_table(f"body.{key}", value), RELIEF))


def _write_relief(relief: Relief) -> dict[str, Any]:
    given = {key: field for key, field in RELIEF.items() if getattr(relief, field.name) is not None}
    return written(given, relief)


def _bone(key: str, value: Any) -> Phalanx:
    return Phalanx(**checked(f"[body.{key}]", as_table(f"body.{key}", value), BONE))


def _mounting(key: str, value: Any) -> Mounting:
    values = checked(f"[body.{key}]", as_table(f"body.{key}", value), MOUNTING)
    if values.get("clips"):  # alone, unless edges are named, too
        values = {"edges": ()} | values
    return Mounting(**values)


def _support_motion(key: str, value: Any) -> SupportMotion:
    values = checked(f"[load.{key}]", as_table(f"load.{key}", value), SUPPORT_MOTION)
    missing = [k for k in ("amplitude_um", "frequency_hz") if SUPPORT_MOTION[k].name not in values]
    if missing:
        raise ValueError(f"[load.{key}] lacks {' and '.join(missing)}; give it")
    return SupportMotion(**values)


def _sides(key: str, value: Any) -> str | Sides:
    if isinstance(value, str):
        return value
    names = {field.name: as_text for field in fields(Sides)}
    return Sides(**checked(f"[body.{key}]", as_table(f"body.{key}", value), names))


def _write_sides(sides: str | Sides) -> str | dict[str, str]:
    return sides if isinstance(sides, str) else sides.by_name


def _direction(key: str, value: Any) -> str | tuple[float, ...]:
    return value if isinstance(value, str) else _numbers(key, value)


def _write_direction(direction: str | tuple[float, ...]) -> str | list[float]:
    return direction if isinstance(direction, str) else list(direction)


def _pair_in_mm(key: str, value: Any) -> tuple[float, float]:
    x, y = _pair(key, value)
    return x / 1e3, y / 1e3


def _contact_in_mm(key: str, value: Any) -> float:
    if not (width := _number(key, value)):
        raise ValueError(f"{key} = 0 is no contact, a point has no response of its own; give its "
                         "width, or leave it out for 2 mm")  # fmt: skip
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
    "prony": SceneKey("prony", _prony, lambda terms: [written(PRONY, term) for term in terms]),
}
INSTEAD = {  # keys of a material of which one is computed from the other
    "young_modulus_pa": "shear_modulus_pa",
    "shear_modulus_pa": "young_modulus_pa",
}
MAXWELL_BRANCH = {  # keys of version 0.2, which load for one release
    "relaxing_modulus_pa": "modulus_pa",
    "relaxation_time_s": "time_s",
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
PULSES = {"pulses_ms": SceneKey("pulses", _pulses, _write_points), "ramp_ms": _scaled("ramp", 1e3)}
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
REQUIRED = {"rhythm": 1, "signal": 2}  # how many of the keys, from the first
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
        "centre_mm": SceneKey("centre", _place, _write_pair),
        "points_mm": SceneKey("points", _points, _write_points),
        "times_s": SceneKey("times", _numbers, list),
        "levels": SceneKey("levels", _numbers, list),
        "hold": SceneKey("hold", _switch, bool),
        "foci": SceneKey("foci", _numbers, lambda phases: [float(phase) for phase in phases]),
        "sharing": _word("sharing"),
        "rhythm": SceneKey("rhythm", *_inner(Rhythm, PULSES)),
        "signal": SceneKey("signal", *_inner(Signal, SIGNAL)),
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
        "sides": SceneKey("sides", _sides, _write_sides),
        "base_stiffness_n_per_m3": _scaled("base_stiffness"),
        "layers": SceneKey("layers", _layers, lambda layers: [written(LAYER, x) for x in layers]),
        "relief": SceneKey("relief", _relief, _write_relief),
        "bone": SceneKey("bone", _bone, partial(written, BONE)),
        "file": _word("file"),
        "unit": _word("unit"),
        "up": _word("up"),
        "regions": SceneKey(
            "regions", _regions, lambda named: {name: write_material(of) for name, of in named}
        ),
        "air": SceneKey("air", _switch, bool),
        "mounting": SceneKey("mounting", _mounting, partial(written, MOUNTING)),
        "grammage_g_m2": _scaled("grammage", 1e3),
    },
    "load": {
        "kind": _word("kind"),
        "direction": SceneKey("direction", _direction, _write_direction),
        "force_n": _scaled("force"),
        "width_mm": replace(_scaled("width", 1e3), read=_contact_in_mm),
        "gravity_m_per_s2": _scaled("gravity"),
        "support_motion": SceneKey(
            "support_motion", _support_motion, partial(written, SUPPORT_MOTION)
        ),
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

# Keys of [body] in version 0.2, which load for one release.
RENAMED = {"width_mm": "size_x_mm", "height_mm": "size_y_mm", "depth_mm": "thickness_mm"}


def renamed(table: dict[str, Any]) -> dict[str, Any]:
    """A scene's table with today's keys for those of version 0.2, and a warning for each.

    Raises
    ------
    ValueError
        If a length is given by both.
    """
    body = table.get("body")
    if not isinstance(body, dict) or not RENAMED.keys() & body.keys():
        return table
    for old in sorted(body.keys() & RENAMED.keys()):
        new = RENAMED[old]
        if new in body:
            raise ValueError(f"[body] has both {old} and {new}, which are one; leave out {old}")
        warnings.warn(f"[body] {old} is now {new}; rename it", FutureWarning, stacklevel=3)
    return table | {"body": {RENAMED.get(key, key): value for key, value in body.items()}}


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
            raise ValueError(f"{where} has the unknown key {_shown(key)}{hint}")
        field = keys[key]
        if isinstance(field, SceneKey):
            values[field.name] = field.read(key, value)
        else:
            values[key] = field(key, value)
    return values
