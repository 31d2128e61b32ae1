"""Free keys of a body: their ranges, and the bodies for their values.

A body with free keys is reduced once, as a sum of matrices whose weights depend on the keys.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from math import inf, isfinite, log

import numpy as np

from simple_model.choices import choose
from simple_model.layers.material import Material
from simple_model.load.spectrum import load_lines
from simple_model.quantities import STRAIN
from skinwave.bodies import Body
from skinwave.bodies.parts import solid_of
from skinwave.bodies.sheet import refuse_unheld_air
from skinwave.bodies.supports import FRAME
from skinwave.models.laws import check_laws
from skinwave.scene.dotted_keys import with_value
from skinwave.scene.keys import SCALES, SECTIONS, TABLES, write_material
from skinwave.scene.scene import Scene
from skinwave.typing import Floats

THICKNESS = ("thickness_mm",)  # path of a key
KEYS = (
    re.compile(r"body\.(layers\.(?P<layer>\d+)\.)?thickness_mm"),
    re.compile(
        r"body\.(regions\.(?P<region>[^.]+)|(layers\.(?P<layer>\d+)\.)?material)\.(?P<path>(?!thickness_mm).+)"
    ),
)
Part = int | str | None  # of a body: a layer, a region by its name, or the rest


@dataclass(frozen=True, kw_only=True)
class FreeKey:
    """Number of a body that is free from `low` to `high`: its `key` in a scene file, the `part` of
    the body, and its `path` (in the material's table, one of `SCALES`, or `THICKNESS`). The mesh
    `moves` with some thicknesses.
    """

    key: str
    part: Part
    path: tuple[str, ...]
    low: float
    high: float
    moves: bool = False

    def at(self, share: float) -> float:
        """Return the value at a share, 0 to 1, of the range; logarithmic if low > 0."""
        if self.low > 0:
            return float(self.low * (self.high / self.low) ** share)
        return float(self.low + share * (self.high - self.low))

    def share(self, value: float) -> float:
        """Return the share of the range at a value, the inverse of `at`."""
        if self.low > 0:
            return log(value / self.low) / log(self.high / self.low)
        return (value - self.low) / (self.high - self.low)

    @property
    def is_thickness(self) -> bool:
        """Whether it is a thickness of the body or of a layer."""
        return self.path == THICKNESS

    @property
    def is_scale(self) -> bool:
        """Whether it is a factor on all moduli, or on all losses, of a material."""
        return self.path[0] in SCALES


def free_keys(body: Body, free: Mapping[str, tuple[float, float]]) -> tuple[FreeKey, ...]:
    """Return the free keys of a body; raises a ValueError if a key or its range is not valid."""
    if not free:
        raise ValueError("free = {} names no key; give one, such as body.material.shear_modulus_pa")
    keys = tuple(_free_key(body, key, bounds) for key, bounds in free.items())
    _check_thicknesses(body, [key for key in keys if key.is_thickness])
    for layers, below in product((0.0, 1.0), repeat=2):
        values = values_at(keys, [below if key.part is None else layers for key in keys])
        try:  # values that materials and bodies refuse
            with_values(body, keys, values)
        except ValueError as error:
            ends = ", ".join(f"{key} = {value:g}" for key, value in values.items())
            raise ValueError(f"at the ends {ends} of free ranges: {error}") from None
    return keys


def with_values(body: Body, keys: Sequence[FreeKey], values: Mapping[str, float]) -> Body:
    """Return the body for values of its free keys; raises a ValueError if one is out of range."""
    if unknown := sorted(set(values) - {key.key for key in keys}):
        raise ValueError(
            f"'{unknown[0]}' is not free; remove it, or free it in addition to "
            f"{', '.join(key.key for key in keys)}"
        )
    thick = {key.part: _value(key, values) / 1e3 for key in keys if key.is_thickness}
    for part in dict.fromkeys(key.part for key in keys if not key.is_thickness):
        own = [key for key in keys if key.part == part and not key.is_thickness]
        body = _with_material(body, part, _with_numbers(solid_at(body, part), own, values))
    if not thick:
        return body
    layers = (replace(o, thickness=thick.get(k, o.thickness)) for k, o in enumerate(body.layers))
    return replace(body, layers=tuple(layers), depth=thick.get(None, body.depth))


def values_at(keys: Sequence[FreeKey], shares: Sequence[float]) -> dict[str, float]:
    """Return values by key at shares (k,) of the ranges, 0 to 1."""
    return {key.key: key.at(share) for key, share in zip(keys, shares, strict=True)}


def training_shares(count: int, inside: int, most_corners: int = 16) -> Floats:
    """Return shares (t, count): corners and middle of the unit cube, and `inside` points in it."""
    corners = np.array(list(product((0.0, 1.0), repeat=count)))
    if len(corners) > most_corners:
        corners = np.random.default_rng(0).choice(corners, most_corners, replace=False)
    few = np.vstack([corners, np.full((1, count), 0.5)])
    if not inside:
        return few
    from scipy.stats import qmc  # slow to import

    return np.vstack([few, qmc.Sobol(count, rng=0).random(inside)])


def meshing_shares(keys: Sequence[FreeKey]) -> tuple[float, ...]:
    """Return the shares (k,) of the ranges at which the body is meshed: the largest thicknesses,
    and the fastest shear waves below all layers, where an absorbing layer is widest. Layers with
    equal ranges get different shares, so that they are not merged.
    """
    fastest = {"shear_modulus_pa": 1.0, "modulus_scale": 1.0, "density_kg_m3": 0.0}
    inside = [0.4 + 0.2 * k / len(keys) for k in range(len(keys))]
    return tuple(
        1.0 if key.is_thickness else fastest.get(key.path[0], x) if key.part is None else x
        for key, x in zip(keys, inside, strict=True)
    )


def solid_at(body: Body, part: Part) -> Material:
    """Return the material of a part of a body."""
    if part is None:
        return body.solid
    if isinstance(part, str):
        return solid_of(dict(body.regions)[part])
    return solid_of(body.layers[part].material)


def _free_key(body: Body, key: str, bounds: tuple[float, float]) -> FreeKey:
    part, path = _part(body, key)
    fixed = ("poisson", "law", "table")  # not numbers, or change the matrices
    if path[0] in fixed:
        raise ValueError(
            f"'{key}' cannot be free, because it changes the matrices of a body; free moduli, "
            "losses, times or densities, or reduce a body for each value"
        )
    if path != THICKNESS:
        known = [*(name for name in TABLES["body.material"] if name not in fixed), *SCALES]
        choose(f"free key '{key}'", path[0], known)
    if path[0] == "prony" and not (
        len(path) == 3 and path[1].isdecimal() and path[2] in TABLES["body.material.prony"]
    ):
        raise ValueError(f"'{key}' is not a number of a Prony term; use, e.g., prony.0.modulus_pa")
    low, high = (float(bound) for bound in bounds)
    if not (isfinite(low) and isfinite(high) and low < high):
        raise ValueError(
            f"{key} is free from {low:g} to {high:g}; give a finite range, low to high"
        )
    if path[0] in SCALES and not low > 0:
        raise ValueError(f"{key} is free from {low:g}; give a factor above 0")
    moves = path == THICKNESS and body.of_kind.morph is not None
    return FreeKey(key=key, part=part, path=path, low=low, high=high, moves=moves)


def _part(body: Body, key: str) -> tuple[Part, tuple[str, ...]]:
    """Return the part of a body that a key belongs to, and the path in it."""
    groups = next((m.groupdict() for each in KEYS if (m := each.fullmatch(key))), None)
    if groups is None:
        raise ValueError(
            f"'{key}' cannot be free, because one reduced body serves only materials and "
            "thicknesses; free keys of body.material, body.layers.0.material or "
            "body.regions.bone, body.thickness_mm or body.layers.0.thickness_mm, and reduce a body "
            "for each value of other keys"
        )
    region, layer = groups.get("region"), groups["layer"]
    path = tuple(groups.get("path", THICKNESS[0]).split("."))
    if region:
        if region not in (known := dict(body.regions)):
            raise ValueError(
                f"'{key}' belongs to a region without a material in the scene; regions with one: "
                f"{', '.join(known) or 'none'}"
            )
        return region, path
    if layer and int(layer) >= len(body.layers):
        raise ValueError(
            f"'{key}' belongs to a layer that does not exist; the body has {len(body.layers)} "
            "layers, counted from 0"
        )
    return int(layer) if layer else None, path


def _check_thicknesses(body: Body, keys: Sequence[FreeKey]) -> None:
    """Raise a ValueError for free thicknesses that one mesh cannot represent."""
    if not keys:
        return
    kind = body.of_kind
    if kind.morph is None and kind.equivalent is None:
        raise ValueError(
            f"'{keys[0].key}' cannot be free, because the mesh of a {body.kind} cannot be scaled "
            "in thickness; use a slab, disc or sheet, or reduce a body for each value"
        )
    if len(keys) > 2:
        raise ValueError(
            f"{len(keys)} thicknesses are free, more than 2, and each multiplies the number of "
            "meshes; free fewer"
        )
    if low := [key.key for key in keys if not key.low > 0]:
        raise ValueError(f"{low[0]} is free from 0 or below; give a smallest value above 0")
    most = 1e3 * kind.equivalent(body) if kind.equivalent else inf
    if high := [key for key in keys if key.high > most * (1 + 1e-9)]:
        raise ValueError(
            f"{high[0].key} is free up to {high[0].high:g} mm, above {most:g} mm, the "
            f"thickness of the elements of a {body.kind}, which represent only thinner ones; "
            "narrow the range, or reduce a body for each value"
        )


def _value(key: FreeKey, values: Mapping[str, float]) -> float:
    if key.key not in values:
        raise ValueError(f"no value is given for the free key {key.key}; give one")
    value, round_off = float(values[key.key]), 1e-9 * (key.high - key.low)
    if not key.low - round_off <= value <= key.high + round_off:
        raise ValueError(
            f"{key.key} = {value:g} is outside its range, {key.low:g} to {key.high:g}; free it "
            "over a wider range"
        )
    return value


def _with_numbers(
    solid: Material, keys: Sequence[FreeKey], values: Mapping[str, float]
) -> Material:
    """Return the material with other numbers, then scaled."""
    table = write_material(solid)
    for key in keys:
        if not key.is_scale:
            table = with_value(table, key.path, _value(key, values))
    if not all(key.is_scale for key in keys):
        solid = SECTIONS["body"]["material"].read("material", table)
    factors = {SCALES[key.path[0]]: _value(key, values) for key in keys if key.is_scale}
    return solid.scaled(**factors) if factors else solid


def _with_material(body: Body, part: Part, solid: Material) -> Body:
    if part is None:
        return replace(body, material=solid)
    if isinstance(part, str):
        return replace(body, regions=(*(dict(body.regions) | {part: solid}).items(),))
    layers = list(body.layers)
    layers[part] = replace(layers[part], material=solid)
    return replace(body, layers=tuple(layers))


def check_scene(
    scene: Scene, keys: Sequence[FreeKey], tolerance: float, most_lines: int = 400
) -> None:
    """Raise a ValueError if sums over free materials cannot solve a scene."""
    if not 0 < tolerance < 1:
        raise ValueError(f"tolerance = {tolerance} is outside 0 < tolerance < 1")
    load, own = scene.load, "or reduce a body for each material"
    if load.gravity:
        raise ValueError(
            "free materials exclude gravity, because the static deflection depends on modulus and "
            f"density; remove gravity, {own}"
        )
    if load.support_motion:
        raise ValueError(
            f"free materials exclude {load.support_motion.words}, because the inertial force "
            f"depends on the density; remove support_motion, {own}"
        )
    check_laws(scene.body, scene.pressure)
    if scene.body.mounting != FRAME or scene.body.solid.orthotropy is not None:
        raise ValueError(
            "free materials need an isotropic sheet in a frame, because tension and other "
            f"mountings do not scale with its modulus; use a frame, {own}"
        )
    refuse_unheld_air(scene.body)
    _check_reading(scene, keys)
    lines = np.unique(np.concatenate([load_lines(each).frequencies for each in scene.loads]))
    if not lines.any():
        raise ValueError(
            "the load has no oscillating line; give it a modulation or a moving focus, or reduce a "
            "body for each material"
        )
    if (count := len(lines)) > most_lines:
        raise ValueError(
            f"the load has {count:,} lines, the limit with free materials is {most_lines}; remove "
            "the rhythm or signal"
        )


def _check_reading(scene: Scene, keys: Sequence[FreeKey]) -> None:
    """Raise a ValueError for a quantity that depends on a free key not only through the motion."""
    quantity, solid, words = scene.reading.record, scene.body.solid, scene.reading.words
    is_thick = any(key.is_thickness for key in keys)
    if is_thick and scene.body.of_kind.equivalent and not quantity.is_normal:
        raise ValueError(
            f"{words} depends on the free thickness of the sheet, not only on the motion of its "
            "middle plane; read the normal displacement, velocity or acceleration"
        )
    if is_thick and quantity.field == STRAIN:
        raise ValueError(
            f"{words} is not a smooth function of a free thickness, which moves the elements; "
            "read a displacement, velocity or acceleration"
        )
    rows, doubled = (quantity.rows(each) for each in (solid, solid.scaled(modulus=2.0)))
    if quantity.relaxes or not np.array_equal(rows, doubled):
        raise ValueError(
            f"{words} depends on the free material, not only on the motion; read a displacement, "
            "velocity or strain"
        )
