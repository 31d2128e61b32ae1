"""Moving radiation pressure, the load of every model:

q(x, t) = p0 I(h)/n sum_j drive(A, M(t)) S(x - x_j(t))

of n foci, which run the same path at phases of their own. A recorded path brings a level L along
it, which multiplies the amplitude.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from simple_model.choices import check_numbers, check_range, choose
from simple_model.load.drive import DRIVES, DriveLaw
from simple_model.load.focus import (
    FOCI,
    NOMINAL_HEIGHT,
    ContactSpot,
    FocalSpot,
    along_axis,
    moved_spot,
    relative_intensity,
)
from simple_model.load.tacton import Tacton, level, modulation
from simple_model.typing import Floats

HEADINGS = ("x", "y", "")
FINER = 8  # samples of a rhythm or signal in each average
IN_CACHE = 2**15  # samples worked on at a time


@dataclass(frozen=True, kw_only=True)
class MovingPressure:
    """Pressure of a Tacton on a surface near the plane z = 0 that its focus moves in.

    Points may have a height: above or below the plane the focus is weaker. The effect of a slope on
    the pressure belongs to the surface.

    Parameters
    ----------
    tacton : Tacton
    profile : "gaussian", "main_lobe" or "array", the shape of the focal spot; or any
        function of offsets (..., 2) in metre, with details no finer than the Gaussian's
    drive : "linear", "pressure_squared", "force_corrected", or a DriveLaw
    depth_of_modulation : float, 0..1; the linear law has none
    peak_pressure : float, Pa, at the focus at full drive and 200 mm. 50 Pa, uncertain by a factor
        of 2, is the radiation pressure of a 160 dB focus on a wall that reflects fully.
    height : float, metre, of the focus above the array
    heading : "x" or "y", the component of the path's unit tangent that multiplies it, as of a
        traction along the path; or "", none

    Raises a ValueError if a value is unknown, not finite or out of range, or a path without tangent
    has a heading.
    """

    tacton: Tacton
    profile: str | FocalSpot = "gaussian"
    drive: str | DriveLaw = "pressure_squared"
    depth_of_modulation: float = 1.0
    peak_pressure: float = 50.0
    height: float = NOMINAL_HEIGHT
    heading: str = ""

    def __post_init__(self) -> None:
        if not callable(self.profile):
            choose("profile", self.profile, FOCI)
        if not isinstance(self.drive, DriveLaw):
            choose("drive", self.drive, DRIVES)
        check_range("depth_of_modulation", self.depth_of_modulation, 0, 1)
        check_numbers("a load", self, "peak_pressure", least="0 or above")
        relative_intensity(self.height)
        choose("heading", self.heading, HEADINGS)
        path = self.tacton.trajectory
        if self.heading and (path.is_static or path.hold):
            raise ValueError(
                "a focus that rests or jumps from point to point has no direction along its path; "
                "give a direction, or let it move"
            )
        self._check_levels()

    def _check_levels(self) -> None:
        tacton = self.tacton
        enveloped = tacton.signal is not None and tacton.signal.role == "envelope"
        if not (tacton.trajectory.levels or tacton.rhythm or enveloped):
            return
        if not self.law.is_product(tacton.amplitude, self.depth_of_modulation):
            raise ValueError(
                f"drive law '{self.law}' is no product of a factor of the level and one of the "
                "modulation, so that levels of a path, a rhythm and an envelope have no lines; "
                "leave them out, or take another law"
            )

    @property
    def law(self) -> DriveLaw:
        """The drive law."""
        return self.drive if isinstance(self.drive, DriveLaw) else DRIVES[self.drive]

    @property
    def profile_name(self) -> str:
        """Name of the focal spot, "own" if it has none."""
        return self.profile if isinstance(self.profile, str) else "own"

    def __call__(self, points: ArrayLike, t: ArrayLike) -> Floats:
        """Pressure (..., n) in Pa at points (n, 2 or 3) in metre and times (...) in s."""
        t, points = np.asarray(t, np.float64), np.asarray(points, np.float64)
        path, gain = self.tacton.trajectory, self.gain(t).ravel()
        phases = [np.mod(path.phase(t).ravel() + ahead, 1.0) for ahead in self.tacton.foci]
        weighted = bool(path.levels or self.heading)
        gains = [gain * self.weight(phase) if weighted else gain for phase in phases]
        foci = [path.at_phase(phase) for phase in phases]
        pressure = np.zeros((t.size, len(points)))
        block = max(1, IN_CACHE // max(1, len(points)))
        for start in range(0, t.size, block):
            part = slice(start, start + block)
            for each, centres in zip(gains, foci, strict=True):
                spot = self.spot(points, centres[part])
                pressure[part] += np.multiply(each[part, None], spot, out=spot)
        return pressure.reshape(*t.shape, len(points))

    def weight(self, phase: ArrayLike) -> Floats:
        """Factor (...) of the path's level and of the heading on the pressure at fractions (...) of
        the period.
        """
        path = self.tacton.trajectory
        factor = self.law.level_factor(path.level_at_phase(phase), self.depth_of_modulation)
        if self.heading:
            factor = factor * path.tangent_at_phase(phase)[..., HEADINGS.index(self.heading)]
        return factor

    def gain(self, t: ArrayLike, over: float = 0.0) -> Floats:
        """Pressure (...) in Pa at each focus at times (...) in s, but for the path's level; a
        rhythm or a signal is averaged over the time `over` in s about each, from the start on.
        """
        if over and self.tacton.is_sampled:
            parts = ((np.arange(FINER) + 0.5) / FINER - 0.5) * over
            fine = np.asarray(t, np.float64)[..., None] + parts
            begun = fine >= 0
            gain = self.gain(np.maximum(fine, 0.0)) * begun
            return np.asarray(gain.sum(axis=-1) / begun.sum(axis=-1))
        return self.driven(modulation(self.tacton, t), level(self.tacton, t))

    def driven(self, modulation: Floats, level: Floats | float = 1.0) -> Floats:
        """Pressure (...) in Pa at each focus where modulation and level (...) have these values."""
        amplitude = self.tacton.amplitude * level
        driven = self.law(amplitude, modulation, self.depth_of_modulation)
        full = self.peak_pressure * relative_intensity(self.height)
        return full / len(self.tacton.foci) * driven

    def spot(self, points: ArrayLike, centre: ArrayLike) -> Floats:
        """Focal spot (..., n) at points (n, 2 or 3), relative, the focus at centres (..., 2)."""
        points, centre = np.asarray(points, np.float64), np.asarray(centre, np.float64)
        spot = moved_spot(points[:, :2], centre, self.height, self.profile)
        contact = isinstance(self.profile, ContactSpot)
        if points.shape[1] == 3 and points[:, 2].any() and not contact:
            spot *= along_axis(points[:, 2], self.height)
        return spot


def check_lines(pressure: MovingPressure) -> None:
    """Refuse a load of another class: models of lines use the formulas of `MovingPressure` without
    calling it.
    """
    if type(pressure) is not MovingPressure:
        raise ValueError(
            f"the load {type(pressure).__name__} is no MovingPressure, whose lines plans and "
            "models but point-kernel and fem-transient use; take one of these two, which evaluate "
            "it point by point, the latter with an element size h"
        )
