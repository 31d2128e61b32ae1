"""Checks of names and numbers, whose error messages say what to do."""

import difflib
from collections.abc import Iterable
from math import isfinite

SHORTEST_PART = 3  # letters of a part of a word that suggests the whole word


def choose(kind: str, value: str, known: Iterable[str]) -> str:
    """Return a known value; for others raise a ValueError with all known ones and the nearest."""
    known = list(known)
    if value in known:
        return value
    raise ValueError(
        f"{kind} '{value}' is unknown, use one of {', '.join(known)}{suggestion(value, known)}"
    )


def suggestion(value: object, known: Iterable[str]) -> str:
    """Suggest the nearest known word as the end of a sentence, empty if none is near."""
    near = nearest(value, known)
    return f"; did you mean '{near}'?" if near else ""


def nearest(value: object, known: Iterable[str], *, longest: int = 60) -> str:
    """Return the known word nearest to the first `longest` letters of another one, or "" if none is
    near. A word without its last parts, such as a key without its unit, is nearest to the shortest
    whole word.
    """
    words, given = {word.lower(): word for word in known}, str(value)[:longest].lower()
    near = sorted(
        (word for word in words if word.startswith(f"{given}_")), key=lambda word: word.count("_")
    )
    near = near or difflib.get_close_matches(given, words, 1, cutoff=0.6)
    if not near and len(given) >= SHORTEST_PART:
        near = [word for word in words if given in word]
    return words[near[0]] if near else ""


def check_numbers(owner: str, record: object, *names: str, least: str = "above 0") -> None:
    """Refuse fields, unless None, that are not finite and `least`: "above 0" or "0 or above"."""
    for name in names:
        value = getattr(record, name)
        if value is None or (
            isfinite(value) and (value > 0 or (value == 0 and least != "above 0"))
        ):
            continue
        raise ValueError(f"{name} = {value} of {owner} must be a finite number, {least}")


def check_range(
    name: str, value: float, low: float, high: float, unit: str = "", cure: str = ""
) -> None:
    """Refuse a number outside low to high, in a unit, with a cure."""
    if not low <= value <= high:
        raise ValueError(f"{name} = {value:g}{unit} is outside {low:g} to {high:g}{unit}{cure}")
