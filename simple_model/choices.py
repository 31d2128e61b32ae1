"""Checks of names and numbers, with error messages that say the cure."""

import difflib
from collections.abc import Iterable
from math import isfinite

NEAR = 0.6  # of difflib's ratio: 2 x letters in common over all letters
SHORTEST, LONGEST = 3, 60  # letters: of a part of a word that is near, and that are compared


def choose(what: str, value: str, known: Iterable[str]) -> str:
    """Return the value, if it is among those known; otherwise raise a ValueError that names `what`,
    all known words, and the nearest of them if it is near.
    """
    known = list(known)
    if value in known:
        return value
    raise ValueError(
        f"{what} '{value}' is unknown, use one of {', '.join(known)}{suggestion(value, known)}"
    )


def suggestion(value: object, known: Iterable[str]) -> str:
    """Suggestion of the nearest word, to end a sentence; empty if none is near.

    What is the beginning of a word, such as a key without its unit, is nearest to that which adds
    fewest parts.
    """
    words, said = {word.lower(): word for word in known}, str(value)[:LONGEST].lower()
    begun = [word for word in words if word.startswith(f"{said}_")]
    near = sorted(begun, key=lambda word: word.count("_")) or difflib.get_close_matches(
        said, words, 1, NEAR
    )
    if not near and len(said) >= SHORTEST:
        near = [word for word in words if said in word]
    return f"; did you mean '{words[near[0]]}'?" if near else ""


def check_numbers(what: str, record: object, *names: str, least: str = "above 0") -> None:
    """Refuse fields of a record that are not finite and "above 0" or, as `least`, "0 or above";
    None is left out.
    """
    for name in names:
        value = getattr(record, name)
        if value is None or (
            isfinite(value) and (value > 0 or (value == 0 and least != "above 0"))
        ):
            continue
        raise ValueError(f"{name} = {value} of {what} must be a finite number, {least}")


def check_range(
    what: str, value: float, low: float, high: float, unit: str = "", cure: str = ""
) -> None:
    """Refuse a number outside low..high, in a unit, with a cure."""
    if not low <= value <= high:
        raise ValueError(f"{what} = {value:g}{unit} is outside {low:g}..{high:g}{unit}{cure}")
