"""Layers of a body as text, such as "0.3/45.3, 1/26.7, 13.7/5/0.2": thickness in mm and shear
modulus in kPa of each, from the surface downwards, and its loss factor at 200 Hz if it is not that
of the material; "inf" is the thickness of a half-space.

A modulus is scaled with all its losses, so that a layer keeps its loss factor.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import inf, isclose, pi
from typing import Any

from fem.materials import Material
from skinwave.scene import Body, Layer, solid_of

PARTS = ("thickness", "modulus", "loss")
THICKNESS = 0.01, 60.0  # mm; a slab of 60 mm is a half-space to the skin's waves
MODULUS = 0.1, 10_000.0  # kPa
LOSS, LOSS_AT = (0.0, 3.0), 200.0  # of a loss factor; Hz
SCALED = 1e-4, 1e4  # factors of losses
SAME = 1e-5  # relative: a modulus as close as its text is the body's own


Given = tuple[float, float, float | None]  # thickness in m, modulus in Pa, loss factor if given


def layers_of(text: str) -> tuple[Given, ...]:
    """Thickness in metre, shear modulus in Pa and loss factor of each layer; none if it is empty.

    Raises
    ------
    ValueError
        If it is no such text, or a value is out of range.
    """
    parts = [part.strip() for part in text.split(",") if part.strip()]
    return tuple(
        _layer_of(number, part, number == len(parts)) for number, part in enumerate(parts, 1)
    )


def _layer_of(number: int, part: str, last: bool) -> Given:
    try:
        thickness, modulus, *losses = (float(value) for value in part.split("/", 2))
        loss = next(iter(losses), None)
    except ValueError:
        raise ValueError(
            f"layer {number}: '{part}' is none; give thickness/modulus in mm and kPa, such as 1/27"
        ) from None
    if loss is not None and not LOSS[0] <= loss <= LOSS[1]:
        raise ValueError(
            f"layer {number}: a loss factor of {loss:g} is outside {LOSS[0]:g} to {LOSS[1]:g}"
        )
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
    return thickness / 1e3, 1e3 * modulus, loss


def with_layers(body: Body, text: str) -> Body:
    """A body with the layers of a text; as it is, if that is empty.

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
    *upper, (_, below) = (
        (each[0], _scaled(material, *each[1:]))
        for each, (_, material) in zip(given, own, strict=True)
    )
    return _stretched(replace(body, material=below), given, upper)


def with_own_materials(body: Body, text: str) -> Body | None:
    """A body with the thicknesses of a text alone, and its own materials; None if it is empty."""
    given, own = layers_of(text), _own(body)
    return _stretched(body, given, own[:-1]) if given else None


def _stretched(
    body: Body, given: Sequence[Given], upper: Sequence[tuple[float, str | Material]]
) -> Body:
    """A body of the thicknesses that are given, with the materials of its upper layers."""
    layers = [
        Layer(thickness=each[0], material=material)
        for each, (_, material) in zip(given, upper, strict=False)
    ]
    depth = sum(each[0] for each in given)
    if isclose(depth, body.depth, rel_tol=SAME):
        depth = body.depth
    return replace(body, layers=tuple(layers), depth=depth)


def loss_factor(solid: Material) -> float:
    """Loss factor of a material at `LOSS_AT`."""
    mu = complex(solid.complex_modulus(2 * pi * LOSS_AT))
    return mu.imag / mu.real


def text_of(values: Sequence[Sequence[str]]) -> str:
    """The text that `layers_of` reads, of thicknesses in mm, moduli in kPa and loss factors."""
    return ", ".join("/".join(each) for each in values)


def rows(body: Body, text: str) -> list[dict[str, Any]]:
    """Layers of a body as a page shows them: name, thickness in mm, shear modulus in kPa and loss
    factor at 200 Hz.
    """
    own = _own(body)
    values = layers_of(text) or [(t, solid_of(material).shear_modulus, None) for t, material in own]
    return [
        {
            "name": material if isinstance(material, str) else f"layer {number}",
            "thickness": f"{1e3 * thickness:.6g}",
            "modulus": f"{modulus / 1e3:.6g}",
            "loss": f"{loss_factor(solid_of(material)) if loss is None else loss:.4g}",
        }
        for number, ((thickness, modulus, loss), (_, material)) in enumerate(
            zip(values, own, strict=True), 1
        )
    ]


def _own(body: Body) -> list[tuple[float, str | Material]]:
    """Thickness in metre and material of each layer of a body, around its regions; none of a sheet,
    or of a body from a file, whose thickness is not its depth.
    """
    if not (body.is_solid and body.of_kind.is_bounded):
        return []
    layers: list[tuple[float, str | Material]] = [(x.thickness, x.material) for x in body.layers]
    return [*layers, (body.depth - sum(thickness for thickness, _ in layers), body.material)]


def _scaled(material: str | Material, modulus: float, loss: float | None) -> str | Material:
    solid = solid_of(material)
    if not isclose(solid.shear_modulus, modulus, rel_tol=SAME):
        material = solid = solid.scaled(modulus=modulus / solid.shear_modulus)
    if loss is None or f"{loss:.4g}" == f"{loss_factor(solid):.4g}":
        return material
    return solid.scaled(loss=_loss_scale(solid, loss))


def _loss_scale(solid: Material, loss: float) -> float:
    """Factor of all losses of a material with which its loss factor is one that is given.

    Raises
    ------
    ValueError
        If there is none.
    """
    from scipy.optimize import brentq  # which takes long to import

    def off(factor: float) -> float:
        return loss_factor(solid.scaled(loss=factor)) - loss

    if not off(SCALED[0]) < 0 < off(SCALED[1]):
        raise ValueError(
            f"a loss factor of {loss:g} at {LOSS_AT:g} Hz is none that the law of this material "
            f"can have; it is {loss_factor(solid):.3g} now"
        )
    return float(brentq(off, *SCALED, rtol=SAME / 10))
