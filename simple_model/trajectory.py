"""Where the focus is: constant speed along a point, line, circle, triangle or square.

Lim, Seifi and Park, CHI EA '24, section 2.2. Positions are computed from the phase of the
drawing period, never by adding steps, and so are as exact at 10 s as at 0.
"""

from dataclasses import dataclass
from math import isfinite, pi, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simple_model.choices import choose

Floats = NDArray[np.float64]

SHAPES = ("point", "line", "circle", "triangle", "square")
SWEEPS = ("there_and_back", "one_way")
LARGEST = 0.060  # m, the size of a palm

_TRIANGLE = np.array([[0, 1 / sqrt(3)], [-0.5, -0.5 / sqrt(3)], [0.5, -0.5 / sqrt(3)]])
_SQUARE = np.array([[0.5, 0.5], [-0.5, 0.5], [-0.5, -0.5], [0.5, -0.5]])
_LINE = np.array([[-0.5, 0.0], [0.5, 0.0]])


@dataclass(frozen=True, kw_only=True)
class Trajectory:
    """A path about the origin of the skin plane, run anticlockwise.

    Parameters
    ----------
    shape : one of `SHAPES`
    size : float, metre, 0..0.06: length of the line, diameter of the circle, side of the others
    speed : float, m/s, along the path
    sweep : how a line is repeated: "there_and_back" (f_d = speed / 2 size) or "one_way"
        (f_d = speed / size, then a jump back); devices differ

    Raises
    ------
    ValueError
        If a value is unknown, not finite or out of range.
    """

    shape: str = "point"
    size: float = 0.0
    speed: float = 0.0
    sweep: str = "there_and_back"

    def __post_init__(self) -> None:
        choose("shape", self.shape, SHAPES)
        choose("sweep", self.sweep, SWEEPS)
        if not (isfinite(self.size) and 0 <= self.size <= LARGEST):
            raise ValueError(
                f"size = {1e3 * self.size:g} mm is outside 0..{1e3 * LARGEST:g} mm, "
                "the size of a palm; make the path smaller"
            )
        if not (isfinite(self.speed) and self.speed >= 0):
            raise ValueError(f"speed = {self.speed} m/s must be a finite number, 0 or above")

    @property
    def length(self) -> float:
        """Path length of one period, metre."""
        sides = {"point": 0.0, "line": 2.0, "circle": pi, "triangle": 3.0, "square": 4.0}
        one_way = self.shape == "line" and self.sweep == "one_way"
        return self.size * (1.0 if one_way else sides[self.shape])

    @property
    def drawing_frequency(self) -> float:
        """Periods per second, Hz; 0 where the focus does not move."""
        return self.speed / self.length if self.length > 0 else 0.0

    @property
    def is_static(self) -> bool:
        """Whether the focus stays where it starts."""
        return self.drawing_frequency == 0

    def phase(self, t: ArrayLike) -> Floats:
        """Fraction 0..1 of the period at times t in s, same shape as t."""
        return np.mod(self.drawing_frequency * np.asarray(t, np.float64), 1.0)

    def position(self, t: ArrayLike) -> Floats:
        """Position (..., 2) in metre at times (...) in s."""
        return self.at_phase(self.phase(t))

    def at_phase(self, phase: ArrayLike) -> Floats:
        """Position (..., 2) in metre at fractions (...) of the period, 0 to 1."""
        phase = np.asarray(phase, np.float64)
        if self.shape == "point":
            return np.zeros((*phase.shape, 2))
        if self.shape == "circle":
            angle = 2 * pi * phase
            return self.size / 2 * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        corners = {"line": _LINE, "triangle": _TRIANGLE, "square": _SQUARE}[self.shape]
        if not (self.shape == "line" and self.sweep == "one_way"):
            corners = np.vstack([corners, corners[:1]])
        knots = np.linspace(0, 1, len(corners))
        unit = [np.interp(phase, knots, corners[:, axis]) for axis in range(2)]
        return self.size * np.stack(unit, axis=-1)
