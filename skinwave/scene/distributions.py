"""Distribution of a number of a scene about its central value, and how a scene file says it.

    shear_modulus_pa = { value = 25e3, spread = 0.3 }
    peak_pressure_pa = { value = 50, factor = 2 }

`value` is what everything takes that does not ask for the spread. Numbers above 0 are lognormal if
nothing else is said, with `value` for their median, so that no sample changes sign.
"""

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from math import isfinite, log, log1p, sqrt
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtri

from meshes.tetmesh import Floats
from simple_model.choices import choose, meant
from skinwave.system.plain_text import number_in

VALUE, SHAPE = "value", "distribution"  # keys of a table beside its width
TAIL = 1.6448536269514722  # standard deviations from the median of a normal to its 95th percentile

Width = tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class Measure:
    """One way to say how wide a distribution is: the `keys` of its numbers in a scene file, and the
    `shapes` that it fits, the first of them if none is named.
    """

    keys: tuple[str, ...]
    shapes: tuple[str, ...]


MEASURES = {
    "spread": Measure(keys=("spread",), shapes=("lognormal", "normal")),
    "factor": Measure(keys=("factor",), shapes=("lognormal",)),
    "standard_error": Measure(keys=("standard_error",), shapes=("normal", "lognormal")),
    "bounds": Measure(keys=("low", "high"), shapes=("uniform", "triangular")),
}
RELATIVE = ("spread", "factor")  # measures over the value
SHAPES = tuple(dict.fromkeys(shape for m in MEASURES.values() for shape in m.shapes))


@dataclass(frozen=True, kw_only=True)
class Distribution:
    """Shape and width of a distribution, whose centre is the value that it is given with.

    Parameters
    ----------
    shape : "lognormal" (`value` is the median), "normal", "uniform" or "triangular" (mode)
    measure : "spread", the standard deviation over the central value; "factor", so that 90 % of a
        lognormal are between value / factor and value * factor; "standard_error", the standard
        deviation in the unit of the value; or "bounds"
    width : of that measure, one number, or low and high

    Raises
    ------
    ValueError
        If a name is unknown, the two do not fit, or a number is out of range.
    """

    shape: str = "lognormal"
    measure: str = "spread"
    width: Width

    def __post_init__(self) -> None:
        choose(SHAPE, self.shape, SHAPES)
        choose("measure", self.measure, MEASURES)
        if self.shape not in (fits := MEASURES[self.measure].shapes):
            raise ValueError(
                f"a {self.shape} distribution has no {self.measure}, which is of "
                f"{' or '.join(fits)}; give {_cure(self.shape)}"
            )
        if not all(map(isfinite, self.width)):
            raise ValueError(f"{self.measure} = {self.width} must be finite; give other numbers")
        if self.measure == "bounds":
            if not self.width[0] < self.width[1]:
                low, high = self.width
                raise ValueError(f"low = {low:g} is not below high = {high:g}; swap them")
        elif self.width[0] < (least := float(self.measure == "factor")):
            raise ValueError(f"{self.measure} = {self.width[0]:g} is below {least:g}, its least")

    @property
    def is_relative(self) -> bool:
        """Whether its width is over the value, and the same in any unit."""
        return self.measure in RELATIVE

    @property
    def is_exact(self) -> bool:
        """Whether it is of no width: the number is known."""
        return self.measure != "bounds" and self.width[0] == float(self.measure == "factor")

    def quantile(self, value: float, shares: ArrayLike) -> Floats:
        """Quantiles (...) about a central value, at shares (...) above 0 and below 1.

        Raises
        ------
        ValueError
            If the value does not fit: outside the bounds, or not above 0 of a lognormal.
        """
        self.check(value)
        return np.asarray(QUANTILES[self.shape](value, self, np.asarray(shares, np.float64)))

    def check(self, value: float) -> None:
        """Refuse a central value that it cannot be about; raises a ValueError."""
        if self.measure == "bounds" and not self.width[0] <= value <= self.width[1]:
            low, high = self.width
            raise ValueError(f"value = {value:g} is outside low = {low:g} .. high = {high:g}")
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


def _lognormal(value: float, given: Distribution, shares: Floats) -> Floats:
    """Median `value`; s^2 = ln(1 + c^2) for a coefficient of variation c."""
    (width,) = given.width
    c = width / value if given.measure == "standard_error" else width
    s = log(width) / TAIL if given.measure == "factor" else sqrt(log1p(c**2))
    return value * np.exp(s * ndtri(shares))


def _normal(value: float, given: Distribution, shares: Floats) -> Floats:
    (width,) = given.width
    return value + (width if given.measure == "standard_error" else width * abs(value)) * ndtri(
        shares
    )


def _uniform(value: float, given: Distribution, shares: Floats) -> Floats:
    low, high = given.width
    return low + (high - low) * shares


def _triangular(value: float, given: Distribution, shares: Floats) -> Floats:
    low, high = given.width
    rising = low + np.sqrt(shares * (high - low) * (value - low))
    falling = high - np.sqrt((1 - shares) * (high - low) * (high - value))
    return np.where(shares * (high - low) < value - low, rising, falling)


QUANTILES: Mapping[str, Callable[[float, Distribution, Floats], Floats]] = {
    "lognormal": _lognormal,
    "normal": _normal,
    "uniform": _uniform,
    "triangular": _triangular,
}


def _cure(shape: str) -> str:
    keys = [m.keys for m in MEASURES.values() if shape in m.shapes]
    return " or ".join(" and ".join(each) for each in keys)


def known_to(factor: float) -> Distribution:
    """Lognormal distribution with 90 % between the value over and times a factor."""
    return Distribution(measure="factor", width=(factor,))


def read_distribution(key: str, table: Mapping[str, Any]) -> Distribution:
    """Distribution in a scene's table of a `value` and its spread.

    Raises
    ------
    ValueError
        If a key is unknown or missing, or the numbers make no distribution.
    """
    keys = (VALUE, SHAPE, *(k for m in MEASURES.values() for k in m.keys))
    for own in table:
        if own not in keys:
            hint = meant(own, keys) or f"; it may have {', '.join(keys)}"
            raise ValueError(f"{key} has the unknown key '{own}'{hint}")
    given = [n for n, m in MEASURES.items() if set(m.keys) <= table.keys()]
    used = {VALUE, SHAPE, *(k for n in given for k in MEASURES[n].keys)}
    if len(given) != 1 or table.keys() - used:
        raise ValueError(
            f"{key} needs one of spread, factor, standard_error, or low and high, beside value"
        )
    measure, value = given[0], _number(key, VALUE, table[VALUE])
    width = tuple(_number(key, own, table[own]) for own in MEASURES[measure].keys)
    shapes = MEASURES[measure].shapes
    shape = shapes[0] if value > 0 or measure != "spread" else "normal"
    try:
        found = Distribution(shape=table.get(SHAPE, shape), measure=measure, width=width)
        found.check(value)
    except ValueError as error:
        raise ValueError(f"{key}: {error}") from None
    return found


# Texts of distributions: shape, measure, and an example with all of its numbers.
CALLS = {
    "normal": ("normal", "spread", "normal(25e3, 0.3)"),
    "lognormal": ("lognormal", "spread", "lognormal(25e3, 0.3)"),
    "factor": ("lognormal", "factor", "factor(25e3, 2)"),
    "uniform": ("uniform", "bounds", "uniform(10, 20)"),
    "triangular": ("triangular", "bounds", "triangular(10, 15, 20)"),
}
CALLED = re.compile(rf"\s*({'|'.join(CALLS)})\s*\(([^()]*)\)\s*")


def called(text: str) -> tuple[float, Distribution] | None:
    """Central value and distribution of a text such as normal(25e3, 0.3), factor(25e3, 2),
    uniform(10, 20) or triangular(10, 15, 20); None of any other text.

    The first number is the central value and the second its relative standard deviation or factor;
    of the last two all are limits, with the mode of a triangular one between them.

    Raises
    ------
    ValueError
        If it has other numbers than that.
    """
    match = CALLED.fullmatch(text)
    if match is None:
        return None
    shape, measure, example = CALLS[match[1]]
    numbers = [x for x in map(number_in, match[2].split(",")) if x is not None]
    if len(numbers) != example.count(",") + 1 or len(numbers) != match[2].count(",") + 1:
        needed = example.count(",") + 1
        raise ValueError(f"{text.strip()} needs {needed} numbers; write {example}")
    if measure == "bounds":
        low, *mode, high = numbers
        value, width = (mode[0] if mode else (low + high) / 2), [low, high]
    else:
        value, *width = numbers
    found = Distribution(shape=shape, measure=measure, width=tuple(width))
    found.check(value)
    return value, found


def _number(key: str, own: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"{own} = {str(value)[:60]!r} of {key} must be a number")
    return float(value)


def _table(value: Any, given: Distribution) -> dict[str, Any]:
    """The table of a value and its distribution, as a scene file has it."""
    numbers = zip(MEASURES[given.measure].keys, given.width, strict=True)
    return {VALUE: value, SHAPE: given.shape, **dict(numbers)}


def without_spreads(node: Any, path: str = "") -> tuple[Any, dict[str, Distribution]]:
    """A scene's table with the central value for each that has a spread, and the distributions by
    dotted key, as `body.layers.0.thickness_mm`.

    Raises
    ------
    ValueError
        As `read_distribution` does.
    """
    if isinstance(node, dict) and VALUE in node and path:
        return node[VALUE], {path: read_distribution(path, node)}
    found: dict[str, Distribution] = {}

    def plain(key: object, inner: Any) -> Any:
        kept, own = without_spreads(inner, f"{path}.{key}" if path else str(key))
        found.update(own)
        return kept

    if isinstance(node, dict):
        return {key: plain(key, inner) for key, inner in node.items()}, found
    if isinstance(node, list) and any(isinstance(inner, dict) for inner in node):
        return [plain(k, inner) for k, inner in enumerate(node)], found
    return node, found


def with_spreads(
    node: dict[str, Any], spreads: Iterable[tuple[str, Distribution]]
) -> dict[str, Any]:
    """A scene's table, changed in place, with a value and its distribution for each of these keys
    that it has; none of a key that it has not.
    """
    for key, given in spreads:
        parent, last = parent_of(node, key)
        if parent is not None:
            parent[last] = _table(parent[last], given)
    return node


def parent_of(node: Any, key: str) -> tuple[Any, Any]:
    """The table or list that holds a dotted key, and its name or place there; None without one."""
    *path, last = key.split(".")
    for name in path:
        node = node[place] if (place := _place(node, name)) is not None else None
    place = _place(node, last)
    return (None, None) if place is None else (node, place)


def _place(node: Any, name: str) -> Any:
    """A name as it is one in a table, or a place in a list; None if it is in neither."""
    if isinstance(node, dict):
        return name if name in node else None
    if isinstance(node, list) and name.isdecimal() and int(name) < len(node):
        return int(name)
    return None
