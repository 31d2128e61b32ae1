"""Records of bodies for the page: what they are, which of their numbers a user may change, their
waves, and the pack from which the page computes motion.
"""

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from math import isclose, isfinite, pi
from typing import Any

import numpy as np
import tomli_w

from simple_model import MovingPressure, Tacton
from simple_model.layers.material import Material
from skinwave.bodies.analytic import dispersion, has_exact_waves, is_laterally_infinite
from skinwave.live.radial import LOWEST
from skinwave.scene.file import from_table, parse_toml, to_table
from skinwave.scene.scene import BODIES, Body, Layer, Scene, body_name, solid_of

SECTIONS = ("body", "placement")  # of a scene file
LOSS_AT = 200.0  # Hz
SPREADS = (1.01, 1.5, 4.0, 100.0)  # of a factor of losses about the ratio of loss factors
SAME = 1e-5  # relative: a value as close to the body's own changes nothing
FREQUENCIES = np.linspace(10.0, 650.0, 33)  # Hz of dispersion curves
MODES = 4
DEEPEST = 0.04  # m that a page draws of a half-space
SIDES = ("clamped", "absorbing", "free")
SUPPORTS = ("clamped", "simply")
MOUNTING = {"tension_x": "Tension along x", "tension_y": "Tension along y", "support": "Edges"}
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


@dataclass(frozen=True, kw_only=True)
class Editable:
    """A number or choice of a body: how a page shows it, and a function of another value to the
    body with it.
    """

    key: str
    label: str
    value: Any
    change: Callable[[Any], Body]
    unit: str = ""
    range: tuple[float, float, float] = (0.0, 1.0, 0.01)
    choices: tuple[str, ...] = ()

    def record(self) -> dict[str, Any]:
        """Return the record for the page; a range that excludes the value is widened."""
        shown = {"key": self.key, "label": self.label, "unit": self.unit, "value": self.value}
        if self.choices:
            return shown | {"choices": [*dict.fromkeys((*self.choices, self.value))]}
        low, high, step = self.range
        if self.value > high:
            high = float(f"{2 * self.value:.1g}")
        return shown | {"low": min(low, self.value), "high": high, "step": step}


def record_of(
    body: Body, pack: Mapping[str, Any], name: str = "", title: str = "", *, waves: bool = True
) -> dict[str, Any]:
    """Return the record of a body for the page, a dict for JSON: its pack, from which the page
    computes motion; name and title, by default its own; `waves`, its dispersion curves, if asked.
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
    """Return the body of a text that `toml_of` or a scene file holds; a ValueError if there is
    none.
    """
    table = parse_toml(toml)
    if "body" not in table:
        raise ValueError("The text has no [body]. Send the toml of a body's record.")
    own = {section: table[section] for section in SECTIONS if section in table}
    return from_table({**own, "probes": {"points_mm": [[0.0, 0.0]]}}).body


def changed(body: Body, changes: Mapping[str, Any]) -> Body:
    """Return a body with other values by key of its `editables`; a ValueError if a key is unknown
    or a value out of range.
    """
    for key, value in changes.items():
        own = {each.key: each for each in editables(body)}
        if key not in own:
            raise ValueError(f"{key} is no value of this body. It has {', '.join(own)}.")
        each = own[key]
        if each.choices:
            if value not in each.choices:
                raise ValueError(f"{key}: '{value}' is unknown. Use {', '.join(each.choices)}.")
            body = each.change(value)
            continue
        if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
            raise ValueError(f"{key} = {value!r} must be a number.")
        if not isclose(value, each.value, rel_tol=SAME):
            body = each.change(float(value))
    return body


def editables(body: Body) -> list[Editable]:
    """Return what a page may change of a body: its layers from the surface downwards, the density
    of a single one, tension and support of a sheet, base and sides of a slab.
    """
    if not body.of_kind.discretise:
        return []
    found = [each for number in range(len(body.layers) + 1) for each in _of_layer(body, number)]
    if not body.layers:
        found.append(Editable(
            key="density", label="Density", unit="kg/m\u00b3", value=_shown(body.solid.density),
            range=RANGES["density"],
            change=lambda value: replace(body, material=replace(body.solid, density=value)),
        ))  # fmt: skip
    if body.of_kind.is_plate and body.sides == "clamped":
        found += [_of_mounting(body, *each) for each in MOUNTING.items()]
    if body.of_kind.is_layer and isfinite(body.depth):
        found += [_support(body, name) for name in ("base", "sides")]
    return [each for each in found if isinstance(each.value, str | float)]


def _of_layer(body: Body, number: int) -> list[Editable]:
    """Thickness, modulus and loss factor of a layer; a body's own material is its last."""
    last, plate = number == len(body.layers), body.of_kind.is_plate
    given = body.material if last else body.layers[number].material
    above = sum(layer.thickness for layer in body.layers)
    own = body.depth - above if last else body.layers[number].thickness
    solid, prefix = solid_of(given), f"layers.{number}." if body.layers else ""
    modulus, words, unit, per = (
        (solid.young, "Young's modulus", "GPa", 1e9)
        if plate
        else (solid.shear_modulus, "Shear modulus", "kPa", 1e3)
    )

    def with_layer(thickness: float, material: str | Material) -> Body:
        layers, depth = [*body.layers], body.depth + (thickness - own)
        if last:
            return replace(body, depth=depth, material=material)
        layers[number] = Layer(thickness=thickness, material=material)
        return replace(body, depth=depth, layers=tuple(layers))

    def with_modulus(value: float) -> Body:
        if not value > 0:
            raise ValueError(f"A modulus of {value:g} {unit} is out of range. Give one above 0.")
        return with_layer(own, solid.scaled(modulus=value * per / modulus))

    def editable(key: str, label: str, value: float, **more: Any) -> Editable:
        if body.layers:
            name = given if isinstance(given, str) else f"layer {number + 1}"
            label = f"{name.capitalize()}: {label[:1].lower()}{label[1:]}"
        return Editable(key=f"{prefix}{key}", label=label, value=_shown(value), **more)

    thickness = editable(
        "thickness", "Thickness", 1e3 * own, unit="mm",
        range=RANGES["sheet_thickness" if plate else "thickness"],
        change=lambda value: with_layer(value / 1e3, given),
    )  # fmt: skip
    return [
        *([thickness] if body.of_kind.is_bounded and isfinite(own) else []),
        editable("modulus", words, modulus / per, unit=unit,
                 range=RANGES["young" if plate else "modulus"], change=with_modulus),
        editable("loss", f"Loss factor at {LOSS_AT:g} Hz", _loss_factor(solid),
                 range=RANGES["loss"], change=lambda value: with_layer(
                     own, solid.scaled(loss=_loss_scale(solid, value)))),
    ]  # fmt: skip


def _of_mounting(body: Body, name: str, label: str) -> Editable:
    return Editable(
        key=name, label=label, value=getattr(body.mounting, name), range=RANGES["tension"],
        unit="" if name == "support" else "N/m", choices=SUPPORTS if name == "support" else (),
        change=lambda new: replace(body, mounting=replace(body.mounting, **{name: new})),
    )  # fmt: skip


def _support(body: Body, name: str) -> Editable:
    return Editable(
        key=name, label=name.capitalize(), value=getattr(body, name), choices=SIDES,
        change=lambda new: replace(body, **{name: new}),
    )  # fmt: skip


def _loss_factor(solid: Material) -> float:
    mu = complex(solid.complex_modulus(2 * pi * LOSS_AT))
    return mu.imag / mu.real


def _loss_scale(solid: Material, loss: float) -> float:
    """Factor of all losses of a material that gives a loss factor; a ValueError if none does."""
    from scipy.optimize import brentq  # which takes long to import

    def off(factor: float) -> float:
        return _loss_factor(solid.scaled(loss=factor)) - loss

    own = _loss_factor(solid)
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
    speeds = [np.where(mode.is_wave, mode.phase_speed, np.nan).tolist() for mode in curves.modes]
    shown = [[_shown(c) if isfinite(c) else None for c in each] for each in speeds]
    branches = [
        {"name": f"mode {k}", "c": each}
        for k, each in enumerate((x for x in shown if any(x)), start=1)
    ]
    return {"f": curves.frequencies.tolist(), "branches": branches} if branches else None


def _shown(value: float) -> float:
    return float(f"{value:.5g}")
