"""Materials in scene files: values by attribute name, and laws."""

from collections.abc import Mapping
from dataclasses import fields
from math import inf, isfinite
from pathlib import Path
from typing import Any

from meshes import reading
from simple_model import MODULUS_LAWS, Material, ModulusTable, modulus_table, of_law, orthotropic
from simple_model.choices import choose
from simple_model.layers.modulus_laws import COLUMNS

PLAIN = ("density", "shear_modulus", "poisson")
LOSSES = ("viscosity", "loss_factor", "prony")  # optional
ALONG = ("young_x", "young_y", "poisson_xy")  # of an orthotropic sheet; shear_xy is optional


def material_of(values: Mapping[str, Any], where: str, keys: Mapping[str, str]) -> Material:
    """Return the material with values by attribute name; `where` and `keys` are for messages."""
    values = _by_shear(values, where, keys)
    _check_limits(values, where, keys)
    kind, needed, optional = _kind(values)
    if missing := [keys[name] for name in needed if name not in values]:
        raise ValueError(f"{where} needs {' and '.join(missing)}; add it, or name a preset")
    if others := [keys[name] for name in values if name not in (*needed, *optional)]:
        raise ValueError(
            f"{where} is {kind}, which does not take {' or '.join(others)}; use only "
            f"{', '.join(keys[name] for name in (*needed, *optional))}"
        )
    rest = {name: value for name, value in values.items() if name not in ("law", "table")}
    if "table" in values:
        return of_law(**rest, law=values["table"])
    if "young_x" in values:
        return orthotropic(**values)
    if "law" not in values:
        return Material(**values)
    solid = {name: rest.pop(name) for name in ("density", "poisson")}
    return of_law(**solid, law=MODULUS_LAWS[values["law"]](**rest))


def _check_limits(values: Mapping[str, Any], where: str, keys: Mapping[str, str]) -> None:
    """Refuse numbers that no solid has in these units; results would overflow."""
    if values.get("shear_modulus") == 0:
        raise ValueError(
            f"{where} is a fluid, because its shear modulus is 0; fluids are not modelled, so give "
            f"{keys['shear_modulus']} of a solid"
        )
    longest = 1e3  # s, viscosity over shear modulus
    slowest = longest * values.get("shear_modulus", inf)
    limits = {"density": (1e-9, 1e6), "shear_modulus": (1e-3, 1e13), "viscosity": (-inf, slowest)}
    for name, (low, high) in limits.items():
        if isfinite(value := values.get(name, low)) and not low <= value <= high:
            raise ValueError(
                f"{where} has {keys[name]} = {value:g}, outside {max(low, 0):g} to {high:g}, "
                "unlike any solid; check its unit"
            )


def _by_shear(values: Mapping[str, Any], where: str, keys: Mapping[str, str]) -> Mapping[str, Any]:
    """The values with the shear modulus E / 2 (1 + nu) in place of Young's modulus E."""
    if "young" not in values:
        return values
    rest = {name: value for name, value in values.items() if name != "young"}
    if "poisson" not in values:
        raise ValueError(f"{where} has {keys['young']} without {keys['poisson']}; give both")
    if not values["young"] >= 0:
        raise ValueError(f"{where} has {keys['young']} = {values['young']:g}; give a value above 0")
    least_poisson = -0.999  # avoids a division by 0; the material checks Poisson's ratio
    shear = values["young"] / (2 * (1 + max(values["poisson"], least_poisson)))
    given = rest.get("shear_modulus", shear)
    if not abs(given - shear) <= 1e-3 * abs(shear):
        raise ValueError(
            f"{where} has {keys['young']} = {values['young']:g}, a shear modulus of {shear:g} Pa "
            f"with its Poisson's ratio, but {keys['shear_modulus']} = {given:g}; remove one"
        )
    return rest | {"shear_modulus": given}


def _kind(values: Mapping[str, Any]) -> tuple[str, tuple[str, ...], tuple[str, ...]]:
    """Kind of a material in words, and its required and optional attributes."""
    if "table" in values:
        return "a table of complex moduli", ("density", "poisson", "table"), ()
    if "law" in values:
        law = MODULUS_LAWS[choose("material law", values["law"], MODULUS_LAWS)]
        own = (field.name for field in fields(law) if field.name != "shear_modulus")
        return f"a material of law '{values['law']}'", (*PLAIN, "law", *own), ()
    if not {*ALONG, "shear_xy"}.isdisjoint(values):
        return "an orthotropic material", ("density", *ALONG), ("shear_xy", *LOSSES)
    return "a material without a law", PLAIN, LOSSES


def values_of(material: Material) -> dict[str, Any]:
    """Return the values of a material that a scene file stores, by attribute name."""
    law = material.law
    if law is None:
        along = material.orthotropy
        values = {name: getattr(material, name) for name in (*PLAIN, *LOSSES)}
        if along is not None:
            values = {name: values[name] for name in ("density", *LOSSES)} | vars(along)
        return {name: value for name, value in values.items() if value not in ((), None)}
    if isinstance(law, ModulusTable):
        return {"density": material.density, "poisson": material.poisson, "table": law}
    for name, kind in MODULUS_LAWS.items():
        if type(law) is kind:
            return {attribute: getattr(material, attribute) for attribute in PLAIN} | {
                "law": name, **{each.name: getattr(law, each.name) for each in fields(kind)}
            }  # fmt: skip
    raise ValueError(
        "the modulus law of the material is a Python function, which a scene file cannot store; "
        "give Prony terms or a table, or simulate it from Python"
    )


def with_tables(scene: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Return the table of a scene with the numbers of modulus files, named relative to a folder."""
    for material in _materials(scene):
        if isinstance(name := material.get("table"), str):
            text = reading.read_text(folder / name)
            with reading.naming(folder / name):
                material["table"] = modulus_columns(modulus_table(text))
    return scene


def _materials(scene: dict[str, Any]) -> list[dict[str, Any]]:
    """Tables of the materials of the body, its layers and its regions."""
    body = scene.get("body")
    if not isinstance(body, dict):
        return []
    layers, regions = body.get("layers"), body.get("regions")
    parts = [body, *(layers if isinstance(layers, list) else [])]
    materials = [part.get("material") for part in parts if isinstance(part, dict)]
    materials += regions.values() if isinstance(regions, dict) else ()
    return [material for material in materials if isinstance(material, dict)]


def modulus_columns(table: ModulusTable) -> dict[str, list[float]]:
    """Return the columns of a table of complex moduli by key."""
    moduli = table.moduli
    columns = (table.frequencies, [mu.real for mu in moduli], [mu.imag for mu in moduli])
    return {key: list(column) for key, column in zip(COLUMNS, columns, strict=True)}
