"""A scene: what is commanded, what it acts on, where it is probed. Physics only, one TOML file."""

from dataclasses import dataclass, replace
from math import inf, isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshes import Palm
from simple_model import MovingPressure, Tacton
from simple_model.choices import choose
from simple_model.material import PRESETS, Material

KINDS = ("none", "sheet", "slab", "palm", "mesh")
BASES = ("clamped", "absorbing", "free")


@dataclass(frozen=True, kw_only=True)
class Layer:
    """A layer below the surface, or below the layer above it.

    Parameters
    ----------
    thickness : float, metre
    material : the name of a preset, or a Material

    Raises
    ------
    ValueError
        If the material is unknown, or the thickness not finite and above 0.
    """

    thickness: float
    material: str | Material

    def __post_init__(self) -> None:
        _check_material(self.material)
        if not (isfinite(self.thickness) and self.thickness > 0):
            raise ValueError(
                f"layer thickness = {1e3 * self.thickness} mm must be finite and above 0"
            )


@dataclass(frozen=True, kw_only=True)
class Relief:
    """Relief of a palm, in metre, as in `meshes.Palm`; with all heights 0 a slab with rounded
    edges.
    """

    cup_depth: float = Palm.cup_depth
    thenar_height: float = Palm.thenar_height
    hypothenar_height: float = Palm.hypothenar_height
    pad_height: float = Palm.pad_height
    corner_radius: float = Palm.corner_radius
    edge_radius: float = 0.007  # soft tissue on bone is thinner than a whole hand


@dataclass(frozen=True, kw_only=True)
class Placement:
    """Where a body lies under the device: turned about the x axis, then about the y axis of the
    plane that the focus moves in, then moved.

    Parameters
    ----------
    tilt_x, tilt_y : float, rad, at most 60 degrees
    offset : (x, y) in metre
    lift : float, metre, upwards, towards the device

    Raises
    ------
    ValueError
        If a value is not finite or out of range.
    """

    tilt_x: float = 0.0
    tilt_y: float = 0.0
    offset: tuple[float, float] = (0.0, 0.0)
    lift: float = 0.0

    def __post_init__(self) -> None:
        for name in ("tilt_x", "tilt_y"):
            if not abs(getattr(self, name)) <= STEEPEST:
                raise ValueError(
                    f"{name} = {np.degrees(getattr(self, name)):g} degrees is beyond "
                    f"{np.degrees(STEEPEST):.0f}, where next to no pressure is left; turn it less"
                )
        if not (np.isfinite(self.offset).all() and abs(self.lift) <= FURTHEST_LIFT):
            raise ValueError(
                f"offset {self.offset} m and lift {self.lift} m: the body must lie within "
                f"{1e3 * FURTHEST_LIFT:g} mm of the focus; move the height of the focus with it"
            )

    @property
    def is_tilted(self) -> bool:
        """Whether it is turned, and not only moved."""
        return bool(self.tilt_x or self.tilt_y)

    @property
    def rotation(self) -> NDArray[np.float64]:
        """The matrix (3, 3) that turns the body."""
        (cx, cy), (sx, sy) = np.cos([self.tilt_x, self.tilt_y]), np.sin([self.tilt_x, self.tilt_y])
        about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
        about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
        return about_y @ about_x

    def __call__(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (n, 3) of the body where they lie under the device."""
        if self == FLAT:
            return points
        return points @ self.rotation.T + [*self.offset, self.lift]


LARGEST = 2.0  # m: a body of more was meant in mm
STEEPEST, FURTHEST_LIFT = np.pi / 3, 0.05
FLAT = Placement()


@dataclass(frozen=True, kw_only=True)
class Body:
    """A body below the plane that the focus moves in, the middle of its surface at the origin.

    Parameters
    ----------
    kind : "none" (the point kernel needs no body), "sheet" (thin, bends), "slab" (thick), "palm"
        (soft tissue on bone, `depth` below the middle of the palm) or "mesh" (from a file)
    material : the name of a preset, or a Material
    width, height, depth : float, metre, along x, y and downwards, at most 2; a slab's depth may
        be inf, a half-space, which only flat-body can compute
    base, sides : "clamped", "absorbing" or "free"; of a hand the part that looks downwards, and
        the ends at the wrist and the fingers or the cuts of a file
    layers : from the surface downwards; what is below them is of `material`
    relief : of a palm
    file, unit, up : of a mesh, as `meshes.body_from_file` takes them
    placement : how the body lies under the device
    air : bool, whether air moves along on both sides of a sheet, as if in a baffle; or vacuum

    Raises
    ------
    ValueError
        If a value is unknown, not finite or out of range.
    """

    kind: str = "slab"
    material: str | Material = "palm"
    width: float = 0.100
    height: float = 0.100
    depth: float = 0.015
    base: str = "clamped"
    sides: str = "absorbing"
    layers: tuple[Layer, ...] = ()
    relief: Relief = Relief()
    file: str = ""
    unit: str = "m"
    up: str = "+z"
    placement: Placement = FLAT
    air: bool = False

    def __post_init__(self) -> None:
        choose("body kind", self.kind, KINDS)
        _check_material(self.material)
        for name in ("base", "sides"):
            choose(name, getattr(self, name), BASES)
        for name in ("width", "height", "depth"):
            length, may_be_infinite = getattr(self, name), name == "depth" and self.kind == "slab"
            if not (length > 0 and (isfinite(length) or (may_be_infinite and length == inf))):
                raise ValueError(f"body {name} = {1e3 * length} mm must be finite and above 0")
            if isfinite(length) and length > LARGEST:
                raise ValueError(
                    f"body {name} = {length:g} m is more than {LARGEST:g} m, the limit of a body; "
                    f"lengths are in metre here and in mm in a scene file, so that "
                    f"{length:g} mm are {name} = {length / 1e3:g}, or {name}_mm = {length:g}"
                )
        if self.kind != "none" and self.base == self.sides == "free":
            raise ValueError(
                "a body with free base and free sides is unconstrained and drifts under the mean "
                "load; clamp one of them"
            )

        self._check_layers()

        if (self.kind == "mesh") != bool(self.file):
            raise ValueError(
                "a body of kind 'mesh' needs a file, no other has one; give it or leave it out"
            )
        if self.air and self.kind != "sheet":
            raise ValueError(
                f"air = true is for a sheet, which weighs little more than the air that it moves, "
                f"not a {self.kind}; leave it out"
            )
        if self.kind == "palm":
            self.palm  # noqa: B018 - refuses what does not fit

    def _check_layers(self) -> None:
        if not self.layers:
            return
        if self.kind in ("none", "sheet"):
            raise ValueError(f"a body of kind '{self.kind}' has no layers; leave them out")
        if (below := sum(layer.thickness for layer in self.layers)) >= self.depth:
            raise ValueError(
                f"the layers are {1e3 * below:g} mm thick in all, but the body is "
                f"{1e3 * self.depth:g} mm deep; leave some of it for what is below them"
            )

    @property
    def solid(self) -> Material:
        """The material itself, below all layers."""
        return solid_of(self.material)

    @property
    def palm(self) -> Palm:
        """The palm that outline and relief describe."""
        return Palm(
            breadth=self.width, length=self.height, thickness=self.depth, **vars(self.relief)
        )

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
        """Depth in metre where each material begins; neighbours of one material are one."""
        found: list[tuple[float, Material]] = []
        top = 0.0
        for thickness, material in [
            *((layer.thickness, solid_of(layer.material)) for layer in self.layers),
            (inf, self.solid),
        ]:
            if not found or found[-1][1] != material:
                found.append((top, material))
            top += thickness
        return tuple(found)

    @property
    def is_held(self) -> bool:
        """Whether it is constrained: clamped at its base or its sides."""
        return "clamped" in (self.base, self.sides)

    @property
    def is_plain(self) -> bool:
        """Whether it is of one material and lies flat under the device."""
        return len(self.strata) == 1 and self.placement == FLAT


def solid_of(material: str | Material) -> Material:
    """The material that a name stands for."""
    return PRESETS[material] if isinstance(material, str) else material


def _check_material(material: str | Material) -> None:
    if isinstance(material, str):
        choose("material", material, PRESETS)


BODIES = {
    "none": Body(kind="none"),
    # 80 g/m2 office paper in a frame.
    "paper-sheet": Body(kind="sheet", material="paper", depth=1e-4, base="free", sides="clamped"),
    # Effective soft tissue of the palm on bone.
    "skin-slab": Body(),
    "palm": Body(kind="palm", width=0.085),
}
SAMPLE_RATE = 10_000.0  # Hz of every response: five times the highest line that matters
MOST_VALUES = 50_000_000  # of all waveforms of one response, 400 MB
PROBES = ((0.0, 0.0), (0.005, 0.0), (0.010, 0.0), (0.015, 0.0), (0.020, 0.0))


@dataclass(frozen=True, kw_only=True)
class Scene:
    """One experiment.

    Parameters
    ----------
    name : str
    pressure : MovingPressure, with its Tacton
    body : Body
    probes : (p, 2) positions in metre, where the surface is watched

    Raises
    ------
    ValueError
        If a probe or the path of the focus is off the body, or there is no probe.
    """

    name: str = "scene"
    pressure: MovingPressure
    body: Body
    probes: tuple[tuple[float, float], ...] = PROBES

    def __post_init__(self) -> None:
        if not self.probes:
            raise ValueError("points_mm is empty; give at least one probe")
        if (values := len(self.probes) * self.tacton.duration * SAMPLE_RATE) > MOST_VALUES:
            raise ValueError(
                f"{len(self.probes):,} probes for {self.tacton.duration:g} s at "
                f"{SAMPLE_RATE:g} Hz are {values:,.0f} values, the limit is {MOST_VALUES:,}; "
                "give fewer probes or a shorter Tacton"
            )
        if self.body.kind in ("none", "mesh"):
            return
        half = np.array([self.body.width, self.body.height]) / 2
        for x, y in self.probes:
            if abs(x) > half[0] or abs(y) > half[1]:
                raise ValueError(
                    f"probe ({1e3 * x:g}, {1e3 * y:g}) mm is off the body, which ends at "
                    f"{1e3 * half[0]:g} and {1e3 * half[1]:g} mm; move it inside"
                )
        path = self.tacton.trajectory.outline
        if (reach := np.abs(path).max(axis=0) - half).max() > 1e-12:
            axis = int(np.argmax(reach))
            raise ValueError(
                f"the focus path reaches {1e3 * (reach + half)[axis]:g} mm along {'xy'[axis]}, off "
                f"the body, which ends at {1e3 * half[axis]:g} mm; shrink it or widen the body"
            )

    @property
    def tacton(self) -> Tacton:
        """The Tacton of the pressure."""
        return self.pressure.tacton

    @property
    def probe_points(self) -> NDArray[np.float64]:
        """Probes as an array (p, 2) in metre."""
        return np.array(self.probes)


def with_body(scene: Scene, body: Body, **pressure: Any) -> Scene:
    """The same Tacton and probes on another body, with changes to the pressure if any."""
    return replace(scene, body=body, pressure=replace(scene.pressure, **pressure))
