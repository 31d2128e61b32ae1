"""Records of bodies for the page: what they are, which of their numbers a user may change, their
waves, and the pack from which the page computes motion.
"""

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from math import floor, inf, isclose, isfinite, log10, pi
from typing import Any

import numpy as np
import tomli_w

from fem.materials import Material
from simple_model import MovingPressure, Tacton
from skinwave.bodies.analytic import dispersion, has_exact_waves, is_laterally_infinite
from skinwave.live.radial import LOWEST
from skinwave.scene import BODIES, Body, Layer, Scene, body_name, solid_of
from skinwave.scene_file import from_table, parsed, to_table

SECTIONS = ("body", "placement")  # of a scene file
LOSS_AT = 200.0  # Hz
SPREADS = (1.01, 1.5, 4.0, 100.0)  # of a factor of losses about the ratio of loss factors
SAME = 1e-5  # relative: a value as close to the body's own changes nothing
FREQUENCIES = np.linspace(10.0, 650.0, 33)  # Hz of dispersion curves
MODES = 4
DEEPEST = 0.04  # m that a page draws of a half-space
SIDES = ("clamped", "absorbing", "free")
SUPPORTS = ("clamped", "simply")
RANGES = {  # low, high, step
    "thickness": (0.05, 40.0, 0.05), "modulus": (0.5, 100.0, 0.5), "loss": (0.01, 2.0, 0.01),
    "sheet_thickness": (0.02, 1.0, 0.005), "young": (0.1, 12.0, 0.1),
    "density": (100.0, 2000.0, 10.0), "tension": (0.0, 400.0, 1.0),
}  # fmt: skip
TITLES = {
    "skin-slab": "Skin slab, 15 mm", "palm-layers": "Layered palm, 25 mm",
    "forearm-layers": "Layered forearm, 20 mm", "palm": "Palm, 15 mm on bone",
    "fingertip": "Fingertip", "paper-sheet": "Paper sheet, 0.13 mm",
    "paper-sheet-loose": "Loose paper sheet", "none": "No body",
}  # fmt: skip

Change = Callable[[Body, Any], Body]


@dataclass(frozen=True, kw_only=True)
class Editable:
    """A number or choice of a body: how a page shows it, and the body with another value."""

    key: str
    label: str
    value: Any
    change: Change
    unit: str = ""
    range: tuple[float, float, float] = (0.0, 1.0, 0.01)
    choices: tuple[str, ...] = ()

    def record(self) -> dict[str, Any]:
        """Return the record for the page; a range that excludes the value is widened."""
        shown = {"key": self.key, "label": self.label, "unit": self.unit, "value": self.value}
        if self.choices:
            return shown | {"choices": list(self.choices)}
        low, high, step = self.range
        return shown | {
            "low": min(low, self.value), "high": max(high, _round_up(2 * self.value))
            if self.value > high else high, "step": step,
        }  # fmt: skip


def record_of(
    body: Body, pack: Mapping[str, Any], name: str = "", title: str = "", *, waves: bool = True
) -> dict[str, Any]:
    """Return the record of a body for the page.

    Parameters
    ----------
    body : Body
    pack : from which the page computes its motion
    name, title : by default the body's own
    waves : whether to compute dispersion curves

    Returns
    -------
    dict for JSON
    """
    kind = body.of_kind
    infinite = is_laterally_infinite(body) and has_exact_waves(body)
    extent = [500 * body.width, 500 * body.height] if kind.is_bounded and not infinite else None
    return {
        "name": name or body_name(body), "title": title or title_of(body), "kind": body.kind,
        "depth_mm": 1e3 * body.depth if isfinite(body.depth) else 1e3 * DEEPEST,
        "is_skin": body.is_skin, "is_infinite": infinite,
        "thickness_mm": 1e3 * body.depth if kind.is_plate else None, "extent_mm": extent,
        "toml": toml_of(body), "lowest_height_mm": pack.get("lowest_height_mm", 1e3 * LOWEST),
        "error": pack.get("error", 0.005), "warnings": list(pack.get("warnings", ())),
        "keys": [each.record() for each in editables(body)],
        "dispersion": dispersion_of(body) if waves else None, "pack": dict(pack),
    }  # fmt: skip


def title_of(body: Body) -> str:
    """Return a readable name of a body."""
    name = next((name for name, known in BODIES.items() if known == body), "")
    words = TITLES.get(name) or body.of_kind.words(body).replace(" x ", " \u00d7 ")
    return words[:1].upper() + words[1:]


def toml_of(body: Body) -> str:
    """Return the tables of a scene file that describe a body."""
    scene = Scene(pressure=MovingPressure(tacton=Tacton()), body=body, probes=((0.0, 0.0),))
    table = to_table(scene)
    return tomli_w.dumps({section: table[section] for section in SECTIONS if section in table})


def body_of(toml: str) -> Body:
    """Return the body of a text that `toml_of` or a scene file holds.

    Raises
    ------
    ValueError
        If it is not TOML or describes no body.
    """
    table = parsed(toml)
    if "body" not in table:
        raise ValueError("The text has no [body]. Send the toml of a body's record.")
    own = {section: table[section] for section in SECTIONS if section in table}
    return from_table({**own, "probes": {"points_mm": [[0.0, 0.0]]}}).body


def changed(body: Body, changes: Mapping[str, Any]) -> Body:
    """Return a body with other values.

    Parameters
    ----------
    body : Body
    changes : value by key of its `editables`

    Returns
    -------
    Body

    Raises
    ------
    ValueError
        If a key is unknown or a value is out of range.
    """
    for key, value in changes.items():
        own = {each.key: each for each in editables(body)}
        if key not in own:
            raise ValueError(f"{key} is no value of this body. It has {', '.join(own)}.")
        each = own[key]
        if each.choices:
            if value not in each.choices:
                raise ValueError(f"{key}: '{value}' is unknown. Use {', '.join(each.choices)}.")
        elif isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
            raise ValueError(f"{key} = {value!r} must be a number.")
        same = isinstance(value, int | float) and isclose(value, each.value, rel_tol=SAME)
        body = body if same or value == each.value else each.change(body, value)
    return body


def editables(body: Body) -> list[Editable]:
    """Return what a page may change of a body: of a sheet its thickness, material, tension and
    support; of a solid its layers, density, base and sides.
    """
    if not body.of_kind.discretise:
        return []
    found = _of_sheet(body) if body.of_kind.is_plate else _of_solid(body)
    if body.of_kind.is_layer and isfinite(body.depth):
        found += [_choice("base", "Base", body.base, SIDES)]
        if isinstance(body.sides, str):
            found += [_choice("sides", "Sides", body.sides, SIDES)]
    return found


def _of_sheet(body: Body) -> list[Editable]:
    found = [
        Editable(
            key="thickness", label="Thickness", unit="mm", value=_shown(1e3 * body.depth),
            range=RANGES["sheet_thickness"],
            change=lambda body, value: replace(body, depth=value / 1e3),
        ),
        Editable(
            key="modulus", label="Young's modulus", unit="GPa",
            value=_shown(body.solid.young / 1e9), range=RANGES["young"], change=_with_young,
        ),
        _loss("", "Loss factor", 0, body.solid),
        _density(body),
    ]  # fmt: skip
    if body.sides != "clamped":
        return found
    for axis in "xy":
        found.append(Editable(
            key=f"tension_{axis}", label=f"Tension along {axis}", unit="N/m",
            value=getattr(body.mounting, f"tension_{axis}"), range=RANGES["tension"],
            change=partial(_with_mounting, f"tension_{axis}"),
        ))  # fmt: skip
    support = partial(_with_mounting, "support")
    return [*found, _choice("support", "Edges", body.mounting.support, SUPPORTS, support)]


def _of_solid(body: Body) -> list[Editable]:
    """Thickness, shear modulus and loss factor of each layer, from the surface downwards."""
    found: list[Editable] = []
    count = len(body.layers) + 1
    for number in range(count):
        material = body.layers[number].material if number < count - 1 else body.material
        name = material if isinstance(material, str) else f"layer {number + 1}"
        label = partial(_of_layer, name) if count > 1 else str
        prefix, solid = f"layers.{number}." if count > 1 else "", solid_of(material)
        thickness = _thickness(body, number)
        if body.of_kind.is_bounded and isfinite(thickness):
            found.append(Editable(
                key=f"{prefix}thickness", label=label("Thickness"), unit="mm",
                value=_shown(1e3 * thickness), range=RANGES["thickness"],
                change=partial(_with_thickness, number),
            ))  # fmt: skip
        found += [
            Editable(
                key=f"{prefix}modulus", label=label("Shear modulus"), unit="kPa",
                value=_shown(solid.shear_modulus / 1e3), range=RANGES["modulus"],
                change=partial(_with_modulus, number),
            ),
            _loss(prefix, label("Loss factor"), number, solid),
        ]  # fmt: skip
    return [*found, *([_density(body)] if count == 1 else [])]


def _loss(prefix: str, label: str, number: int, solid: Material) -> Editable:
    return Editable(
        key=f"{prefix}loss", label=f"{label} at {LOSS_AT:g} Hz", value=_shown(loss_factor(solid)),
        range=RANGES["loss"], change=partial(_with_loss, number),
    )  # fmt: skip


def _density(body: Body) -> Editable:
    return Editable(
        key="density", label="Density", unit="kg/m³", value=_shown(body.solid.density),
        range=RANGES["density"],
        change=lambda body, value: replace(body, material=replace(body.solid, density=value)),
    )  # fmt: skip


def _choice(
    key: str, label: str, value: str, choices: tuple[str, ...], change: Change | None = None
) -> Editable:
    return Editable(
        key=key, label=label, value=value,
        choices=choices if value in choices else (value, *choices),
        change=change or (lambda body, given: replace(body, **{key: given})),
    )  # fmt: skip


def _of_layer(name: str, words: str) -> str:
    return f"{name.capitalize()}: {words[:1].lower()}{words[1:]}"


def _thickness(body: Body, number: int) -> float:
    """Thickness in metre of a layer; the last is the body's own material."""
    if number < len(body.layers):
        return body.layers[number].thickness
    return body.depth - sum(layer.thickness for layer in body.layers)


def _with_thickness(number: int, body: Body, value: float) -> Body:
    """The body with a thickness in mm of a layer; the layers below keep theirs."""
    thickness = value / 1e3
    depth = body.depth + thickness - _thickness(body, number)
    layers = [
        replace(layer, thickness=thickness) if k == number else layer
        for k, layer in enumerate(body.layers)
    ]
    return replace(body, layers=tuple(layers), depth=depth)


def _with_material(number: int, body: Body, change: Callable[[Material], Material]) -> Body:
    if number == len(body.layers):
        return replace(body, material=change(body.solid))
    layers: list[Layer] = list(body.layers)
    layers[number] = replace(layers[number], material=change(solid_of(layers[number].material)))
    return replace(body, layers=tuple(layers))


def _with_modulus(number: int, body: Body, value: float) -> Body:
    """The body with a shear modulus in kPa of a layer, which keeps its loss factor."""
    return _with_material(
        number,
        body,
        lambda solid: solid.scaled(modulus=1e3 * _positive(value) / solid.shear_modulus),
    )


def _with_young(body: Body, value: float) -> Body:
    return replace(
        body, material=body.solid.scaled(modulus=1e9 * _positive(value) / body.solid.young)
    )


def _with_loss(number: int, body: Body, value: float) -> Body:
    return _with_material(number, body, lambda solid: solid.scaled(loss=_loss_scale(solid, value)))


def _with_mounting(name: str, body: Body, value: Any) -> Body:
    return replace(body, mounting=replace(body.mounting, **{name: value}))


def _positive(value: float) -> float:
    if not value > 0:
        raise ValueError(f"A modulus of {value:g} is out of range. Give one above 0.")
    return value


def loss_factor(solid: Material) -> float:
    """Return the loss factor of a material at 200 Hz."""
    mu = complex(solid.complex_modulus(2 * pi * LOSS_AT))
    return mu.imag / mu.real


def _loss_scale(solid: Material, loss: float) -> float:
    """Factor of all losses of a material that gives a loss factor.

    Raises
    ------
    ValueError
        If there is none.
    """
    from scipy.optimize import brentq  # which takes long to import

    def off(factor: float) -> float:
        return loss_factor(solid.scaled(loss=factor)) - loss

    own = loss_factor(solid)
    for spread in SPREADS if own > 0 else ():
        with suppress(ValueError):  # beyond a material's limits, or no change of sign
            return float(brentq(off, loss / own / spread, loss / own * spread, rtol=SAME / 10))
    raise ValueError(
        f"A loss factor of {loss:g} at {LOSS_AT:g} Hz is out of reach of this material's law. "
        f"Its own is {own:.3g}."
    )


def dispersion_of(body: Body) -> dict[str, Any] | None:
    """Return phase speeds in m/s of a body's propagating waves over frequency in Hz; None if it has
    none that are known.
    """
    try:
        curves = dispersion(body, FREQUENCIES, MODES)
    except (ValueError, ArithmeticError):
        return None
    branches: list[dict[str, Any]] = []
    for mode in curves.modes:
        speeds = [
            _shown(speed) if wave and isfinite(speed) else None
            for speed, wave in zip(mode.phase_speed.tolist(), mode.is_wave.tolist(), strict=True)
        ]
        if any(speed is not None for speed in speeds):
            branches.append({"name": f"mode {len(branches) + 1}", "c": speeds})
    return {"f": curves.frequencies.tolist(), "branches": branches} if branches else None


def _shown(value: float) -> float:
    return float(f"{value:.5g}")


def _round_up(value: float) -> float:
    """The next of 1, 2, 5, 10, ... at or above a value."""
    if not 0 < value < inf:
        return 1.0
    ten = 10 ** floor(log10(value))
    return next(float(ten * part) for part in (1, 2, 5, 10) if ten * part >= value * (1 - 1e-9))
