"""What an answer cost: seconds by phase, memory, versions."""

import platform
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager, suppress
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from multiprocessing import get_context
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")
SOLVERS = ("mkl", "scikit-sparse", "pymetis")  # used where they are installed
Progress = Callable[[str, float], None]  # phase and fraction of it done


class SkinwaveWarning(UserWarning):
    """One sentence on what is less than was asked for."""


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


def apart(function: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
    """What a function returns in a new process: its memory and its caches begin empty."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(function, *args, **kwargs).result()


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


def silent(phase: str, fraction: float) -> None:
    """Progress that nobody watches."""
