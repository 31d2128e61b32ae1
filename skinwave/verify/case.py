"""Verification case, the checks that decide it, and its place in the suite."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import SupportsFloat

import numpy as np
from numpy.typing import ArrayLike

from meshes import TetMesh


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


@dataclass(frozen=True, kw_only=True, eq=False)
class Plot:
    """Curves `lines`, name -> (x, y); measured ones have markers, those in `drawn` a line only."""

    x: str
    y: str
    lines: Mapping[str, tuple[ArrayLike, ArrayLike]]
    drawn: tuple[str, ...] = ()
    log: bool = False


@dataclass(frozen=True, kw_only=True, eq=False)
class Case:
    """A case with its checks; `source` is outside this project, `said` the message of a refusal."""

    title: str
    source: str
    mesh: str
    checks: tuple[Check, ...]
    plot: Plot | None = None
    note: str = ""
    said: str = ""

    @property
    def passed(self) -> bool:
        """Whether every check passed, and there is one."""
        return bool(self.checks) and all(check.passed for check in self.checks)

    @property
    def worst(self) -> Check:
        """The check that is nearest to its tolerance, or farthest beyond."""
        return max(self.checks, key=lambda c: np.inf if not c.passed else c.error / (c.bar or 1))


@dataclass(frozen=True, kw_only=True)
class Entry:
    """A case by name; a slow one is left out of the quick suite."""

    name: str
    topic: str
    run: Callable[[], Case]
    slow: bool = False


@dataclass(frozen=True, kw_only=True, eq=False)
class Result:
    """A finished case and the seconds it took."""

    entry: Entry
    case: Case
    seconds: float


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


def yes(what: str, is_so: bool) -> Check:
    """A check that something is so."""
    return _check(what, float(is_so), 1.0, 1.0 - is_so, 0.0)


def order(what: str, sizes: ArrayLike, errors: ArrayLike, expected: float, band: float) -> Check:
    """Fitted slope of log error against log size; its error is absolute."""
    return absolute(what, slope(sizes, errors), expected, band)


def _check(
    what: str, value: float, reference: float, error: float, bar: float, unit: str = ""
) -> Check:
    scale = {"um": 1e6, "mm": 1e3}.get(unit, 1.0)
    return Check(
        what=what, value=float(scale * value), reference=float(scale * reference),
        error=float(error), bar=bar, unit=unit,
    )  # fmt: skip


def slope(sizes: ArrayLike, errors: ArrayLike) -> float:
    """Slope of log error against log size, by least squares."""
    return float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])


def described(mesh: TetMesh, rest: str = "") -> str:
    """A mesh in words."""
    text = f"{len(mesh.tets):,} ten-node tetrahedra, {mesh.n_dofs:,} dofs"
    return f"{text}; {rest}" if rest else text
