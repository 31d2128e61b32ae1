"""Check that a JSON file of a result contains values of the expected kinds."""

from dataclasses import fields
from math import isfinite
from typing import Any

from simple_model import Effort, Statement

PLAN = {
    "rows": [{"what": str, "value": str, "reason": str}], "tolerance": float, "warnings": [str],
    "model": str, "misfit?": float,
}  # fmt: skip
EFFORT = {
    f"{one.name}?": str if isinstance(one.default, str) else float
    for one in fields(Effort) if one.name != "errors"
} | {"seconds?": {str: float}, "versions?": {str: str}, "warnings?": [str]}  # fmt: skip


def fitting(value: Any, pattern: Any, where: str) -> Any:
    """Return a value that fits a pattern; raise a ValueError if it does not.

    A pattern is a type (float for any finite number), [pattern] for a list, {str: pattern} for a
    table, or a table of patterns by key, where "key?" is optional.
    """
    if not _fits(value, pattern):
        raise ValueError(f"{where} has unexpected contents; compute the result again")
    return value


def is_finite_number(value: Any) -> bool:
    """Whether a value is a finite number, not a bool."""
    try:
        return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)
    except OverflowError:  # of a large integer
        return False


def effort_of(table: Any, errors: Any, where: str) -> Effort:
    """Return the effort in a table that fits `EFFORT`, with the `errors` of its record.

    Raises a ValueError for unknown keys, and for other contents of the errors.
    """
    parts = [{"name": str, "source": str, "error": float | None, "cure": str}]
    statement = Statement.of_errors(fitting(errors, parts, where))
    if unknown := table.keys() - {key.removesuffix("?") for key in EFFORT}:
        raise ValueError(
            f"{where} has the unknown key {min(unknown)[:40]!r}; compute the result again"
        )
    return Effort(**table, errors=statement)


def _fits(value: Any, pattern: Any) -> bool:
    if isinstance(pattern, list):
        return isinstance(value, list) and all(_fits(item, pattern[0]) for item in value)
    if pattern is float:
        return is_finite_number(value)
    if pattern == float | None:
        return value is None or is_finite_number(value)
    if not isinstance(pattern, dict):
        return isinstance(value, pattern)
    if not isinstance(value, dict):
        return False
    if str in pattern:
        return all(_fits(item, pattern[str]) for item in value.values())
    return all(
        _fits(value[name], of) if (name := key.removesuffix("?")) in value else name != key
        for key, of in pattern.items()
    )
