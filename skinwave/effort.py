"""Cost of a response: seconds by phase, memory, versions."""

import os
import platform
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from threading import Lock

SOLVERS = ("mkl", "scikit-sparse", "pymetis")  # used where they are installed
THREADS = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")
Progress = Callable[[str, float], None]  # phase and fraction of it done


class SkinwaveWarning(UserWarning):
    """Warning that a result falls short of the request, in one sentence."""


class Clock:
    """Wall seconds by phase: `with clock("mesh"): ...`."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def __call__(self, phase: str) -> Iterator[None]:
        """Time a phase."""
        started = time.perf_counter()
        yield
        self.seconds[phase] = self.seconds.get(phase, 0.0) + time.perf_counter() - started


def peak_memory() -> int:
    """Largest resident size of this process so far, bytes; 0 where the system does not tell."""
    try:
        import resource
    except ImportError:
        return 0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return int(peak if sys.platform == "darwin" else 1024 * peak)


class _SharedLimit:
    """Limit of the whole process: who enters first sets it, and who leaves last lifts it. Each with
    one of its own would set again what another had found limited.
    """

    def __init__(self, **libraries: str) -> None:
        self._lock, self._within, self._limit = Lock(), 0, ExitStack()
        self._libraries = libraries

    def enter(self) -> None:
        from threadpoolctl import ThreadpoolController

        with self._lock:
            self._within += 1
            if self._within == 1:
                chosen = ThreadpoolController().select(**self._libraries)
                self._limit.enter_context(chosen.limit(limits=1))

    def leave(self) -> None:
        with self._lock:
            self._within -= 1
            if not self._within:
                self._limit.close()


_ALL, _DENSE = _SharedLimit(user_api="blas"), _SharedLimit(internal_api="openblas")


@contextmanager
def one_thread() -> Iterator[None]:
    """Linear algebra on one thread: in small products several wait for each other."""
    with _on_one_thread(_ALL):
        yield


@contextmanager
def dense_on_one_thread() -> Iterator[None]:
    """Products of dense matrices on one thread, sparse solutions by MKL on all: these take 0.6 of
    the time on two.
    """
    with _on_one_thread(_DENSE):
        yield


@contextmanager
def _on_one_thread(limit: _SharedLimit) -> Iterator[None]:
    limit.enter()
    try:
        yield
    finally:
        limit.leave()


def versions() -> dict[str, str]:
    """Versions of Python, skinwave, what it computes with, and the operating system."""
    return dict(_versions())


@lru_cache(maxsize=1)
def _versions() -> tuple[tuple[str, str], ...]:
    found = {"python": sys.version.split()[0]}
    for name in ("skinwave", "numpy", "scipy", *SOLVERS):
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    return (*found.items(), ("os", platform.platform()))


def usable_cores() -> int:
    """How many cores this process may use."""
    counted = getattr(os, "sched_getaffinity", None)
    return len(counted(0)) if counted else os.cpu_count() or 1


def threads() -> dict[str, str]:
    """How many threads linear algebra takes, by the environment variables that say so.

    Sums in another order round otherwise; as many threads give the same digits again.
    """
    usable = os.environ.get(THREADS[0]) or str(usable_cores())
    return {name: os.environ.get(name) or usable for name in THREADS}


def silent(phase: str, fraction: float) -> None:
    """Progress that is not shown."""
