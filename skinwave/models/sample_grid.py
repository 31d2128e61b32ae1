"""Times of a response that a user asks for, on the grid from rest that models compute on."""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from meshes.tetmesh import Floats
from simple_model import Response
from simple_model.response import UNEVEN
from skinwave.models.prepared import sample_times
from skinwave.scene.scene import MOST_VALUES, Scene


def sample_grid(scene: Scene, times: ArrayLike | None = None) -> tuple[Floats, int]:
    """Times (t,) in s from 0 with the step of some times, and which of them is the first of these;
    those of the scene if none are given.

    Raises
    ------
    ValueError
        If they are not evenly spaced, not within the duration, or too many.
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
    """A response from a time on that has a number."""
    if not first:
        return response
    return replace(response, times=response.times[first:], values=response.values[first:])
