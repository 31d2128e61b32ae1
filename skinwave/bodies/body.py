"""A body, its kind, and the registry of kinds."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Set
from dataclasses import dataclass, field, fields
from math import inf, isfinite
from typing import Any

import numpy as np

from meshes import Palm
from simple_model.layers.compliance import Compliance
from simple_model.layers.dispersion import DispersionCurves
from simple_model.layers.material import NOT_SKIN, PRESETS, Material
from skinwave.bodies.discretised import Discretise, Discretised
from skinwave.bodies.parts import (
    FLAT,
    PHALANX,
    PLAIN,
    Layer,
    Phalanx,
    Placement,
    Relief,
    check_material,
    check_regions,
    solid_of,
)
from skinwave.bodies.supports import (
    DEFAULT_SIDE,
    FRAME,
    Mounting,
    Sides,
    check_base,
    check_extent,
    complete_sides,
)
from skinwave.system import extensions
from skinwave.system.extensions import Registry
from skinwave.typing import Floats


@dataclass(frozen=True, kw_only=True)
class Body:
    """A body below the plane in which the focus moves, with the middle of its surface at the
    origin.

    Parameters
    ----------
    kind : name of a registered `BodyKind`: "none" (the point kernel needs no body), "sheet" (thin,
        bends), "slab" (thick), "palm" (soft tissue on bone, `depth` below the middle of the palm),
        "finger" (soft tissue around bone), "disc" or "mesh" (from a file)
    material : name of a preset, or a Material
    width, height, depth : float, m, along x, y and downwards, at most 2; the depth of a slab may be
        inf, a half-space, for flat-body models only
    base, sides : "clamped", "absorbing" or "free"; a base may also be "elastic", a Winkler
        foundation. The base of a hand is the part that faces downwards; its sides are the ends at
        wrist and fingers, or the cuts of a file. `Sides` gives each side its own condition.
    base_stiffness : N/m3, traction per displacement of an elastic base, in every direction
    layers : Layers from the surface downwards; `material` fills the rest
    relief : Relief of a palm
    bone : Phalanx in a finger
    regions : (name or number, material) of regions of the mesh that are not of `material`, such as
        bone in soft tissue
    file, unit, up : of a mesh, see `meshes.body_from_file`
    placement : position and rotation under the device
    air : False for a sheet in vacuum; "free" (or True) if air flows around its edges or frame,
        "baffle" if a rigid wall larger than a wavelength of sound surrounds it
    mounting : Mounting, the supports and the tension of a sheet

    Raises a ValueError if a value is unknown, not finite or out of range.

    >>> Body(kind="slab", material="palm", depth=0.015).solid.shear_modulus
    25000.0
    """

    kind: str = "slab"
    material: str | Material = "palm"
    width: float = 0.100
    height: float = 0.100
    depth: float = 0.015
    base: str = "clamped"
    sides: str | Sides = DEFAULT_SIDE
    base_stiffness: float = 0.0
    layers: tuple[Layer, ...] = ()
    relief: Relief = PLAIN
    bone: Phalanx = PHALANX
    file: str = ""
    unit: str = "m"
    up: str = "+z"
    regions: tuple[tuple[str, str | Material], ...] = ()
    placement: Placement = FLAT
    air: bool | str = False
    mounting: Mounting = FRAME

    def __post_init__(self) -> None:
        kind = self.of_kind
        object.__setattr__(self, "air", "free" if self.air is True else self.air)
        check_material(self.material)
        check_base(self.base, self.base_stiffness, depth=self.depth, is_plate=kind.is_plate)
        object.__setattr__(self, "sides", complete_sides(self.sides, kind.named_sides, self.kind))
        # In a scene file.
        keys = {"width": "size_x_mm", "height": "size_y_mm", "depth": "thickness_mm"}
        largest = 2.0  # m: larger numbers are probably in mm
        for name in ("width", "height", "depth"):
            length = getattr(self, name)
            if name == "depth" and kind.is_layer and length == inf:
                continue
            if not 0 < length < inf:
                raise ValueError(f"{keys[name]} = {1e3 * length:g} must be finite and above 0")
            if length > largest:
                raise ValueError(
                    f"body {name} = {length:g} m exceeds {largest:g} m; {length:g} mm are "
                    f"{name} = {length / 1e3:g} in m, or {keys[name]} = {length:g} in a scene"
                )
        if kind.discretise and {self.base, *self.conditions} == {"free"}:
            raise ValueError(
                "a body with free base and sides is unconstrained and drifts; clamp one"
            )
        self._check_layers()
        check_regions(self.regions)
        check_keys(
            kind, {each.name for each in fields(self) if getattr(self, each.name) != each.default}
        )
        if "file" in kind.keys and not self.file:
            raise ValueError(f"a body of kind '{self.kind}' needs a file; give its name")
        self._check_sheet()
        kind.check(self)

    def _check_sheet(self) -> None:
        """Refuse properties that only a sheet has, and supports that contradict each other."""
        if self.solid.orthotropy is not None and not self.of_kind.is_plate:
            raise ValueError("an orthotropic material is for a sheet; use an isotropic material")
        air = (False, "free", "baffle")
        if self.air not in air:
            raise ValueError(
                f'air = {self.air!r} is unknown; use "free", "baffle", or false for vacuum'
            )
        if self.air == "baffle" and self.sides == "clamped" and not self.mounting.is_frame:
            raise ValueError(
                f'air = "baffle" needs a sheet in a frame, not one {self.mounting.words}; '
                'hold all edges, or use air = "free"'
            )
        if self.mounting == FRAME:
            return
        if self.sides != "clamped":
            raise ValueError(
                f'a mounting needs sides = "clamped", not {self.sides}; clamp the sides'
            )
        needs_flat = self.mounting.support == "simply" or self.mounting.is_curled
        if needs_flat and self.placement.is_tilted:
            raise ValueError("a tilted sheet cannot be simply supported or curled; remove its tilt")
        check_extent(self.mounting, self.width, self.height)

    def _check_layers(self) -> None:
        if not self.layers:
            return
        if not self.of_kind.may_be_layered:
            raise ValueError(f"a body of kind '{self.kind}' cannot have layers; remove them")
        if any(solid_of(layer.material).orthotropy is not None for layer in self.layers):
            raise ValueError(
                "layers must be isotropic; use another material than an orthotropic one"
            )
        if (below := sum(layer.thickness for layer in self.layers)) >= self.depth:
            raise ValueError(
                f"the layers of {1e3 * below:g} mm fill the body of {1e3 * self.depth:g} mm; "
                "make them thinner"
            )

    @property
    def of_kind(self) -> BodyKind:
        """The registered record of its kind."""
        return kind_of(self.kind)

    @property
    def solid(self) -> Material:
        """The material below all layers."""
        return solid_of(self.material)

    @property
    def palm(self) -> Palm:
        """The palm that outline and relief describe."""
        return self.relief.of(self.width, self.height, self.depth)

    @property
    def bending_stiffness(self) -> float:
        """Bending stiffness E d^3 / 12 (1 - nu^2) of a sheet, N m."""
        return self.solid.young * self.depth**3 / 12 / (1 - self.solid.poisson**2)

    @property
    def mass_per_area(self) -> float:
        """Mass per area of a sheet, kg/m2."""
        return self.solid.density * self.depth

    @property
    def strata(self) -> tuple[tuple[float, Material], ...]:
        """(Depth in m at the top, material) of each stratum; equal neighbours are merged."""
        layers = [(layer.thickness, solid_of(layer.material)) for layer in self.layers]
        strata: list[tuple[float, Material]] = []
        top = 0.0
        for thickness, material in [*layers, (inf, self.solid)]:
            if not strata or strata[-1][1] != material:
                strata.append((top, material))
            top += thickness
        return tuple(strata)

    @property
    def interfaces(self) -> list[float]:
        """Depths in m at which the strata begin, and at which the last one ends."""
        return [*(start for start, _ in self.strata), self.depth]

    @property
    def thicknesses(self) -> list[float]:
        """Thickness in m of each given layer, then of the whole body."""
        return [*(layer.thickness for layer in self.layers), self.depth]

    @property
    def solids(self) -> tuple[Material, ...]:
        """Materials of the strata, then of the regions."""
        strata = (solid for _, solid in self.strata)
        return (*strata, *(solid_of(material) for _, material in self.regions))

    @property
    def softest(self) -> Material:
        """Material with the slowest shear waves among the lowest stratum and the regions."""
        inside = (solid_of(material) for _, material in self.regions)
        return min((self.solid, *inside), key=lambda solid: solid.shear_speed)

    @property
    def conditions(self) -> tuple[str, ...]:
        """Conditions of the sides, one if all are equal."""
        return (self.sides,) if isinstance(self.sides, str) else (*self.sides.by_name.values(),)

    def side(self, name: str) -> str:
        """Return the condition of one side."""
        return self.sides if isinstance(self.sides, str) else getattr(self.sides, name)

    @property
    def symmetry(self) -> str:
        """Axes, out of "xy", across whose middle planes the supports are mirror images."""
        sides = "xy" if isinstance(self.sides, str) else self.sides.symmetry
        return "".join(axis for axis in sides if axis in self.mounting.symmetry)

    @property
    def is_held(self) -> bool:
        """Whether the body is constrained: at its base, or clamped at a side."""
        at_base = self.base in ("clamped", "elastic") or self.is_on_half_space
        return at_base or "clamped" in self.conditions

    @property
    def is_on_half_space(self) -> bool:
        """Whether it is a slab with absorbing base and sides, like part of a half-space."""
        return self.of_kind.is_layer and {self.base, *self.conditions} == {"absorbing"}

    @property
    def is_skin(self) -> bool:
        """Whether its surface is skin: not a plate, nor a preset such as silicone."""
        top = self.layers[0].material if self.layers else self.material
        others = [PRESETS[name] for name in NOT_SKIN]
        return self.is_solid and solid_of(top) not in others

    @property
    def is_solid(self) -> bool:
        """Whether it is a solid with surface waves: neither a plate nor "none"."""
        return self.of_kind.discretise is not None and not self.of_kind.is_plate


@dataclass(frozen=True, kw_only=True, eq=False)
class BodyKind:
    """Kind of body: the keys it takes, how it is meshed, and its waves.

    Functions take a body first. Optional ones are None if the kind does not support them.

    Parameters
    ----------
    name : `kind` in a scene
    keys : attributes of `Body` that not every kind takes, but this one does
    presets : name of a preset body -> attributes that differ from `Body()`; the first preset
        supplies missing keys of a scene
    check : raises a ValueError for an impossible body
    words : kind and size in a few words
    discretise : mesh for an element size in m
    morph : function of the thinnest and the thickest body of a range and an element size in m. It
        returns a function like `discretise` whose meshes have the same nodes, moved in proportion
        to the layers, so that matrices are sums of few terms
    equivalent : thickness in m of the mesh that represents all thinner bodies, with equivalent
        modulus and density (`sheet.bending_equivalent`)
    check_size : raises a ValueError for an element size in m that gives too many elements
    default_size : default element size, m
    interactive_size : element size in m for a response within seconds and errors of a few per cent
    compliance : wavenumber integral of a laterally infinite body
    dispersion : dispersion curves of a laterally infinite body of the same section, for frequencies
        (f,) in Hz and a largest number of modes
    wave_speed : phase speed in m/s of its surface waves at a frequency in Hz
    named_sides : names of the sides that may have separate conditions
    is_plate : whether it is thin: it bends, tension stiffens it, and air adds mass
    is_layer : whether it is a layer of uniform depth, which may be inf
    is_symmetric : whether its mesh may be halved at x = 0 and y = 0
    is_bounded : whether its surface has this width and height
    may_be_layered : whether it may have layers
    actual_size : element size in m of a mesh with whole numbers of cells
    conforming : whether the elements follow its layers
    is_smooth : whether its supports begin smoothly, without edges at which strain is singular
    may_be_coated : whether layers thinner than elements can become a coat
    normal_patch : m, standard deviation of the area around a probe over which the normal, the
        direction of its motion, is averaged; 0 for the normal at the probe
    """

    name: str
    keys: tuple[str, ...] = ()
    presets: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    check: Callable[[Body], object] = lambda body: None
    words: Callable[[Body], str] = lambda body: _size(body)
    discretise: Callable[[Body, float], Discretised] | None = None
    morph: Callable[[Body, Body, float], Discretise] | None = None
    equivalent: Callable[[Body], float] | None = None
    check_size: Callable[[Body, float], None] = lambda body, h: None
    default_size: Callable[[Body], float] = lambda body: min(body.width, body.height) / 20
    interactive_size: float = 4.5e-3
    compliance: Callable[[Body], Compliance] | None = None
    dispersion: Callable[[Body, Floats, int], DispersionCurves] | None = None
    wave_speed: Callable[[Body, float], float] = lambda body, frequency: _rayleigh(body, frequency)
    named_sides: tuple[str, ...] = ()
    is_plate: bool = False
    is_layer: bool = False
    is_symmetric: bool = False
    is_bounded: bool = True
    may_be_layered: bool = True
    actual_size: Callable[[Body, float], float] | None = None
    conforming: bool = False
    is_smooth: bool = False
    may_be_coated: bool = False
    normal_patch: float = 0.0


def _size(body: Body) -> str:
    across = f"{1e3 * body.width:g} x {1e3 * body.height:g}"
    deep = f" x {1e3 * body.depth:.3g}" if isfinite(body.depth) else ""
    return f"{body.kind} of {across}{deep} mm"


def _rayleigh(body: Body, frequency: float) -> float:
    """Phase speed in m/s of the Rayleigh wave of the softest material, as if the body were deep.

    It is w / Re k with k = w / (c_R/c_s sqrt(mu*/rho)) and mu* = `Material.complex_modulus`. Waves
    in layers that are thin compared with the wavelength are faster.
    """
    solid = body.softest
    slowness = 1 / np.sqrt(solid.complex_modulus(2 * np.pi * frequency) / solid.density)
    return float(1 / np.real(slowness)) * solid.rayleigh_speed / solid.shear_speed


_KINDS = Registry[BodyKind](what="body kind")
KINDS = _KINDS.records
BODIES: dict[str, Body] = {}  # presets by name


def register(kind: BodyKind) -> BodyKind:
    """Register a kind of body and its presets; raises a ValueError if the name is registered.

    A preset of a known kind needs no registration: `BODIES[name] = Body(...)`.
    """
    extensions.add(_KINDS, kind.name, kind, kind.discretise)
    for name, own in kind.presets.items():
        BODIES[name] = Body(kind=kind.name, **own)
    return kind


def kind_of(name: str) -> BodyKind:
    """Return the kind with a name; raises a ValueError if it is unknown."""
    return extensions.find(_KINDS, name)


def check_keys(kind: BodyKind, names: Set[str]) -> None:
    """Refuse attributes, given by name, that only other kinds of body take."""
    for name in sorted(names - set(kind.keys)):
        if takers := [f'"{each.name}"' for each in KINDS.values() if name in each.keys]:
            raise ValueError(
                f'{name} is for kind = {" or ".join(takers)}, not "{kind.name}"; remove it'
            )


def body_name(body: Body) -> str:
    """Return the name of a preset body, or the kind of any other body."""
    return next((name for name, known in BODIES.items() if known == body), body.kind)


def _no_wave(body: Body, frequency: float) -> float:
    raise ValueError("body kind 'none' has no waves; choose a sheet or a slab")


register(  # what the point kernel acts on
    BodyKind(
        name="none",
        presets={"none": {}},
        words=lambda body: "none",
        wave_speed=_no_wave,
        is_bounded=False,
        may_be_layered=False,
    )
)
