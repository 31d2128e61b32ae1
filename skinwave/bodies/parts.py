"""Parts of a body: layers, relief of a palm, bone of a finger, and placement under the device."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from meshes import Palm
from simple_model.choices import check_numbers, check_range, choose
from simple_model.layers.material import PRESETS, Material
from skinwave.typing import Floats


@dataclass(frozen=True, kw_only=True)
class Layer:
    """A layer below the surface, or below the layer above it.

    Parameters
    ----------
    thickness : float, m
    material : name of a preset, or a Material
    """

    thickness: float
    material: str | Material

    def __post_init__(self) -> None:
        check_material(self.material)
        check_numbers("a layer", self, "thickness")


@dataclass(frozen=True, kw_only=True)
class Relief:
    """Relief of a palm, in m, see `meshes.Palm`; with all heights 0, a slab with rounded edges.

    None stands for the value of an adult, reduced if the palm is too small for it.
    """

    cup_depth: float | None = None
    thenar_height: float | None = None
    hypothenar_height: float | None = None
    pad_height: float | None = None
    corner_radius: float | None = None
    edge_radius: float | None = None

    def of(self, breadth: float, length: float, thickness: float) -> Palm:
        """Return the palm with this relief; sizes in m."""
        edge_radius = 7e-3  # m: soft tissue on bone is thinner than a whole hand
        thin = min(1.0, thickness / (2 * edge_radius))
        roundest = 0.95  # of half the shorter side: rounder outlines have no straight side to mesh
        corner = min(Palm.corner_radius, roundest * min(breadth, length) / 2)
        usual = {
            "cup_depth": thin * Palm.cup_depth,
            "thenar_height": thin * Palm.thenar_height,
            "hypothenar_height": thin * Palm.hypothenar_height,
            "pad_height": thin * Palm.pad_height,
            "corner_radius": corner,
            "edge_radius": min(thin * edge_radius, self.corner_radius or corner),
        }
        given = {name: value for name, value in vars(self).items() if value is not None}
        return Palm(breadth=breadth, length=length, thickness=thickness, **(usual | given))


PLAIN = Relief()


@dataclass(frozen=True, kw_only=True)
class Phalanx:
    """Bone in a finger. The defaults are rounded values of an adult's index finger, not
    measurements.

    Parameters
    ----------
    breadth, thickness : float, m
    cover, tip : float, m, of soft tissue between the pad, or the tip, and the bone
    """

    breadth: float = 0.007
    thickness: float = 0.004
    cover: float = 0.006
    tip: float = 0.004


PHALANX = Phalanx()


@dataclass(frozen=True, kw_only=True)
class Placement:
    """Position of a body under the device: rotated about the x axis, then about the y axis, then
    moved.

    Parameters
    ----------
    tilt_x, tilt_y : float, rad, at most 60 degrees
    offset : (x, y) in m
    lift : float, m, towards the device
    """

    tilt_x: float = 0.0
    tilt_y: float = 0.0
    offset: tuple[float, float] = (0.0, 0.0)
    lift: float = 0.0

    def __post_init__(self) -> None:
        steepest = 60.0 + 1e-9  # degrees: almost no pressure acts on steeper bodies
        for name in ("tilt_x", "tilt_y"):
            degrees = np.degrees(getattr(self, name))
            check_range(name, degrees, -steepest, steepest, " degrees", "; tilt the body less")
        furthest_lift = 0.05  # m
        if not (np.isfinite(self.offset).all() and abs(self.lift) <= furthest_lift):
            raise ValueError(
                f"offset {self.offset} m and lift {self.lift} m: the body must lie within "
                f"{1e3 * furthest_lift:g} mm of the focus; change the height of the focus "
                "instead"
            )

    @property
    def is_tilted(self) -> bool:
        """Whether the body is rotated."""
        return bool(self.tilt_x or self.tilt_y)

    @property
    def rotation(self) -> Floats:
        """The rotation matrix (3, 3) of the body."""
        (cx, cy), (sx, sy) = np.cos([self.tilt_x, self.tilt_y]), np.sin([self.tilt_x, self.tilt_y])
        about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
        about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
        return about_y @ about_x

    def __call__(self, points: Floats) -> Floats:
        """Return points (n, 3) of the body in their position under the device."""
        if self == FLAT:
            return points
        return points @ self.rotation.T + [*self.offset, self.lift]


FLAT = Placement()


def solid_of(material: str | Material) -> Material:
    """Return the material with a name, or the given material."""
    return PRESETS[material] if isinstance(material, str) else material


def check_regions(regions: Sequence[tuple[str, str | Material]]) -> None:
    """Refuse duplicate regions, and regions of unknown or orthotropic materials."""
    names = [name for name, _ in regions]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise ValueError(f"region '{twice[0]}' has two materials; give one")
    for name, material in regions:
        check_material(material)
        if solid_of(material).orthotropy is not None:
            raise ValueError(
                f"the material of region '{name}' is orthotropic, which only a sheet can be; use "
                "an isotropic material"
            )


def check_material(material: str | Material) -> None:
    """Raise a ValueError for the name of an unknown material."""
    if isinstance(material, str):
        choose("material", material, PRESETS)
