"""Trajectory of the focus: a named shape, a polyline at constant speed, or a recorded path.

The named shapes are those of Lim, Seifi and Park, CHI EA '24, section 2.2. Positions follow from
the phase of the drawing period, not from summed steps, so they are as exact at 10 s as at 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import isfinite, pi, sqrt

import numpy as np
from numpy.typing import ArrayLike

from simple_model.choices import check_numbers, check_range, choose
from simple_model.load.rhythm import between
from simple_model.typing import Bools, Floats, Ints, Points

SHAPES = ("point", "line", "circle", "triangle", "square")  # defined by a size alone
BY_POINTS = ("polyline", "recorded")
SWEEPS = ("there_and_back", "one_way", "sinusoidal")
LARGEST_SIZE = 0.060  # m, of a palm
LEAST_JUMP = 1e-7, 1e-6  # m and of the level; smaller changes are no jump
CORNERS_OF_CIRCLE = 132  # 0.01 mm from the largest circle; also for a line swept as a cosine
SAME_PHASE = 1e-9  # of a period
UNIT = {  # corners of shapes of size 1
    "line": ((-0.5, 0.0), (0.5, 0.0)),
    "triangle": (
        (0.0, 1 / sqrt(3)), (-0.5, -0.5 / sqrt(3)), (0.5, -0.5 / sqrt(3)), (0.0, 1 / sqrt(3)),
    ),
    "square": ((0.5, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.5, -0.5), (0.5, 0.5)),
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Trajectory:
    """A path in the skin plane. The named shapes run anticlockwise about the centre.

    Parameters
    ----------
    shape : one of `SHAPES` or `BY_POINTS`
    size : float, m, 0 to 0.06: length of the line, diameter of the circle, side of the triangle or
        square; 0 for "polyline" and "recorded"
    speed : float, m/s, along the path; 0 for "recorded"
    sweep : how a line or an open polyline repeats: "there_and_back" (f_d = speed / 2 length),
        "one_way" (f_d = speed / length, then a jump back) or "sinusoidal" (there and back as a
        cosine of time, with `speed` as the mean speed)
    centre : (x, y), m, added to all positions
    points : (k, 2), m, corners of a polyline or positions of a recording. A polyline is closed if
        its last corner equals its first.
    times : (k,), s, at which a recording is at its points; they start at 0 and never fall. The
        period is times[-1]. Equal times make a jump.
    levels : (k,), 0 to 1, factors of the amplitude at these times; all 1 if empty
    hold : bool, whether a recording stays at a point until the next time, as devices do, or moves
        there in a straight line

    Raises a ValueError if a value is unknown, not finite or out of range.

    >>> circle = Trajectory(shape="circle", size=0.02, speed=12.0)
    >>> round(circle.drawing_frequency, 1)  # Hz
    191.0
    >>> circle.position(0.0)
    array([0.01, 0.  ])
    """

    shape: str = "point"
    size: float = 0.0
    speed: float = 0.0
    sweep: str = "there_and_back"
    centre: tuple[float, float] = (0.0, 0.0)
    points: Points = ()
    times: tuple[float, ...] = ()
    levels: tuple[float, ...] = ()
    hold: bool = False

    def __post_init__(self) -> None:
        choose("shape", self.shape, (*SHAPES, *BY_POINTS))
        choose("sweep", self.sweep, SWEEPS)
        check_range("size", 1e3 * self.size, 0, 1e3 * LARGEST_SIZE, " mm", ", the size of a palm")
        check_numbers("a path", self, "speed", least="0 or above")
        _check_points(self)
        if self.shape == "recorded":
            _check_recording(self)

    @property
    def length(self) -> float:
        """Path length of one period, m."""
        if self.shape in ("point", "circle"):
            return pi * self.size * (self.shape == "circle")
        steps = float(self._arc[-1])
        return steps if self._is_one_run else 2 * steps

    @property
    def drawing_frequency(self) -> float:
        """Periods per second, Hz; 0 if the focus does not move."""
        if self.shape == "recorded":
            return 1 / self.times[-1]
        return self.speed / self.length if self.length > 0 else 0.0

    @property
    def is_static(self) -> bool:
        """Whether the focus stays where it starts."""
        return self.drawing_frequency == 0

    @property
    def is_eased(self) -> bool:
        """Whether the speed varies as a sine. Its maximum is then pi/2 times its mean."""
        can_be = self.shape in ("line", "polyline") and not self._is_one_run
        return self.sweep == "sinusoidal" and can_be

    @property
    def outline(self) -> Floats:
        """Positions (k, 2) in m whose convex hull contains the path."""
        if self.shape == "circle":
            return self.at_phase(np.linspace(0, 1, 721))
        return self._corners + self.centre

    def phase(self, t: ArrayLike) -> Floats:
        """Fraction (...) of the period, 0 to 1, at times (...) in s."""
        return np.mod(self.drawing_frequency * np.asarray(t, np.float64), 1.0)

    def position(self, t: ArrayLike) -> Floats:
        """Position (..., 2) in m at times (...) in s."""
        return self.at_phase(self.phase(t))

    def at_phase(self, phase: ArrayLike) -> Floats:
        """Position (..., 2) in m at fractions (...) of the period, 0 to 1."""
        around = self._about_origin(np.asarray(phase, np.float64))
        return around + self.centre if any(self.centre) else around

    def tangent_at_phase(self, phase: ArrayLike) -> Floats:
        """Unit tangent (..., 2) of the motion at fractions (...) of the period; 0 at rest."""
        phase, step = np.asarray(phase, np.float64), self._tangent_step
        way = np.subtract(*(self.at_phase(np.mod(phase + d, 1.0)) for d in (step, -step)))
        length = np.linalg.norm(way, axis=-1, keepdims=True)
        return np.asarray(way / np.where(length > 0, length, 1.0))

    def level_at_phase(self, phase: ArrayLike) -> Floats:
        """Level (...) of the amplitude, 0 to 1, at fractions (...) of the period."""
        phase = np.asarray(phase, np.float64)
        if not self.levels:
            return np.ones_like(phase)
        before, part = self._between(phase)
        level = np.array(self.levels)
        return np.asarray(level[before] + part * (level[before + 1] - level[before]))

    @cached_property
    def parts(self) -> tuple[Floats, Floats]:
        """Bounds (s + 1,) of the smooth parts, as phases, and their lengths (s,) in m."""
        if self.shape == "recorded":
            clock = self._clock
            bounds = np.unique(clock) / clock[-1]
            steps = np.linalg.norm(np.diff(self._corners, axis=0), axis=1)[np.diff(clock) > 0]
            return bounds, np.zeros_like(steps) if self.hold else steps
        bounds = np.array([0.0, 1.0])
        if self.shape != "circle" and self.length > 0:
            bounds = np.unique(self._arc) / self._arc[-1]
            if not self._is_one_run:
                way = np.arccos(1 - 2 * bounds) / pi if self.is_eased else bounds
                bounds = np.concatenate([way, 2 - way[-2::-1]]) / 2
        share = pi / 2 if self.is_eased else 1.0  # at its fastest
        return bounds, share * self.length * np.diff(bounds)

    @cached_property
    def jumps(self) -> Floats:
        """Fractions (j,) of the period, in [0, 1), at which position or level jumps."""
        starts = self.parts[0][:-1]
        return starts[differ(*self.limits_at(starts))]

    @cached_property
    def turns(self) -> Floats:
        """Fractions (j,) of the period, in [0, 1), at which the direction jumps."""
        starts, aside = self.parts[0][:-1], 2 * self._tangent_step
        ways = self.tangent_at_phase(np.mod([starts - aside, starts + aside], 1.0))
        return starts[np.abs(ways[1] - ways[0]).max(axis=-1) > 1e-3]  # less is no turn

    def limits_at(self, phases: Floats) -> tuple[Floats, Floats]:
        """Positions and level (k, 3) just before and just after fractions (k,) of the period."""
        aside = np.mod([phases - self._nearby, phases + self._nearby], 1.0)
        before, after = (np.column_stack([self.at_phase(a), self.level_at_phase(a)]) for a in aside)
        return before, after

    def within_part(self, part: int, along: Floats) -> Floats:
        """Positions (k, 2) in m at fractions (k,) of the time of a part, ends included."""
        start, end = self.parts[0][part : part + 2]
        phases = start + (end - start) * along
        return self.at_phase(np.clip(phases, start + self._nearby, end - self._nearby))

    @property
    def _tangent_step(self) -> float:
        return 1e-6 / max(1, len(self.points))

    @property
    def _nearby(self) -> float:
        """Fraction of the period between distinct times in which nothing moves."""
        return 2e-9 / max(1, len(self.points) - 1)

    def _about_origin(self, phase: Floats) -> Floats:
        if self.shape == "point":
            return np.zeros((*phase.shape, 2))
        if self.shape == "circle":
            angle = 2 * pi * phase
            return self.size / 2 * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        if self.shape == "recorded":
            before, part = self._between(phase)
            start = self._corners[before]
            return np.asarray(start + part[..., None] * (self._corners[before + 1] - start))
        if self.is_eased:
            phase = (1 - np.cos(2 * pi * phase)) / 2
        elif not self._is_one_run:
            phase = 1 - np.abs(1 - 2 * phase)
        at = phase * self._arc[-1]
        return np.stack([np.interp(at, self._arc, x) for x in self._corners.T], axis=-1)

    @property
    def _is_one_run(self) -> bool:
        """Whether a period is one run along the corners."""
        corners = self._corners
        closed = len(corners) > 2 and (corners[0] == corners[-1]).all()
        return bool(self.shape == "recorded" or self.sweep == "one_way" or closed)

    @cached_property
    def _corners(self) -> Floats:
        if self.shape in BY_POINTS:
            return np.array(self.points, np.float64)
        return self.size * np.array(UNIT.get(self.shape, ((0.0, 0.0),)))

    @cached_property
    def _arc(self) -> Floats:
        """Arc length (k,) in m up to each point."""
        steps = np.linalg.norm(np.diff(self._corners, axis=0), axis=1)
        return np.concatenate([[0.0], np.cumsum(steps)])

    @cached_property
    def _clock(self) -> Floats:
        return np.array(self.times, np.float64)

    def _between(self, phase: Floats) -> tuple[Ints, Floats]:
        """Index of the last point of a recording, and the fraction of the way to the next; a sample
        holds at its own time.
        """
        clock = self._clock
        t = phase * clock[-1]
        before, part = between(clock, t, t + self._nearby / 2 * clock[-1])
        return before, np.zeros_like(t) if self.hold else part


def differ(before: Floats, after: Floats) -> Bools:
    """Whether each position or level (k, 3) differs by more than `LEAST_JUMP`."""
    place, level = LEAST_JUMP
    apart = np.abs(after - before)
    return (apart[:, :2] > place).any(axis=1) | (apart[:, 2] > level)


def joined(paths: Sequence[Trajectory], frequency: float) -> Trajectory:
    """Join the paths of several foci into one recording, which the foci share.

    The recording runs through the n named shapes in turn, each drawn at a frequency in Hz instead
    of its own speed. If each takes a time T, the period is n T. With `even_phases(n)` as foci, each
    path has one focus at all times. A circle of diameter d becomes a polygon, within d/2 (1 -
    cos(pi / 132)) of it. Raises a ValueError if there are no paths, if a path has points of its
    own, or if the frequency is not above 0.

    >>> path = joined([Trajectory(shape="circle", size=0.02), Trajectory(shape="point")], 185.0)
    >>> path.shape, round(path.drawing_frequency, 1)
    ('recorded', 92.5)
    """
    if not paths:
        raise ValueError("there are no paths to join; give one for each focus")
    if not (isfinite(frequency) and frequency > 0):
        raise ValueError(f"frequency = {frequency} Hz of joined paths must be finite and above 0")
    points, times = list[tuple[float, float]](), list[float]()
    for before, path in enumerate(paths):
        if path.shape not in SHAPES:
            raise ValueError(
                f"a {path.shape} path has points of its own; join {', '.join(SHAPES)} only"
            )
        is_round = path.shape == "circle" or path.is_eased
        phases = np.linspace(0, 1, CORNERS_OF_CIRCLE + 1) if is_round else path.parts[0]
        points += map(tuple, path.at_phase(phases).tolist())
        times += ((before + phases) / frequency).tolist()
    return Trajectory(shape="recorded", points=tuple(points), times=tuple(times))


def even_phases(n: int) -> tuple[float, ...]:
    """Return the phases (n,) of n foci that share a path evenly.

    >>> even_phases(4)
    (0.0, 0.25, 0.5, 0.75)
    """
    return tuple(j / n for j in range(n))


def split_recording(path: Trajectory, n: int) -> tuple[Floats, ...]:
    """Split a recording into n parts of equal time. Return the corners (k, 2) in m of each."""
    clock = np.array(path.times) * n / path.times[-1]
    # At a jump from part to part there are two corners: the first ends one, the second begins one.
    first = np.searchsorted(clock, np.arange(n) + SAME_PHASE, side="right") - 1
    last = np.searchsorted(clock, np.arange(1, n + 1) - SAME_PHASE)
    return tuple(path.outline[a : b + 1] for a, b in zip(first, last, strict=True))


def _check_points(path: Trajectory, most: int = 1_000_000, farthest: float = 0.300) -> None:
    """Refuse more than `most` points, and points beyond `farthest` in m, the reach of devices."""
    count = len(path.points)
    if (count < 2 or path.size != 0) if path.shape in BY_POINTS else count > 0:
        raise ValueError(
            f"a {path.shape} path has {count} points and size {1e3 * path.size:g} mm; give a "
            "polyline or recorded path at least two points and no size, other shapes a size and no "
            "points"
        )
    check_range("number of points", count, 0, most)
    try:
        places = np.array([path.centre, *path.points], np.float64)
    except (TypeError, ValueError):
        raise ValueError("points and centre must be pairs of numbers, such as (0.01, 0)") from None
    if places.shape[1:] != (2,) or not (np.abs(places) <= farthest).all():
        raise ValueError(
            f"points and centre must be pairs within ±{1e3 * farthest:g} mm, the reach of "
            "devices; move or shrink the path"
        )


def _check_recording(path: Trajectory) -> None:
    times, levels = np.array(path.times, np.float64), np.array(path.levels, np.float64)
    n = len(path.points)
    if path.speed != 0 or len(times) != n or len(levels) not in (0, n):
        raise ValueError(
            f"a recorded path has {n} points, {len(times)} times, {len(levels)} levels and speed "
            f"{path.speed:g} m/s; give one time and one level for each point, or no levels, and no "
            "speed"
        )
    if not (np.isfinite(times).all() and times[0] == 0 < times[-1] and (np.diff(times) >= 0).all()):
        raise ValueError("times of a recorded path must be finite, begin at 0 and never fall")
    if not ((levels >= 0) & (levels <= 1)).all():
        raise ValueError(
            "levels of a recorded path must be between 0 and 1; scale them to full drive"
        )
