"""Free keys of a body: their ranges, the bodies that values of them make, and the scenes that one
affine sum of matrices serves for all of these.
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
from skinwave.bodies.sheet import refuse_open_air
from skinwave.bodies.supports import FRAME
from skinwave.models.laws import check_laws
from skinwave.scene.keys import (
    MATERIAL,
    MODULI,
    PRONY,
    SCALES,
    SECTIONS,
    with_value,
    write_material,
)
from skinwave.scene.scene import Scene
from skinwave.typing import Floats

THICKNESS = ("thickness_mm",)  # path of a key
KEYS = (
    re.compile(r"body\.(layers\.(?P<layer>\d+)\.)?thickness_mm"),
    re.compile(
        r"body\.(regions\.(?P<region>[^.]+)|(layers\.(?P<layer>\d+)\.)?material)\.(?P<path>(?!thickness_mm).+)"
    ),
)
MOST_THICKNESSES = 2
FIXED = ("poisson", "law", "table")  # keys of a material that are no number, or change the matrices
MOST_CORNERS = 16
MOST_LINES = 400  # of a load
OUTSIDE = 1e-9  # of a range: round-off by which a value may be beyond it
Part = int | str | None  # of a body: a layer, a region by its name, or what is in neither


@dataclass(frozen=True, kw_only=True)
class FreeKey:
    """A number of a body that is free from `low` to `high`: its `key` in a scene file, the `part`
    that it is of, and the `path` in the material's table, one of `SCALES`, or `THICKNESS`; and
    whether the mesh `moves` with it.
    """

    key: str
    part: Part
    path: tuple[str, ...]
    low: float
    high: float
    moves: bool = False

    def at(self, share: float) -> float:
        """Value at a share 0 to 1 of the range, of its logarithm if that is finite."""
        if self.low > 0:
            return float(self.low * (self.high / self.low) ** share)
        return float(self.low + share * (self.high - self.low))

    def share(self, value: float) -> float:
        """Share of the range at a value, the inverse of `at`."""
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
    """Free keys of a body; raises a ValueError if a key cannot be free, or has no range."""
    if not free:
        raise ValueError("free = {} names no key; give one, such as body.material.shear_modulus_pa")
    found = tuple(_free_key(body, key, bounds) for key, bounds in free.items())
    _check_thicknesses(body, [key for key in found if key.is_thickness])
    for layers, below in product((0.0, 1.0), repeat=2):
        values = values_at(found, [below if key.part is None else layers for key in found])
        try:  # what materials and bodies refuse, they refuse here
            with_values(body, found, values)
        except ValueError as error:
            said = ", ".join(f"{key} = {value:g}" for key, value in values.items())
            raise ValueError(f"at {said}, ends of free ranges: {error}") from None
    return found


def with_values(body: Body, keys: Sequence[FreeKey], values: Mapping[str, float]) -> Body:
    """Body with values of its free keys; raises a ValueError unless each is in its range."""
    if strange := sorted(set(values) - {key.key for key in keys}):
        raise ValueError(
            f"'{strange[0]}' is not free; free it as well, or leave it out: free are "
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
    """Values by key at shares (k,) of the ranges, 0 to 1."""
    return {key.key: key.at(share) for key, share in zip(keys, shares, strict=True)}


def training_shares(count: int, inside: int) -> Floats:
    """Corners, the middle, and points `inside` of a unit cube: shares (t, count)."""
    corners = np.array(list(product((0.0, 1.0), repeat=count)))
    if len(corners) > MOST_CORNERS:
        corners = np.random.default_rng(0).choice(corners, MOST_CORNERS, replace=False)
    few = np.vstack([corners, np.full((1, count), 0.5)])
    if not inside:
        return few
    from scipy.stats import qmc  # which takes long to import

    return np.vstack([few, qmc.Sobol(count, rng=0).random(inside)])


def meshing_shares(keys: Sequence[FreeKey]) -> tuple[float, ...]:
    """Shares (k,) of the ranges of the body that is meshed: the largest thicknesses, and the
    fastest shear waves below all layers, for which an absorbing layer is widest; layers of one
    range differ, so that their elements do.
    """
    fastest = {"shear_modulus_pa": 1.0, MODULI: 1.0, "density_kg_m3": 0.0}
    inside = [0.4 + 0.2 * k / len(keys) for k in range(len(keys))]
    return tuple(
        1.0 if key.is_thickness else fastest.get(key.path[0], x) if key.part is None else x
        for key, x in zip(keys, inside, strict=True)
    )


def solid_at(body: Body, part: Part) -> Material:
    """Material of a part of a body."""
    if part is None:
        return body.solid
    if isinstance(part, str):
        return solid_of(dict(body.regions)[part])
    return solid_of(body.layers[part].material)


def _free_key(body: Body, key: str, bounds: tuple[float, float]) -> FreeKey:
    part, path = _part(body, key)
    known = [*(name for name in MATERIAL if name not in FIXED), *SCALES]
    if path[0] in FIXED:
        raise ValueError(
            f"'{key}' cannot be free: only moduli, losses, times and densities change none of a "
            "body's matrices; reduce a body for each value of it"
        )
    if tuple(path) != THICKNESS:
        choose(f"free key '{key}'", path[0], known)
    if path[0] == "prony" and not (len(path) == 3 and path[1].isdecimal() and path[2] in PRONY):
        raise ValueError(f"'{key}' is no number of a Prony term; name one as prony.0.modulus_pa")
    low, high = (float(bound) for bound in bounds)
    if not (isfinite(low) and isfinite(high) and low < high):
        raise ValueError(
            f"{key} is free from {low:g} to {high:g}; give a finite range, low to high"
        )
    if path[0] in SCALES and not low > 0:
        raise ValueError(f"{key} is free from {low:g}, and must be above 0; give a least factor")
    moves = tuple(path) == THICKNESS and body.of_kind.morph is not None
    return FreeKey(key=key, part=part, path=tuple(path), low=low, high=high, moves=moves)


def _part(body: Body, key: str) -> tuple[Part, list[str]]:
    """The part of a body that a key is of, and the path in it."""
    found = next((m.groupdict() for each in KEYS if (m := each.fullmatch(key))), None)
    if found is None:
        raise ValueError(
            f"'{key}' cannot be free: one reduced body serves materials and thicknesses alone; "
            "free keys of body.material, body.layers.0.material or body.regions.bone, "
            "body.thickness_mm or body.layers.0.thickness_mm, and reduce a body for each value of "
            "others"
        )
    region, layer = found.get("region"), found["layer"]
    path = found.get("path", THICKNESS[0]).split(".")
    if region:
        if region not in dict(body.regions):
            raise ValueError(
                f"'{key}' is of a region whose material the scene does not give; it gives those of "
                f"{', '.join(dict(body.regions)) or 'none'}"
            )
        return region, path
    if layer and int(layer) >= len(body.layers):
        raise ValueError(
            f"'{key}' is of a layer that the body has not; it has {len(body.layers)}, counted "
            "from 0"
        )
    return int(layer) if layer else None, path


def _check_thicknesses(body: Body, keys: Sequence[FreeKey]) -> None:
    """Refuse thicknesses that one mesh does not stand for."""
    if not keys:
        return
    kind = body.of_kind
    if kind.morph is None and kind.equivalent is None:
        raise ValueError(
            f"'{keys[0].key}' cannot be free: no mesh of a {body.kind} follows its thickness; free "
            "that of a slab, disc or sheet, or reduce a body for each value"
        )
    if len(keys) > MOST_THICKNESSES:
        raise ValueError(
            f"{len(keys)} thicknesses are free, the limit is {MOST_THICKNESSES}; each multiplies "
            "the meshes that a body is interpolated between"
        )
    if low := [key.key for key in keys if not key.low > 0]:
        raise ValueError(f"{low[0]} is free from 0 or below; give a least value above 0")
    most = 1e3 * kind.equivalent(body) if kind.equivalent else inf
    if high := [key for key in keys if key.high > most * (1 + OUTSIDE)]:
        raise ValueError(
            f"{high[0].key} is free up to {high[0].high:g} mm, the limit is {most:g} mm for this "
            f"{body.kind}: elements of that thickness stand for all thinner ones, and thicker ones "
            "have a mesh each; narrow the range, or reduce a body for each value"
        )


def _value(key: FreeKey, values: Mapping[str, float]) -> float:
    if key.key not in values:
        raise ValueError(f"the values lack {key.key}, which is free; give it")
    value, slack = float(values[key.key]), OUTSIDE * (key.high - key.low)
    if not key.low - slack <= value <= key.high + slack:
        raise ValueError(
            f"{key.key} = {value:g} is outside its range, {key.low:g} to {key.high:g}; free it "
            "over a wider one"
        )
    return value


def _with_numbers(
    solid: Material, keys: Sequence[FreeKey], values: Mapping[str, float]
) -> Material:
    """Material with other numbers, which are scaled then."""
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


def has_affine_operators(body: Body) -> bool:
    """Whether the operators of a body are sums over its materials, as of a plain sheet."""
    return body.mounting == FRAME and body.solid.orthotropy is None


def check_scene(scene: Scene, keys: Sequence[FreeKey], tolerance: float) -> None:
    """Refuse what no affine sum gives for free keys, to a relative error of each line."""
    if not 0 < tolerance < 1:
        raise ValueError(f"tolerance = {tolerance} is outside 0 < tolerance < 1")
    if scene.load.gravity:
        raise ValueError(
            "a body with free materials has no gravity: the static deflection is that of each "
            "modulus and density; leave gravity out, or reduce the body of each material"
        )
    if scene.load.support_motion:
        raise ValueError(
            f"a body with free materials does not take {scene.load.support_motion.words}, whose "
            "inertial force goes with the density; leave support_motion out, or reduce the body of "
            "each material"
        )
    check_laws(scene.body, scene.pressure)
    if not has_affine_operators(scene.body):
        raise ValueError(
            "a body with free materials is an isotropic sheet in a frame, or none: tension and "
            "other mountings do not scale with its modulus; reduce the body of each material"
        )
    refuse_open_air(scene.body)
    _check_reading(scene, keys)
    each = [load_lines(pressure).frequencies for pressure in scene.loads]
    if (count := len(np.unique(np.concatenate(each)))) > MOST_LINES:
        raise ValueError(
            f"the load has {count:,} lines, the limit with free materials is {MOST_LINES}; leave "
            "out the rhythm or signal"
        )


def _check_reading(scene: Scene, keys: Sequence[FreeKey]) -> None:
    """Refuse what depends on a free material or thickness beyond the motion of the mesh."""
    asked, solid = scene.reading.record, scene.body.solid
    is_thick = any(key.is_thickness for key in keys)
    if is_thick and scene.body.of_kind.equivalent and not asked.is_normal:
        raise ValueError(
            f"{scene.reading.words} goes with the thickness of a sheet beyond the motion of its "
            "middle; take the normal displacement, velocity or acceleration"
        )
    if is_thick and asked.field == STRAIN:
        raise ValueError(
            f"{scene.reading.words} of elements that move with a thickness is not smooth in it; "
            "take a displacement, velocity or acceleration"
        )
    rows, doubled = (asked.rows(each) for each in (solid, solid.scaled(modulus=2.0)))
    if asked.relaxes or not np.array_equal(rows, doubled):
        raise ValueError(
            f"{scene.reading.words} depends on the material beyond the motion, which is all that a "
            "body with free materials gives; take a displacement, velocity or strain"
        )
