"""A scene: what is commanded, what it acts on, where it is probed. Physics only, one TOML file."""

from dataclasses import dataclass, replace
from math import inf, isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.materials import PRESETS, Material
from simple_model import MovingPressure, Tacton
from simple_model.choices import choose

KINDS = ("none", "sheet", "slab")
BASES = ("clamped", "absorbing", "free")


@dataclass(frozen=True, kw_only=True)
class Body:
    """A flat body below the plane that the focus moves in, centred under the origin.

    Parameters
    ----------
    kind : "none" (the point kernel needs no body), "sheet" (thin, bends) or "slab" (thick)
    material : the name of a preset, or a Material
    width, height, depth : float, metre, along x, y and downwards; a slab's depth may be inf,
        a half-space, which only flat-body answers
    base, sides : "clamped", "absorbing" or "free"

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

    def __post_init__(self) -> None:
        choose("body kind", self.kind, KINDS)
        if isinstance(self.material, str):
            choose("material", self.material, PRESETS)
        for name in ("base", "sides"):
            choose(name, getattr(self, name), BASES)
        for name in ("width", "height", "depth"):
            length, endless = getattr(self, name), name == "depth" and self.kind == "slab"
            if not (length > 0 and (isfinite(length) or (endless and length == inf))):
                raise ValueError(f"body {name} = {1e3 * length} mm must be finite and above 0")
        if self.kind != "none" and self.base == self.sides == "free":
            raise ValueError("a body with free base and free sides flies away; clamp one of them")

    @property
    def solid(self) -> Material:
        """The material itself."""
        return PRESETS[self.material] if isinstance(self.material, str) else self.material


BODIES = {
    "none": Body(kind="none"),
    # 80 g/m2 office paper in a frame.
    "paper-sheet": Body(kind="sheet", material="paper", depth=1e-4, base="free", sides="clamped"),
    # Effective soft tissue of the palm on bone.
    "skin-slab": Body(),
}
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
        if self.body.kind == "none":
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
