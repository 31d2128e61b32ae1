"""Distribution of a number of a scene about its central value, as in a scene file:

    shear_modulus_pa = { value = 25e3, spread = 0.3 }
    peak_pressure_pa = { value = 50, factor = 2 }

Commands that do not use the spread take `value`. Numbers above 0 are lognormal by default, with
`value` as the median, so that no sample changes sign.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite, log, log1p, sqrt
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtri

from simple_model.choices import choose, suggestion
from skinwave.system.plain_text import number_in
from skinwave.typing import Floats

VALUE = "value"  # key of the central value in the table of a number
# Keys in a scene file and possible shapes, the default first, of each measure of the width.
MEASURES = {
    "spread": (("spread",), ("lognormal", "normal")),
    "factor": (("factor",), ("lognormal",)),
    "standard_error": (("standard_error",), ("normal", "lognormal")),
    "bounds": (("low", "high"), ("uniform", "triangular")),
}


@dataclass(frozen=True, kw_only=True)
class Distribution:
    """Shape and width of a distribution about a value that is given elsewhere.

    Parameters
    ----------
    shape : "lognormal" (the value is the median), "normal", "uniform" or "triangular" (the mode)
    measure : "spread", standard deviation over the central value; "factor": 90 % of a lognormal lie
        between value / factor and value * factor; "standard_error", standard deviation in the unit
        of the value; or "bounds"
    width : one number in this measure, or low and high

    >>> Distribution(measure="factor", width=(2.0,)).quantile(50.0, [0.05, 0.5, 0.95]).round(6)
    array([ 25.,  50., 100.])
    """

    shape: str = "lognormal"
    measure: str = "spread"
    width: tuple[float, ...]

    def __post_init__(self) -> None:
        choose("measure", self.measure, MEASURES)
        if self.shape not in (fits := MEASURES[self.measure][1]):
            raise ValueError(
                f"a {self.shape} distribution cannot be given by {self.measure}; use "
                f"{' or '.join(fits)}, or another measure of its width"
            )
        if not all(map(isfinite, self.width)):
            raise ValueError(f"{self.measure} = {self.width} must be finite")
        if self.measure == "bounds":
            if not self.width[0] < self.width[1]:
                low, high = self.width
                raise ValueError(f"low = {low:g} must be below high = {high:g}; swap them")
        elif self.width[0] < (least := float(self.measure == "factor")):
            raise ValueError(f"{self.measure} = {self.width[0]:g} must be at least {least:g}")

    @property
    def is_relative(self) -> bool:
        """Whether its width is relative to the value, and so independent of the unit."""
        return self.measure in ("spread", "factor")

    @property
    def is_exact(self) -> bool:
        """Whether the number is known exactly."""
        return self.measure != "bounds" and self.width[0] == float(self.measure == "factor")

    def quantile(self, value: float, shares: ArrayLike) -> Floats:
        """Return the quantiles (...) about a central value, at shares (...) from 0 to 1."""
        self.check(value)
        edge = 1e-9  # distance of shares from 0 and 1, which keeps quantiles finite
        shares = np.clip(np.asarray(shares, np.float64), edge, 1 - edge)
        if self.measure == "bounds":
            low, high = self.width
            if self.shape == "uniform":
                return np.asarray(low + (high - low) * shares)
            rising = low + np.sqrt(shares * (high - low) * (value - low))
            falling = high - np.sqrt((1 - shares) * (high - low) * (high - value))
            return np.where(shares * (high - low) < value - low, rising, falling)
        (width,) = self.width
        if self.shape == "normal":
            deviation = width if self.measure == "standard_error" else width * abs(value)
            return np.asarray(value + deviation * ndtri(shares))
        c = width / value if self.measure == "standard_error" else width
        s = sqrt(log1p(c**2))
        if self.measure == "factor":
            s = log(width) / float(ndtri(0.95))
        return np.asarray(value * np.exp(s * ndtri(shares)))

    def check(self, value: float) -> None:
        """Raise a ValueError for a central value that does not fit the distribution."""
        if self.measure == "bounds" and not self.width[0] <= value <= self.width[1]:
            low, high = self.width
            raise ValueError(
                f"value = {value:g} is outside low = {low:g} to high = {high:g}; change one of them"
            )
        if self.shape == "lognormal" and not value > 0:
            raise ValueError(
                f"value = {value:g} of a lognormal distribution must be above 0; give "
                "standard_error, or low and high"
            )
        if self.measure == "spread" and value == 0:
            raise ValueError("spread is relative to value, which is 0; give standard_error")

    @property
    def words(self) -> str:
        """Shape and width in a few words."""
        if self.measure == "bounds":
            return f"{self.shape}, {self.width[0]:g} to {self.width[1]:g}"
        if self.measure == "factor":
            return f"known to a factor of {self.width[0]:g} (90 %)"
        if self.measure == "spread":
            return f"{self.shape}, standard deviation {100 * self.width[0]:.3g} %"
        return f"{self.shape}, standard error {self.width[0]:g}"


@dataclass(frozen=True, kw_only=True)
class Spread:
    """An uncertain number of a scene."""

    key: str  # dotted
    value: float  # the central one, in the unit of the key
    distribution: Distribution
    implied: bool = False  # by a preset or the device

    @property
    def part(self) -> str:
        """The source of uncertainty that it belongs to: material, device or placement."""
        parts = {"body": "material", "focus": "device", "tacton": "device"}
        return parts.get(self.key.partition(".")[0], "placement")

    def at(self, shares: ArrayLike) -> list[float]:
        """Return the quantiles at shares (n,) from 0 to 1."""
        return list(self.distribution.quantile(self.value, shares).tolist())


def within_factor(factor: float) -> Distribution:
    """Return the lognormal distribution with 90 % between the value over and times a factor."""
    return Distribution(measure="factor", width=(factor,))


def uniform(key: str, low: float, high: float) -> Spread:
    """Return a number that is uniformly distributed between limits."""
    bounds = Distribution(shape="uniform", measure="bounds", width=(low, high))
    return Spread(key=key, value=(low + high) / 2, distribution=bounds)


def read_distribution(key: str, table: Mapping[str, Any]) -> Distribution:
    """Return the distribution in the table of a `value` and its spread."""
    known = (VALUE, "distribution", *(k for keys, _ in MEASURES.values() for k in keys))
    for own in table:
        if own not in known:
            hint = suggestion(own, known) or f"; use one of {', '.join(known)}"
            raise ValueError(f"{key} has the unknown key '{own}'{hint}")
    given = [name for name, (keys, _) in MEASURES.items() if {*keys} & table.keys()]
    if len(given) != 1 or not {*MEASURES[given[0]][0]} <= table.keys():
        raise ValueError(
            f"{key} needs value and one of spread, factor, standard_error, or low and high"
        )
    keys, shapes = MEASURES[given[0]]
    for own in (VALUE, *keys):
        if isinstance(table[own], bool) or not isinstance(table[own], int | float):
            raise ValueError(f"{own} = {str(table[own])[:60]!r} of {key} must be a number")
    value, default = float(table[VALUE]), shapes[0]
    if given == ["spread"] and value <= 0:
        default = "normal"
    try:
        distribution = Distribution(
            shape=table.get("distribution", default),
            measure=given[0],
            width=tuple(float(table[k]) for k in keys),
        )
        distribution.check(value)
    except ValueError as error:
        raise ValueError(f"{key}: {error}") from None
    return distribution


def distribution_table(value: Any, given: Distribution) -> dict[str, Any]:
    """Return the table of a value and its distribution for a scene file."""
    keys, _ = MEASURES[given.measure]
    return {VALUE: value, "distribution": given.shape, **dict(zip(keys, given.width, strict=True))}


# Distributions on the command line: shape, measure, and an example with all numbers.
CALLS = {
    "normal": ("normal", "spread", "normal(25e3, 0.3)"),
    "lognormal": ("lognormal", "spread", "lognormal(25e3, 0.3)"),
    "factor": ("lognormal", "factor", "factor(25e3, 2)"),
    "uniform": ("uniform", "bounds", "uniform(10, 20)"),
    "triangular": ("triangular", "bounds", "triangular(10, 15, 20)"),
}


def parse_distribution(key: str, text: str) -> Spread | None:
    """Return the spread of a key from a text like those in `CALLS`; None for any other text.

    The central value comes first, or is the middle of the limits.
    """
    match = re.fullmatch(rf"\s*({'|'.join(CALLS)})\s*\(([^()]*)\)\s*", text)
    if match is None:
        return None
    shape, measure, example = CALLS[match[1]]
    numbers = [x for x in map(number_in, match[2].split(",")) if x is not None]
    if not len(numbers) == example.count(",") + 1 == match[2].count(",") + 1:
        needed = example.count(",") + 1
        raise ValueError(f"{text.strip()} needs {needed} numbers; write {example}")
    if measure == "bounds":
        low, *mode, high = numbers
        value, width = (mode[0] if mode else (low + high) / 2), [low, high]
    else:
        value, *width = numbers
    distribution = Distribution(shape=shape, measure=measure, width=tuple(width))
    distribution.check(value)
    return Spread(key=key, value=value, distribution=distribution)
