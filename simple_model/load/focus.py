"""Focal spot (pressure profile about the focus), and the phased array that makes it.

The array has 16 x 16 circular pistons (pitch 10.3 mm, 40 kHz), as Ultraleap's STRATOS Explore:

    p(x) = sum_i P1/r_i 2 J1(k a sin th_i)/(k a sin th_i) exp(j(k r_i - k |x_f - x_i|) - al r_i)

Its intensity |p|^2 near the focus is close to sinc^2(D/D0). D0 grows with height.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import j1

from simple_model.choices import check_range
from simple_model.load.spot_map import GaussianSum
from simple_model.typing import Complex, Floats

if TYPE_CHECKING:
    from scipy.interpolate import RegularGridInterpolator

SPEED_OF_SOUND = 343.0  # m/s
GAUSSIAN_WIDTH = 4.35e-3  # m at 200 mm: the half width of sinc^2, and the force out to 20 mm
NOMINAL_HEIGHT = 0.200  # m
FOCI = ("gaussian", "main_lobe", "array")
REACH = 5.7  # standard deviations at which a Gaussian is 1e-7
FocalSpot = Callable[[Floats], Floats]  # offsets (..., 2) in m from the focus -> relative (...)


def _one_gaussian(width: float) -> GaussianSum:
    return GaussianSum(width=width, offsets=np.zeros((1, 2)), shares=np.ones(1))


@dataclass(frozen=True, kw_only=True)
class ContactSpot:
    """Gaussian traction of a small contact of standard deviation `width` in m.

    It does not depend on the height. A width outside 0.2 to 20 mm raises a ValueError.
    """

    width: float

    def __post_init__(self) -> None:
        cure = "; a point contact has no finite response, give the size of the contact"
        check_range("width of a contact", 1e3 * self.width, 0.2, 20, " mm", cure)

    @property
    def spacing(self) -> float:
        """Length in m that samples must resolve."""
        return self.width

    @property
    def reach(self) -> float:
        """Radius in m beyond which it is below 1e-7."""
        return REACH * self.width

    @property
    def gaussians(self) -> GaussianSum:
        """The spot as a sum of one Gaussian."""
        return _one_gaussian(self.width)

    def __call__(self, offsets: Floats) -> Floats:
        """Relative traction (...) at offsets (..., 2) in m from the middle."""
        return np.asarray(np.exp(-(offsets**2).sum(axis=-1) / (2 * self.width**2)))


def array_field(points: ArrayLike, focus: ArrayLike) -> Complex:
    """Return the complex sound pressure amplitude (n,) in Pa at points (n, 3) for a focus (3,), m.

    The array is centred at the origin in the plane z = 0 and radiates upwards.
    """
    pitch, radius, per_side = 10.3e-3, 4.5e-3, 16  # m, m
    pressure_at_1m = 3.4  # Pa, amplitude per element on its axis
    absorption = 1.32 / (20 * np.log10(np.e))  # 1.32 dB/m at 20 C and 50 % humidity, ISO 9613-1
    wavenumber = 2 * np.pi * 40e3 / SPEED_OF_SOUND
    line = (np.arange(per_side) - (per_side - 1) / 2) * pitch
    elements = np.stack(np.meshgrid(line, line, [0.0]), axis=-1).reshape(-1, 3)
    rays = np.atleast_2d(np.asarray(points, np.float64))[:, None] - elements
    distance = np.linalg.norm(rays, axis=2)
    argument = wavenumber * radius * np.hypot(rays[..., 0], rays[..., 1]) / distance
    directivity = np.ones_like(argument)
    np.divide(2 * j1(argument), argument, out=directivity, where=argument > 1e-9)
    delay = np.linalg.norm(np.asarray(focus, np.float64) - elements, axis=1)
    wave = np.exp(1j * wavenumber * (distance - delay) - absorption * distance)
    return (pressure_at_1m / distance * directivity * wave).sum(axis=1)


@lru_cache(maxsize=64)  # every pressure of a load needs it
def relative_intensity(height: float) -> float:
    """Return the intensity at a height in m relative to 200 mm, where it is greatest.

    Raises a ValueError if the height is outside 20 to 600 mm.
    """
    heights = [20, 40, 60, 80, 100, 120, 150, 180, 200, 220, 250, 300, 350, 400, 500, 600]  # mm
    # Force of `array_field` on a disc of radius 10 mm about the focus, relative to 200 mm. A
    # balance measures this force, and only this force has its maximum at 200 mm.
    forces = [
        0.2395, 0.4048, 0.5717, 0.6989, 0.7850, 0.8502, 0.9319, 0.9860,
        1.0, 0.9963, 0.9634, 0.8655, 0.7505, 0.6411, 0.4644, 0.3414,
    ]  # fmt: skip
    check_range("height", 1e3 * height, heights[0], heights[-1], " mm", ", where the array focuses")
    if height == NOMINAL_HEIGHT:
        return 1.0
    from scipy.interpolate import PchipInterpolator  # slow to import

    return float(PchipInterpolator(heights, forces)(1e3 * height))


def lobe_width(height: float) -> float:
    """Radius D0 in m of the main lobe, to the first zero, at a height in m."""
    above = height - NOMINAL_HEIGHT
    return 11.6e-3 + 46.5e-3 * above + 25e-3 * above**2


def focal_spot(
    offsets: ArrayLike, height: float = NOMINAL_HEIGHT, profile: str | FocalSpot = "main_lobe"
) -> Floats:
    """Focal spot S (...): intensity relative to the focus at offsets (..., 2) in m from it, for a
    height in m above the array.

    The profile is "main_lobe", sinc^2(D/D0); "gaussian", of the same half width and force; "array",
    the field of the array with its side lobes, to 60 mm along each axis; or a function of the
    offsets.

    >>> focal_spot([[0.0, 0.0], [0.005, 0.0]]).round(3)
    array([1.  , 0.52])
    """
    offsets = np.asarray(offsets, np.float64)
    if not isinstance(profile, str):
        return np.asarray(profile(offsets))
    if profile == "array":
        return _array_spot(height)(np.abs(offsets).clip(max=60e-3))
    scaled = (offsets / _scale(height, profile)) ** 2
    return _round_spot(np.asarray(scaled[..., 0] + scaled[..., 1]), profile)


def spot_of_foci(
    points: Floats, centres: Floats, height: float, profile: str | FocalSpot
) -> Floats:
    """Focal spot (..., n) at points (n, 2) in m for a focus at positions (..., 2)."""
    if profile == "array" or not isinstance(profile, str):
        return focal_spot(points - centres[..., None, :], height, profile)
    # |x - c|^2 = |x|^2 - 2 x.c + |c|^2 as one matrix product, the fastest way.
    x, c = points / _scale(height, profile), centres / _scale(height, profile)
    left = np.stack([*np.moveaxis(-2 * c, -1, 0), (c**2).sum(axis=-1), np.ones(c.shape[:-1])], -1)
    return _round_spot(left @ np.stack([*x.T, np.ones(len(x)), (x**2).sum(axis=1)]), profile)


def _scale(height: float, profile: str) -> float:
    """Length d in m of an axisymmetric focal spot, exp(-(D/d)^2) or (sin(D/d) / (D/d))^2."""
    return np.sqrt(2) * spot_width(height) if profile == "gaussian" else lobe_width(height) / np.pi


def _round_spot(squared: Floats, profile: str) -> Floats:
    """Axisymmetric focal spot at squared scaled distances (...), which it overwrites."""
    if profile == "gaussian":
        return np.exp(np.negative(squared, out=squared), out=squared)
    angle = np.sqrt(np.maximum(squared, 1e-18, out=squared), out=squared)  # 1 to the last digit
    sinc = np.sin(angle)
    sinc /= angle
    return np.multiply(sinc, sinc, out=sinc)


def spot_width(height: float) -> float:
    """Standard deviation in m of the Gaussian focal spot at a height in m."""
    return GAUSSIAN_WIDTH * lobe_width(height) / lobe_width(NOMINAL_HEIGHT)


def spot_detail(height: float, profile: str | FocalSpot) -> float:
    """Length in m that samples of a focal spot along its path must resolve."""
    return min(spot_width(height), getattr(profile, "spacing", np.inf))


def along_axis(offset: ArrayLike, width: float = GAUSSIAN_WIDTH) -> Floats:
    """Relative intensity (...) on the axis, at an offset (...) in m above or below the focus.

    A Gaussian whose half width is proportional to the square of that of the focal spot, here as
    the standard deviation `width` in m. It is within 4 % of `array_field`.
    """
    half_width = 37e-3 * (width / GAUSSIAN_WIDTH) ** 2  # m
    return np.exp(-np.log(2) * (np.asarray(offset, np.float64) / half_width) ** 2)


def spot_reach(height: float, profile: str | FocalSpot) -> float:
    """Radius in m beyond which a focal spot is below 1e-7; infinite if that is not known."""
    own = REACH * spot_width(height) if profile == "gaussian" else np.inf
    return float(getattr(profile, "reach", own))


def gaussian_sum(height: float, profile: str | FocalSpot) -> GaussianSum | None:
    """Return a focal spot as a sum of Gaussians; None if that is not known."""
    own = _one_gaussian(spot_width(height)) if profile == "gaussian" else None
    return getattr(profile, "gaussians", own)


@cache
def _array_spot(height: float) -> RegularGridInterpolator:
    """Relative intensity |p|^2 in one quadrant; the field is symmetric about both axes."""
    from scipy.interpolate import RegularGridInterpolator

    line = np.linspace(0, 60e-3, 121)
    x, y = np.meshgrid(line, line, indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, height)])
    intensity = np.abs(array_field(points, (0.0, 0.0, height))).reshape(x.shape) ** 2
    return RegularGridInterpolator((line, line), intensity / intensity[0, 0], method="cubic")
