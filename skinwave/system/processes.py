"""Python functions in processes of their own: none imports from the working folder, none outlives
the process that started it.

`apart` calls one function, `side_by_side`, `helper` and `pool` many; `meshes.subprocess_call` runs
programs. Three more have processes that are none of these, with what they share here: a page's
process serves pages until it is told to end (`web.processes`), the one that computes for it sends
its progress and is ended in the middle of it (`web.worker`), and `rerun` has a command go on in the
terminal.

Only what Python has loaded anyway is imported here, because the command line begins with it.
"""

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

if TYPE_CHECKING:
    from concurrent.futures import Executor, Future
    from multiprocessing.process import BaseProcess

P = ParamSpec("P")
T = TypeVar("T")
SAFE_PATH = {"PYTHONSAFEPATH": "1"}  # imports nothing from the working folder
ENDING = ("SIGTERM", "SIGHUP")
AGAIN = 5.0  # s
PATIENCE = 2.0  # s that a process has to remove what it made, before it is killed


@contextmanager
def environment(values: Mapping[str, str]) -> Iterator[None]:
    """Environment variables that have these values meanwhile."""
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
def ended_by_signals() -> Iterator[None]:
    """SIGTERM and SIGHUP meanwhile raise SystemExit, so that what was made aside is removed.

    A signal that is ignored or handled already stays so, as under `nohup`. Compiled code that is
    being imported may make an ImportError of the exit, or nothing: hence it comes again, and holds
    whatever else is raised.
    """
    came: list[int] = []

    def handle(number: int, _: object) -> None:
        came.append(number)
        _again(partial(sys.exit, 128 + number))
        end(number)

    handled = [number for number in _numbers() if signal.getsignal(number) is signal.SIG_DFL]
    for number in handled:
        signal.signal(number, handle)
    try:
        yield
    finally:
        for number in handled:
            signal.signal(number, signal.SIG_DFL)
        if came:
            _again(None)
            sys.exit(128 + came[0])


def _numbers() -> list[signal.Signals]:
    if threading.current_thread() is not threading.main_thread():
        return []  # Python lets no other thread set handlers
    return [getattr(signal, name) for name in ENDING if hasattr(signal, name)]


def _again(call: Callable[[], Any] | None) -> None:
    """Call something every few seconds from now on, or no longer."""
    if hasattr(signal, "setitimer"):
        signal.signal(signal.SIGALRM, (lambda *_: call()) if call else signal.SIG_DFL)
        signal.setitimer(signal.ITIMER_REAL, AGAIN if call else 0.0, AGAIN)


def end(number: int, _: object = None) -> None:
    """Handle a signal by SystemExit with the code that a shell gives it; the next one is ignored,
    so that nothing interrupts the removal of what was made.
    """
    signal.signal(number, signal.SIG_IGN)
    sys.exit(128 + number)


def guarded(work: Callable[..., T], *args: Any, **kwargs: Any) -> T:
    """Return what `work` returns; a signal that ends it ends the process, too.

    A pool would take the SystemExit for the result, and begin what is next.
    """
    try:
        return work(*args, **kwargs)
    except SystemExit as error:
        os._exit(error.code if isinstance(error.code, int) else 1)


def apart(function: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
    """Call a function in a new process, whose memory and caches begin empty."""
    with pool(1, as_part) as other:
        return other.submit(function, *args, **kwargs).result()


def side_by_side(
    calls: Sequence[Callable[[], T]],
    may_begin: Callable[[int, Collection[int]], bool],
    begun: Callable[[int], None],
    most: int = 2,
) -> "Iterator[tuple[int, Future[T]]]":
    """Call functions, some at once, each in a new process on one thread.

    Parameters
    ----------
    calls : functions, in the order in which they are begun if they may
    may_begin : whether call `k` may run beside those `running`, which it may beside none
    begun : called with the number of each as it begins
    most : how many at once

    Yields
    ------
    Number and future of each, as it ends.
    """
    from concurrent.futures import FIRST_COMPLETED, wait

    left = list(range(len(calls)))
    running: dict[Future[T], tuple[int, ExitStack]] = {}
    with environment(SAFE_PATH), ExitStack() as every:
        while left or running:
            busy = [k for k, _ in running.values()]
            ready = next((k for k in left if not busy or may_begin(k, busy)), None)
            if ready is not None and len(busy) < most:
                own = every.enter_context(ExitStack())
                executor = own.enter_context(pool(1, as_worker))
                begun(ready)
                left.remove(ready)
                running[executor.submit(calls[ready])] = ready, own
                continue
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                k, own = running.pop(future)
                own.close()
                yield k, future


@contextmanager
def helper() -> "Iterator[Executor]":
    """A process beside this one, on one thread; what it has not done when this ends is given up."""
    with pool(1, as_worker) as other:
        yield other


@contextmanager
def pool(count: int, begin: Callable[[], None]) -> "Iterator[Executor]":
    """So many processes, which call `begin` first; what they have not done at the end of this is
    given up.
    """
    from concurrent.futures import Future, ProcessPoolExecutor
    from multiprocessing import get_context

    with environment(SAFE_PATH):  # the `python -c` of multiprocessing looks in it first
        executor = ProcessPoolExecutor(count, get_context("spawn"), initializer=begin)
        submit: Callable[..., Future[Any]] = executor.submit
        executor.submit = partial(submit, guarded)  # type: ignore[method-assign]
        try:
            yield executor
        finally:
            manager: Any = executor._executor_manager_thread
            own = list((executor._processes or {}).values())
            executor.shutdown(wait=False, cancel_futures=True)
            stop(own)
            # As it ends, Python wakes this thread up, and prints a traceback if its pipe is closed
            # at that moment.
            if manager is not None:
                manager.join(PATIENCE)


def as_worker(threads: int = 1) -> None:
    """Begin a process as a part of its parent, on so many threads if the user has not said."""
    from skinwave.system.effort import THREADS

    for name in THREADS:
        os.environ.setdefault(name, str(threads))
    as_part()


def as_part() -> None:
    """Begin a process: interrupts are the parent's, it does not outlive that, and removes what it
    made aside when it is ended.
    """

    def leave() -> None:
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(PATIENCE)
        os._exit(1)

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, end)
    when_parent_ends(leave)


def when_parent_ends(call: Callable[[], object]) -> None:
    """Call something in a thread of this process as soon as the one that started it is gone."""
    from multiprocessing import parent_process

    parent = parent_process()

    def wait() -> None:
        if parent is not None:
            parent.join()
            call()

    threading.Thread(target=wait, daemon=True).start()


def stop(processes: "Iterable[BaseProcess]") -> None:
    """End processes: first by a signal that lets them remove what they made, then by force."""
    ended = list(processes)
    for process in ended:
        process.terminate()
    last = time.monotonic() + PATIENCE
    for process in ended:
        process.join(max(0.0, last - time.monotonic()))
        process.kill()
        process.join()
