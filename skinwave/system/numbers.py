"""Whether what a file holds is a number; how numbers are printed is in `simple_model.numbers`."""

from math import isfinite
from typing import Any

from simple_model.numbers import FAINTEST, decibel, significant

__all__ = ["FAINTEST", "decibel", "is_finite_number", "significant"]


def is_finite_number(value: Any) -> bool:
    """Whether a value is a number that a float can hold, and none of the two truth values."""
    try:
        return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)
    except OverflowError:  # of a whole number
        return False
