"""Drive laws: from a commanded amplitude to the radiation pressure on the surface.

A is the amplitude (0..1), which may vary in time, M the modulation (-1..1), m the depth of
modulation (0..1). Without modulation M = 1, and every law gives its full value, 1 at A = 1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from simple_model.typing import Floats

PUBLISHED = "linear"  # of the point kernel of Lim, Seifi and Park
EXACT = 1e-9  # relative misfit within which a law is what it is said to be


@dataclass(frozen=True, kw_only=True)
class DriveLaw:
    """Drive law: pressure from amplitude, modulation and depth of modulation.

    Parameters
    ----------
    name : str, of messages, pages and, if it is registered in `DRIVES`, scene files
    pressure : amplitude (...), modulation (...), depth -> pressure (...) over that at full drive
    degree : int, of a polynomial in the modulation; None if it is no polynomial
    words, note : str, a few words for a choice on a page, and a sentence about its lines of AM

    Raises a ValueError if it is no polynomial of its degree in the modulation.
    """

    name: str
    pressure: Callable[[Floats | float, Floats, float], Floats]
    degree: int | None = None
    words: str = ""
    note: str = ""

    def __post_init__(self) -> None:
        if self.degree is None:
            return
        for depth in (0.5, 1.0):
            M = np.cos(np.linspace(0, np.pi, 4 * self.degree + 9))
            found = self(1.0, M, depth)
            misfit = found - np.polynomial.Polynomial.fit(M, found, self.degree)(M)
            if np.abs(misfit).max() > EXACT * max(1.0, np.abs(found).max()):
                raise ValueError(
                    f"drive law '{self.name}' is no polynomial of degree {self.degree} in the "
                    "modulation; give it its degree, or None"
                )

    def __str__(self) -> str:
        return self.name

    def __call__(self, amplitude: Floats | float, modulation: Floats, depth: float) -> Floats:
        """Pressure (...) over that at full drive."""
        return np.asarray(self.pressure(amplitude, modulation, depth))

    @property
    def uses_depth(self) -> bool:
        """Whether the depth of modulation changes the pressure."""
        M = np.linspace(-1, 1, 9)
        return not np.allclose(self(1.0, M, 0.25), self(1.0, M, 1.0))

    def level_factor(self, level: Floats, depth: float) -> Floats:
        """Factor (...) on the pressure of a level (...) of the amplitude."""
        one = np.ones(1)
        return np.asarray(self(level, one, depth) / self(1.0, one, depth))

    def is_product(self, amplitude: float, depth: float) -> bool:
        """Whether a level of the amplitude is a factor of the pressure, whatever the modulation."""
        level, M = np.meshgrid(np.linspace(0, 1, 9), np.linspace(-1, 1, 9))
        both = self(amplitude * level, M, depth)
        factors = self.level_factor(level, depth) * self(amplitude * np.ones_like(M), M, depth)
        return bool(np.abs(both - factors).max() <= EXACT * np.abs(both).max())


DRIVES = {
    law.name: law
    for law in (
        # Pressure is the commanded signal itself, with its sign (Lim et al.).
        DriveLaw(
            name="linear", degree=1, pressure=lambda A, M, m: A * M,
            words="the signal itself, as published",
        ),
        # Sound pressure is modulated, and radiation pressure is its square: traditional AM (US
        # 11704983 B2), with a line at twice the AM frequency.
        DriveLaw(
            name="pressure_squared", degree=2,
            pressure=lambda A, M, m: (A * (1 + m * M) / (1 + m)) ** 2, words="usual AM",
            note="Lines at 2 f_AM and, in AM+STM, at n f_d come from the drive law, not from "
            "propagation: a device that modulates its sound pressure pushes with the square of "
            "that pressure. The point kernel under the same load has them, too.",
        ),
        # The device takes the square root first, so that pressure follows M.
        DriveLaw(
            name="force_corrected", degree=1,
            pressure=lambda A, M, m: A * (1 + m * M) / (1 + m), words="square root first",
        ),
    )
}  # fmt: skip


def usual_drive(drive: str | DriveLaw, usual: str | DriveLaw) -> str | DriveLaw:
    """The drive law, or the usual one in place of the published."""
    return usual if drive == PUBLISHED else drive
