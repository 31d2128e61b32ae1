"""Identifiability: intervals, correlations, and directions that the data do not resolve.

At the solution the residual r changes by its slopes J over the unit cube. With s^2 the scale of the
variances and J / s = U diag(S) V^T, a move by d along a column of V changes the residual by S d of
its standard errors. Where the 95 % interval of such a direction is wider than the limits, the data
do not resolve it, and of a parameter no interval is given whose own is as wide (Transtrum, Machta
and Sethna, Phys Rev E 83:036701 (2011), of such sloppy directions). Where residuals are not white,
intervals are widened as `coloured` says.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np
from scipy.stats import chi2, t

from meshes.tetmesh import Floats
from skinwave.measure.coloured import widening
from skinwave.measure.parameters import Parameter
from skinwave.measure.solve import AT_LIMIT, Solution

LEVEL = 0.95
ROUND_OFF = 1e-7  # of the largest singular value: what differences leave of one that is 0
MEMBER = 0.1  # of the largest part in a direction: keys that it is of
LAGS = 20  # of a test of whiteness
SIGNIFICANT = 0.01


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """Estimate of a parameter: its `value`, the limits `low` and `high` of its 95 % interval, nan
    if the data do not resolve it, and whether it is at a limit of its range.
    """

    key: str
    value: float
    low: float
    high: float
    at_limit: bool

    @property
    def is_resolved(self) -> bool:
        """Whether it has an interval."""
        return bool(np.isfinite(self.low))


@dataclass(frozen=True, kw_only=True, eq=False)
class Direction:
    """Direction that the data do not resolve: its keys, the part (k,) of each parameter in it, and
    of two keys by their logarithms the `exponent` b for which a times the other to b is determined;
    nan of others.
    """

    keys: tuple[str, ...]
    parts: Floats
    exponent: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Whiteness:
    """Test of residuals by Ljung and Box: lags, autocorrelations (lags,), and the probability `p`
    of as large ones in white noise.
    """

    correlations: Floats
    p: float

    @property
    def is_white(self) -> bool:
        """Whether nothing speaks against it."""
        return self.p >= SIGNIFICANT


def covariance(solution: Solution) -> Floats:
    """Covariance (k, k) over the unit cube; huge along directions that are not resolved."""
    _, singular, v = _singular(solution)
    return (v / singular**2) @ v.T


def width(solution: Solution) -> float:
    """Half of a 95 % interval, in standard errors: normal where the errors are known, else
    Student's t of the residual's degrees of freedom.
    """
    dof = np.inf if solution.problem.data.is_known else solution.dof
    return float(t.ppf((1 + LEVEL) / 2, dof))


def half_widths(solution: Solution) -> Floats:
    """Halves (k,) of the 95 % intervals over the unit cube, widened if residuals are not white."""
    error = np.sqrt(np.diag(covariance(solution)))
    return np.asarray(width(solution) * widenings(solution) * error)


def widenings(solution: Solution) -> Floats:
    """Factors (k,) of the intervals for residuals that are not white; 1 if they are."""
    left, singular, v = _singular(solution)
    return _widened(solution, (v / singular) @ left.T)


def _widened(solution: Solution, rows: Floats) -> Floats:
    """Factors (k,) of the intervals of combinations (k, n s) of the errors."""
    test = whiteness(solution.residual)
    if test.is_white or np.isnan(test.p):
        return np.ones(len(rows))
    return widening(solution.residual, rows.reshape(-1, *solution.residual.shape))


def estimates(solution: Solution) -> tuple[Estimate, ...]:
    """Estimates with intervals by the covariance, those by logarithms symmetric in these."""
    parameters = solution.problem.parameters.free
    half = half_widths(solution)
    return tuple(
        _estimate(each, float(u), float(h))
        for each, u, h in zip(parameters, solution.u, half, strict=True)
    )


def _estimate(parameter: Parameter, u: float, half: float) -> Estimate:
    resolved = half < 0.5  # of the range
    low, high = (max(u - half, 0.0), min(u + half, 1.0)) if resolved else (np.nan, np.nan)
    return Estimate(
        key=parameter.key, value=parameter.value(u), low=parameter.value(low),
        high=parameter.value(high), at_limit=not AT_LIMIT <= u <= 1 - AT_LIMIT,
    )  # fmt: skip


def correlations(solution: Solution) -> Floats:
    """Correlations (k, k) of the estimates; nan with those that are not resolved."""
    found = covariance(solution)
    error = np.sqrt(np.diag(found))
    unresolved = half_widths(solution) >= 0.5
    table = found / np.outer(error, error)
    table[unresolved] = np.nan
    table[:, unresolved] = np.nan
    return np.asarray(table)


def unresolved(solution: Solution) -> tuple[Direction, ...]:
    """Directions that the data do not resolve, the least resolved first."""
    _, _, v = _singular(solution)
    return tuple(_direction(solution, part) for part in v.T[~_resolved(solution)][::-1])


def _resolved(solution: Solution) -> np.ndarray:
    """Mask (k,) of the directions of the singular vectors that the data resolve."""
    left, singular, _ = _singular(solution)
    return np.asarray(singular >= 2 * width(solution) * _widened(solution, left.T))


def _direction(solution: Solution, parts: Floats) -> Direction:
    free = solution.problem.parameters.free
    members = np.flatnonzero(np.abs(parts) > MEMBER * np.abs(parts).max())
    exponent = np.nan
    if len(members) == 2 and all(free[k].is_log for k in members):
        first, second = (parts[k] * free[k].span for k in members)
        exponent = float(-first / second)
    return Direction(keys=tuple(free[k].key for k in members), parts=parts, exponent=exponent)


def combined(solution: Solution, direction: Direction) -> tuple[float, float, float]:
    """Value and 95 % interval of the combination of two keys that a direction leaves, by its
    exponent.

    Parameters
    ----------
    solution : Solution
    direction : Direction, of two keys with an exponent

    Returns
    -------
    value, low and high, in the unit of the first key times that of the second to the exponent; nan
    for the limits where the combination is not determined, since it has a part in other directions
    that are not resolved
    """
    parameters = solution.problem.parameters
    at = [parameters.keys.index(key) for key in direction.keys]
    powers = np.zeros(len(solution.u))
    powers[at] = [1.0, direction.exponent]
    across = powers * np.array([each.span for each in parameters.free])
    left, singular, v = _singular(solution)
    parts = (across @ v) / singular
    (factor,) = _widened(solution, (parts @ left.T)[None])
    half = width(solution) * float(factor * np.linalg.norm(parts))
    values = parameters.values(solution.u)
    first, second = (values[key] for key in direction.keys)
    middle = first * second**direction.exponent
    if half >= 0.5 * np.abs(across).sum():  # of the range of the combination
        return middle, np.nan, np.nan
    return middle, middle * np.exp(-half), middle * np.exp(half)


def sharing(directions: Sequence[Direction]) -> list[list[Direction]]:
    """Directions in groups, such that those of two groups have no key in common."""
    groups: list[list[Direction]] = []
    for each in directions:
        joined = [g for g in groups if any(set(one.keys) & set(each.keys) for one in g)]
        groups = [g for g in groups if g not in joined]
        groups.append([*chain.from_iterable(joined), each])
    return groups


def _singular(solution: Solution) -> tuple[Floats, Floats, Floats]:
    """U (n s, k), singular values (k,), none below round-off, and V (k, k) of slopes over standard
    errors.
    """
    scale = max(solution.scale, 1e-300)
    left, singular, vt = np.linalg.svd(solution.slopes / np.sqrt(scale), full_matrices=False)
    least = ROUND_OFF * max(float(singular.max()), 1e-300)
    return left, np.maximum(singular, least), vt.T


def whiteness(residual: Floats) -> Whiteness:
    """Test of residuals (n, s) along their axis, all series together (Ljung and Box, Biometrika
    65:297 (1978)); p is nan for fewer than ten.
    """
    n, series = residual.shape
    lags = min(LAGS, n // 5)
    if lags < 2:
        return Whiteness(correlations=np.empty(0), p=np.nan)
    x = residual - residual.mean(axis=0)
    power = np.maximum((x**2).sum(axis=0), 1e-300)
    each = np.array([(x[lag:] * x[:-lag]).sum(axis=0) / power for lag in range(1, lags + 1)])
    terms = n * (n + 2) * each**2 / (n - np.arange(1, lags + 1))[:, None]
    return Whiteness(correlations=each.mean(axis=1), p=float(chi2.sf(terms.sum(), lags * series)))
