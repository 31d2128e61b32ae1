"""Many runs at once: in threads, in processes, or on the workers of a Dask scheduler.

This module imports nothing that loads numpy, because a worker process sets its threads first.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from typing import Any

from skinwave.system.effort import usable_cores
from skinwave.system.processes import pool

LOCAL = ("processes", "threads")
ATTEMPTS = 4  # to finish items whose worker was killed
CONNECTION_TIMEOUT = 10  # s


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
        return max(1, sum(client.nthreads().values()))


def run_all(
    work: Callable[[Any], Any],
    items: Sequence[Any],
    scheduler: str,
    count: int,
    done: Callable[[int, Any], None],
) -> None:
    """Compute items on workers; call `done(index, result)` here as each one is finished.

    If a worker is killed, others repeat its item. Items that kill every worker are left out.
    """
    if not items:
        return
    if scheduler not in LOCAL:
        _run_on_cluster(work, items, scheduler, done)
        return
    missing = dict(enumerate(items))
    for _ in range(ATTEMPTS):
        with suppress(BrokenProcessPool), _executor(scheduler, count) as executor:
            futures = {executor.submit(work, item): k for k, item in missing.items()}
            for future in as_completed(futures):
                done(futures[future], future.result())
                del missing[futures[future]]
        if not missing:
            return


@contextmanager
def _executor(scheduler: str, count: int) -> Iterator[Executor]:
    """Yield workers of this machine; unfinished work is cancelled at the end."""
    if scheduler == "processes":
        threads = max(1, usable_cores() // count)  # of linear algebra in each process
        with pool(count, threads) as executor:
            yield executor
        return
    threads_here = ThreadPoolExecutor(count)
    try:
        yield threads_here
    finally:
        threads_here.shutdown(wait=False, cancel_futures=True)


def _run_on_cluster(
    work: Callable[[Any], Any], items: Sequence[Any], address: str, done: Callable[[int, Any], None]
) -> None:
    from distributed import KilledWorker
    from distributed import as_completed as finished_futures

    with _client(address) as client:
        futures = {client.submit(work, item, pure=False): k for k, item in enumerate(items)}
        for future in finished_futures(list(futures), loop=client.loop):
            with suppress(KilledWorker):
                done(futures[future], future.result())
            future.release()


@contextmanager
def _client(address: str) -> Iterator[Any]:
    from distributed import Client

    try:
        client = Client(address, timeout=CONNECTION_TIMEOUT, set_as_default=False)
    except (OSError, ValueError) as error:
        cause = " ".join(str(error).split()) or type(error).__name__
        raise ValueError(
            f"no Dask scheduler responds at {address} ({cause}); start one with dask scheduler"
        ) from None
    with client:
        yield client
