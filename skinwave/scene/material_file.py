"""Materials as scene files have them: values by attribute name, and the laws behind them."""

from collections.abc import Mapping
from dataclasses import fields
from math import inf, isfinite
from pathlib import Path
from typing import Any

from meshes import reading
from simple_model import MODULUS_LAWS, Material, ModulusTable, modulus_table, of_law, orthotropic
from simple_model.choices import choose
from simple_model.layers.modulus_laws import COLUMNS

PLAIN = ("density", "shear_modulus", "poisson")  # and losses, which may be left out
LOSSES = ("viscosity", "loss_factor", "prony")
ALONG = ("young_x", "young_y", "poisson_xy")  # of an orthotropic sheet, and shear_xy
TABULATED = ("density", "poisson", "table")
LIMITS = {"density": (1e-9, 1e6), "shear_modulus": (1e-3, 1e13)}  # kg/m3, Pa
LONGEST = 1e3  # s, of viscosity over shear modulus
SAME_MODULUS = 1e-3  # relative: moduli that are given as Young's and as shear agree as far as this
LEAST_POISSON = -0.999  # below which no solid is; Poisson's ratio is checked with the others


def material_of(values: Mapping[str, Any], where: str, keys: Mapping[str, str]) -> Material:
    """The material of values by attribute name; `where`, the section of the file, and `keys` of the
    file by attribute name are for messages.
    """
    values = _by_shear(values, where, keys)
    _check_limits(values, where, keys)
    kind, needed, optional = _kind(values)
    if missing := [keys[name] for name in needed if name not in values]:
        raise ValueError(f"{where} lacks {' and '.join(missing)}; give it, or name a preset")
    if others := [keys[name] for name in values if name not in (*needed, *optional)]:
        raise ValueError(
            f"{where} is {kind} and has no {' or '.join(others)}; leave it out, it has "
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
    """Refuse numbers that no solid has in these units, and whose results overflow."""
    slowest = LONGEST * values.get("shear_modulus", inf)
    for name, (low, high) in {**LIMITS, "viscosity": (-inf, slowest)}.items():
        if isfinite(value := values.get(name, low)) and not low <= value <= high:
            raise ValueError(
                f"{where} has {keys[name]} = {value:g}, outside {max(low, 0):g} to {high:g}, far "
                "from any solid; check its unit"
            )


def _by_shear(values: Mapping[str, Any], where: str, keys: Mapping[str, str]) -> Mapping[str, Any]:
    """The same values with the shear modulus E / 2 (1 + nu) in place of Young's modulus E."""
    if "young" not in values:
        return values
    rest = {name: value for name, value in values.items() if name != "young"}
    if "poisson" not in values:
        raise ValueError(f"{where} has {keys['young']} without {keys['poisson']}; give both")
    if not values["young"] > 0:
        raise ValueError(f"{where} has {keys['young']} = {values['young']:g}; give one above 0")
    shear = values["young"] / (2 * (1 + max(values["poisson"], LEAST_POISSON)))
    given = rest.get("shear_modulus", shear)
    if "shear_modulus" in rest and not abs(given - shear) <= SAME_MODULUS * abs(shear):
        raise ValueError(
            f"{where} has {keys['young']} = {values['young']:g}, a shear modulus of {shear:g} Pa "
            f"with its Poisson's ratio, and {keys['shear_modulus']} = {given:g}; leave out one"
        )
    return rest | {"shear_modulus": given}


def _kind(values: Mapping[str, Any]) -> tuple[str, tuple[str, ...], tuple[str, ...]]:
    """A material in words, the attributes that it needs, and those that it may have."""
    if "table" in values:
        return "a table of complex moduli", TABULATED, ()
    if "law" in values:
        law = MODULUS_LAWS[choose("material law", values["law"], MODULUS_LAWS)]
        own = (field.name for field in fields(law) if field.name != "shear_modulus")
        return f"of law '{values['law']}'", (*PLAIN, "law", *own), ()
    if not {*ALONG, "shear_xy"}.isdisjoint(values):
        return "orthotropic", ("density", *ALONG), ("shear_xy", *LOSSES)
    return "without a law", PLAIN, LOSSES


def values_of(material: Material) -> dict[str, Any]:
    """The values of a material that a scene file holds, by attribute name."""
    law = material.law
    if law is None:
        along = material.orthotropy
        found = {name: getattr(material, name) for name in (*PLAIN, *LOSSES)}
        if along is not None:
            found = {name: found[name] for name in ("density", *LOSSES)} | vars(along)
        return {name: value for name, value in found.items() if value not in ((), None)}
    if isinstance(law, ModulusTable):
        return {"density": material.density, "poisson": material.poisson, "table": law}
    for name, kind in MODULUS_LAWS.items():
        if type(law) is kind:
            return {attribute: getattr(material, attribute) for attribute in PLAIN} | {
                "law": name, **{each.name: getattr(law, each.name) for each in fields(kind)}
            }  # fmt: skip
    raise ValueError(
        "the material has a modulus law of its own, a Python function, which a scene file cannot "
        "hold; give it Prony terms or a table, or simulate it from Python"
    )


def with_tables(scene: dict[str, Any], folder: Path) -> dict[str, Any]:
    """The table of a scene with the numbers of files of moduli, named from a folder, in place of
    their names.
    """
    for material in _materials(scene):
        if isinstance(name := material.get("table"), str):
            text = reading.read_text(folder / name)
            try:
                material["table"] = written_table(modulus_table(text))
            except ValueError as error:
                raise ValueError(f"{folder / name}: {error}") from None
    return scene


def _materials(scene: dict[str, Any]) -> list[dict[str, Any]]:
    """Tables of materials, of the body, its layers and its regions."""
    body = scene.get("body")
    if not isinstance(body, dict):
        return []
    layers, regions = body.get("layers"), body.get("regions")
    parts = [body, *(layers if isinstance(layers, list) else [])]
    found = [part.get("material") for part in parts if isinstance(part, dict)]
    found += regions.values() if isinstance(regions, dict) else ()
    return [material for material in found if isinstance(material, dict)]


def written_table(table: ModulusTable) -> dict[str, list[float]]:
    """The columns of a table of complex moduli, by their keys."""
    moduli = table.moduli
    columns = (table.frequencies, [mu.real for mu in moduli], [mu.imag for mu in moduli])
    return {key: list(column) for key, column in zip(COLUMNS, columns, strict=True)}
