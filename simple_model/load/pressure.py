"""Moving radiation pressure, the load of every model:

    q(x, t) = p0 I(h)/n sum_j drive(A, M(t)) S(x - x_j(t))

The n foci run along the same path at phases of their own. The level L of a recorded path multiplies
the amplitude.
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
    relative_intensity,
    spot_of_foci,
    spot_width,
)
from simple_model.load.spot_map import SpotMap
from simple_model.load.tacton import Tacton, level, modulation
from simple_model.typing import Floats

HEADINGS = ("x", "y", "")


@dataclass(frozen=True, kw_only=True)
class MovingPressure:
    """Pressure of a Tacton on a surface near the plane z = 0, in which its focus moves.

    Points may have a height: above and below the plane the focus is weaker. The surface accounts
    for the effect of its slope.

    Parameters
    ----------
    tacton : Tacton
    profile : "gaussian", "main_lobe" or "array", the shape of the focal spot; a `SpotMap`; or a
        function of offsets (..., 2) in m, with details no finer than those of the Gaussian
    drive : "linear", "pressure_squared", "force_corrected", or a DriveLaw
    depth_of_modulation : float, 0 to 1; the linear law does not use it
    peak_pressure : float, Pa, at the focus at full drive and 200 mm. The default of 50 Pa,
        uncertain by a factor of 2, is the radiation pressure of a 160 dB focus on a wall that
        reflects fully.
    height : float, m, of the focus above the array
    heading : "x" or "y" multiplies the pressure by this component of the unit tangent of the path,
        for a traction along the path; "" for none

    Raises a ValueError if a value is unknown, not finite or out of range, or if there is a heading
    but the path has no tangent.

    >>> from simple_model import Tacton
    >>> load = MovingPressure(tacton=Tacton(am_frequency=140.0), drive="linear")
    >>> load([[0.0, 0.0], [0.005, 0.0]], 1 / 560).round(1)  # Pa, at the peak of the modulation
    array([50. , 25.8])
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
                "the focus rests or jumps from point to point, so its path has no direction; give "
                "a fixed direction, or a path along which the focus moves"
            )
        rhythm, signal = self.tacton.rhythm, self.tacton.signal
        has_levels = path.levels or rhythm or (signal and signal.role == "envelope")
        if has_levels and not self.law.is_product(self.tacton.amplitude, self.depth_of_modulation):
            raise ValueError(
                f"drive law '{self.law}' is not a product of factors for the level and for the "
                "modulation, so that it supports no path levels, rhythm or envelope; remove "
                "these, or use another drive law"
            )

    @property
    def law(self) -> DriveLaw:
        """The drive law."""
        return self.drive if isinstance(self.drive, DriveLaw) else DRIVES[self.drive]

    @property
    def profile_name(self) -> str:
        """Name of the focal spot; "file" for a map, "own" for a function."""
        if isinstance(self.profile, str):
            return self.profile
        return "file" if isinstance(self.profile, SpotMap) else "own"

    @property
    def spot_scale(self) -> float:
        """Standard deviation in m of a Gaussian as wide as the focal spot."""
        return float(getattr(self.profile, "width", spot_width(self.height)))

    def __call__(self, points: ArrayLike, t: ArrayLike) -> Floats:
        """Pressure (..., n) in Pa at points (n, 2 or 3) in m and times (...) in s."""
        t, points = np.asarray(t, np.float64), np.asarray(points, np.float64)
        path, gain = self.tacton.trajectory, self.gain(t).ravel()
        phases = [np.mod(path.phase(t).ravel() + ahead, 1.0) for ahead in self.tacton.foci]
        weighted = bool(path.levels or self.heading)
        gains = [gain * self.weight(phase) if weighted else gain for phase in phases]
        foci = [path.at_phase(phase) for phase in phases]
        pressure = np.zeros((t.size, len(points)))
        block = max(1, 2**15 // max(1, len(points)))  # so that arrays stay in cache
        for start in range(0, t.size, block):
            part = slice(start, start + block)
            for each, centres in zip(gains, foci, strict=True):
                spot = self.spot(points, centres[part])
                pressure[part] += np.multiply(each[part, None], spot, out=spot)
        return pressure.reshape(*t.shape, len(points))

    def weight(self, phase: ArrayLike) -> Floats:
        """Factor (...) of path level and heading at fractions (...) of the period."""
        path = self.tacton.trajectory
        factor = self.law.level_factor(path.level_at_phase(phase), self.depth_of_modulation)
        if self.heading:
            factor = factor * path.tangent_at_phase(phase)[..., HEADINGS.index(self.heading)]
        return factor

    def gain(self, t: ArrayLike) -> Floats:
        """Pressure (...) in Pa at each focus at times (...) in s, without the level of the path."""
        return self.gain_at(modulation(self.tacton, t), level(self.tacton, t))

    def gain_at(self, modulation: Floats, level: Floats | float = 1.0) -> Floats:
        """Pressure (...) in Pa at each focus for given modulation and level (...)."""
        amplitude = self.tacton.amplitude * level
        relative = self.law(amplitude, modulation, self.depth_of_modulation)
        full = self.peak_pressure * relative_intensity(self.height)
        return full / len(self.tacton.foci) * relative

    def spot(self, points: ArrayLike, centre: ArrayLike) -> Floats:
        """Relative focal spot (..., n) at points (n, 2 or 3) for a focus at centres (..., 2), m."""
        points, centre = np.asarray(points, np.float64), np.asarray(centre, np.float64)
        spot = spot_of_foci(points[:, :2], centre, self.height, self.profile)
        contact = isinstance(self.profile, ContactSpot)
        if points.shape[1] == 3 and points[:, 2].any() and not contact:
            spot *= along_axis(points[:, 2], self.spot_scale)
        return spot


def check_lines(pressure: MovingPressure) -> None:
    """Refuse subclasses of `MovingPressure`, because models of lines use only its formulas."""
    if type(pressure) is not MovingPressure:
        raise ValueError(
            f"the load {type(pressure).__name__} is a subclass of MovingPressure, and only "
            "point-kernel and fem-transient evaluate its own formulas; use one of these two, "
            "fem-transient with an element size h"
        )
