"""Requests that a page may send to its process: values of controls, of the view, and triggers.

A page's own script is not the only one that can talk: whatever has the page's password can set any
variable of trame's state and call any of its triggers with any content. What is of another kind
than the page itself sends is left out, before anything here reads it.
"""

import inspect
import sys
import traceback
from collections.abc import Callable, Sequence
from functools import wraps
from math import isfinite
from typing import Any

from skinwave.web.controls import KEYS
from skinwave.web.plots import SPANS
from skinwave.web.shown import HIGHEST, THIRD

LONGEST = 10_000  # characters of a text
LARGEST_NUMBER = 1e12
MOST_GIVEN = 3  # to a trigger


def is_number(given: Any) -> bool:
    """Whether it is a number that can be computed with."""
    return (
        isinstance(given, int | float)
        and not isinstance(given, bool)
        and abs(given) <= LARGEST_NUMBER
        and isfinite(given)
    )


def is_text(given: Any) -> bool:
    """Whether it is a text that a field may hold."""
    return isinstance(given, str) and len(given) <= LONGEST


def is_switch(given: Any) -> bool:
    """Whether it is on, off or not yet either."""
    return given is None or isinstance(given, bool)


def is_file(given: Any) -> bool:
    """Whether it is what a browser sends of a file that was chosen, or of none."""
    one = given[0] if isinstance(given, list) and len(given) == 1 else given
    if not isinstance(one, dict):
        return given is None or given == []
    content = one.get("content", b"")
    parts = content if isinstance(content, list) else [content]
    return all(isinstance(part, bytes) for part in parts)


SET: dict[str, Callable[[Any], bool]] = {
    **dict.fromkeys(KEYS, lambda given: is_number(given) or is_text(given)),
    **dict.fromkeys(
        (
            "hold",
            "solid",
            "published",
            "dark",
            "about",
            "drawer",
            "decibel",
            "against",
            "layers_open",
        ),
        is_switch,
    ),
    "span": lambda given: is_text(given) and given in SPANS,
    "highest": lambda given: is_number(given) and given in HIGHEST,
    "third": lambda given: is_text(given) and given in THIRD,
    "pulse": lambda given: is_number(given) and given >= 0,
    "rhythm_span": lambda given: is_number(given) and given >= 0,
    "opened": is_file,
    "measured_file": is_file,
}


def kept(changes: Any) -> list[dict[str, Any]]:
    """Changes of a state that the page's own script would send, among those that were sent."""
    if not isinstance(changes, list):
        return []
    return [
        {"key": change["key"], "value": change.get("value")}
        for change in changes
        if isinstance(change, dict)
        and isinstance(change.get("key"), str)
        and change["key"] in SET
        and SET[change["key"]](change.get("value"))
    ]


def numbers(*given: Any) -> tuple[float, ...]:
    """Values that a trigger is given, as numbers.

    Raises
    ------
    ValueError
        If one of them is none.
    """
    if not all(map(is_number, given)):
        raise ValueError("the page gives what is no number where one is needed; reload it")
    return tuple(map(float, given))


def checked_call(make: Callable[..., Any] | None, args: Any, kwargs: Any) -> Sequence[Any]:
    """Arguments of a trigger, checked.

    Raises
    ------
    ValueError
        If there is no such trigger, or it takes no such values.
    """
    if make is None:
        raise ValueError("the page asks for what is not known here; reload it")
    if not isinstance(args, list) or len(args) > MOST_GIVEN or kwargs:
        raise ValueError(f"the page gives other than at most {MOST_GIVEN} values; reload it")
    if not all(is_number(each) or is_text(each) or is_switch(each) for each in args):
        raise ValueError("the page gives a value that is no number and no text; reload it")
    try:
        inspect.signature(make).bind(*args)
    except TypeError:
        raise ValueError(f"the page gives {len(args)} values, too many or too few") from None
    return args


def guard(core: Any) -> None:
    """Have trame's protocol (its class) take from a page what is allowed here, and no more.

    Raises
    ------
    AttributeError
        If it is another protocol than the one known here: nothing would be guarded.
    """
    update, trigger = core.update_state, core.trigger

    @wraps(update)
    def update_state(self: Any, changes: Any) -> Any:
        return update(self, kept(changes))

    @wraps(trigger)
    async def trigger_checked(self: Any, name: Any, args: Any = (), kwargs: Any = None) -> Any:
        state = self.server.state
        try:
            named = self.server.controller.trigger_fn(name) if is_text(name) else None
            return await trigger(self, name, list(checked_call(named, args, kwargs)), {})
        except ValueError as error:
            with state:
                state.problem = str(error)
            raise
        except Exception:
            traceback.print_exc(file=sys.stderr)
            raise

    core.update_state, core.trigger = update_state, trigger_checked
    for name in ("force_push_state", "life_cycle_update"):  # which nothing here needs
        setattr(core, name, wraps(getattr(core, name))(lambda self, *_: None))
