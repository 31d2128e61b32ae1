"""Keys of a scene file, each with its unit, its values and its attribute."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from math import inf, isfinite, nextafter, pi
from typing import Any

from simple_model import DRIVES, DriveLaw, Material, ModulusTable, PronyTerm, Rhythm, Signal
from simple_model.choices import choose
from simple_model.layers.modulus_laws import COLUMNS
from simple_model.load.focus import FOCI, FocalSpot
from simple_model.load.spot_map import SpotMap
from skinwave.scene.key_hints import key_hint
from skinwave.scene.load import SupportMotion
from skinwave.scene.material_file import material_of, modulus_columns, values_of
from skinwave.scene.receptors import RECEPTORS
from skinwave.scene.scene import Layer, Mounting, Phalanx, Relief, Sides


@dataclass(frozen=True)
class SceneKey:
    """A key of a scene file: its attribute, and how its value is read and written."""

    name: str
    read: Callable[[str, Any], Any]
    write: Callable[[Any], Any]


Keys = Mapping[str, SceneKey]


def write_record(keys: Keys, record: Any) -> dict[str, Any]:
    """Return the table of a record by the keys of a file, without values of None."""
    values = ((key, field, getattr(record, field.name)) for key, field in keys.items())
    return {key: field.write(value) for key, field, value in values if value is not None}


def _of_type(key: str, value: Any, kind: Any, must: str) -> Any:
    if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
        text = repr(value)
        text = text if len(text) <= 60 else f"{text[:57]}..."
        raise ValueError(f"{key} = {text} must be {must}")
    return value


def _number(key: str, value: Any) -> float:
    try:
        return float(_of_type(key, value, int | float, "a number"))
    except OverflowError:
        raise ValueError(f"{key} is too large; give a number below 1e308") from None


def as_text(key: str, value: Any) -> str:
    """Return a text; raise a ValueError for another type."""
    text: str = _of_type(key, value, str, "a text in quotes")
    return text


def as_table(key: str, value: Any) -> dict[str, Any]:
    """Return a table; raise a ValueError for another type."""
    table: dict[str, Any] = _of_type(key, value, dict, f"a table, [{key}]")
    return table


def _switch(must: str) -> Callable[[str, Any], bool]:
    return lambda key, value: bool(_of_type(key, value, bool, must))


def _word_or(own: SceneKey) -> SceneKey:
    """Key of a word, or of the value of another key."""
    return SceneKey(
        own.name,
        lambda key, value: value if isinstance(value, str) else own.read(key, value),
        lambda value: value if isinstance(value, str) else own.write(value),
    )


def _list_of(own: SceneKey, must: str) -> SceneKey:
    """Key of a list of the values of another key."""
    return SceneKey(
        own.name,
        lambda key, value: tuple(own.read(key, x) for x in _of_type(key, value, list, must)),
        lambda values: [own.write(x) for x in values],
    )


def _numbers_in_list(name: str) -> SceneKey:
    return _list_of(_scaled_number(name), "a list of numbers")


def _point(name: str) -> SceneKey:
    return SceneKey(name, _pair_in_mm, lambda pair: [_in_units(x, 1e3) for x in pair])


def _points(name: str) -> SceneKey:
    return _list_of(_point(name), "a list of pairs, such as [[0, 0], [5, 0]]")


def _pair(key: str, value: Any) -> tuple[float, float]:
    must = "a pair of numbers, such as [1.0, 0.0]"
    if len(_of_type(key, value, list, must)) != 2:
        raise ValueError(f"{key} = {value!r} must be {must}")
    return _number(key, value[0]), _number(key, value[1])


def _pair_in_mm(key: str, value: Any) -> tuple[float, float]:
    x, y = _pair(key, value)
    if not (isfinite(x) and isfinite(y)):
        raise ValueError(
            f"{key} has the point [{x}, {y}]; coordinates must be finite numbers in mm"
        )
    return x / 1e3, y / 1e3


def _record(where: str, make: Callable[..., Any], required: int = 0) -> SceneKey:
    """Key of a table [where] that makes a record; its first `required` keys must be given."""

    def read(key: str, value: Any) -> Any:
        table = as_table(where, value)
        return make(**_read_required(f"[{where}]", table, TABLES[where], required))

    name = where.rpartition(".")[2]
    return SceneKey(name, read, lambda record: write_record(TABLES[where], record))


def _records(where: str, make: Callable[..., Any]) -> SceneKey:
    """Key of a list of tables [[where]] for records; all keys of each table must be given."""

    def read(key: str, value: Any) -> Any:
        tables = _of_type(key, value, list, f"a list of tables, each under [[{where}]]")
        keys, title = TABLES[where], f"[[{where}]]"
        each = [_read_required(title, as_table(where, t), keys, len(keys)) for t in tables]
        return tuple(make(**values) for values in each)

    name = where.rpartition(".")[2]
    return SceneKey(name, read, lambda each: [write_record(TABLES[where], one) for one in each])


def _read_required(where: str, table: dict[str, Any], keys: Keys, required: int) -> dict[str, Any]:
    values = read_keys(where, table, keys)
    if missing := [k for k in list(keys)[:required] if keys[k].name not in values]:
        raise ValueError(f"{where} needs {' and '.join(missing)}; add it")
    return values


def _material(key: str, value: Any) -> str | Material:
    if isinstance(value, str):
        return value
    where = f"[body.{key}]"
    keys = TABLES["body.material"]
    values = read_keys(where, as_table(key, value), keys)
    return material_of(values, where, {field.name: own for own, field in keys.items()})


def write_material(material: str | Material) -> Any:
    """Return the name of a material, or its table."""
    if isinstance(material, str):
        return material
    values, keys = values_of(material), TABLES["body.material"]
    return {k: key.write(values[key.name]) for k, key in keys.items() if key.name in values}


def _table(key: str, value: Any) -> ModulusTable:
    if isinstance(value, str):
        raise ValueError(
            f"{key} = {value!r} names a file, which is possible only in a scene file; give the "
            f"numbers as {key}.{', '.join(COLUMNS)}"
        )
    where, columns = f"[body.material.{key}]", {n: _numbers_in_list(n) for n in COLUMNS}
    values = _read_required(where, as_table(key, value), columns, len(columns))
    frequencies, storage, loss = (values[name] for name in COLUMNS)
    if not len(frequencies) == len(storage) == len(loss):
        raise ValueError(
            f"{where} has {len(frequencies)} frequencies, {len(storage)} storage moduli and "
            f"{len(loss)} loss moduli; give equally many"
        )
    moduli = tuple(complex(*each) for each in zip(storage, loss, strict=True))
    return ModulusTable(frequencies=frequencies, moduli=moduli)


def _write_drive(drive: str | DriveLaw) -> str:
    if isinstance(drive, DriveLaw) and DRIVES.get(drive.name) is not drive:
        raise ValueError(
            f"drive law '{drive}' is a Python function, which a scene file cannot store; use one "
            f"of {', '.join(DRIVES)}, register it in DRIVES, or simulate it from Python"
        )
    return str(drive)


def _write_profile(profile: str | FocalSpot) -> str:
    if isinstance(profile, SpotMap) and profile.file:
        return "file"
    if not isinstance(profile, str):
        raise ValueError(
            "the focus profile is a Python function or a map without a file, which a scene file "
            f"cannot store; use one of {', '.join(FOCI)} or a file, or simulate it from Python"
        )
    return profile


def _regions(key: str, value: Any) -> tuple[tuple[str, str | Material], ...]:
    table = as_table(f"body.{key}", value)
    return tuple((name, _material(f"{key}.{name}", each)) for name, each in table.items())


def _mounting(**values: Any) -> Mounting:
    """Mounting of a sheet; with clips, edges are supported only if they are named."""
    return Mounting(**({"edges": ()} if values.get("clips") else {}) | values)


def _contact_in_mm(key: str, value: Any) -> float:
    if not (width := _number(key, value)):
        raise ValueError(
            f"{key} = 0 must be above 0; give the width of the contact, or remove it for 2 mm"
        )
    return width / 1e3


def _scaled_number(name: str, per_unit: float = 1.0) -> SceneKey:
    """A number that is stored in SI units, and in the file times `per_unit`."""
    return SceneKey(
        name,
        lambda key, value: _number(key, value) / per_unit,
        lambda value: _in_units(value, per_unit),
    )


def _in_units(value: float, per_unit: float) -> float:
    """The shortest number that is read back from a file as the same value."""
    near = value * per_unit
    low, high = nextafter(near, -inf), nextafter(near, inf)
    nearest = [round(near, 9), round(near, 12), near, low, high]
    nearest += [nextafter(low, -inf), nextafter(high, inf)]
    return next((x for x in nearest if x / per_unit == value), near)


def _one_depth(key: str, value: Any) -> float:
    if isinstance(value, str):
        return RECEPTORS[choose(key, value, RECEPTORS)]
    return _number(key, value) / 1e3


def _depths() -> SceneKey:
    """Key of a depth, or of a list of depths."""
    one = SceneKey("depth", _one_depth, lambda depth: _in_units(depth, 1e3))
    each = _list_of(one, "a list of depths")
    return SceneKey(
        one.name,
        lambda key, value: (each if isinstance(value, list) else one).read(key, value),
        lambda depth: (each if isinstance(depth, tuple) else one).write(depth),
    )


def _numbers_of(**keys: str) -> dict[str, SceneKey]:
    """Number keys by attribute name; the end of a key is its unit."""
    per_si = {
        "_mm": 1e3, "_ms": 1e3, "_um": 1e6, "_percent": 100.0, "_deg": 180 / pi, "_g_m2": 1e3,
    }  # fmt: skip
    units = {key: next((x for end, x in per_si.items() if key.endswith(end)), 1.0) for key in keys}
    return {key: _scaled_number(name, units[key]) for key, name in keys.items()}


def _words_of(*names: str) -> dict[str, SceneKey]:
    """Word keys by attribute name."""
    return {name: SceneKey(name, as_text, str) for name in names}


SCALES = {"modulus_scale": "modulus", "loss_scale": "loss"}  # arguments of `Material.scaled`
_MATERIAL = {"material": SceneKey("material", _material, write_material)}
_DIRECTION = {"direction": _word_or(_numbers_in_list("direction"))}
TABLES: Mapping[str, Keys] = {  # keys within tables of a section
    "tacton.rhythm": {
        "pulses_ms": _points("pulses"), **_numbers_of(ramp_ms="ramp"),
    },
    "tacton.signal": {
        **_numbers_of(rate_hz="rate"), "samples": _numbers_in_list("samples"),
        **_words_of("role"),
    },
    "body.material": {
        **_numbers_of(
            density_kg_m3="density", shear_modulus_pa="shear_modulus", young_modulus_pa="young",
            poisson="poisson", young_x_pa="young_x", young_y_pa="young_y", poisson_xy="poisson_xy",
            shear_xy_pa="shear_xy", viscosity_pa_s="viscosity", loss_factor="loss_factor",
        ),
        **_words_of("law"),
        **_numbers_of(fast_modulus_pa="fast_modulus", exponent="exponent", time_s="time"),
        "table": SceneKey("table", _table, modulus_columns),
        "prony": _records("body.material.prony", PronyTerm),
    },
    "body.material.prony": _numbers_of(modulus_pa="modulus", time_s="time"),
    "body.layers": {**_numbers_of(thickness_mm="thickness"), **_MATERIAL},
    "body.relief": _numbers_of(**{f"{each.name}_mm": each.name for each in fields(Relief)}),
    "body.bone": _numbers_of(**{f"{each.name}_mm": each.name for each in fields(Phalanx)}),
    "body.mounting": {
        "edges": _list_of(_words_of("edges")["edges"], 'a list of words, such as ["left"]'),
        **_words_of("support"),
        "clips_mm": _points("clips"),
        **_numbers_of(
            clip_radius_mm="clip_radius", tension_x_n_per_m="tension_x",
            tension_y_n_per_m="tension_y", curl_x_mm="curl_x", curl_y_mm="curl_y",
            edge_loss="edge_loss", frame_width_mm="frame_width",
        ),
    },
    "body.sides": _words_of(*(side.name for side in fields(Sides))),
    "load.support_motion": {
        **_numbers_of(amplitude_um="amplitude", frequency_hz="frequency"), **_DIRECTION,
    },
}  # fmt: skip
SECTIONS: Mapping[str, Keys] = {
    "tacton": {
        **_numbers_of(
            amplitude_percent="amplitude", am_frequency_hz="am_frequency",
            second_am_frequency_hz="second_am_frequency",
        ),
        "superposition": SceneKey("superposition", _pair, list),
        **_numbers_of(envelope_frequency_hz="envelope_frequency", duration_s="duration"),
        **_words_of("shape"),
        **_numbers_of(size_mm="size", speed_m_per_s="speed"),
        **_words_of("sweep"),
        "centre_mm": _point("centre"),
        "points_mm": _points("points"),
        "times_s": _numbers_in_list("times"),
        "levels": _numbers_in_list("levels"),
        "hold": SceneKey("hold", _switch("true or false"), bool),
        "foci": _numbers_in_list("foci"),
        **_words_of("sharing"),
        "rhythm": _record("tacton.rhythm", Rhythm, 1),
        "signal": _record("tacton.signal", Signal, 2),
    },
    "focus": {
        **_numbers_of(height_mm="height"),
        "drive": SceneKey("drive", as_text, _write_drive),
        **_numbers_of(
            depth_of_modulation="depth_of_modulation", peak_pressure_pa="peak_pressure",
        ),
        "profile": SceneKey("profile", as_text, _write_profile),
        **_words_of("file", "unit"),
    },
    "body": {
        **_words_of("kind"), **_MATERIAL,
        **_numbers_of(size_x_mm="width", size_y_mm="height", thickness_mm="depth"),
        **_words_of("base"),
        "sides": _word_or(_record("body.sides", Sides)),
        **_numbers_of(base_stiffness_n_per_m3="base_stiffness"),
        "layers": _records("body.layers", Layer),
        "relief": _record("body.relief", Relief),
        "bone": _record("body.bone", Phalanx),
        **_words_of("file", "unit", "up"),
        "regions": SceneKey(
            "regions", _regions, lambda named: {name: write_material(each) for name, each in named}
        ),
        "air": _word_or(SceneKey("air", _switch('false, "free" or "baffle"'), bool)),
        "mounting": _record("body.mounting", _mounting),
        **_numbers_of(grammage_g_m2="grammage"),
    },
    "load": {
        **_words_of("kind"), **_DIRECTION,
        **_numbers_of(force_n="force"),
        "width_mm": replace(_scaled_number("width", 1e3), read=_contact_in_mm),
        **_numbers_of(gravity_m_per_s2="gravity"),
        "support_motion": _record("load.support_motion", SupportMotion, 2),
    },
    "placement": {
        **_numbers_of(tilt_x_deg="tilt_x", tilt_y_deg="tilt_y"),
        "offset_mm": _point("offset"),
        **_numbers_of(lift_mm="lift"),
    },
    "probes": {
        "points_mm": _points("probes"),
        "depth_mm": _depths(),
        **_words_of("quantity"),
    },
}  # fmt: skip
DERIVED = {"grammage_g_m2"}  # keys that set others, and that are not written


def read_keys(where: str, table: dict[str, Any], keys: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of a table by attribute name; errors suggest keys for unknown ones."""
    values = {}
    for key, value in table.items():
        if key not in keys:
            others = [f"[{name}]" for name, known in SECTIONS.items() if key in known]
            hint = f"; move it to {' or '.join(others)}" if others else key_hint(key, keys, value)
            hint = hint or f"; use one of {', '.join(keys)}"
            raise ValueError(f"{where} has the unknown key {key[:60]!r}{hint}")
        field = keys[key]
        if isinstance(field, SceneKey):
            values[field.name] = field.read(key, value)
        else:
            values[key] = field(key, value)
    return values
