"""Options of a solution, the times of its samples, and the record of its response."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

import fem
from simple_model import Effort, Response
from simple_model.choices import choose
from simple_model.response import UNEVEN
from skinwave.scene.scene import MOST_VALUES, SAMPLE_RATE, Scene
from skinwave.system.effort import Progress, silent
from skinwave.typing import Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class SolveOptions:
    """Options of a solution, independent of the scene.

    Parameters
    ----------
    model : str, a name of `models.names()`; "auto" selects the cheapest within the tolerance
    tolerance : float, 0 to 1, acceptable relative error; reduction may use a fiftieth of it
    h : float, m, element size; if not given, a plan chooses it and the modelled part of the body
    dt : float, s, time step of "fem-transient" and the nonlinear models; chosen if not given
    band : float, Hz up to which a reduced-order model meets its tolerance; a plan raises it for
        stiff bodies under faster loads
    solver : str, a backend of `fem.linear_solver`, or "auto"
    times : (t,) float, s, equally spaced within the duration, the first a multiple of their step;
        by default 10,000 samples per second over the whole duration. Spectral lines above half the
        sampling rate are left out
    progress : called with the name of the phase and the fraction done

    Raises
    ------
    ValueError
        If the solver is not installed, or a number is out of range.

    Examples
    --------
    >>> import skinwave
    >>> skinwave.SolveOptions(model="fem", tolerance=0.02, h=3e-3).h
    0.003
    >>> skinwave.SolveOptions(h=-1e-3)
    Traceback (most recent call last):
        ...
    ValueError: element size -1 mm must be a finite number above 0
    """

    model: str = "auto"
    tolerance: float = 0.05
    h: float | None = None
    dt: float | None = None
    band: float = 1000.0
    solver: str = "auto"
    times: ArrayLike | None = None
    progress: Progress = silent

    def __post_init__(self) -> None:
        if not 0 < self.tolerance < 1:
            raise ValueError(f"tolerance = {self.tolerance} is outside 0 < tolerance < 1")
        if self.solver != "auto":
            choose("solver", self.solver, ("auto", *fem.available()))
        sizes = {"h": ("element size", 1e3, "mm"), "dt": ("time step", 1.0, "s")}
        for name, (what, per_unit, unit) in sizes.items():
            value = getattr(self, name)
            if value is not None and not (np.isfinite(value) and value > 0):
                raise ValueError(
                    f"{what} {per_unit * value:g} {unit} must be a finite number above 0"
                )


DEFAULT = SolveOptions()
Solve = Callable[[Scene, Floats, SolveOptions], Response]


@contextmanager
def underflow_to_zero() -> Iterator[None]:
    """Round underflow to 0, where exponentials end, even if the caller lets NumPy raise it. It
    decorates the entries of all computing: plans, reductions and the `solve` of models.
    """
    with np.errstate(under="ignore"):
        yield


def solver_name(solver: str) -> str:
    """Return the backend that a solver option selects."""
    return fem.available()[0] if solver == "auto" else solver


def response_of(
    scene: Scene, model: str, times: Floats, values: Floats, effort: Effort
) -> Response:
    """Return the response for a scene's quantity."""
    return Response(
        model=model, times=times, probes=scene.probe_points, quantity=scene.quantity,
        values=values, effort=effort,
    )  # fmt: skip


def sample_times(scene: Scene, rate: float = SAMPLE_RATE) -> Floats:
    """Return sample times (t,) in s of a response: from 0 up to the duration, at least two."""
    return np.arange(max(2, round(scene.tacton.duration * rate))) / rate


def sample_grid(scene: Scene, times: ArrayLike | None = None) -> tuple[Floats, int]:
    """Return the times (t,) in s from 0 at which models compute, and the index of the first
    requested time; by default those of the scene. Raises a ValueError if times are not evenly
    spaced, exceed the duration, or are too many.
    """
    if times is None:
        return sample_times(scene), 0
    given = np.asarray(times, np.float64)
    if given.ndim != 1 or len(given) < 2 or not np.isfinite(given).all():
        raise ValueError(f"times have shape {given.shape}; give (t,) finite numbers in s, t >= 2")
    start, end = float(given[0]), float(given[-1])
    step, duration = (end - start) / (len(given) - 1), scene.tacton.duration
    if not (step > 0 and np.abs(np.diff(given) - step).max() <= UNEVEN * step):
        raise ValueError("times do not rise in equal steps; give evenly spaced times")
    if not (start >= 0 and end <= duration + UNEVEN * step):
        raise ValueError(
            f"times from {start:g} to {end:g} s are outside 0..{duration:g} s, the duration of the "
            "Tacton; give times within it"
        )
    first = round(start / step)
    if abs(start - first * step) > UNEVEN * step * max(1, first):
        raise ValueError(
            f"times begin at {start:g} s, which is not a multiple of their step, {step:g} s; begin "
            f"at {first * step:g} s"
        )
    if (count := (first + len(given)) * len(scene.probes)) > MOST_VALUES:
        raise ValueError(
            f"{count:,} values from 0 to {end:g} s exceed the limit of {MOST_VALUES:,}; give a "
            "larger step"
        )
    return np.asarray(step * np.arange(first + len(given)), np.float64), first


def from_first(response: Response, first: int) -> Response:
    """Return a response without the samples before an index."""
    if not first:
        return response
    return replace(response, times=response.times[first:], values=response.values[first:])
