"""Parameters of a fit: numeric keys of a scene, and four parameters of the measurement.

Each parameter, or its logarithm if both limits are above 0, is mapped to the unit interval between
its limits.
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

GAIN, DELAY = "gain", "delay_ms"
OF_MEASUREMENT = (GAIN, DELAY, "offset_x_mm", "offset_y_mm")  # not keys of a scene
Values = Mapping[str, float]


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """Parameter of a fit by its key, with limits in the unit of the key."""

    key: str
    low: float
    high: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
            text = f"{self.key}={self.low:g}:{self.high:g}"
            raise ValueError(f"--vary {text} needs two finite numbers, the lower one first")

    @property
    def is_log(self) -> bool:
        """Whether the logarithm varies."""
        return self.low > 0

    @property
    def span(self) -> float:
        """Distance between the limits, or between their logarithms."""
        return math.log(self.high / self.low) if self.is_log else self.high - self.low

    def value(self, u: float) -> float:
        """Return the value at u in the unit interval."""
        return self.low * math.exp(u * self.span) if self.is_log else self.low + u * self.span

    def position(self, value: float) -> float:
        """Return the position of a value in the unit interval, clipped to 0 to 1."""
        value = min(max(value, self.low), self.high)
        return (math.log(value / self.low) if self.is_log else value - self.low) / self.span


@dataclass(frozen=True, kw_only=True)
class Parameters:
    """The `free` parameters of a fit, and `ties`: expressions of them by key."""

    free: tuple[Parameter, ...]
    ties: Mapping[str, str]

    def __post_init__(self) -> None:
        if not self.free:
            raise ValueError("nothing is fitted; give --vary KEY=low:high at least once")
        every = [*self.keys, *self.ties]
        if twice := [key for key in dict.fromkeys(every) if every.count(key) > 1]:
            raise ValueError(f"{twice[0]} is given twice; vary it, or tie it, once")

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys of the free parameters."""
        return tuple(each.key for each in self.free)

    def values(self, u: Floats) -> dict[str, float]:
        """Return the values of all keys at a point u (k,) of the unit cube."""
        values = {each.key: each.value(float(x)) for each, x in zip(self.free, u, strict=True)}
        for key, text in self.ties.items():
            values[key] = _tied_value(key, text, values)
        return values


def parse(vary: Sequence[str], tie: Sequence[str] = ()) -> Parameters:
    """Parse texts `KEY=low:high` and `KEY=expression` into parameters."""
    ties = {}
    for text in tie:
        key, _, right = text.partition("=")
        if not right.strip():
            raise ValueError(f"--tie {text} has no expression; write KEY=expression")
        ties[_key(key)] = right.strip()
    return Parameters(free=tuple(map(_parameter, vary)), ties=ties)


def _parameter(text: str) -> Parameter:
    key, _, right = text.partition("=")
    limits = [number_in(part) for part in right.split(":")]
    if len(limits) != 2 or None in limits:
        raise ValueError(f"--vary {text} has no limits; write KEY=low:high")
    low, high = (x for x in limits if x is not None)
    return Parameter(key=_key(key), low=low, high=high)


def _key(text: str) -> str:
    key = text.strip()
    return key if key in OF_MEASUREMENT else variation.parse(f"{key}=0").key


def _tied_value(key: str, expression: str, values: Values) -> float:
    """Return the value of an expression in terms of other keys."""
    keys = r"(?<![\w.])[A-Za-z_][\w.]*"
    try:
        numbers = re.sub(keys, lambda match: f"({float(values[match[0]])!r})", expression)
        value = float(_evaluate(ast.parse(numbers, mode="eval").body))
    except (ArithmeticError, LookupError, SyntaxError, TypeError, ValueError):
        raise ValueError(
            f"--tie {key}={expression} cannot be evaluated; use numbers and keys that vary"
        ) from None
    if not math.isfinite(value):
        raise ValueError(f"--tie {key}={expression} gives {value}; it must be finite")
    return value


def _evaluate(node: ast.AST) -> float:
    """Return the value of an expression of numbers with + - * / and **."""
    operators: dict[type, Callable[[float, float], float]] = {
        ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul,
        ast.Div: operator.truediv, ast.Pow: math.pow,
    }  # fmt: skip
    match node:
        case ast.Constant(value=int() | float() as value):
            return value
        case ast.BinOp(left=left, op=op, right=right):
            return operators[type(op)](_evaluate(left), _evaluate(right))
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -_evaluate(operand)
    raise ValueError


def of_scene(values: Values) -> dict[str, float]:
    """Return those of the values that are keys of a scene."""
    return {key: value for key, value in values.items() if key not in OF_MEASUREMENT}


def check_limits(scene: Scene, parameters: Parameters) -> None:
    """Raise a ValueError if the scene is not valid at a limit of a parameter."""
    for k, each in enumerate(parameters.free):
        for end, limit in ((0.0, each.low), (1.0, each.high)):
            u = np.full(len(parameters.free), 0.5)
            u[k] = end
            try:
                with_values(scene, of_scene(parameters.values(u)))
            except ValueError as error:
                raise ValueError(f"--vary {each.key} at {limit:g}: {error}") from None
