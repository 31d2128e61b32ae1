"""Dotted keys, such as "body.layers.0.thickness_mm", in the table of a scene."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from simple_model import Material
from simple_model.choices import choose
from simple_model.layers.material import PRESETS
from skinwave.scene.keys import write_material
from skinwave.scene.scene import Body, solid_of


def value_at(node: Any, key: str) -> Any:
    """Return the value of a dotted key, or None."""
    for name in key.split("."):
        if isinstance(node, list):
            node = node[int(name)] if name.isdecimal() and int(name) < len(node) else None
        else:
            node = node.get(name) if isinstance(node, dict) else None
    return node


def with_value(node: Any, path: Sequence[str], value: Any, complete: Any = None) -> Any:
    """Return a copy of a table with another value at the end of a path.

    Missing tables on the path come from the `complete` table. A table replaces the name of a
    preset. Young's modulus replaces the shear modulus, and the reverse.
    """
    if not path:
        return value
    head, rest = path[0], path[1:]
    if isinstance(node, list):
        if not (head.isdecimal() and int(head) < len(node)):
            raise ValueError(f"there is no item '{head}' in a list of {len(node)}; count from 0")
        k = int(head)
        return [*node[:k], with_value(node[k], rest, value), *node[k + 1 :]]
    if isinstance(node, str):
        node = write_material(solid_of(choose("material", node, PRESETS)))
    if not isinstance(node, dict):
        raise ValueError(f"there is no key '{head}' in {node!r}; change the whole value")
    before = complete.get(head) if isinstance(complete, dict) else None
    inner = with_value(node.get(head, before or {}), rest, value, before)
    moduli = {"young_modulus_pa", "shear_modulus_pa"}
    kept = {name: x for name, x in node.items() if name == head or {name, head} != moduli}
    return kept | {head: inner}


def materials_of(body: Body) -> dict[str, str | Material]:
    """Return the materials of a body, its layers and its regions by dotted key."""
    if not body.of_kind.discretise:
        return {}
    return (
        {"body.material": body.material}
        | {f"body.layers.{k}.material": layer.material for k, layer in enumerate(body.layers)}
        | {f"body.regions.{name}": material for name, material in body.regions}
    )


def with_materials(body: Body, materials: Mapping[str, str | Material]) -> Body:
    """Return the body with other materials, as in `materials_of`."""
    layers = tuple(
        replace(layer, material=materials[f"body.layers.{k}.material"])
        for k, layer in enumerate(body.layers)
    )
    regions = tuple((name, materials[f"body.regions.{name}"]) for name, _ in body.regions)
    return replace(body, material=materials["body.material"], layers=layers, regions=regions)
