"""Numbers as pages, tables and captions print them: by magnitude, to three significant digits; and
whether what a file holds is one.
"""

from math import isfinite
from typing import Any

from simple_model.numbers import significant

__all__ = ["FAINTEST", "decibel", "is_finite_number", "significant"]

FAINTEST = -120.0  # dB: a level below it is round-off


def decibel(value: float, *, signed: bool = False) -> str:
    """A level or ratio in dB, without the unit, to 0.1 dB; "< -120" if it is below `FAINTEST`, "-"
    if it is no number.
    """
    if value < FAINTEST:
        return f"< {FAINTEST:g}"
    if not isfinite(value):
        return "-"
    rounded = round(value, 1) + 0.0  # no -0.0
    return f"{rounded:+.1f}" if signed else f"{rounded:.1f}"


def is_finite_number(value: Any) -> bool:
    """Whether a value is a number that a float can hold, and none of the two truth values."""
    try:
        return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)
    except OverflowError:  # of a whole number
        return False
