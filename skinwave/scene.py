"""A scene: what is commanded, what it acts on, where it is probed. Physics only, one TOML file."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simple_model import MovingPressure, Tacton
from skinwave.bodies import (
    BODIES,
    FLAT,
    KINDS,
    Body,
    Layer,
    Placement,
    Relief,
    body_name,
    kind_of,
    solid_of,
)

__all__ = [
    "BODIES", "FLAT", "KINDS", "PROBES", "SAMPLE_RATE",
    "Body", "Layer", "Placement", "Relief", "Scene",
    "body_name", "kind_of", "solid_of", "with_body",
]  # fmt: skip

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
        if not self.body.of_kind.is_bounded:
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
