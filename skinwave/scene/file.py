"""Reading and writing of scenes as TOML files."""

import re
import tomllib
from collections.abc import Mapping
from dataclasses import fields, replace
from math import inf
from pathlib import Path
from typing import Any

import tomli_w

from meshes import reading
from simple_model import MovingPressure, Tacton, Trajectory
from simple_model.choices import choose
from simple_model.load.spot_map import SpotMap
from simple_model.load.trajectory import BY_POINTS
from skinwave.bodies.body import BodyKind, check_keys
from skinwave.bodies.parts import check_material
from skinwave.scene.distributions import (
    VALUE,
    Distribution,
    distribution_table,
    read_distribution,
)
from skinwave.scene.dotted_keys import value_at, with_value
from skinwave.scene.focus_file import with_spot
from skinwave.scene.keys import DERIVED, SECTIONS, as_table, as_text, read_keys
from skinwave.scene.load import Load
from skinwave.scene.material_file import with_tables
from skinwave.scene.scene import BODIES, KINDS, Body, Placement, Scene, kind_of, solid_of

DEEPEST = 100  # parts of a key, or tables in each other; those of a scene have at most seven
TOO_DEEP = (
    "keys or brackets are nested too deeply; write keys such as thickness_mm = 10 below a header "
    "such as [body]"
)
PATHS = "write a Windows path in single quotes, 'C:\\hand.stl', or with /, \"C:/hand.stl\""


def read(path: str | Path) -> Scene:
    """Read the scene in a TOML file; a scene without a name has that of its file.

    Raises a ValueError if the file cannot be read or is not a scene.

    >>> from pathlib import Path
    >>> _ = Path("scene.toml").write_text("[tacton]\\nam_frequency_hz = 140\\n")
    >>> read("scene.toml").tacton.am_frequency
    140.0
    """
    must = "a scene, TOML text of keys such as size_mm = 20 below a header such as [tacton]"
    text = reading.read_text(path, must=must)
    with reading.naming(path):
        return from_table({"name": Path(path).stem} | parse_toml(text, Path(path).parent))


def loads(text: str) -> Scene:
    """Return the scene in a TOML text; missing keys take the values of the preset body. Raises a
    ValueError if it is not a scene.

    >>> scene = loads('[tacton]\\nshape = "circle"\\nsize_mm = 20\\nspeed_m_per_s = 12')
    >>> scene.tacton.trajectory.size, scene.body.kind
    (0.02, 'slab')
    """
    return from_table(parse_toml(text))


def parse_toml(text: str, folder: Path | None = None) -> dict[str, Any]:
    """Return the table of a TOML text.

    With the folder of its files, numbers replace the modulus files, and the files of body and focus
    get their full path.
    """
    # The time of the parser is quadratic in the parts of a key.
    keys = re.split(r"[\n#={,]", text)
    if max(sum(1 for part in key.split(".") if part.strip()) for key in keys) > DEEPEST:
        raise ValueError(TOO_DEEP)
    try:
        table = tomllib.loads(text)
    except ValueError as error:
        raise ValueError(_not_toml(text, str(error))) from None
    except RecursionError:
        raise ValueError(TOO_DEEP) from None
    _check_texts({key: value for key, value in table.items() if key != "name"})
    if not folder:
        return table
    for section in map(table.get, ("body", "focus")):
        if isinstance(section, dict) and isinstance(name := section.get("file"), str) and name:
            section["file"] = str((folder / name).resolve())
    return with_tables(table, folder)


def _not_toml(text: str, error: str) -> str:
    """Error of the parser in plain words, with the line and the cure."""
    lines = text.splitlines() or [""]
    place = re.search(r"at line (\d+)", error)
    k = min(int(place[1]), len(lines)) if place else len(lines)
    if "Illegal character '\\n'" in error and k > 1:  # reported at the start of the next line
        k -= not lines[k - 1].count('"') % 2
    line = lines[k - 1].strip()
    cure = "write key = value, with each key once, texts in quotes, and numbers such as 0.5"
    cure = PATHS if "\\" in line else cure
    return f"not valid TOML: line {k} is {line[:60]}; {cure}"


def _check_texts(table: Mapping[str, Any], depth: int = 1) -> None:
    """Refuse tables too deep for recursion, and control characters, as from "C:\\new"."""
    if depth > DEEPEST:
        raise ValueError(TOO_DEEP)
    for key, value in table.items():
        for each in value if isinstance(value, list) else [value]:
            if isinstance(each, dict):
                _check_texts(each, depth + 1)
            elif isinstance(each, str) and not each.isprintable():
                raise ValueError(f"{key} = {each[:60]!r} has a control character; {PATHS}")


def from_table(table: dict[str, Any]) -> Scene:
    """Return the scene from a table with the keys of a scene file."""
    table, spreads = without_spreads(table)
    sections = {"name": as_text, **dict.fromkeys(SECTIONS, as_table)}
    preset, table = _preset(table)
    top = read_keys("scene", table, sections)
    parts = {
        section: read_keys(f"[{section}]", top.get(section, {}), keys)
        for section, keys in SECTIONS.items()
    }
    if parts["probes"].get("probes") == ():
        raise ValueError("points_mm is empty; give at least one probe")
    body = _body(parts["body"] | parts["placement"], preset)
    load = Load(**parts["load"])
    if parts["focus"] and not load.of_kind.is_of_device:
        raise ValueError(f"[focus] does not apply to a load of kind '{load.kind}'; remove it")
    tacton, path = _split(parts["tacton"], tuple(field.name for field in fields(Trajectory)))
    pressure = MovingPressure(
        tacton=Tacton(**tacton, trajectory=Trajectory(**path)), **with_spot(parts["focus"])
    )
    scene = Scene(
        name=top.get("name", "scene"), pressure=pressure, body=body, load=load, **parts["probes"]
    )
    return with_distributions(scene, spreads) if spreads else scene


def with_distributions(scene: Scene, spreads: Mapping[str, Distribution]) -> Scene:
    """Return the scene with only these distributions of its numbers, by dotted key."""
    complete = to_table(scene)
    by_key = dict(_of_shear(complete, *each) for each in spreads.items())
    for key in by_key:
        if value_at(complete, key) is None:
            raise ValueError(f"{key} has a spread, but the scene has no such number; remove it")
    return replace(scene, spreads=tuple(sorted(by_key.items())))


def _of_shear(complete: dict[str, Any], key: str, given: Distribution) -> tuple[str, Distribution]:
    """The distribution of a shear modulus from that of a Young's modulus."""
    path, _, name = key.rpartition(".")
    shear = f"{path}.shear_modulus_pa"
    if name != "young_modulus_pa" or value_at(complete, shear) is None:
        return key, given
    share = 1.0
    if not given.is_relative:
        share = 1 / (2 * (1 + value_at(complete, f"{path}.poisson")))
    return shear, replace(given, width=tuple(share * x for x in given.width))


def without_spreads(node: Any, path: str = "") -> tuple[Any, dict[str, Distribution]]:
    """Return a table with the central value of each number, and distributions by dotted key."""
    if isinstance(node, dict) and VALUE in node and path:
        return node[VALUE], {path: read_distribution(path, node)}
    is_list = isinstance(node, list) and any(isinstance(inner, dict) for inner in node)
    if not (isinstance(node, dict) or is_list):
        return node, {}
    spreads: dict[str, Distribution] = {}
    plain = {}
    for key, inner in node.items() if isinstance(node, dict) else enumerate(node):
        plain[key], own = without_spreads(inner, f"{path}.{key}" if path else str(key))
        spreads |= own
    return list(plain.values()) if is_list else plain, spreads


def dumps(scene: Scene) -> str:
    """Return the complete scene as TOML, which `loads` reads back.

    >>> loads(dumps(loads(""))) == loads("")
    True
    """
    pairs = r"\[\s+(-?\d[\d.e+-]*),\s+(-?\d[\d.e+-]*),\s+\]"  # each number on its own line
    return re.sub(pairs, r"[\1, \2]", tomli_w.dumps(to_table(scene)))


def to_table(scene: Scene) -> dict[str, Any]:
    """Return the complete scene as a table, which `from_table` reads back."""
    tacton, body = scene.tacton, scene.body
    sources: dict[str, tuple[Any, ...]] = {
        "tacton": (tacton, tacton.trajectory),
        "focus": (scene.pressure, scene.pressure.profile),
        "body": (body,),
        "load": (scene.load,),
        "placement": (body.placement,),
        "probes": (scene,),
    }
    table: dict[str, Any] = {"name": scene.name}
    unused = _unused_keys(scene)
    for section, keys in SECTIONS.items():
        if section in unused:
            continue
        table[section] = {}
        for key, field in keys.items():
            if key not in DERIVED and f"{section}.{key}" not in unused:
                source = next(s for s in sources[section] if hasattr(s, field.name))
                table[section][key] = field.write(getattr(source, field.name))
    for key, given in scene.spreads:
        if (value := value_at(table, key)) is not None:
            table = with_value(table, key.split("."), distribution_table(value, given))
    return table


def _unused_keys(scene: Scene) -> set[str]:
    """Sections and dotted keys that do not apply to the scene's other values."""
    tacton, body, load = scene.tacton, scene.body, scene.load
    shape, has_map = tacton.trajectory.shape, isinstance(scene.pressure.profile, SpotMap)
    of_load = {"kind", "gravity", *load.of_kind.defaults}
    of_load |= {"support_motion"} if load.support_motion else set()
    of_others = {key for kind in KINDS.values() for key in kind.keys} - {*body.of_kind.keys}
    of_others |= set() if body.of_kind.discretise else SECTIONS["body"].keys() - {"kind"}
    unused = {
        "tacton.rhythm": tacton.rhythm is None,
        "tacton.signal": tacton.signal is None,
        **dict.fromkeys(("tacton.times_s", "tacton.levels", "tacton.hold"), shape != "recorded"),
        "tacton.points_mm": shape not in BY_POINTS,
        "focus": not load.of_kind.is_of_device,
        "focus.height_mm": has_map,
        **dict.fromkeys(("focus.file", "focus.unit"), not has_map),
        "body.base_stiffness_n_per_m3": not body.base_stiffness,
        "placement": not body.of_kind.discretise,
        **{f"load.{key}": own.name not in of_load for key, own in SECTIONS["load"].items()},
        **dict.fromkeys((f"body.{key}" for key in of_others), True),
    }
    return {key for key, is_unused in unused.items() if is_unused}


def _preset(scene: dict[str, Any]) -> tuple[Body | None, dict[str, Any]]:
    """The body that `preset` of [body] names, and the table without that key."""
    body = scene.get("body")
    if not isinstance(body, dict):
        return None, scene
    named = body.get("preset")
    if named is None:
        if (kind := str(body.get("kind"))) in BODIES and kind not in KINDS:
            raise ValueError(
                f"'{kind}' is not a kind of body but a preset; write preset = \"{kind}\""
            )
        return None, scene
    name = choose("body preset", as_text("preset", named), BODIES)
    return BODIES[name], scene | {"body": {k: v for k, v in body.items() if k != "preset"}}


def _body(values: dict[str, Any], preset: Body | None) -> Body:
    kind = kind_of(values.get("kind", preset.kind if preset else Body.kind))
    if preset and kind is not preset.of_kind:
        raise ValueError(
            f'[body] has kind = "{kind.name}" and a preset of kind = "{preset.kind}"; remove one'
        )
    check_keys(kind, values.keys())
    shape, placement = _split(values, tuple(field.name for field in SECTIONS["placement"].values()))
    missing = vars(preset) if preset else next(iter(kind.presets.values()), {})
    if (grammage := shape.pop("grammage", None)) is not None:
        shape |= _of_grammage(grammage, kind, {**missing, **shape}, "depth" in shape)
    if preset:
        placed = {**vars(preset.placement), **placement}
        return replace(preset, **shape, placement=Placement(**placed))
    return Body(**{**missing, **shape}, placement=Placement(**placement))


def _of_grammage(
    grammage: float, kind: BodyKind, values: dict[str, Any], thickness_is_given: bool
) -> dict[str, Any]:
    """The density or, if not given, the thickness of a sheet from its mass per area in kg/m2."""
    if not kind.is_plate:
        raise ValueError(f'[body] grammage_g_m2 is for a sheet, not "{kind.name}"; remove it')
    if not 0 < grammage < inf:
        raise ValueError(f"grammage_g_m2 = {1e3 * grammage:g} must be a finite number above 0")
    check_material(values["material"])
    solid = solid_of(values["material"])
    if not thickness_is_given:
        return {"depth": grammage / solid.density}
    if not values["depth"] > 0:
        return {}  # the body refuses it
    return {"material": replace(solid, density=grammage / values["depth"])}


def _split(values: dict[str, Any], names: tuple[str, ...]) -> tuple[dict[str, Any], dict[str, Any]]:
    inside = {name: value for name, value in values.items() if name in names}
    return {n: v for n, v in values.items() if n not in names}, inside
