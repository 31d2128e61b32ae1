"""Parts of a result that fail. The rest is written; its first sentence names what is left out.

Failures are reasons by the name of the part.
"""

from collections.abc import Iterator, Mapping
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager

from simple_model.numbers import first_few, plural

REASONS = (ValueError, ArithmeticError, MemoryError, OSError, BrokenProcessPool)


@contextmanager
def or_failed(failures: dict[str, str], name: str) -> Iterator[None]:
    """Add a part whose block fails to the failures, and go on without it."""
    try:
        yield
    except REASONS as error:
        failures[name] = reason(error)


def reason(error: BaseException) -> str:
    """Return an error in one line, with its type unless it is a message to users."""
    text = " ".join(str(error).split())
    is_message = isinstance(error, ValueError | ArithmeticError) and text
    return text if is_message else f"{type(error).__name__}: {text}"


def failure_text(failures: Mapping[str, str], most: int = 3) -> str:
    """Return a sentence on the failures, with at most a few names for each reason; "" if none."""
    by_reason: dict[str, list[str]] = {}
    for name, why in failures.items():
        by_reason.setdefault(why.rstrip("."), []).append(name)
    each = [f"{first_few(names, most)} ({why})" for why, names in by_reason.items()]
    return f"{plural(len(failures), 'part')} of this result failed: {'; '.join(each)}." * bool(each)
