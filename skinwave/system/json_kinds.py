"""Whether what a JSON file of a result holds is of the kinds that are read from it."""

from dataclasses import fields
from math import isfinite
from typing import Any

from simple_model import Effort

CASE = {
    "title": str, "source": str, "value": float, "reference": float, "error": float, "bar": float,
    "passed": bool,
}  # fmt: skip
TRUST = {"command?": str, "model?": str, "misfit?": float, "cases?": [CASE]}
PLAN = {"rows": [{"what": str, "value": str, "reason": str}], "tolerance": float, "warnings": [str]}
EFFORT = {
    f"{field.name}?": {"seconds": {str: float}, "versions": {str: str}, "warnings": [str]}.get(
        field.name, str if isinstance(field.default, str) else float
    )
    for field in fields(Effort)
}


def fitting(value: Any, pattern: Any, where: str) -> Any:
    """The value, if it fits.

    Parameters
    ----------
    pattern : a type, float for any finite number; [pattern] for a list of these; {str: pattern} for
        a table of these, or a table of patterns by key, which must be there but for "key?"

    Raises
    ------
    ValueError
        If it does not.
    """
    if isinstance(pattern, dict):
        _fit_table(value, pattern, where)
    elif isinstance(pattern, list):
        for k, item in enumerate(_of(value, list, where)):
            fitting(item, pattern[0], f"{where}[{k}]")
    elif pattern is float:
        if not is_finite_number(value):
            raise ValueError(f"{where} is no finite number; make the result anew")
    else:
        _of(value, pattern, where)
    return value


def is_finite_number(value: Any) -> bool:
    """Whether a value is a number that a float can hold, and none of the two truth values."""
    try:
        return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)
    except OverflowError:  # of a whole number
        return False


def effort_of(table: Any, where: str) -> Effort:
    """The effort in a table of a JSON file.

    Raises
    ------
    ValueError
        If it is none.
    """
    known = {field.name for field in fields(Effort)}
    if strange := set(_of(table, dict, where)) - known:
        raise ValueError(f"{where} has the unknown key {min(strange)[:40]!r}; make it anew")
    return Effort(**fitting(table, EFFORT, where))


def _fit_table(value: Any, pattern: dict[Any, Any], where: str) -> None:
    table = _of(value, dict, where)
    if str in pattern:
        for key, item in table.items():
            fitting(item, pattern[str], f"{where}.{key[:40]}")
        return
    for key, of in pattern.items():
        name = key.removesuffix("?")
        if name in table:
            fitting(table[name], of, f"{where}.{name}")
        elif name == key:
            raise ValueError(f"{where} lacks '{name}'; make the result anew")


def _of(value: Any, kind: type, where: str) -> Any:
    if not isinstance(value, kind):
        raise ValueError(f"{where} is no {kind.__name__}; make the result anew")
    return value
