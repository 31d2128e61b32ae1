"""A scene: the load, the body and the probes of an experiment. It is stored as one TOML file."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from simple_model import MovingPressure, Tacton
from simple_model.load.line_names import during_pulses
from simple_model.quantities import DISPLACEMENT, STRAIN, Quantity, quantity
from skinwave.bodies import (
    BODIES,
    FLAT,
    KINDS,
    Body,
    Layer,
    Mounting,
    Phalanx,
    Placement,
    Relief,
    Sides,
    body_name,
    kind_of,
    solid_of,
)
from skinwave.scene.distributions import Distribution
from skinwave.scene.load import PRESSURE, Load
from skinwave.system.drawing import call_report
from skinwave.typing import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = [
    "BODIES", "FLAT", "KINDS", "PROBES", "SAMPLE_RATE", "STILL", "SURFACE",
    "Body", "Layer", "Load", "Mounting", "Phalanx", "Placement", "Reading", "Relief", "Scene",
    "Sides",
    "body_name", "check_motion", "default_probes", "kind_of", "solid_of", "with_body",
    "without_tacton",
]  # fmt: skip

SAMPLE_RATE = 10_000.0  # Hz of every response: five times the highest relevant line
MOST_VALUES = 50_000_000  # of all waveforms of one response, 400 MB
STILL = MovingPressure(tacton=Tacton())
PROBES = ((0.0, 0.0), (0.005, 0.0), (0.010, 0.0), (0.015, 0.0), (0.020, 0.0))


@dataclass(frozen=True, kw_only=True)
class Reading:
    """Name of the quantity that probes read, and their depths in m; () at the surface."""

    quantity: str = DISPLACEMENT.name
    depths: tuple[float, ...] = ()

    @property
    def record(self) -> Quantity:
        """The record of the quantity."""
        return quantity(self.quantity)

    @property
    def is_on_surface(self) -> bool:
        """Whether all probes are at the surface."""
        return not any(self.depths)

    @property
    def is_plain(self) -> bool:
        """Whether the probes read the normal displacement at the surface."""
        return self.record is DISPLACEMENT and self.is_on_surface

    @property
    def words(self) -> str:
        """Quantity and depth in a few words."""
        if self.is_on_surface:
            return self.record.words
        shown = sorted({f"{1e3 * z:g}" for z in self.depths}, key=float)
        return f"{self.record.words} at a depth of {', '.join(shown)} mm"


SURFACE = Reading()


@dataclass(frozen=True, kw_only=True)
class Scene:
    """One experiment.

    Parameters
    ----------
    name : str
    pressure : MovingPressure, with the Tacton; for a load without a device, that of the load
    body : Body
    probes : (p, 2) float, m, positions on the surface; by default those of `default_probes`
    depth : float or (p,) float, m, of the probes below the surface, along its normal
    load : Load, its kind and gravity
    quantity : str, what probes read, a name in `simple_model.quantities.QUANTITIES`
    spreads : (dotted key of a scene file, Distribution about the scene's value) of uncertain
        numbers. `skinwave.scene.spreads` adds those of presets and of the device.

    Raises a ValueError if a probe or the path of the focus lies outside the body, or if the body
    does not have the quantity or depth.

    >>> from simple_model import MovingPressure, Tacton
    >>> scene = Scene(pressure=MovingPressure(tacton=Tacton(am_frequency=140)), body=BODIES["palm"])
    >>> scene.probe_points.shape, scene.reading.words
    ((5, 2), 'displacement into the body')
    """

    name: str = "scene"
    pressure: MovingPressure
    body: Body
    probes: tuple[tuple[float, float], ...] = ()
    depth: float | tuple[float, ...] = 0.0
    quantity: str = DISPLACEMENT.name
    load: Load = PRESSURE
    spreads: tuple[tuple[str, Distribution], ...] = ()

    def __post_init__(self) -> None:
        acting = self.load.of_kind.acting(self.load, self.pressure)
        object.__setattr__(self, "pressure", acting)
        if not len(self.probes):
            object.__setattr__(self, "probes", default_probes(self.body))
        self._check_probes()
        self._check_load()
        _check_reading(self.body, self.reading)
        if self.body.of_kind.is_bounded:
            self._check_extent()

    def _check_probes(self) -> None:
        if (values := len(self.probes) * self.tacton.duration * SAMPLE_RATE) > MOST_VALUES:
            raise ValueError(
                f"{len(self.probes):,} probes for {self.tacton.duration:g} s give {values:,.0f} "
                f"values, more than the limit of {MOST_VALUES:,}; use fewer probes or a shorter "
                "Tacton"
            )
        if isinstance(self.depth, tuple) and len(self.depth) != len(self.probes):
            raise ValueError(
                f"depth_mm has {len(self.depth)} values for {len(self.probes)} probes; give one "
                "for all or one for each"
            )
        if not (np.isfinite(self.depths).all() and min(self.depths) >= 0):
            raise ValueError(f"depth_mm = {1e3 * np.array(self.depth)} must be finite, 0 or above")

    def _check_load(self) -> None:
        _ = self.loads  # raises an error if a path has no direction
        body, load = self.body, self.load
        if body.of_kind.is_plate and not load.is_normal:
            raise ValueError(
                f"a {body.kind} needs a load normal to it, not {load.words}; use a slab"
            )
        carries = body.is_held and not body.is_on_half_space  # a half-space sags without bound
        if load.gravity and body.of_kind.discretise and not carries:
            raise ValueError("an unconstrained body falls under gravity; clamp its base")
        if (motion := load.support_motion) is None:
            return
        if not body.of_kind.discretise or body.of_kind.is_plate:
            raise ValueError(
                f"{motion.words} needs a solid, not a body of kind '{body.kind}'; use a slab"
            )
        if not body.is_held:
            raise ValueError(f"{motion.words} does not move an unconstrained body; clamp its base")
        if "absorbing" in (body.base, *body.conditions):
            key = "base" if body.base == "absorbing" else "sides"
            raise ValueError(
                f'{motion.words} is not possible with {key} = "absorbing", because the tissue '
                f'beyond is at rest; use {key} = "clamped"'
            )

    def _check_extent(self) -> None:
        half = np.array([self.body.width, self.body.height]) / 2
        for x, y in self.probes:
            if abs(x) > half[0] or abs(y) > half[1]:
                raise ValueError(
                    f"probe ({1e3 * x:g}, {1e3 * y:g}) mm lies outside the body. Move it inside "
                    f"x = ±{1e3 * half[0]:g} mm, y = ±{1e3 * half[1]:g} mm"
                )
        path = self.tacton.trajectory.outline
        if (reach := np.abs(path).max(axis=0) - half).max() > 1e-12:
            axis = int(np.argmax(reach))
            raise ValueError(
                f"the focus path reaches {1e3 * (reach + half)[axis]:g} mm along {'xy'[axis]}, "
                f"outside the body, which ends at ±{1e3 * half[axis]:g} mm; shrink the path (of "
                "a file: skinwave convert --resize) or widen the body"
            )

    @property
    def tacton(self) -> Tacton:
        """The Tacton of the pressure."""
        return self.pressure.tacton

    @property
    def loads(self) -> tuple[MovingPressure, ...]:
        """Components (c,) of the load, each a moving scalar in the direction of its kind."""
        return self.load.pressures(self.pressure)

    @property
    def files(self) -> tuple[str, ...]:
        """Files of its body and its focus."""
        return tuple(filter(None, (self.body.file, getattr(self.pressure.profile, "file", ""))))

    @property
    def during_pulses(self) -> Scene:
        """The scene while a pulse of its rhythm is on; see `line_names.during_pulses`."""
        steady = during_pulses(self.pressure)
        return self if steady is self.pressure else replace(self, pressure=steady)

    @property
    def probe_points(self) -> Floats:
        """Probes as an array (p, 2) in m."""
        return np.array(self.probes)

    @property
    def depths(self) -> tuple[float, ...]:
        """Depth in m of each probe."""
        one = not isinstance(self.depth, tuple)
        return (self.depth,) * len(self.probes) if one else self.depth  # type: ignore[return-value]

    @property
    def reading(self) -> Reading:
        """Quantity and depths of the probes."""
        return Reading(quantity=self.quantity, depths=self.depths if any(self.depths) else ())

    def plot(self, *, ax: Axes | None = None) -> Axes:
        """Draw the body, path, initial foci and probes from above, and return the axes."""
        return call_report("notebook", "draw_scene", self, ax)

    def __repr__(self) -> str:
        return call_report("notebook", "scene_line", self)

    def _repr_html_(self) -> str:
        return call_report("notebook", "scene_page", self)


def default_probes(body: Body) -> tuple[tuple[float, float], ...]:
    """Return the probes in m of a scene that gives none.

    They are `PROBES`, or closer ones on a body too narrow for these. The width of a body in a file
    is unknown here, so it gets `PROBES`.
    """
    half, furthest = body.width / 2, PROBES[-1][0]
    if not body.of_kind.is_bounded or half > furthest:
        return PROBES
    outermost = 0.75  # of half the width, where the surface is not yet too steep
    step = float(f"{outermost * half / (len(PROBES) - 1):.2g}")
    return tuple((round(k * step, 9), 0.0) for k in range(len(PROBES)))


def _check_reading(body: Body, reading: Reading) -> None:
    """Raise a ValueError for a quantity or depth that a body does not have."""
    quantity, is_plate = reading.record, body.of_kind.is_plate
    deepest = max(reading.depths, default=0.0)
    if not quantity.of_body:
        raise ValueError(f"quantity '{quantity.name}' does not apply to a body; remove it")
    is_outside = deepest > body.depth if is_plate else deepest >= body.depth
    if is_outside and (is_plate or body.of_kind.is_layer):
        raise ValueError(
            f"depth_mm = {1e3 * deepest:g} of a probe lies outside the body, which is "
            f"{1e3 * body.depth:g} mm thick; use a smaller depth"
        )
    if quantity.is_normal or not is_plate:
        return
    if body.mounting.is_curled or body.placement.is_tilted:
        raise ValueError(
            f"{quantity.words} is computed only for a flat {body.kind} across the beam; remove "
            "its curl or tilt"
        )
    if quantity.field == STRAIN and body.solid.orthotropy is not None:
        raise ValueError(
            f"{quantity.words} of an orthotropic {body.kind} depends on moduli across its "
            "thickness, which are unknown; use an isotropic material"
        )


def check_motion(scene: Scene, command: str) -> None:
    """Raise a ValueError if a command needs the surface displacement under a pressure."""
    check_load(scene, command)
    if not scene.reading.is_plain:
        raise ValueError(
            f"{command} computes the displacement of the surface, not {scene.reading.words}; "
            "remove depth_mm and quantity, or use skinwave run, compare, report, film or sweep"
        )


def check_load(scene: Scene, command: str) -> None:
    """Raise a ValueError if a command needs the pressure of a focus."""
    if not scene.load.is_plain:
        raise ValueError(
            f"{command} needs the pressure of a focus, not {scene.load.words}; remove [load], or "
            "use skinwave run or sweep"
        )


def without_tacton(scene: Scene) -> Scene:
    """Return the scene under a pressure at rest: what the reduction of its body depends on."""
    return replace(scene, name="", pressure=STILL, spreads=())


def with_body(scene: Scene, body: Body, **pressure: Any) -> Scene:
    """Return the scene on another body, with optional changes to the pressure."""
    return replace(scene, body=body, pressure=replace(scene.pressure, **pressure))
