"""Drive laws: from a commanded amplitude to the radiation pressure on the surface.

A is the amplitude (0 to 1), which may vary in time, M the modulation (-1 to 1), m the depth of
modulation (0 to 1). Without modulation M = 1, and every law gives 1 at A = 1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from simple_model.typing import Floats

PUBLISHED = "linear"  # of the point kernel of Lim, Seifi and Park
ROUND_OFF = 1e-9  # largest relative misfit of a law from its polynomial or product


@dataclass(frozen=True, kw_only=True)
class DriveLaw:
    """Drive law: pressure as a function of amplitude, modulation and depth of modulation.

    Parameters
    ----------
    name : str, for messages, pages and, if it is registered in `DRIVES`, scene files
    pressure : amplitude (...), modulation (...), depth -> pressure (...) relative to full drive
    degree : int, of the polynomial of the modulation; None if it is not a polynomial
    words, note : str, a few words for menus, and a sentence about its lines under AM

    Raises a ValueError if the pressure is not a polynomial of this degree.

    >>> import numpy as np
    >>> law = DriveLaw(name="cubic", degree=3, pressure=lambda A, M, m: (A * (1 + m * M) / 2) ** 3)
    >>> law(1.0, np.array([-1.0, 0.0, 1.0]), 1.0)
    array([0.   , 0.125, 1.   ])
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
            pressure = self(1.0, M, depth)
            misfit = pressure - np.polynomial.Polynomial.fit(M, pressure, self.degree)(M)
            if np.abs(misfit).max() > ROUND_OFF * max(1.0, np.abs(pressure).max()):
                raise ValueError(
                    f"drive law '{self.name}' is not a polynomial of degree {self.degree} in the "
                    "modulation; give the right degree, or None"
                )

    def __str__(self) -> str:
        return self.name

    def __call__(self, amplitude: Floats | float, modulation: Floats, depth: float) -> Floats:
        """Pressure (...) relative to full drive."""
        return np.asarray(self.pressure(amplitude, modulation, depth))

    @property
    def uses_depth(self) -> bool:
        """Whether the depth of modulation changes the pressure."""
        M = np.linspace(-1, 1, 9)
        return not np.allclose(self(1.0, M, 0.25), self(1.0, M, 1.0))

    def level_factor(self, level: Floats, depth: float) -> Floats:
        """Factor (...) by which a level (...) of the amplitude changes the pressure."""
        one = np.ones(1)
        return np.asarray(self(level, one, depth) / self(1.0, one, depth))

    def is_product(self, amplitude: float, depth: float) -> bool:
        """Whether the level multiplies the pressure by the same factor for any modulation."""
        level, M = np.meshgrid(np.linspace(0, 1, 9), np.linspace(-1, 1, 9))
        both = self(amplitude * level, M, depth)
        factors = self.level_factor(level, depth) * self(amplitude * np.ones_like(M), M, depth)
        return bool(np.abs(both - factors).max() <= ROUND_OFF * np.abs(both).max())


DRIVES = {
    law.name: law
    for law in (
        # Pressure is the commanded signal itself, with its sign (Lim et al.).
        DriveLaw(
            name="linear", degree=1, pressure=lambda A, M, m: A * M,
            words="the signal itself, as published",
        ),
        # Radiation pressure is the square of the modulated sound pressure: traditional AM (US
        # 11704983 B2), with a line at twice the AM frequency.
        DriveLaw(
            name="pressure_squared", degree=2,
            pressure=lambda A, M, m: (A * (1 + m * M) / (1 + m)) ** 2, words="usual AM",
            note="Lines at 2 f_AM and, in AM+STM, at n f_d come from the drive law, not from "
            "propagation: a device that modulates its sound pressure pushes with the square of "
            "that pressure. The point kernel under the same load also has these lines.",
        ),
        # The device takes the square root first, so the pressure follows M.
        DriveLaw(
            name="force_corrected", degree=1,
            pressure=lambda A, M, m: A * (1 + m * M) / (1 + m), words="square root first",
        ),
    )
}  # fmt: skip


def usual_drive(drive: str | DriveLaw, usual: str | DriveLaw) -> str | DriveLaw:
    """Return a drive law, with `usual` in place of the published one."""
    return usual if drive == PUBLISHED else drive
