"""Palm: a rounded slab with mounds, joined smoothly and bent to a cup.

It is a right hand with the palm facing +z, the fingers towards +y and the thumb towards +x. The
origin is the middle of the palm, on its surface. The body is where the level set is negative:

    F(x, y, z) = join(box, mounds)(x, y, z - rise),  rise = cup_depth ((2x/b)^2 + (2y/l)^2)

`box` is the exact distance from a slab with rounded corners and edges, a mound the first-order
distance from an ellipsoid, and `join` a smooth minimum with continuous second derivatives. It
differs from the minimum only where box and mound differ by less than the height of the mound. Near
the surface, F is the distance from it within a few per cent. Without cup and mounds, the top is the
plane z = 0 up to `edge_radius` from the sides.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from meshes.tetmesh import MeshError
from meshes.typing import Floats

LevelSet = tuple[Floats, Floats]  # values (n,) and gradients (n, 3)


@dataclass(frozen=True, kw_only=True)
class Palm:
    """Size and relief of a palm, in m. The defaults are those of an adult.

    Parameters
    ----------
    breadth, length : across the four fingers (x) and from wrist to finger roots (y)
    thickness : in the middle, from the palm to the back of the hand
    cup_depth : height of the middles of the sides above the middle of the palm
    thenar_height, hypothenar_height : of the mounds at the thumb and opposite, above the palm
    pad_height : of the four pads below the fingers
    corner_radius, edge_radius : of the outline seen from above, and of its cross-section

    Raises a MeshError if a value is out of range, or a radius does not fit.

    >>> Palm(thickness=0.030).edge_radius
    0.01
    """

    breadth: float = 0.085
    length: float = 0.100
    thickness: float = 0.022
    cup_depth: float = 0.003
    thenar_height: float = 0.005
    hypothenar_height: float = 0.003
    pad_height: float = 0.0012
    corner_radius: float = 0.028
    edge_radius: float = 0.010

    def __post_init__(self) -> None:
        relief = ("cup_depth", "thenar_height", "hypothenar_height", "pad_height")
        for name, value in vars(self).items():
            if not (0 < value < 1 or (value == 0 and name in relief)):
                least = "0 or above" if name in relief else "above 0"
                raise MeshError(
                    f"{name} = {1e3 * value:g} mm of the palm must be {least} and below 1 m"
                )
        for name, limit, meaning in (
            *((name, self.thickness, "its thickness") for name in relief),
            ("corner_radius", min(self.breadth, self.length) / 2, "half the shorter side"),
            ("edge_radius", self.thickness / 2, "half the thickness"),
            ("edge_radius", self.corner_radius, "corner_radius"),
        ):
            if not (value := getattr(self, name)) <= limit * (1 + 1e-9):
                raise MeshError(
                    f"{name} = {1e3 * value:g} mm of the palm exceeds {meaning}, "
                    f"{1e3 * limit:g} mm; reduce it"
                )


def level_set(palm: Palm, points: ArrayLike) -> Floats:
    """Return a level-set function (n,) in m at points (n, 3).

    It is negative inside, and near the surface it is about the signed distance.
    """
    return _field(palm, np.asarray(points, np.float64))[0]


def gradient(palm: Palm, points: ArrayLike) -> Floats:
    """Return the gradient (n, 3) of `level_set`, about a unit outward normal near the surface."""
    return _field(palm, np.asarray(points, np.float64))[1]


def rise(palm: Palm, places: Floats) -> Floats:
    """Return the height (...,) in m by which the cup raises places (..., 2)."""
    return np.asarray(places**2 @ _bend(palm))


def _bend(palm: Palm) -> Floats:
    return np.asarray(palm.cup_depth * np.array([2 / palm.breadth, 2 / palm.length]) ** 2)


def _field(palm: Palm, points: Floats) -> LevelSet:
    bend = _bend(palm)
    flat = points.copy()
    flat[:, 2] -= rise(palm, points[:, :2])
    value, slope = _box_distance(palm, flat)
    for height, centre, half_axes in _mounds(palm):
        value, slope = _join((value, slope), _ellipsoid(flat - centre, half_axes), height)
    slope[:, :2] -= 2 * bend * points[:, :2] * slope[:, 2:]
    return value, slope


def _mounds(palm: Palm) -> Iterator[tuple[float, Floats, Floats]]:
    """Height, centre and semi-axes of each mound."""
    b, length, half = palm.breadth, palm.length, palm.thickness / 2
    pads = (-0.33, -0.11, 0.11, 0.33)  # of the breadth: x of the finger roots
    places = [
        (palm.thenar_height, 0.25 * b, -0.21 * length, 0.22 * b, 0.29 * length),
        (palm.hypothenar_height, -0.27 * b, -0.16 * length, 0.19 * b, 0.31 * length),
        *((palm.pad_height, x * b, 0.37 * length, 0.12 * b, 0.12 * length) for x in pads),
    ]
    for height, x, y, across, along in places:
        if height > 0:
            # As deep as the slab and raised, so that the back of the hand does not change.
            yield height, np.array([x, y, height - half]), np.array([across, along, half])


def _box_distance(palm: Palm, points: Floats) -> LevelSet:
    """Distance from a box with rounded corners in plan and rounded edges."""
    half = np.array([palm.breadth, palm.length]) / 2
    middle = points + [0, 0, palm.thickness / 2]
    sign = np.where(middle < 0, -1.0, 1.0)
    outline, across = _corner_distance(np.abs(middle[:, :2]) - half, palm.corner_radius)
    upward = np.abs(middle[:, 2]) - palm.thickness / 2
    value, share = _corner_distance(np.column_stack([outline, upward]), palm.edge_radius)
    return value, sign * np.column_stack([share[:, :1] * across, share[:, 1]])


def _corner_distance(beyond: Floats, radius: float) -> LevelSet:
    """Distance (n,) from a corner of a radius, for points beyond its two sides by (n, 2)."""
    inner = beyond + radius
    outside = np.maximum(inner, 0)
    length = np.linalg.norm(outside, axis=1)
    value = length + np.minimum(inner.max(axis=1), 0) - radius
    nearest = np.eye(2)[inner.argmax(axis=1)]
    round_part = outside / np.maximum(length, 1e-300)[:, None]
    return value, np.where((length > 0)[:, None], round_part, nearest)


def _ellipsoid(points: Floats, half_axes: Floats) -> LevelSet:
    """First-order distance k (k - 1) / |grad k^2 / 2|, with k = |p / half_axes|."""
    scaled, twice = points / half_axes, points / half_axes**2
    k = np.maximum(np.linalg.norm(scaled, axis=1), 1e-9)
    m = np.maximum(np.linalg.norm(twice, axis=1), 1e-9 / half_axes.max())
    value = k * (k - 1) / m
    by_k, by_m = (2 * k - 1) / m, -value / m
    slope = (by_k / k)[:, None] * twice + (by_m / m)[:, None] * (twice / half_axes**2)
    return value, slope


def _join(one: LevelSet, other: LevelSet, width: float) -> LevelSet:
    """Smooth minimum, cubic, with continuous second derivatives."""
    (a, slope_a), (b, slope_b) = one, other
    gap = np.maximum(width - np.abs(a - b), 0) / width
    lesser = a <= b
    share = gap**2 / 2  # weight of the larger one
    slope_low = np.where(lesser[:, None], slope_a, slope_b)
    slope_high = np.where(lesser[:, None], slope_b, slope_a)
    slope = slope_low + share[:, None] * (slope_high - slope_low)
    return np.minimum(a, b) - width * gap**3 / 6, slope
