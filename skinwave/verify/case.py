"""Verification cases and the checks that decide them."""

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import SupportsFloat

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True, kw_only=True)
class Check:
    """A computed value and its reference; `error` is relative unless `what` says otherwise."""

    what: str
    value: float
    reference: float
    error: float
    bar: float
    unit: str = ""

    @property
    def passed(self) -> bool:
        """Whether the error is a number within the tolerance."""
        return bool(self.error <= self.bar)


Checks = Iterator[Check]


@dataclass(frozen=True, kw_only=True)
class Case:
    """A verification case: `checks` yields its checks; `source` is independent of this project."""

    name: str
    title: str
    source: str
    mesh: str
    note: str
    slow: bool
    checks: Callable[[], Iterable[Check]]

    def run(self, debug: bool = False) -> "Result":
        """Run the case. An error makes it fail, or is raised if `debug`."""
        started, checks, error = time.perf_counter(), list[Check](), ""
        try:
            checks.extend(self.checks())
        except (ValueError, ArithmeticError, MemoryError) as raised:
            if debug:
                raise
            error = str(raised)
        seconds = time.perf_counter() - started
        return Result(case=self, checks=tuple(checks), seconds=seconds, error=error)


@dataclass(frozen=True, kw_only=True)
class Result:
    """A finished case, its duration in seconds, and the error that ended it early, if any."""

    case: Case
    checks: tuple[Check, ...]
    seconds: float
    error: str = ""

    @property
    def passed(self) -> bool:
        """Whether there are checks and all passed."""
        return not self.error and bool(self.checks) and all(c.passed for c in self.checks)

    @property
    def worst(self) -> Check:
        """The check closest to its tolerance, or farthest beyond it."""
        nothing = [below("no checks", np.nan, 0.0)]
        return max(
            self.checks or nothing, key=lambda c: np.inf if not c.passed else c.error / (c.bar or 1)
        )


def case(
    source: str, *, mesh: str = "none", note: str = "", slow: bool = False
) -> Callable[[Callable[[], Iterable[Check]]], Case]:
    """Turn a function that yields checks into a case, with its docstring as the title.

    `source` is that of the reference. The quick suite omits slow cases.
    """

    def decorate(checks: Callable[[], Iterable[Check]]) -> Case:
        title = " ".join((checks.__doc__ or "").split()).rstrip(".")
        name = checks.__name__.replace("_", "-")
        return Case(
            name=name, title=title, source=source, mesh=mesh, note=note, slow=slow, checks=checks
        )

    return decorate


def relative(
    what: str, value: ArrayLike, reference: ArrayLike, bar: float, unit: str = ""
) -> Check:
    """Check the relative error of a number, or the largest such error of several numbers.

    All checks take SI units; `unit` is that of the page.
    """
    value, reference = np.ravel(value), np.ravel(reference)
    errors = np.abs(value / reference - 1)
    worst = int(np.argmax(errors))
    return _in_unit(what, abs(value[worst]), abs(reference[worst]), errors[worst], bar, unit)


def misfit(what: str, value: ArrayLike, reference: ArrayLike, bar: float, unit: str = "") -> Check:
    """Check the relative L2 distance of two curves or fields; the largest magnitudes are shown."""
    value, reference = np.asarray(value), np.asarray(reference)
    error = np.linalg.norm(value - reference) / np.linalg.norm(reference)
    return _in_unit(what, np.abs(value).max(), np.abs(reference).max(), error, bar, unit)


def below(what: str, value: SupportsFloat, bar: float, unit: str = "") -> Check:
    """Check a number whose reference is 0, absolutely."""
    return _in_unit(what, value, 0.0, abs(float(value)), bar, unit)


def absolute(what: str, value: complex, reference: complex, bar: float) -> Check:
    """Check the absolute error of one number; magnitudes are shown."""
    error = abs(value - reference)
    return _in_unit(f"{what} (absolute)", abs(value), abs(reference), error, bar)


def order(what: str, sizes: ArrayLike, errors: ArrayLike, expected: float, band: float) -> Check:
    """Check the slope of log error over log size, by least squares; its error is absolute."""
    slope = float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])
    return absolute(what, slope, expected, band)


def _in_unit(
    what: str, value: SupportsFloat, reference: SupportsFloat, error: SupportsFloat, bar: float,
    unit: str = "",
) -> Check:  # fmt: skip
    scales = {"um": 1e6, "mm": 1e3}  # of units in which values in m are shown
    scale = scales.get(unit, 1.0)
    return Check(
        what=what, value=scale * float(value), reference=scale * float(reference),
        error=float(error), bar=bar, unit=unit,
    )  # fmt: skip
