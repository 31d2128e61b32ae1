"""Layers of a slab as text, such as "0.3/45.3, 1/26.7, 13.7/5": thickness in mm and shear modulus
in kPa of each, from the surface downwards; "inf" is the thickness of a half-space.

A modulus is scaled with all its losses, so that a layer keeps its loss factor.
"""

from dataclasses import replace
from math import inf, isclose
from typing import Any

from fem.materials import Material
from skinwave.scene import Body, Layer, solid_of

THICKNESS = 0.01, 60.0  # mm; a slab of 60 mm is a half-space to the skin's waves
MODULUS = 0.1, 10_000.0  # kPa
SAME = 1e-5  # relative: a modulus as close as its text is the body's own


def layers_of(text: str) -> tuple[tuple[float, float], ...]:
    """Thickness in metre and shear modulus in Pa of each layer; none if it is empty.

    Raises
    ------
    ValueError
        If it is no such text, or a value is out of range.
    """
    parts = [part.strip() for part in text.split(",") if part.strip()]
    return tuple(
        _layer_of(number, part, number == len(parts)) for number, part in enumerate(parts, 1)
    )


def _layer_of(number: int, part: str, last: bool) -> tuple[float, float]:
    try:
        thickness, modulus = (float(value) for value in part.split("/"))
    except ValueError:
        raise ValueError(
            f"layer {number}: '{part}' is none; give thickness/modulus in mm and kPa, such as 1/27"
        ) from None
    for name, unit, value, (low, high) in (
        ("thickness", "mm", thickness, THICKNESS),
        ("shear modulus", "kPa", modulus, MODULUS),
    ):
        half_space = last and unit == "mm" and value == inf
        if not (low <= value <= high or half_space):
            raise ValueError(
                f"layer {number}: a {name} of {value:g} {unit} is outside {low:g} to {high:g} "
                f"{unit}"
            )
    return thickness / 1e3, 1e3 * modulus


def with_layers(body: Body, text: str) -> Body:
    """A slab with the layers of a text; as it is, if that is empty.

    Raises
    ------
    ValueError
        If the text is none, or it or the body has another number of layers.
    """
    given = layers_of(text)
    if not given:
        return body
    own = _own(body)
    if len(given) != len(own):
        raise ValueError(
            f"{len(given)} layers are given, and this body has {len(own)}; give one for each"
        )
    layers = [
        Layer(thickness=thickness, material=_scaled(material, modulus))
        for (thickness, modulus), (_, material) in zip(given[:-1], own[:-1], strict=True)
    ]
    (below, modulus), (_, material) = given[-1], own[-1]
    depth = sum(layer.thickness for layer in layers) + below
    return replace(body, layers=tuple(layers), material=_scaled(material, modulus), depth=depth)


def text_of(values: list[tuple[str, str]]) -> str:
    """The text that `layers_of` reads, of thicknesses in mm and moduli in kPa."""
    return ", ".join("/".join(pair) for pair in values)


def rows(body: Body, text: str) -> list[dict[str, Any]]:
    """Layers of a slab as a page shows them: name, thickness in mm and shear modulus in kPa."""
    own = _own(body)
    values = layers_of(text) or [(t, solid_of(material).shear_modulus) for t, material in own]
    return [
        {
            "name": material if isinstance(material, str) else f"layer {number}",
            "thickness": f"{1e3 * thickness:.6g}",
            "modulus": f"{modulus / 1e3:.6g}",
        }
        for number, ((thickness, modulus), (_, material)) in enumerate(
            zip(values, own, strict=True), 1
        )
    ]


def _own(body: Body) -> list[tuple[float, str | Material]]:
    """Thickness in metre and material of each layer of a slab; of another body none."""
    if not body.of_kind.is_layer:
        return []
    layers: list[tuple[float, str | Material]] = [(x.thickness, x.material) for x in body.layers]
    return [*layers, (body.depth - sum(thickness for thickness, _ in layers), body.material)]


def _scaled(material: str | Material, modulus: float) -> str | Material:
    solid = solid_of(material)
    if isclose(solid.shear_modulus, modulus, rel_tol=SAME):
        return material
    return solid.scaled(modulus=modulus / solid.shear_modulus)
