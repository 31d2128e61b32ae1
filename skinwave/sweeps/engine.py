"""Many runs at once: in threads, in processes, or on the workers of a Dask scheduler.

Items are handed out in pieces of about equal time, a few for each worker. This module imports
nothing that loads numpy, because a worker process sets its threads first.
"""

import sys
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError, Executor, Future, ThreadPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import partial
from importlib.metadata import version
from importlib.util import find_spec
from typing import Any

from skinwave.system.effort import usable_cores
from skinwave.system.plain_text import say
from skinwave.system.processes import pool

LOCAL = ("processes", "threads")
ATTEMPTS = 3  # at items whose worker is killed: in a piece, as a piece, and with no other running
IN_FLIGHT = 2  # pieces for each worker


def check(scheduler: str) -> None:
    """Raise a ValueError for an unknown scheduler or a missing package."""
    extra, packages = "sweep", ["pyarrow"]
    if scheduler not in LOCAL:
        extra, packages = "cluster", [*packages, "distributed"]
        if ":" not in scheduler:
            raise ValueError(
                f"scheduler '{scheduler}' is unknown; give {' or '.join(LOCAL)}, or the address "
                "of a Dask scheduler such as tcp://host:8786"
            )
    for name in packages:
        if find_spec(name) is None:
            raise ValueError(f"{name} is not installed; run pip install 'skinwave[{extra}]'")


def worker_count(scheduler: str, workers: int | None = None) -> int:
    """Return the number of simultaneous runs: `workers`, or all cores or scheduler threads."""
    if workers is not None and workers < 1:
        raise ValueError(f"--workers is {workers}; give 1 or more")
    if scheduler in LOCAL:
        return workers or usable_cores()
    with _client(scheduler) as client:
        if not client.nthreads():
            say(f"skinwave: {scheduler} has no workers; start dask worker {scheduler}", sys.stderr)
        return _threads(client, set())


def run_all(
    work: Callable[[Any], Any],
    items: Sequence[Any],
    scheduler: str,
    count: int,
    done: Callable[[Mapping[int, Any]], None],
    *,
    seconds: float = 20.0,
) -> None:
    """Compute items on `count` workers; call `done(results by index)` here after each piece.

    A piece takes about `seconds`. Its length follows from the last piece, and a worker returns the
    results that it has by then. If a worker is killed, others repeat its items, one at a time.
    Items that kill every worker are left out.
    """
    waiting, killed, size = deque(range(len(items))), Counter[int](), 1
    limit = [seconds]
    while waiting:
        running, broken = dict[Future[Any], list[int]](), False
        with _executor(scheduler, count, limit) as (executor, workers):
            while running or (waiting and not broken):
                most = workers()
                while not broken and (piece := _take(waiting, killed, size, running, most)):
                    try:
                        future = executor.submit(_compute, work, [items[k] for k in piece], limit)
                        running[future] = piece
                    except BrokenProcessPool:
                        waiting.extendleft(reversed(piece))
                        broken = True
                polling = None if scheduler in LOCAL else 5  # s: new workers then get pieces
                for future in wait(running, polling, "FIRST_COMPLETED").done:
                    piece, error = running.pop(future), future.exception()
                    if type(error).__name__ in ("BrokenProcessPool", "KilledWorker"):
                        killed.update(piece)
                        waiting.extend(k for k in piece if killed[k] < ATTEMPTS)
                        broken |= isinstance(error, BrokenProcessPool)
                        continue
                    results, took = future.result()
                    n = len(results)
                    waiting.extendleft(reversed(piece[n:]))
                    size = max(1, int(min(4 * n, n * seconds / max(took, 1e-9))))
                    done(dict(zip(piece, results, strict=False)))


def _take(
    waiting: deque[int],
    killed: Mapping[int, int],
    size: int,
    running: Mapping[Any, Sequence[int]],
    workers: int,
) -> list[int]:
    """Take the next piece of at most `size` from the waiting items; empty if it has to wait."""
    if not waiting or len(running) >= IN_FLIGHT * workers:
        return []
    heads = [waiting[0], *(piece[0] for piece in running.values())]
    if running and any(killed[k] == ATTEMPTS - 1 for k in heads):
        return []  # whether an item kills its worker is certain only if no other runs
    # Pieces at the end are smaller, so that no worker waits long for the last.
    size = min(size, len(waiting) // (2 * IN_FLIGHT * workers))
    piece = [waiting.popleft()]
    while len(piece) < size and not (killed[piece[0]] or killed[waiting[0]]):
        piece.append(waiting.popleft())
    return piece


def _compute(
    work: Callable[[Any], Any], items: Sequence[Any], limit: Sequence[float]
) -> tuple[list[Any], float]:
    """Return, on a worker, the results of the first items, at least one, and their seconds."""
    results, started, took = [], time.perf_counter(), 0.0
    for item in items:
        results.append(work(item))
        if (took := time.perf_counter() - started) >= limit[0]:
            break
    return results, took


@contextmanager
def _executor(
    scheduler: str, count: int, limit: list[float]
) -> Iterator[tuple[Executor, Callable[[], int]]]:
    """Yield workers and a function of their number; unfinished work is cancelled at the end."""
    if scheduler == "processes":
        threads = max(1, usable_cores() // count)  # of linear algebra in each process
        with pool(count, threads) as executor:
            yield executor, lambda: count
    elif scheduler == "threads":
        threads_here = ThreadPoolExecutor(count)
        try:
            yield threads_here, lambda: count
        finally:
            limit[0] = 0.0  # threads share this list: each ends after its present item
            threads_here.shutdown(wait=False, cancel_futures=True)
    else:
        with _client(scheduler) as client:
            there = client.get_executor(pure=False)
            try:
                yield there, partial(_threads, client, set())
            except CancelledError:
                raise ValueError(
                    f"the Dask scheduler at {scheduler} has ended; start it and repeat the command"
                ) from None
            finally:
                there.shutdown(wait=False)


def _threads(client: Any, known: set[str]) -> int:
    """Return the number of threads of all workers, at least 1, and add the workers to those known.

    Raises a ValueError if a new worker has another version of a package, and a CancelledError if
    the scheduler has ended.
    """
    try:
        threads: dict[str, int] = client.nthreads()
    except OSError:
        raise CancelledError from None
    new = sorted(threads.keys() - known)
    for name in ("skinwave", "numpy", "scipy") if new else ():
        own, found = version(name), client.run(version, name, workers=new, on_error="return")
        for address, theirs in found.items():
            if theirs != own and not isinstance(theirs, OSError):  # of a worker that has ended
                theirs = theirs if isinstance(theirs, str) else "not installed"
                raise ValueError(
                    f"{name} is {theirs} on the Dask worker {address}, but {own} here; install the "
                    "same version on both"
                )
    known.update(new)
    return max(1, sum(threads.values()))


@contextmanager
def _client(address: str, timeout: float = 10.0) -> Iterator[Any]:
    from distributed import Client

    try:
        client = Client(address, timeout=timeout, set_as_default=False)
    except (OSError, ValueError) as error:
        cause = " ".join(str(error).split()) or type(error).__name__
        raise ValueError(
            f"no Dask scheduler responds at {address} ({cause}); start one with dask scheduler"
        ) from None
    with client:
        yield client
