"""Cost of a response: seconds by phase, memory, versions, threads."""

import os
import platform
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from threading import Lock

THREADS = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")
Progress = Callable[[str, float], None]  # of a phase and the fraction done


class SkinwaveWarning(UserWarning):
    """Warning that a result does not meet the request."""


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
    """Return the largest resident size of this process in bytes; 0 if unknown."""
    try:
        import resource
    except ImportError:
        return 0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return int(peak if sys.platform == "darwin" else 1024 * peak)


_LOCK, _LIMIT, _WITHIN = Lock(), ExitStack(), [0]


@contextmanager
def one_thread() -> Iterator[None]:
    """Limit linear algebra to one thread, because in small products threads wait for each other.

    The limit applies to the whole process, from the first entry to the last exit.
    """
    from threadpoolctl import threadpool_limits

    with _LOCK:
        _WITHIN[0] += 1
        if _WITHIN[0] == 1:
            _LIMIT.enter_context(threadpool_limits(limits=1, user_api="blas"))
    try:
        yield
    finally:
        with _LOCK:
            _WITHIN[0] -= 1
            if not _WITHIN[0]:
                _LIMIT.close()


@cache
def versions() -> dict[str, str]:
    """Return the versions of Python, skinwave, its numerical libraries and the operating system."""
    found = {"python": sys.version.split()[0]}
    for name in ("skinwave", "numpy", "scipy", "mkl", "scikit-sparse", "pymetis"):
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    return found | {"os": platform.platform()}


def usable_cores() -> int:
    """Return the number of cores that this process may use."""
    counted = getattr(os, "sched_getaffinity", None)
    return len(counted(0)) if counted else os.cpu_count() or 1


def threads() -> dict[str, str]:
    """Return the number of threads of linear algebra, which affects rounding, by variable."""
    usable = os.environ.get(THREADS[0]) or str(usable_cores())
    return {name: os.environ.get(name) or usable for name in THREADS}


def silent(phase: str, fraction: float) -> None:
    """Progress callback that does nothing."""
