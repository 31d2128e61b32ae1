"""One sentence for a word that is not among those that are known."""

import difflib
from collections.abc import Iterable


def choose(what: str, value: str, known: Iterable[str]) -> str:
    """The value, if it is known.

    Raises
    ------
    ValueError
        With all known words and the nearest of them.
    """
    known = list(known)
    if value in known:
        return value
    near = difflib.get_close_matches(str(value), known, 1, 0.0)
    hint = f"; did you mean '{near[0]}'?" if near else ""
    raise ValueError(f"{what} '{value}' is unknown, use one of {', '.join(known)}{hint}")
