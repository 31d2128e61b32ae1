"""Prescribed motion of all that a body is clamped to, or rests on springs on: one translation

    u_c(t) = direction amplitude sin(2 pi f t),   t >= 0

With u = w + u_c everywhere, w is the motion seen from the support. A rigid translation strains
nothing, so that A(s) w = -s^2 M u_c, the load of an inertial force.
"""

from dataclasses import dataclass
from math import hypot, isfinite, pi

LARGEST = 0.01  # m: strains are small
HIGHEST = 1000.0  # Hz up to which reduced bodies meet their tolerance


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
        way = self.direction
        if len(way) != 3 or not (isfinite(sum(way)) and hypot(*way) > 0):
            raise ValueError(
                f"direction = {way!r} of a support must be three finite numbers, not all 0"
            )

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
        way = ", ".join(f"{x:g}" for x in self.direction)
        return (
            f"a support that moves by {1e6 * self.amplitude:g} um at {self.frequency:g} Hz along "
            f"({way})"
        )
