"""Several foci on paths of their own, as one recorded path that they share.

One period of each path follows the other: n paths, each drawn in T, make a recording of period n T.
Foci at phases j/n of it are at every time one on each path; as all have the same pressure, which of
them is where makes no difference.
"""

from collections.abc import Sequence
from math import isfinite

import numpy as np

from simple_model.load.trajectory import SHAPES, Trajectory
from simple_model.typing import Floats

ROUND = 132  # corners for a circle, 0.01 mm from the largest; and for a line swept as a cosine
SAME = 1e-9  # of a period
CORNERS = {"point": 1, "line": 2, "triangle": 3, "square": 4}


def joined(paths: Sequence[Trajectory], frequency: float) -> Trajectory:
    """Recorded path of one period of each path; give it `evenly(len(paths))` as foci.

    Straight sides are exact. A circle of diameter d becomes a polygon on it, which is nowhere
    further from it than d/2 (1 - cos(pi / 132)): 0.009 mm of one of 60 mm.

    Parameters
    ----------
    paths : named shapes; each is drawn `frequency` times a second, whatever its own speed
    frequency : float, Hz, above 0

    Raises
    ------
    ValueError
        If there is no path, one has points of its own, or the frequency is not above 0.
    """
    if not paths:
        raise ValueError("no paths to join; give one for each focus")
    if not (isfinite(frequency) and frequency > 0):
        raise ValueError(f"frequency = {frequency} Hz must be finite and above 0 to draw paths")
    points, times = list[tuple[float, float]](), list[float]()
    for before, path in enumerate(paths):
        phases = _corners(path)
        points += map(tuple, path.at_phase(phases).tolist())
        times += ((before + phases) / frequency).tolist()
    return Trajectory(shape="recorded", points=tuple(points), times=tuple(times))


def evenly(n: int) -> tuple[float, ...]:
    """Phases (n,) of n foci that share a path evenly."""
    return tuple(j / n for j in range(n))


def parted(path: Trajectory, n: int) -> tuple[Floats, ...]:
    """Corners (k, 2) in metre of each of n parts that take a recording equally long."""
    clock = np.array(path.times) * n / path.times[-1]
    # At a jump from part to part there are two corners: the first ends one, the second begins one.
    first = np.searchsorted(clock, np.arange(n) + SAME, side="right") - 1
    last = np.searchsorted(clock, np.arange(1, n + 1) - SAME)
    return tuple(path.outline[a : b + 1] for a, b in zip(first, last, strict=True))


def _corners(path: Trajectory) -> Floats:
    """Fractions (k,) of the period, from 0 to 1, between which a named shape is straight."""
    if path.shape not in SHAPES:
        raise ValueError(f"a {path.shape} path has points of its own; join named shapes")
    if path.shape == "circle" or path.sweep == "sinusoidal":
        return np.linspace(0, 1, ROUND + 1)
    sides = 1 if path.sweep == "one_way" and path.shape == "line" else CORNERS[path.shape]
    return np.linspace(0, 1, sides + 1)
