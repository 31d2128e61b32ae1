"""Python functions in processes of their own, which end with the process that started them.

Only light modules are imported here, because the command line begins with it.
"""

import os
import signal
import threading
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

if TYPE_CHECKING:
    from concurrent.futures import Executor, Future

P = ParamSpec("P")
T = TypeVar("T")
SAFE_PATH = {"PYTHONSAFEPATH": "1"}  # so that a random.py of the working folder is not imported


@contextmanager
def environment(values: Mapping[str, str]) -> Iterator[None]:
    """Set environment variables meanwhile."""
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
def pool(count: int, threads: int | None = 1) -> "Iterator[Executor]":
    """Start so many processes, each with `threads` of linear algebra unless the environment says
    otherwise; None for as many as here. What they have not done when this ends is given up.
    """
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    begin = partial(begin_worker, threads)
    with environment(SAFE_PATH):
        executor = ProcessPoolExecutor(count, get_context("spawn"), initializer=begin)
        try:
            yield executor
        finally:
            workers = list((executor._processes or {}).values())
            executor.shutdown(wait=False, cancel_futures=True)
            for worker in workers:
                worker.terminate()
            for worker in workers:
                worker.join()


def apart(function: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
    """Call a function in a new process, whose memory and caches begin empty."""
    with pool(1, threads=None) as other:
        return other.submit(function, *args, **kwargs).result()


def side_by_side(
    calls: Sequence[Callable[[], T]],
    may_begin: Callable[[int, Collection[int]], bool],
    begun: Callable[[int], None],
    most: int = 2,
) -> "Iterator[tuple[int, Future[T]]]":
    """Call functions, at most so many at once, each in a new process on one thread; yield the
    number and future of each as it ends. `may_begin(k, running)` says whether call k may run beside
    others, and `begun(k)` is called as it begins.
    """
    from concurrent.futures import FIRST_COMPLETED, wait

    left = list(range(len(calls)))
    running: dict[Future[T], tuple[int, ExitStack]] = {}
    with ExitStack() as every:
        while left or running:
            busy = [k for k, _ in running.values()]
            ready = next((k for k in left if not busy or may_begin(k, busy)), None)
            if ready is not None and len(busy) < most:
                own = every.enter_context(ExitStack())
                executor = own.enter_context(pool(1))
                begun(ready)
                left.remove(ready)
                running[executor.submit(calls[ready])] = ready, own
                continue
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                k, own = running.pop(future)
                own.close()
                yield k, future


def begin_worker(threads: int | None) -> None:
    """Begin a process of a pool: interrupts are its parent's, and it ends with that."""
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
