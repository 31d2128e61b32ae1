"""Benchmarks and comparisons with other codes; tests assert none of these numbers."""

import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any


def table(*heads: str) -> Callable[..., None]:
    """Print the head of a Markdown table; return a function that prints a row."""

    def row(*cells: object) -> None:
        print(f"| {' | '.join(map(str, cells))} |", flush=True)

    row(*heads)
    row(*["---"] * len(heads))
    return row


def timed(call: Callable[..., Any], *arguments: Any, **options: Any) -> tuple[Any, float]:
    """Return the value of a call, and its wall time in s."""
    started = time.perf_counter()
    value = call(*arguments, **options)
    return value, time.perf_counter() - started


def in_process(call: Callable[..., Any], *arguments: Any) -> Any:
    """Return the value of a call in a fresh process."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as alone:
        return alone.submit(call, *arguments).result()
