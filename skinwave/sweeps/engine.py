"""Many runs at once: in threads, in processes, or on the workers of a Dask scheduler.

Nothing that loads numpy is imported here: a worker process sets its threads before that.
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
ATTEMPTS = 4  # to finish what was lost with a killed worker
CONNECTED = 10  # s that a scheduler may take to respond


def check(scheduler: str) -> None:
    """Refuse, before any work, what is not installed."""
    extra, needed = "sweep", ["pyarrow"]
    if scheduler not in LOCAL:
        extra, needed = "cluster", [*needed, "distributed"]
        if ":" not in scheduler:
            raise ValueError(
                f"scheduler '{scheduler}' is none of {', '.join(LOCAL)} and no address; "
                "write one such as tcp://host:8786"
            )
    for name in needed:
        if find_spec(name) is None:
            raise ValueError(f"{name} is not installed; pip install 'skinwave[{extra}]'")


def workers(scheduler: str, asked: int | None = None) -> int:
    """How many runs go on at a time."""
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

    If a worker is killed, others repeat what it was at; what kills every worker is left out.
    """
    if not items:
        return
    if scheduler not in LOCAL:
        _run_on_cluster(work, items, scheduler, done)
        return
    left = dict(enumerate(items))
    for _ in range(ATTEMPTS):
        with suppress(BrokenProcessPool), _executor(scheduler, count) as executor:
            futures = {executor.submit(work, item): k for k, item in left.items()}
            for future in as_completed(futures):
                done(futures[future], future.result())
                del left[futures[future]]
        if not left:
            return


@contextmanager
def _executor(scheduler: str, count: int) -> Iterator[Executor]:
    """Workers of this machine; what they have not done at the end of this is given up."""
    if scheduler == "processes":
        threads = max(1, usable_cores() // count)  # of linear algebra in each process
        with pool(count, threads) as executor:
            yield executor
        return
    several = ThreadPoolExecutor(count)
    try:
        yield several
    finally:
        several.shutdown(wait=False, cancel_futures=True)


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
        client = Client(address, timeout=CONNECTED, set_as_default=False)
    except (OSError, ValueError) as error:
        said = " ".join(str(error).split()) or type(error).__name__
        raise ValueError(
            f"no scheduler responds at {address} ({said}); start one with dask scheduler"
        ) from None
    with client:
        yield client
