"""A verification case and the checks that decide it."""

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import SupportsFloat

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True, kw_only=True)
class Check:
    """A value of ours beside its reference; `error` is relative unless `what` says otherwise."""

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
    """A verification case: `checks` yields its checks; `source` is outside this project."""

    name: str
    title: str
    source: str
    mesh: str
    note: str
    slow: bool
    checks: Callable[[], Iterable[Check]]

    def run(self, debug: bool = False) -> "Result":
        """Run the case; one that raises an error fails, or raises it if `debug`."""
        started, found, error = time.perf_counter(), list[Check](), ""
        try:
            found.extend(self.checks())
        except (ValueError, ArithmeticError, MemoryError) as raised:
            if debug:
                raise
            error = str(raised)
        seconds = time.perf_counter() - started
        return Result(case=self, checks=tuple(found), seconds=seconds, error=error)


@dataclass(frozen=True, kw_only=True)
class Result:
    """A finished case, the seconds it took, and the error that ended it early, if one did."""

    case: Case
    checks: tuple[Check, ...]
    seconds: float
    error: str = ""

    @property
    def passed(self) -> bool:
        """Whether every check passed, and there is one."""
        return not self.error and bool(self.checks) and all(c.passed for c in self.checks)

    @property
    def worst(self) -> Check:
        """The check that is nearest to its tolerance, or farthest beyond."""
        nothing = [below("there is no check", np.nan, 0.0)]
        return max(
            self.checks or nothing, key=lambda c: np.inf if not c.passed else c.error / (c.bar or 1)
        )


def case(
    source: str, *, mesh: str = "none", note: str = "", slow: bool = False
) -> Callable[[Callable[[], Iterable[Check]]], Case]:
    """Make a case of a function that yields checks, its docstring the title, with the `source` of
    its reference. The quick suite leaves out a slow case.
    """

    def made(checks: Callable[[], Iterable[Check]]) -> Case:
        title = " ".join((checks.__doc__ or "").split()).rstrip(".")
        name = checks.__name__.replace("_", "-")
        return Case(
            name=name, title=title, source=source, mesh=mesh, note=note, slow=slow, checks=checks
        )

    return made


def relative(
    what: str, found: SupportsFloat, expected: SupportsFloat, bar: float, unit: str = ""
) -> Check:
    """Relative error of one number. All values are given in SI units and shown in `unit`."""
    value, reference = float(found), float(expected)
    return _check(what, value, reference, abs(value / reference - 1), bar, unit)


def largest(what: str, found: ArrayLike, expected: ArrayLike, bar: float, unit: str = "") -> Check:
    """The largest relative error of several numbers, at the place where it is."""
    found, expected = np.ravel(found), np.ravel(expected)
    errors = np.abs(found / expected - 1)
    worst = int(np.argmax(errors))
    return _check(what, abs(found[worst]), abs(expected[worst]), errors[worst], bar, unit)


def misfit(what: str, found: ArrayLike, expected: ArrayLike, bar: float, unit: str = "") -> Check:
    """Relative L2 distance of two curves or fields; the values are their largest magnitudes."""
    found, expected = np.asarray(found), np.asarray(expected)
    error = float(np.linalg.norm(found - expected) / np.linalg.norm(expected))
    return _check(what, np.abs(found).max(), np.abs(expected).max(), error, bar, unit)


def below(what: str, value: SupportsFloat, bar: float, unit: str = "") -> Check:
    """A number whose reference is 0, absolute."""
    return _check(what, float(value), 0.0, abs(float(value)), bar, unit)


def absolute(what: str, found: complex, expected: complex, bar: float) -> Check:
    """Absolute error of one number, of which magnitudes are shown."""
    return _check(f"{what} (absolute)", abs(found), abs(expected), abs(found - expected), bar)


def order(what: str, sizes: ArrayLike, errors: ArrayLike, expected: float, band: float) -> Check:
    """Slope of log error against log size, by least squares; its error is absolute."""
    slope = float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])
    return absolute(what, slope, expected, band)


def _check(
    what: str, value: float, reference: float, error: float, bar: float, unit: str = ""
) -> Check:
    scale = {"um": 1e6, "mm": 1e3}.get(unit, 1.0)
    return Check(
        what=what, value=float(scale * value), reference=float(scale * reference),
        error=float(error), bar=bar, unit=unit,
    )  # fmt: skip
