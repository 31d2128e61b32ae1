"""Statement of the expected error of a response: its parts, how they add, and its warnings."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from math import hypot, inf, isfinite
from typing import Any

from simple_model.numbers import change_text, if_finite, percent, stated_error


@dataclass(frozen=True, kw_only=True)
class ErrorPart:
    """One cause of error: its `name` in a word or two, its `source` as a noun phrase, the relative
    `error` of the worst probe's waveform, inf if unknown, and the `cure` in the imperative.
    """

    name: str
    source: str
    error: float
    cure: str = ""

    def warning(self, tolerance: float) -> str:
        """Return the sentence that warns of this part."""
        size = f"expected error {change_text(self.error)}" if isfinite(self.error) else "not known"
        return f"{self.source}: {size}, tolerance {100 * tolerance:g} %; {self.cure}"


@dataclass(frozen=True, kw_only=True)
class Statement:
    """Expected error of a response: its `parts`, the largest first, and the `tolerance`.

    The causes are independent of each other, so the squares of the parts add: `error` is the root
    of their sum. It is inf if a part is unknown, or if no part is known.

    >>> parts = [("mesh", 0.031), ("sides", 0.012), ("start", 0.004)]
    >>> statement = Statement(
    ...     parts=tuple(ErrorPart(name=name, source=name, error=error) for name, error in parts)
    ... )
    >>> statement.words
    'mesh 3.1 %, sides 1.2 %, start 0.40 %; together 3.3 %'
    """

    parts: tuple[ErrorPart, ...] = ()
    tolerance: float = inf

    def __post_init__(self) -> None:
        parts = sorted(self.parts, key=lambda part: -part.error)
        object.__setattr__(self, "parts", tuple(parts))

    @property
    def error(self) -> float:
        """Expected relative error of the worst probe's waveform; inf if unknown."""
        return hypot(*(part.error for part in self.parts)) if self.parts else inf

    @property
    def cure(self) -> str:
        """What reduces the largest part, in the imperative; "" if nothing is known to."""
        return self.parts[0].cure if self.parts and self.parts[0].error else ""

    @property
    def warnings(self) -> tuple[str, ...]:
        """A sentence for each part above the tolerance, or for the total if no part is."""
        above = [part for part in self.parts if part.error > self.tolerance]
        if not above and self.parts and self.error > self.tolerance:
            above = [replace(self.parts[0], source="all errors together", error=self.error)]
        return tuple(part.warning(self.tolerance) for part in above)

    @property
    def words(self) -> str:
        """The parts above 1 % of the total, the largest first, and their total."""
        error = self.error
        shown = [part for part in self.parts if part.error > 0.01 * error]
        each = ", ".join(f"{part.name} {percent(part.error)}" for part in shown)
        return f"{each}; together {stated_error(error)}" if shown else stated_error(error)

    def with_parts(self, measured: Iterable[ErrorPart]) -> Statement:
        """Return the statement with measured parts, in place of those of the same names."""
        parts = {part.name: part for part in (*self.parts, *measured)}
        return replace(self, parts=tuple(parts.values()))

    def summary(self) -> dict[str, Any]:
        """Return `expected_error` and its parts, `errors`, for JSON; an unknown error is None."""
        return {
            "expected_error": if_finite(self.error),
            "errors": [asdict(part) | {"error": if_finite(part.error)} for part in self.parts],
        }

    def columns(self) -> dict[str, Any]:
        """Return `expected_error`, its parts in words and the cure of the largest, for a table;
        none if nothing is known.
        """
        if not self.parts:
            return {}
        words = {"error_parts": self.words, "error_cure": self.cure}
        return ({"expected_error": self.error} if isfinite(self.error) else {}) | words

    @staticmethod
    def of_errors(errors: Iterable[Mapping[str, Any]]) -> Statement:
        """Return the statement of the `errors` of a `summary`, without a tolerance."""
        parts = (
            ErrorPart(**{**part, "error": inf if part["error"] is None else part["error"]})
            for part in errors
        )
        return Statement(parts=tuple(parts))
