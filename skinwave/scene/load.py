"""Load of a scene: a pressure, a shear traction, or the force of a contact.

A Tacton defines q(x, t) at the surface. The kind of load defines the meaning of q, and its
direction on a surface with normal n. Static gravity may be added. The support, which is everything
that clamps the body or carries its springs, may move in one translation

    u_c(t) = direction amplitude sin(2 pi f t),   t >= 0

With u = w + u_c everywhere, w is the motion relative to the support. A rigid translation causes no
strain, so that A(s) w = -s^2 M u_c, an inertial force.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import hypot, isfinite, pi
from typing import Any

import numpy as np

from simple_model import MovingPressure
from simple_model.choices import check_numbers, check_range, choose
from simple_model.load.focus import NOMINAL_HEIGHT, ContactSpot
from skinwave.typing import Floats


@dataclass(frozen=True, kw_only=True)
class SupportMotion:
    """Harmonic translation of a support: a sine that starts at t = 0.

    Parameters
    ----------
    amplitude : float, m, at most 0.01
    frequency : float, Hz, at most 1000
    direction : (x, y, z) of any length, z upwards

    Raises a ValueError if a value is out of range.
    """

    amplitude: float
    frequency: float
    direction: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        check_numbers("a support", self, "amplitude", "frequency")
        check_range("amplitude_um", 1e6 * self.amplitude, 0, 1e4)  # for small strains
        # Reduced bodies meet their tolerance up to 1000 Hz.
        check_range("frequency_hz", self.frequency, 0, 1000.0)
        _check_direction(self.direction, 3, "a support")

    @property
    def unit(self) -> tuple[float, ...]:
        """Unit vector of the direction."""
        return tuple(x / hypot(*self.direction) for x in self.direction)

    @property
    def line(self) -> complex:
        """Amplitude a in m of the motion Re a exp(2 pi i f t)."""
        return -1j * self.amplitude

    @property
    def speed(self) -> float:
        """Initial speed in m/s."""
        return 2 * pi * self.frequency * self.amplitude

    @property
    def acceleration(self) -> complex:
        """Amplitude of the acceleration, m/s2."""
        return -((2 * pi * self.frequency) ** 2) * self.line

    @property
    def words(self) -> str:
        """The motion in a few words."""
        return (
            f"a support that moves by {1e6 * self.amplitude:g} um at {self.frequency:g} Hz along "
            f"{_direction_text(self.direction)}"
        )


@dataclass(frozen=True, kw_only=True)
class Load:
    """Kind and direction of the load of a Tacton.

    Parameters
    ----------
    kind : one of `LOADS`
    direction : of a shear traction (x, y) of any length, or "path" for that of the focus; of a
        force (x, y, z), z upwards; () for the default of the kind
    force : float, N, of a contact at full drive
    width : float, m, standard deviation of the Gaussian traction of a contact; 0 for 2 mm
    gravity : float, m/s2, downwards; it deflects the body before the load begins
    support_motion : SupportMotion, or None

    Raises a ValueError if a value is unknown or out of range, or does not apply to the kind.

    >>> Load(kind="shear").words
    'a shear traction along (1, 0)'
    """

    kind: str = "pressure"
    direction: str | tuple[float, ...] = ()
    force: float = 0.0
    width: float = 0.0
    gravity: float = 0.0
    support_motion: SupportMotion | None = None

    def __post_init__(self) -> None:
        kind = self.of_kind
        for name in ("direction", "force", "width"):
            if not getattr(self, name) and name in kind.defaults:
                object.__setattr__(self, name, kind.defaults[name])
            elif getattr(self, name) and name not in kind.defaults:
                raise ValueError(f"a load of kind '{self.kind}' does not take {name}; remove it")
        strongest = 30.0  # three times that of the earth
        check_range("gravity", self.gravity, -strongest, strongest, " m/s2")
        kind.check(self)

    @property
    def of_kind(self) -> LoadKind:
        """The record of its kind."""
        return LOADS[choose("load kind", self.kind, LOADS)]

    @property
    def is_plain(self) -> bool:
        """Whether it is the pressure of the focus alone."""
        return self == PRESSURE

    @property
    def is_normal(self) -> bool:
        """Whether the moving load is normal to a flat surface, like a pressure."""
        return not self.moving.tractions(np.array([[0.0, 0.0, 1.0]]))[..., :2].any()

    @property
    def moving(self) -> Load:
        """The same load without gravity."""
        return replace(self, gravity=0.0)

    @property
    def words(self) -> str:
        """Kind, direction, gravity and support motion in a few words."""
        gravity = f" and gravity of {self.gravity:g} m/s2" if self.gravity else ""
        moved = f" and {self.support_motion.words}" if self.support_motion else ""
        return f"{self.of_kind.words(self)}{gravity}{moved}"

    def pressures(self, pressure: MovingPressure) -> tuple[MovingPressure, ...]:
        """Return its components (c,), each a moving scalar load."""
        return self.of_kind.pressures(self, pressure)

    def tractions(self, normals: Floats) -> Floats:
        """Return traction vectors (c, n, 3) of its components, per unit of each.

        They act at points of a surface that faces the device, with unit normals (n, 3).
        """
        return self.of_kind.tractions(self, normals)


@dataclass(frozen=True, kw_only=True, eq=False)
class LoadKind:
    """Kind of load: its `words`, the `defaults` of its attributes, and its `check`.

    `acting` turns the Tacton's pressure into the scalar load of this kind; `pressures` and
    `tractions` are those of `Load`.
    """

    words: Callable[[Load], str]
    defaults: dict[str, Any]
    tractions: Callable[[Load, Floats], Floats]
    check: Callable[[Load], object] = lambda load: None
    acting: Callable[[Load, MovingPressure], MovingPressure] = lambda load, pressure: pressure
    pressures: Callable[[Load, MovingPressure], tuple[MovingPressure, ...]] = (
        lambda load, pressure: (pressure,)
    )

    @property
    def is_of_device(self) -> bool:
        """Whether the device produces it, so that a scene has [focus]."""
        return "force" not in self.defaults


def _facing(normals: Floats) -> Floats:
    """Cosines (n, 1) between normals and the direction to the device: area across the beam."""
    return np.maximum(normals[:, 2:], 0.0)


def _pressure_tractions(load: Load, normals: Floats) -> Floats:
    """Radiation pressure, which scales with the squared cosine of incidence.

    A sloping surface spreads the beam, and reflects momentum along its normal.
    """
    return (-normals * _facing(normals) ** 2)[None]


def _shear_tractions(load: Load, normals: Floats) -> Floats:
    """Tangential part of the direction, or of both axes for the path."""
    along = np.eye(3)[:2] if load.direction == "path" else _unit((*load.direction, 0.0))[None]
    normal = np.einsum("ci,ni->cn", along, normals)[..., None] * normals
    return (along[:, None] - normal) * _facing(normals)


def _unit(direction: Any) -> Floats:
    vector = np.array(direction, np.float64)
    return np.asarray(vector / np.linalg.norm(vector), np.float64)


def _shear_pressures(load: Load, pressure: MovingPressure) -> tuple[MovingPressure, ...]:
    if load.direction != "path":
        return (pressure,)
    return tuple(replace(pressure, heading=axis) for axis in "xy")


def _contact_pressure(load: Load, pressure: MovingPressure) -> MovingPressure:
    """Traction of a contact, whose force follows the commanded signal."""
    return replace(
        pressure, profile=ContactSpot(width=load.width), drive="linear", height=NOMINAL_HEIGHT,
        depth_of_modulation=1.0, peak_pressure=load.force / (2 * pi * load.width**2),
    )  # fmt: skip


def _check_direction(direction: Any, axes: int, what: str, instead: str = "") -> None:
    is_wrong = isinstance(direction, str) or len(direction) != axes
    if is_wrong or not (isfinite(sum(direction)) and hypot(*direction) > 0):
        raise ValueError(
            f"direction = {direction!r} of {what} must be {axes} finite numbers, not all 0{instead}"
        )


def _check_shear(load: Load) -> None:
    if load.direction != "path":
        _check_direction(load.direction, 2, "a load of kind 'shear'", ', or "path"')


def _check_contact(load: Load) -> None:
    check_numbers(f"a load of kind '{load.kind}'", load, "force")
    ContactSpot(width=load.width)
    _check_direction(load.direction, 3, "a load of kind 'point_force'")


def _contact_words(load: Load) -> str:
    return (
        f"a force of {load.force:g} N along {_direction_text(load.direction)} over a contact of "
        f"{1e3 * load.width:g} mm"
    )


def _direction_text(direction: Any) -> str:
    if direction == "path":
        return "the path"
    return f"({', '.join(f'{x:g}' for x in direction)})"


LOADS = {
    "pressure": LoadKind(words=lambda load: "pressure", defaults={}, tractions=_pressure_tractions),
    "shear": LoadKind(
        words=lambda load: f"a shear traction along {_direction_text(load.direction)}",
        defaults={"direction": (1.0, 0.0)}, tractions=_shear_tractions, check=_check_shear,
        pressures=_shear_pressures,
    ),
    "point_force": LoadKind(
        words=_contact_words,
        defaults={"direction": (0.0, 0.0, -1.0), "force": 0.0, "width": 2e-3},
        tractions=lambda load, normals: (_unit(load.direction) * _facing(normals))[None],
        check=_check_contact, acting=_contact_pressure,
    ),
}  # fmt: skip
PRESSURE = Load()
