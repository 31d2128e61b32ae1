"""Options of a solution, and the times at which it is sampled."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import fem
from simple_model import Response
from simple_model.choices import choose
from simple_model.response import UNEVEN
from skinwave.scene.scene import MOST_VALUES, SAMPLE_RATE, Scene
from skinwave.system.effort import Progress, silent
from skinwave.typing import Floats

MapFunction = Callable[..., Iterable[Any]]  # of the shape of the built-in `map`
SIZES = {"h": ("element size", 1e3, "mm"), "dt": ("time step", 1.0, "s")}


@dataclass(frozen=True, kw_only=True, eq=False)
class SolveOptions:
    """How a scene is solved, whatever the scene.

    Parameters
    ----------
    model : str, a name of `models.names()`, or "auto": the cheapest within the tolerance
    tolerance : float, 0..1, relative error that may be made; reduction takes at most a fiftieth
    h : float, metre, element size; planned if not given, and with it the extent of the body
    dt : float, s, time step of "fem-transient" and the nonlinear models; chosen if not given
    solver : str, a backend of `fem.linear_solver`, or "auto"
    times : (t,) float, s, equally spaced within the duration, the first a multiple of their step;
        10 kHz over all of it if not given. Lines above half their rate are left out
    progress : called with the name of the phase and the fraction done
    mapped : called like the built-in `map`, for the lines of "fem-harmonic"

    Raises
    ------
    ValueError
        If the solver is not installed, or a number is out of range.
    """

    model: str = "auto"
    tolerance: float = 0.05
    h: float | None = None
    dt: float | None = None
    solver: str = "auto"
    times: ArrayLike | None = None
    progress: Progress = silent
    mapped: MapFunction = map

    def __post_init__(self) -> None:
        if not 0 < self.tolerance < 1:
            raise ValueError(f"tolerance = {self.tolerance} is outside 0 < tolerance < 1")
        if self.solver != "auto":
            choose("solver", self.solver, ("auto", *fem.available()))
        for name, (what, per_unit, unit) in SIZES.items():
            value = getattr(self, name)
            if value is not None and not (np.isfinite(value) and value > 0):
                raise ValueError(
                    f"{what} {per_unit * value:g} {unit} must be a finite number above 0"
                )


DEFAULT = SolveOptions()


def sample_times(scene: Scene, rate: float = SAMPLE_RATE) -> Floats:
    """Sample times (t,) in s of a response: from 0 up to the duration, at least two."""
    return np.arange(max(2, round(scene.tacton.duration * rate))) / rate


def sample_grid(scene: Scene, times: ArrayLike | None = None) -> tuple[Floats, int]:
    """Times (t,) in s from 0, on which models compute, and the number of the first that is asked
    for; those of the scene if none are given. Raises a ValueError if they are not evenly spaced,
    not within the duration, or too many.
    """
    if times is None:
        return sample_times(scene), 0
    asked = np.asarray(times, np.float64)
    if asked.ndim != 1 or len(asked) < 2 or not np.isfinite(asked).all():
        raise ValueError(
            f"times have shape {asked.shape}; give (t,) finite numbers in s, two or more"
        )
    step = float(asked[-1] - asked[0]) / (len(asked) - 1)
    if not (step > 0 and np.abs(np.diff(asked) - step).max() <= UNEVEN * step):
        raise ValueError("times do not rise in equal steps; give evenly spaced ones")
    duration = scene.tacton.duration
    if not (asked[0] >= 0 and asked[-1] <= duration + UNEVEN * step):
        raise ValueError(
            f"times from {asked[0]:g} to {asked[-1]:g} s are outside 0..{duration:g} s, the "
            "duration of the Tacton; give times within it"
        )
    first = round(float(asked[0]) / step)
    if abs(asked[0] - first * step) > UNEVEN * step * max(1, first):
        raise ValueError(
            f"times begin at {asked[0]:g} s, which is no multiple of their step, {step:g} s; begin "
            f"at {first * step:g} s"
        )
    if (values := (first + len(asked)) * len(scene.probes)) > MOST_VALUES:
        raise ValueError(
            f"{values:,} values from 0 to {asked[-1]:g} s are more than {MOST_VALUES:,}; give a "
            "larger step"
        )
    return np.asarray(step * np.arange(first + len(asked)), np.float64), first


def from_first(response: Response, first: int) -> Response:
    """A response without its samples before a number."""
    if not first:
        return response
    return replace(response, times=response.times[first:], values=response.values[first:])
