"""Rates of a motion that was sampled: velocity and acceleration of a displacement."""

from typing import TYPE_CHECKING

import numpy as np

from simple_model.quantities import NotOfThis, Quantity
from simple_model.typing import Floats

if TYPE_CHECKING:
    from simple_model.response import Response

DEGREE = 9  # of the splines that are differentiated


def derivative(response: "Response", wanted: Quantity) -> Floats:
    """A normal motion (t, p) as a rate of it."""
    own = response.record
    order = wanted.rate - own.rate
    if not own.is_normal or order < 0:
        raise NotOfThis(
            f"this response is of {own.words}, from which no {wanted.words} follows; simulate the "
            f'scene with quantity = "{wanted.name}"'
        )
    if not order:
        return response.values
    if len(response.times) <= DEGREE:
        raise NotOfThis(
            f"{len(response.times)} times are too few to differentiate, which takes {DEGREE + 1}; "
            "sample it longer"
        )
    from scipy.interpolate import make_interp_spline

    spline = make_interp_spline(response.times, response.values, DEGREE)
    return np.asarray(spline(response.times, order))
