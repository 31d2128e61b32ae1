"""Parameters of a fit: numeric keys of a scene, and the nuisance parameters of a measurement.

A fit works in the unit interval between the limits of each parameter, by its logarithm where both
limits are above 0, as those of moduli are.
"""

import ast
import math
import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from skinwave.scene import variation
from skinwave.scene.scene import Scene
from skinwave.scene.variation import with_values
from skinwave.system.plain_text import number_in
from skinwave.typing import Floats

GAIN, DELAY, OFFSET_X, OFFSET_Y = "gain", "delay_ms", "offset_x_mm", "offset_y_mm"
NUISANCES = (GAIN, DELAY, OFFSET_X, OFFSET_Y)  # of a measurement, no keys of a scene
PRESSURE, FORCE = "focus.peak_pressure_pa", "load.force_n"  # which linear waves go with
Values = Mapping[str, float]
OPERATORS: dict[type, Callable[[float, float], float]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.Pow: math.pow,
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """Parameter of a fit by its key, in the unit of the key between the limits `low` and `high`."""

    key: str
    low: float
    high: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
            raise ValueError(
                f"--vary {self.key}={self.low:g}:{self.high:g} must be two finite numbers, the "
                "lower one first; give KEY=low:high"
            )

    @property
    def is_log(self) -> bool:
        """Whether it is varied by its logarithm."""
        return self.low > 0

    @property
    def span(self) -> float:
        """Width between the limits, of the logarithm if it is varied by that."""
        return math.log(self.high / self.low) if self.is_log else self.high - self.low

    def value(self, u: float) -> float:
        """Value at u of the unit interval."""
        return self.low * math.exp(u * self.span) if self.is_log else self.low + u * self.span

    def place(self, value: float) -> float:
        """Place of a value in the unit interval, the nearest if it is outside."""
        value = min(max(value, self.low), self.high)
        return (math.log(value / self.low) if self.is_log else value - self.low) / self.span


@dataclass(frozen=True, kw_only=True)
class Parameters:
    """All parameters of a fit: those that are `free`, and expressions of them by key, `ties`."""

    free: tuple[Parameter, ...]
    ties: Mapping[str, str]

    def __post_init__(self) -> None:
        keys = [each.key for each in self.free]
        if not keys:
            raise ValueError("nothing is fitted; give --vary KEY=low:high at least once")
        every = keys + list(self.ties)
        if twice := [key for key in dict.fromkeys(every) if every.count(key) > 1]:
            raise ValueError(f"{twice[0]} is given twice; vary it, or tie it, once")

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys of the free ones."""
        return tuple(each.key for each in self.free)

    def values(self, u: Floats) -> dict[str, float]:
        """Values by key at a point u (k,) of the unit cube, those that are tied too."""
        found = {each.key: each.value(float(x)) for each, x in zip(self.free, u, strict=True)}
        return found | _tied(found, self.ties) if self.ties else found


def parse(vary: Sequence[str], tie: Sequence[str] = ()) -> Parameters:
    """Parameters of `KEY=low:high` and ties of `KEY=expression`; raises a ValueError if a key or a
    limit is none.
    """
    ties = dict(_tie(text) for text in tie)
    return Parameters(free=tuple(map(_parameter, vary)), ties=ties)


def _parameter(text: str) -> Parameter:
    key, _, right = text.partition("=")
    limits = [number_in(part) for part in right.split(":")]
    if len(limits) != 2 or None in limits:
        raise ValueError(f"--vary {text} has no limits; write KEY=low:high")
    low, high = (x for x in limits if x is not None)
    return Parameter(key=_key(key), low=low, high=high)


def _tie(text: str) -> tuple[str, str]:
    key, equals, right = text.partition("=")
    if not equals or not right.strip():
        raise ValueError(f"--tie {text} has no expression; write KEY=expression")
    return _key(key), right.strip()


def _key(text: str) -> str:
    """A nuisance parameter, or a key of a scene."""
    key = text.strip()
    return key if key in NUISANCES else variation.parse(f"{key}=0").key


def _tied(values: Values, ties: Mapping[str, str]) -> dict[str, float]:
    """Values of expressions of other keys, also of ties before them."""
    known, found = dict(values), {}
    for key, text in ties.items():
        names = {each: f"key_{n}" for n, each in enumerate(known)}
        for each in sorted(names, key=len, reverse=True):
            pattern = rf"(?<![\w.]){re.escape(each)}(?![\w.])"
            text = re.sub(pattern, names[each], text)
        numbers = {names[each]: value for each, value in known.items()}
        try:
            value = float(_evaluated(ast.parse(text.strip(), mode="eval").body, numbers))
        except (ArithmeticError, LookupError, SyntaxError, TypeError, ValueError):
            raise ValueError(
                f"--tie {key}={ties[key]} cannot be evaluated; use numbers and keys that are varied"
            ) from None
        if not math.isfinite(value):
            raise ValueError(f"--tie {key}={ties[key]} is {value}; write one that is finite")
        known[key] = found[key] = value
    return found


def _evaluated(node: ast.AST, numbers: Values) -> float:
    """Value of an expression of numbers, names, + - * / and **."""
    match node:
        case ast.Constant(value=int() | float() as value):
            return value
        case ast.Name(id=name):
            return numbers[name]
        case ast.BinOp(left=left, op=op, right=right):
            return OPERATORS[type(op)](_evaluated(left, numbers), _evaluated(right, numbers))
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -_evaluated(operand, numbers)
    raise ValueError


def of_scene(values: Values) -> dict[str, float]:
    """Return the values of keys of a scene."""
    return {key: value for key, value in values.items() if key not in NUISANCES}


def check(scene: Scene, parameters: Parameters) -> None:
    """Raise a ValueError if a limit makes no scene, before any work."""
    middle = np.full(len(parameters.free), 0.5)
    for k, each in enumerate(parameters.free):
        for end, limit in ((0.0, each.low), (1.0, each.high)):
            at = np.where(np.arange(len(middle)) == k, end, middle)
            try:
                with_values(scene, of_scene(parameters.values(at)))
            except ValueError as error:
                raise ValueError(f"--vary {each.key} at {limit:g}: {error}") from None
