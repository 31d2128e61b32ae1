"""Pools of processes, which end with the process that started them.

This module imports only light modules, because the command line starts with it.
"""

import os
import signal
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from concurrent.futures import Executor, Future, ProcessPoolExecutor

_RESERVED = [0]  # cores of the processes of this one's pools
SAFE_PATH = {"PYTHONSAFEPATH": "1"}  # do not import a random.py of the working folder


@contextmanager
def environment(values: Mapping[str, str]) -> Iterator[None]:
    """Set environment variables for the duration of a block."""
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


@contextmanager
def pool(count: int, threads: int | None = 1, *, renewed: bool = False) -> "Iterator[Executor]":
    """Start `count` processes, and cancel unfinished work at the end.

    Linear algebra uses so many `threads` in each, or those that the environment sets; None sets no
    limit. With `renewed`, each call runs in a new process.
    """
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    with environment(SAFE_PATH):
        executor = ProcessPoolExecutor(
            count, get_context("spawn"), initializer=begin_worker, initargs=(threads,),
            max_tasks_per_child=1 if renewed else None,
        )  # fmt: skip
        _RESERVED[0] += count
        try:
            yield executor
        finally:
            _RESERVED[0] -= count
            _end(executor)


@contextmanager
def beside() -> "Iterator[Callable[..., Future[Any]] | None]":
    """Yield a function that begins a call in a thread, or None if no core is free.

    Pools have a core for each process, and a process of a pool has one core.
    """
    from concurrent.futures import ThreadPoolExecutor
    from multiprocessing import parent_process

    from skinwave.system.effort import usable_cores

    if parent_process() or usable_cores() - _RESERVED[0] <= 1:
        yield None
        return
    with ThreadPoolExecutor(1) as thread:
        yield thread.submit


def _end(executor: "ProcessPoolExecutor") -> None:
    """Cancel the work of an executor, end its processes, and wait for its own thread.

    Until then, that thread may start another process.
    """
    ending = threading.Thread(
        target=executor.shutdown, kwargs={"cancel_futures": True}, daemon=True
    )
    ending.start()
    while ending.is_alive():
        for worker in list((executor._processes or {}).values()):
            worker.terminate()
        ending.join(0.05)


def begin_worker(threads: int | None) -> None:
    """Initialise a process of a pool: it ignores interrupts and ends with its parent."""
    from multiprocessing import parent_process

    from skinwave.system.effort import THREADS

    for name in THREADS if threads else ():
        os.environ.setdefault(name, str(threads))
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if (parent := parent_process()) is not None:
        threading.Thread(target=_end_after, args=[parent], daemon=True).start()


def _end_after(parent: Any) -> None:
    parent.join()
    os._exit(1)
