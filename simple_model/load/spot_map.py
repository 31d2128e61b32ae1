"""Focal spot of a measured or computed map of pressure, also as a sum of Gaussians.

Wavenumber integrals take any map as a sum of Gaussians of one width at the nodes of a lattice,
because the motion due to each is the same apart from its place.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from hashlib import sha256
from typing import TYPE_CHECKING, Any

import numpy as np

from simple_model.typing import Floats

if TYPE_CHECKING:
    from scipy.interpolate import RectBivariateSpline


@dataclass(frozen=True, kw_only=True, eq=False)
class GaussianSum:
    """Focal spot made of Gaussians of one standard deviation `width` in m, with factors `shares`
    (i,) and middles at `offsets` (i, 2) in m from the focus.
    """

    width: float
    offsets: Floats
    shares: Floats


@dataclass(frozen=True, kw_only=True)
class SpotMap:
    """Focal spot of a map, interpolated by cubic splines and 0 outside; see `spot_map`.

    Parameters
    ----------
    x, y : (nx,) and (ny,) float, m from the focus, ascending
    values : (nx, ny) float, pressure relative to the focus
    error : float, estimated error of the interpolation, relative to the focus
    file, unit, source : the file, its unit of length if given, and what it holds, in words
    peak : float, Pa, pressure of the focus that the file gives; 0 if it gives none
    key : str, hash of the numbers, by which maps are compared
    """

    x: Floats = field(repr=False, compare=False)
    y: Floats = field(repr=False, compare=False)
    values: Floats = field(repr=False, compare=False)
    error: float = field(default=0.0, repr=False, compare=False)
    file: str = ""
    unit: str = ""
    source: str = field(default="", compare=False)
    peak: float = field(default=0.0, compare=False)
    key: str = field(init=False)

    def __post_init__(self) -> None:
        numbers = b"".join(each.tobytes() for each in (self.x, self.y, self.values))
        object.__setattr__(self, "key", sha256(numbers).hexdigest()[:32])

    @cached_property
    def _spline(self) -> RectBivariateSpline:
        return _spline(self.x, self.y, self.values)

    def __call__(self, offsets: Floats) -> Floats:
        """Relative pressure (...) at offsets (..., 2) in m from the focus."""
        x, y = np.moveaxis(np.asarray(offsets, np.float64), -1, 0)
        inside = (self.x[0] <= x) & (x <= self.x[-1]) & (self.y[0] <= y) & (y <= self.y[-1])
        values = np.zeros(x.shape)
        values[inside] = self._spline.ev(x[inside], y[inside])
        return values

    @cached_property
    def area(self) -> float:
        """Force over the pressure of the focus, m2."""
        return float(self._spline.integral(self.x[0], self.x[-1], self.y[0], self.y[-1]))

    @property
    def width(self) -> float:
        """Standard deviation in m of the Gaussian of the same force."""
        return float(np.sqrt(self.area / (2 * np.pi)))

    @cached_property
    def spacing(self) -> float:
        """Length in m that samples must resolve: that of a Gaussian with the same mean slope."""
        u, v = (np.linspace(each[0], each[-1], 2 * len(each)) for each in (self.x, self.y))
        of, along_x, along_y = (
            np.mean(self._spline(u, v, dx=n, dy=m) ** 2) for n, m in ((0, 0), (1, 0), (0, 1))
        )
        return float(np.sqrt(of / (2 * max(along_x, along_y))))

    @property
    def reach(self) -> float:
        """Radius in m beyond which it is 0."""
        return float(np.hypot(*(np.abs(each).max() for each in (self.x, self.y))))

    @property
    def half_widths(self) -> tuple[float, float]:
        """Widths in m along x and y through the focus, at half of its pressure."""
        u, v = (np.linspace(each[0], each[-1], 40_001) for each in (self.x, self.y))
        cuts = (u, self._spline(u, 0.0)[:, 0]), (v, self._spline(0.0, v)[0])
        widths = []
        for at, cut in cuts:
            low = at[cut < 0.5]
            widths.append(float(low[low > 0].min() - low[low < 0].max() - (at[1] - at[0])))
        return widths[0], widths[1]

    @cached_property
    def gaussians(self) -> GaussianSum:
        """The same as a sum of Gaussians half as wide as its details, equal at their middles."""
        width = self.spacing / 2
        lines = [width * np.arange(np.floor(each[0] / width), np.ceil(each[-1] / width) + 1)
                 for each in (self.x, self.y)]  # fmt: skip
        offsets = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1)
        of_x, of_y = (
            np.linalg.inv(np.exp(-(((line[:, None] - line) / width) ** 2) / 2)) for line in lines
        )
        shares = of_x @ self(offsets) @ of_y
        kept = np.abs(shares) > 1e-4 * np.abs(shares).max()
        return GaussianSum(width=width, offsets=offsets[kept], shares=shares[kept])


def spot_map(
    x: Floats, y: Floats, values: Floats, *, peak_per_value: float = 0.0, border: float = 0.05,
    most_error: float = 0.05, fewest: int = 8, **source: Any,
) -> SpotMap:  # fmt: skip
    """Return the focal spot of a map of pressure (nx, ny) at x (nx,) and y (ny,) in m, ascending.

    The focus is where the splines are largest. Pressures are those of the map times
    `peak_per_value` in Pa; 0 if unknown. `source` are further fields of `SpotMap`. Raises a
    ValueError if the map has fewer than `fewest` samples along an axis, if its border exceeds the
    fraction `border` of the focus, or if the estimated error of the interpolation exceeds
    `most_error`.

    >>> line = np.linspace(-0.02, 0.02, 41)
    >>> spot = spot_map(line, line, np.exp(-np.add.outer(line**2, line**2) / 3e-5))
    >>> spot(np.array([[0.0, 0.0], [0.0, 0.003]])).round(4)
    array([1.    , 0.7408])
    """
    if min(values.shape) < fewest:
        raise ValueError(
            f"the map has {len(x)} x {len(y)} samples; give at least {fewest} along x and y"
        )
    if not (np.isfinite(values).all() and values.max() > 0):
        raise ValueError("the map needs finite pressures, some of them above 0; fill its gaps")
    spot, largest = _centred(x, y, values, **source)
    edges = np.abs([*spot.values[[0, -1]].ravel(), *spot.values[:, [0, -1]].ravel()])
    if edges.max() > border:
        raise ValueError(
            f"the pressure on the border of the map is {100 * edges.max():.2g} % of that in the "
            f"focus; give a larger map, with less than {100 * border:g} % on its border"
        )
    # Every second sample has 2^3 times the error, as the place of the focus; this allows twice it.
    coarse, _ = _centred(x[::2], y[::2], values[::2, ::2])
    at = np.stack(np.meshgrid(spot.x[2:-2], spot.y[2:-2], indexing="ij"), axis=-1)
    error = float(np.abs(coarse(at) - spot.values[2:-2, 2:-2]).max() / 4)
    if error > most_error:
        raise ValueError(
            f"the samples of the map are too far apart: interpolation errs by {100 * error:.2g} % "
            f"of the pressure in the focus, more than {100 * most_error:g} %; give more samples"
        )
    return replace(spot, error=error, peak=peak_per_value * largest)


def _centred(x: Floats, y: Floats, values: Floats, **source: Any) -> tuple[SpotMap, float]:
    """The map about and relative to the maximum of its splines, and this maximum."""
    spline, k = _spline(x, y, values), np.divmod(values.argmax(), len(y))
    low, high = (
        np.array(
            [each[np.clip(i + step, 0, len(each) - 1)] for each, i in zip((x, y), k, strict=True)]
        )
        for step in (-1, 1)
    )
    for _ in range(3):  # to 1/4000 of a step
        lines = np.linspace(low, high, 33).T
        near = spline(*lines)
        at = lines[[0, 1], np.unravel_index(near.argmax(), near.shape)]
        step = (high - low) / 32
        low, high = np.maximum(at - step, low), np.minimum(at + step, high)
    largest = float(near.max())
    return SpotMap(x=x - at[0], y=y - at[1], values=values / largest, **source), largest


def _spline(x: Floats, y: Floats, values: Floats) -> RectBivariateSpline:
    from scipy.interpolate import RectBivariateSpline  # slow to import

    return RectBivariateSpline(x, y, values)
