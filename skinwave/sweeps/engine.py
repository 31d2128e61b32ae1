"""Many runs at once, by Dask: in threads, in processes, or on the workers of a scheduler.

Nothing that loads numpy is imported here: a worker process sets its threads before that.
"""

import operator
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from functools import partial
from importlib.util import find_spec
from typing import Any

from skinwave.system.effort import usable_cores
from skinwave.system.processes import pool

LOCAL = ("processes", "threads")
ATTEMPTS = 4  # to finish what was lost with a killed worker
CONNECTED = 10  # s that a scheduler may take to respond


def check(scheduler: str) -> None:
    """Refuse, before any work, what is not installed.

    Raises
    ------
    ValueError
        If Dask or pyarrow or, for an address, distributed is missing.
    """
    extra, needed = "sweep", ["dask", "pyarrow"]
    if scheduler not in LOCAL:
        extra, needed = "cluster", [*needed, "distributed"]
        if ":" not in scheduler:
            raise ValueError(
                f"scheduler '{scheduler}' is none of {', '.join(LOCAL)} and no address; "
                "write one such as tcp://host:8786"
            )
    if missing := [name for name in needed if find_spec(name) is None]:
        raise ValueError(
            f"{' and '.join(missing)} {'is' if len(missing) == 1 else 'are'} not installed; "
            f"pip install 'skinwave[{extra}]'"
        )


def workers(scheduler: str, asked: int | None = None) -> int:
    """How many runs go on at a time.

    Raises
    ------
    ValueError
        If fewer than one is asked for, or a scheduler does not respond.
    """
    if asked is not None and asked < 1:
        raise ValueError(f"--workers = {asked} is below 1; give one at least")
    if scheduler in LOCAL:
        return asked or usable_cores()
    with _client(scheduler) as client:
        return max(1, sum(client.nthreads().values()))


def run_all(
    work: Callable[[Any], Any],
    items: Sequence[Any],
    scheduler: str,
    count: int,
    done: Callable[[int, Any], None],
) -> None:
    """Call `done` here with the index and the result of each item as soon as its work is finished.

    What a killed worker was at is done again by another; what kills every worker is left out.
    """
    if not items:
        return
    if scheduler not in LOCAL:
        _run_on_cluster(work, items, scheduler, done)
        return
    left = set(range(len(items)))

    def finished(key: Any, result: Any, *_: Any) -> None:
        done(key, result)
        left.discard(key)

    for _ in range(ATTEMPTS):
        with suppress(BrokenProcessPool):
            _run_here(work, {k: items[k] for k in sorted(left)}, scheduler, count, finished)
        if not left:
            return


@contextmanager
def mapped_on(address: str) -> Iterator[Callable[..., Iterable[Any]]]:
    """A function like the built-in `map` whose calls are spread over the workers of a scheduler."""
    with _client(address) as client:

        def mapped(work: Callable[..., Any], *items: Iterable[Any]) -> Iterator[Any]:
            # What the function holds, such as a body's matrices, goes to each worker once.
            sent = client.scatter(work, broadcast=True)
            calls = zip(*items, strict=True)
            futures = [client.submit(operator.call, sent, *each, pure=False) for each in calls]
            return (future.result() for future in futures)

        yield mapped


def _run_here(
    work: Callable[[Any], Any],
    items: Mapping[int, Any],
    scheduler: str,
    count: int,
    finished: Callable[..., None],
) -> None:
    """Dask's own loop over threads or over processes that end with this one."""
    from dask import multiprocessing, threaded
    from dask.callbacks import Callback

    own = scheduler == "processes"
    get: Callable[..., Any] = multiprocessing.get if own else threaded.get
    graph = {k: (partial(work, item),) for k, item in items.items()}
    threads = max(1, usable_cores() // count)  # of linear algebra in each process
    several = pool(count, threads) if own else _threads(count)
    with several as executor, Callback(posttask=finished):
        get(graph, list(graph), pool=executor, num_workers=count, chunksize=1)


@contextmanager
def _threads(count: int) -> Iterator[Executor]:
    executor = ThreadPoolExecutor(count)
    try:
        yield executor
    finally:
        executor.shutdown(wait=False, cancel_futures=True)


def _run_on_cluster(
    work: Callable[[Any], Any], items: Sequence[Any], address: str, done: Callable[[int, Any], None]
) -> None:
    from distributed import KilledWorker, as_completed

    with _client(address) as client:
        futures = {client.submit(work, item, pure=False): k for k, item in enumerate(items)}
        for future in as_completed(list(futures), loop=client.loop):
            with suppress(KilledWorker):
                done(futures[future], future.result())
            future.release()


@contextmanager
def _client(address: str) -> Iterator[Any]:
    from distributed import Client

    try:
        client = Client(address, timeout=CONNECTED, set_as_default=False)
    except (OSError, ValueError) as error:
        said = " ".join(str(error).split()) or type(error).__name__
        raise ValueError(
            f"no scheduler responds at {address} ({said}); start one with dask scheduler"
        ) from None
    with client:
        yield client
