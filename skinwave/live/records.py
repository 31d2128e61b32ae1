"""Records of bodies for the page: title, editable values, dispersion, and pack."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from math import isclose, isfinite, pi
from typing import Any

import numpy as np
import tomli_w

from simple_model.layers.material import Material
from skinwave.bodies.analytic import dispersion
from skinwave.live.packs import pack_method, resting_scene
from skinwave.scene.file import from_table, parse_toml, to_table
from skinwave.scene.scene import BODIES, Body, Layer, body_name, solid_of

SECTIONS = ("body", "placement")  # of a scene file
LOSS_AT = 200.0  # Hz
SAME = 1e-5  # relative: a value this close to the present one changes nothing
RANGES = {  # lowest, highest, step
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
    """A number or choice of a body that a page can change; `change(value)` returns the new body."""

    key: str
    label: str
    value: Any
    change: Callable[[Any], Body]
    unit: str = ""
    range: tuple[float, float, float] = (0.0, 1.0, 0.01)
    choices: tuple[str, ...] = ()

    def record(self) -> dict[str, Any]:
        """Return the record for the page. The range is widened if it excludes the value."""
        record = {"key": self.key, "label": self.label, "unit": self.unit, "value": self.value}
        if self.choices:
            return record | {"choices": [*dict.fromkeys((*self.choices, self.value))]}
        low, high, step = self.range
        if self.value > high:
            high = float(f"{2 * self.value:.1g}")
        return record | {"low": min(low, self.value), "high": high, "step": step}


def record_of(
    body: Body, pack: Mapping[str, Any], name: str = "", title: str = "", *, waves: bool = True
) -> dict[str, Any]:
    """Return the record of a body with its pack as a dict for JSON.

    Name and title are those of the body by default. Without `waves` the record has no dispersion
    curves.
    """
    kind, infinite = body.of_kind, pack_method(body) == "radial"
    extent = [500 * body.width, 500 * body.height] if kind.is_bounded and not infinite else None
    return {
        "name": name or body_name(body), "title": title or title_of(body), "is_skin": body.is_skin,
        "thickness_mm": 1e3 * body.depth if kind.is_plate else None, "extent_mm": extent,
        "toml": toml_of(body), "keys": [each.record() for each in editables(body)],
        "dispersion": dispersion_of(body) if waves else None, "pack": dict(pack),
    }  # fmt: skip


def title_of(body: Body) -> str:
    """Return a readable name of a body."""
    name = next((name for name, known in BODIES.items() if known == body), "")
    words = TITLES.get(name) or body.of_kind.words(body).replace(" x ", " \u00d7 ")
    return words[:1].upper() + words[1:]


def toml_of(body: Body) -> str:
    """Return the tables of a scene file that describe a body."""
    table = to_table(resting_scene(body))
    return tomli_w.dumps({section: table[section] for section in SECTIONS if section in table})


def body_of(toml: str) -> Body:
    """Return the body of a scene file, or of a text from `toml_of`."""
    table = parse_toml(toml)
    if "body" not in table:
        raise ValueError("The text has no table [body]. Add one.")
    own = {section: table[section] for section in SECTIONS if section in table}
    return from_table({**own, "probes": {"points_mm": [[0.0, 0.0]]}}).body


def with_changes(body: Body, changes: Mapping[str, Any]) -> Body:
    """Return a body with changed values, by keys of its `editables`.

    Raises ValueError if a key is unknown or a value is out of range.
    """
    for key, value in changes.items():
        own = {each.key: each for each in editables(body)}
        if key not in own:
            raise ValueError(f"This body has no value '{key}'. Use {', '.join(own)}.")
        each = own[key]
        if each.choices:
            if value not in each.choices:
                raise ValueError(f"{key}: '{value}' is unknown. Use {', '.join(each.choices)}.")
            body = each.change(value)
            continue
        if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
            raise ValueError(f"{key} = {value!r} is not a number. Give a finite number.")
        if not isclose(value, each.value, rel_tol=SAME):
            body = each.change(float(value))
    return body


def editables(body: Body) -> list[Editable]:
    """Return the values of a body that a page can change.

    These are layers from the surface downwards, the density of a single layer, the mounting of a
    sheet, and base and sides of a slab.
    """
    if not body.of_kind.discretise:
        return []
    values = [each for number in range(len(body.layers) + 1) for each in _of_layer(body, number)]
    if not body.layers:
        values.append(_part(body, "material", body.solid, "density", "Density",
                            unit="kg/m\u00b3", range=RANGES["density"]))  # fmt: skip
    if body.of_kind.is_plate and body.sides == "clamped":
        mounting = partial(_part, body, "mounting", body.mounting)
        for axis in "xy":
            label = f"Tension along {axis}"
            values.append(mounting(f"tension_{axis}", label, unit="N/m", range=RANGES["tension"]))
        values.append(mounting("support", "Edges", choices=("clamped", "simply")))
    if body.of_kind.is_layer and isfinite(body.depth):
        sides = ("clamped", "absorbing", "free")
        values += [_part(body, "", body, name, name.capitalize(), choices=sides)
                   for name in ("base", "sides")]  # fmt: skip
    return [each for each in values if isinstance(each.value, str | float)]


def _part(body: Body, owner: str, record: Any, name: str, label: str, **more: Any) -> Editable:
    """Return the field `name` of a record: the body itself, or its field `owner`."""
    value = getattr(record, name)

    def change(new: Any) -> Body:
        changed = replace(record, **{name: new})
        return replace(body, **{owner: changed}) if owner else changed

    shown = _five_digits(value) if isinstance(value, int | float) else value
    return Editable(key=name, label=label, value=shown, change=change, **more)


def _of_layer(body: Body, number: int) -> list[Editable]:
    """Thickness, modulus and loss factor of a layer; the last layer has the body's own material."""
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
            raise ValueError(f"The modulus {value:g} {unit} is out of range. Give a value above 0.")
        return with_layer(own, solid.scaled(modulus=value * per / modulus))

    def editable(key: str, label: str, value: float, **more: Any) -> Editable:
        if body.layers:
            name = given if isinstance(given, str) else f"layer {number + 1}"
            label = f"{name.capitalize()}: {label[:1].lower()}{label[1:]}"
        return Editable(key=f"{prefix}{key}", label=label, value=_five_digits(value), **more)

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


def _loss_factor(solid: Material) -> float:
    mu = complex(solid.complex_modulus(2 * pi * LOSS_AT))
    return mu.imag / mu.real


def _loss_scale(solid: Material, loss: float) -> float:
    """Return the factor on the losses of a material that gives it a loss factor.

    It is looked for near the ratio of the loss factors, then farther away.
    """
    from scipy.optimize import brentq  # slow to import

    def excess(factor: float) -> float:
        return _loss_factor(solid.scaled(loss=factor)) - loss

    own = _loss_factor(solid)
    for spread in (1.01, 1.5, 4.0, 100.0) if own > 0 else ():
        with suppress(ValueError):  # outside the material's law, or no change of sign
            return float(brentq(excess, loss / own / spread, loss / own * spread, rtol=SAME / 10))
    raise ValueError(
        f"The material's law cannot have a loss factor of {loss:g} at {LOSS_AT:g} Hz. Give a value "
        f"closer to the present one, {own:.3g}."
    )


def dispersion_of(
    body: Body, *, highest: float = 650.0, count: int = 33, most: int = 4
) -> dict[str, Any] | None:
    """Return phase speeds in m/s of at most `most` waves over frequency in Hz, or None."""
    try:
        curves = dispersion(body, np.linspace(10.0, highest, count), most)
    except (ValueError, ArithmeticError):
        return None
    speeds = [np.where(mode.is_wave, mode.phase_speed, np.nan).tolist() for mode in curves.modes]
    finite = [[_five_digits(c) if isfinite(c) else None for c in each] for each in speeds]
    branches = [
        {"name": f"mode {k}", "c": each}
        for k, each in enumerate((x for x in finite if any(x)), start=1)
    ]
    return {"f": curves.frequencies.tolist(), "branches": branches} if branches else None


def _five_digits(value: float) -> float:
    return float(f"{value:.5g}")
