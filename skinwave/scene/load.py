"""How a scene's load acts: as a pressure, as a shear traction, or as the force of a contact.

A Tacton says where and when, by q(x, t) at the surface; a kind of load says what q is, and in which
direction it acts on a surface of normal n. Beside it there may be gravity, which is static, and a
support that moves: all that a body is clamped to, or rests on springs on, has one translation

    u_c(t) = direction amplitude sin(2 pi f t),   t >= 0

With u = w + u_c everywhere, w is the motion seen from the support. A rigid translation strains
nothing, so that A(s) w = -s^2 M u_c, the load of an inertial force.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import hypot, isfinite, pi
from typing import Any

import numpy as np

from simple_model import MovingPressure
from simple_model.choices import choose
from simple_model.load.focus import NOMINAL_HEIGHT, ContactSpot
from skinwave.typing import Floats

ALONG_PATH = "path"
STRONGEST = 30.0  # m/s2 of gravity: three times that of the earth
LARGEST = 0.01  # m, amplitude of a support: strains are small
HIGHEST = 1000.0  # Hz of a support, up to which reduced bodies meet their tolerance


@dataclass(frozen=True, kw_only=True)
class SupportMotion:
    """Harmonic translation of a support, a sine from rest.

    Parameters
    ----------
    amplitude : float, metre, at most 0.01
    frequency : float, Hz, at most 1000
    direction : (x, y, z) of any length, z upwards

    Raises
    ------
    ValueError
        If a value is not finite or out of range.
    """

    amplitude: float
    frequency: float
    direction: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        if not 0 < self.amplitude <= LARGEST:
            raise ValueError(
                f"amplitude = {1e6 * self.amplitude:g} um of a support must be above 0 and at most "
                f"{1e6 * LARGEST:g} um; give amplitude_um"
            )
        if not 0 < self.frequency <= HIGHEST:
            raise ValueError(
                f"frequency = {self.frequency:g} Hz of a support must be above 0 and at most "
                f"{HIGHEST:g} Hz; give frequency_hz"
            )
        _check_direction(self.direction, 3, "a support")

    @property
    def unit(self) -> tuple[float, ...]:
        """Unit vector of the direction."""
        return tuple(x / hypot(*self.direction) for x in self.direction)

    @property
    def line(self) -> complex:
        """Amplitude a in metre of the motion Re a exp(2 pi i f t)."""
        return -1j * self.amplitude

    @property
    def speed(self) -> float:
        """Speed in m/s that it starts with."""
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
            f"{_shown(self.direction)}"
        )


@dataclass(frozen=True, kw_only=True)
class Load:
    """How the Tacton's load acts.

    Parameters
    ----------
    kind : the name of one of `LOADS`
    direction : of a shear traction (x, y) of any length, or "path", along the path of the focus; of
        a force (x, y, z), z upwards; () for that of its kind
    force : float, N, of a contact at full drive
    width : float, metre, standard deviation of a contact's Gaussian traction; 0 for 2 mm
    gravity : float, m/s2, downwards; it deflects the body before the load begins
    support_motion : SupportMotion, of all that the body is clamped to or rests on; or None

    Raises
    ------
    ValueError
        If a value is unknown, not finite or out of range, or its kind has none of that name.
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
                raise ValueError(f"a load of kind '{self.kind}' has no {name}; leave it out")
        if not abs(self.gravity) <= STRONGEST:
            raise ValueError(
                f"gravity = {self.gravity} m/s2 must be a number within {STRONGEST:g} of 0"
            )
        kind.check(self)

    @property
    def of_kind(self) -> LoadKind:
        """The record of its kind."""
        return LOADS[choose("load kind", self.kind, LOADS)]

    @property
    def is_plain(self) -> bool:
        """Whether it is the pressure of the focus and nothing else."""
        return self == PRESSURE

    @property
    def is_normal(self) -> bool:
        """Whether what moves is normal to a flat surface, as a pressure is."""
        return not self.moving.tractions(np.array([[0.0, 0.0, 1.0]]))[..., :2].any()

    @property
    def moving(self) -> Load:
        """The same without gravity."""
        return replace(self, gravity=0.0)

    @property
    def words(self) -> str:
        """Its kind, its direction, gravity and the motion of the support, in a few words."""
        gravity = f" and gravity of {self.gravity:g} m/s2" if self.gravity else ""
        moved = f" and {self.support_motion.words}" if self.support_motion else ""
        return f"{self.of_kind.words(self)}{gravity}{moved}"

    def pressures(self, pressure: MovingPressure) -> tuple[MovingPressure, ...]:
        """Its components (c,), each a moving scalar load."""
        return self.of_kind.pressures(self, pressure)

    def tractions(self, normals: Floats) -> Floats:
        """Traction vectors (c, n, 3) of its components, per unit of each, at points of a surface
        that faces the device, of unit normals (n, 3).
        """
        return self.of_kind.tractions(self, normals)


@dataclass(frozen=True, kw_only=True, eq=False)
class LoadKind:
    """Kind of load: a load in `words`; the attributes of `Load` that it has beside gravity, with
    their `defaults`; what it may not be, `check`; and the Tacton's pressure as the scalar load that
    is `acting`, with the `pressures` and `tractions` of `Load`.
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
        """Whether the device makes it, so that a scene has the focus of one."""
        return "force" not in self.defaults


def _facing(normals: Floats) -> Floats:
    """Cosines (n, 1) between normals and the direction to the device: area across the beam."""
    return np.maximum(normals[:, 2:], 0.0)


def _pushing(load: Load, normals: Floats) -> Floats:
    """Radiation pressure, which goes with the square of the cosine of incidence: once for the beam
    that is spread over a sloping surface, once for the momentum that is reflected along its normal.
    """
    return (-normals * _facing(normals) ** 2)[None]


def _dragging(load: Load, normals: Floats) -> Floats:
    """Tangential part of the direction; of the path, of both axes."""
    along = np.eye(3)[:2] if load.direction == ALONG_PATH else _unit((*load.direction, 0.0))[None]
    normal = np.einsum("ci,ni->cn", along, normals)[..., None] * normals
    return (along[:, None] - normal) * _facing(normals)


def _unit(direction: Any) -> Floats:
    way = np.array(direction, np.float64)
    return np.asarray(way / np.linalg.norm(way), np.float64)


def _along(load: Load, pressure: MovingPressure) -> tuple[MovingPressure, ...]:
    if load.direction != ALONG_PATH:
        return (pressure,)
    return tuple(replace(pressure, heading=axis) for axis in "xy")


def _contact(load: Load, pressure: MovingPressure) -> MovingPressure:
    """Traction of a contact, whose force is the commanded signal itself."""
    return replace(
        pressure, profile=ContactSpot(width=load.width), drive="linear", height=NOMINAL_HEIGHT,
        depth_of_modulation=1.0, peak_pressure=load.force / (2 * pi * load.width**2),
    )  # fmt: skip


def _check_direction(way: Any, axes: int, what: str, instead: str = "") -> None:
    if isinstance(way, str) or len(way) != axes or not (isfinite(sum(way)) and hypot(*way) > 0):
        raise ValueError(
            f"direction = {way!r} of {what} must be {axes} finite numbers, not all 0{instead}"
        )


def _check_shear(load: Load) -> None:
    if load.direction != ALONG_PATH:
        _check_direction(load.direction, 2, "a load of kind 'shear'", ", or path")


def _check_contact(load: Load) -> None:
    if not (isfinite(load.force) and load.force > 0):
        raise ValueError(
            f"force = {load.force} N of a load of kind '{load.kind}' must be a finite number above "
            "0; give force_n"
        )
    ContactSpot(width=load.width)
    _check_direction(load.direction, 3, "a load of kind 'point_force'")


def _contact_in_words(load: Load) -> str:
    return (
        f"a force of {load.force:g} N along {_shown(load.direction)} over a contact of "
        f"{1e3 * load.width:g} mm"
    )


def _shown(direction: Any) -> str:
    if direction == ALONG_PATH:
        return "the path"
    return f"({', '.join(f'{x:g}' for x in direction)})"


LOADS = {
    "pressure": LoadKind(words=lambda load: "pressure", defaults={}, tractions=_pushing),
    "shear": LoadKind(
        words=lambda load: f"a shear traction along {_shown(load.direction)}",
        defaults={"direction": (1.0, 0.0)}, tractions=_dragging, check=_check_shear,
        pressures=_along,
    ),
    "point_force": LoadKind(
        words=_contact_in_words,
        defaults={"direction": (0.0, 0.0, -1.0), "force": 0.0, "width": 2e-3},
        tractions=lambda load, normals: (_unit(load.direction) * _facing(normals))[None],
        check=_check_contact, acting=_contact,
    ),
}  # fmt: skip
PRESSURE = Load()
