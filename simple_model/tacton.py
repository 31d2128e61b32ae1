"""The commanded signal, equation 1 of Lim, Seifi and Park, CHI EA '24:

    p(t) = A U(t) {w1 M1(t) + w2 M2(t)} E(t)

with the carrier U at 40 kHz, AM sinusoids M = sin(2 pi f_AM t) and the envelope
E = sin(2 pi f_e t). A frequency of 0 means a factor of exactly 1.
"""

from dataclasses import dataclass, field
from math import isfinite

import numpy as np
from numpy.typing import ArrayLike

from simple_model.trajectory import Floats, Trajectory

CARRIER = 40e3  # Hz
LONGEST = 10.0  # s
SUPERPOSITIONS = ((1.0, 0.0), (0.75, 0.25), (0.5, 0.5), (0.25, 0.75), (0.0, 1.0))


@dataclass(frozen=True, kw_only=True)
class Tacton:
    """A mid-air tactile pattern of one focus.

    Parameters
    ----------
    amplitude : float, 0..1, of the device's full drive
    am_frequency, second_am_frequency : float, Hz, 0 = off
    superposition : (w1, w2), weights >= 0 of the two AM sinusoids, sum 1
    envelope_frequency : float, Hz, 0 = constant
    duration : float, s, above 0 and at most 10
    trajectory : Trajectory

    Raises
    ------
    ValueError
        If a value is not finite or out of range.
    """

    amplitude: float = 1.0
    am_frequency: float = 0.0
    second_am_frequency: float = 0.0
    superposition: tuple[float, float] = (1.0, 0.0)
    envelope_frequency: float = 0.0
    duration: float = 1.0
    trajectory: Trajectory = field(default_factory=Trajectory)

    def __post_init__(self) -> None:
        if not (isfinite(self.amplitude) and 0 <= self.amplitude <= 1):
            raise ValueError(
                f"amplitude = {100 * self.amplitude:g} % is outside 0..100 %; 100 % is full drive"
            )
        for name in ("am_frequency", "second_am_frequency", "envelope_frequency"):
            value = getattr(self, name)
            if not (isfinite(value) and 0 <= value <= CARRIER / 2):
                raise ValueError(
                    f"{name} = {value} Hz is outside 0..{CARRIER / 2:g} Hz, half the carrier; "
                    "0 switches it off"
                )
        if not (isfinite(self.duration) and 0 < self.duration <= LONGEST):
            raise ValueError(
                f"duration = {self.duration} s is outside 0 < duration <= {LONGEST:g} s, "
                "the longest Tacton; shorten it"
            )
        if not (drawn := self.trajectory.drawing_frequency) <= CARRIER / 2:
            raise ValueError(
                f"the path is drawn {drawn:.3g} times a second, more than {CARRIER / 2:g} Hz, "
                "half the carrier; make it longer or slower"
            )
        w1, w2 = self.superposition
        if not (w1 >= 0 and w2 >= 0 and abs(w1 + w2 - 1) <= 1e-9):
            raise ValueError(
                f"superposition = [{w1}, {w2}] must be two weights of 0 or above with sum 1, "
                "such as [0.75, 0.25]"
            )


def modulation(tacton: Tacton, t: ArrayLike) -> Floats:
    """{w1 M1 + w2 M2} E at times (...) in s: what the carrier is multiplied by, -1..1."""
    t = np.asarray(t, np.float64)
    return modulation_at_phases(tacton, *(2 * np.pi * f * t for f in tones(tacton)))


def modulation_at_phases(tacton: Tacton, first: Floats, second: Floats, envelope: Floats) -> Floats:
    """The modulation (...) where its three sinusoids have these phases (...) in rad."""
    w1, w2 = tacton.superposition
    m1, m2, e = (
        np.sin(phase) if f > 0 else np.ones_like(phase)
        for f, phase in zip(tones(tacton), (first, second, envelope), strict=True)
    )
    return (w1 * m1 + w2 * m2) * e


def tones(tacton: Tacton) -> tuple[float, float, float]:
    """Frequencies in Hz of the two AM sinusoids and the envelope; 0 where one is off."""
    return tacton.am_frequency, tacton.second_am_frequency, tacton.envelope_frequency


def commanded(tacton: Tacton, t: ArrayLike) -> Floats:
    """p(t) of equation 1 at times (...) in s, carrier included, as a fraction of full drive."""
    carrier = np.sin(2 * np.pi * CARRIER * np.asarray(t, np.float64))
    return tacton.amplitude * carrier * modulation(tacton, t)
