"""Intervals of a fit, by the covariance and by profiles of the likelihood, and what the data do not
resolve.

At the solution the residual r changes by its slopes J over the unit cube. With s^2 the scale of the
variances and J / s = U diag(S) V^T, a move by d along a column of V changes the residual by S d of
its standard errors. Where the 95 % interval of such a direction is wider than the limits, the data
do not resolve it, and of a parameter no interval is given whose own is as wide (Transtrum, Machta
and Sethna, Phys Rev E 83:036701 (2011), of such sloppy directions).

Where residuals are not white, intervals are widened. Least squares moves an estimate by d = P e
with the errors e of variance s^2, P the pseudo-inverse of the slopes. If e is stationary along the
axis, the variance of d is that of a sandwich covariance, as in `lines`, instead of s^2 |P|^2, with
the residuals' periodogram, smoothed over the square root of their number (Daniell).

A profile is the least chi squared at each value of a parameter, over all the others. Its interval
is where it exceeds the least by the square of Student's t (Venzon and Moolgavkar, Appl Stat 37:87
(1988)), for residuals that are not white by as much more as the variance of a sandwich covariance
is larger (Kent, Biometrika 69:19 (1982)); it need not be symmetric.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.stats import chi2, t

from simple_model.typing import Floats
from skinwave.measure.parameters import Parameter
from skinwave.measure.search import AT_LIMIT, CLOSE, Solution
from skinwave.system.effort import Progress

LEVEL = 0.95
ROUND_OFF = 1e-7  # of the largest singular value: what differences leave of one that is 0
MEMBER = 0.1  # of the largest part in a direction: keys that it is of
LAGS = 20  # of a test of whiteness
SIGNIFICANT = 0.01
STEPS = 3  # of the other parameters at each value of a profile
ATTEMPTS = 4  # at the end of the interval of a profile
ACCURATE = 0.03  # of the excess there, as a root


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
        return not self.p < SIGNIFICANT


@dataclass(frozen=True, kw_only=True, eq=False)
class Profile:
    """Profile of a parameter: its `values` (n,), ascending, and the `excess` (n,) there, twice the
    log of the likelihood ratio; the `level` of it at the ends `low` and `high` of its 95 %
    interval. It `is_open` where one of these is a limit of the range.
    """

    key: str
    values: Floats
    excess: Floats
    level: float
    low: float
    high: float
    is_open: bool


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
    if whiteness(solution.residual).is_white:
        return np.ones(len(rows))
    return widening(solution.residual, rows.reshape(-1, *solution.residual.shape))


def widening(residual: Floats, rows: Floats) -> Floats:
    """Factors (k,) >= 1 by which intervals of linear combinations P (k, n, s) of the errors are
    wider than for independent ones, by the residual (n, s).
    """
    power = np.abs(np.fft.fft(residual, axis=0)) ** 2 / len(residual)
    power[0] = power[1:3].mean(axis=0)  # a fit may have taken the mean out
    density = uniform_filter1d(power, int(np.sqrt(len(residual))) | 1, axis=0, mode="wrap")
    sandwich = [(density * np.abs(np.fft.fft(row, axis=0)) ** 2).sum() for row in rows]
    independent = (residual**2).sum() * (rows**2).sum(axis=(1, 2)) / residual.shape[1]
    return np.asarray(np.sqrt(np.maximum(sandwich / np.maximum(independent, 1e-300), 1.0)))


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


def estimates(solution: Solution) -> tuple[Estimate, ...]:
    """Estimates with intervals by the covariance, those by logarithms symmetric in these."""
    free = solution.problem.parameters.free
    each = zip(free, solution.u.tolist(), half_widths(solution).tolist(), strict=True)
    return tuple(_estimate(*one) for one in each)


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
    hidden = half_widths(solution) >= 0.5
    return np.where(hidden[:, None] | hidden, np.nan, found / np.outer(error, error))


def unresolved(solution: Solution) -> tuple[Direction, ...]:
    """Directions that the data do not resolve, the least resolved first."""
    left, singular, v = _singular(solution)
    resolved = singular >= 2 * width(solution) * _widened(solution, left.T)
    return tuple(_direction(solution, part) for part in v.T[~resolved][::-1])


def _direction(solution: Solution, parts: Floats) -> Direction:
    free = solution.problem.parameters.free
    members = np.flatnonzero(np.abs(parts) > MEMBER * np.abs(parts).max())
    exponent = np.nan
    if len(members) == 2 and all(free[k].is_log for k in members):
        first, second = (parts[k] * free[k].span for k in members)
        exponent = float(-first / second)
    return Direction(keys=tuple(free[k].key for k in members), parts=parts, exponent=exponent)


def combined(solution: Solution, direction: Direction) -> tuple[float, float, float]:
    """Value and 95 % interval of the combination of two keys that a direction leaves.

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
    across = np.zeros(len(solution.u))
    across[at] = [1.0, direction.exponent]
    across *= [each.span for each in parameters.free]
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


def profiles(solution: Solution, progress: Progress) -> tuple[Profile, ...]:
    """Profiles of all parameters that are resolved."""
    half, levels = half_widths(solution), (width(solution) * widenings(solution)) ** 2
    resolved = np.flatnonzero(half < 0.5)
    found = []
    for n, k in enumerate(resolved.tolist()):
        progress("profile likelihood", n / len(resolved))
        found.append(_profile(solution, k, float(half[k]), float(levels[k])))
    return tuple(found)


def _profile(solution: Solution, k: int, half: float, level: float) -> Profile:
    parameter = solution.problem.parameters.free[k]
    sides = [_side(solution, k, sign * half, level) for sign in (-1, 1)]
    points = sorted([(float(solution.u[k]), 0.0), *sides[0], *sides[1]])
    u, excess = (np.array(column) for column in zip(*points, strict=True))
    ends = [side[-1] for side in sides]
    return Profile(
        key=parameter.key, values=np.array([parameter.value(x) for x in u]), excess=excess,
        level=level, low=parameter.value(ends[0][0]), high=parameter.value(ends[1][0]),
        is_open=any(x in (0.0, 1.0) and found < 0.9 * level for x, found in ends),
    )  # fmt: skip


def _side(solution: Solution, k: int, half: float, level: float) -> list[tuple[float, float]]:
    """Points and excesses towards an end of the interval, which is the last one: the root of the
    excess is nearly in proportion to the distance.
    """
    least, wanted = float(solution.u[k]), np.sqrt(level)
    found, at = [], least + half
    for _ in range(ATTEMPTS):
        at = float(np.clip(at, 0.0, 1.0))
        found.append((at, _excess(solution, k, at)))
        root = np.sqrt(max(found[-1][1], 1e-12))
        if abs(root - wanted) <= ACCURATE * wanted or (at in (0.0, 1.0) and root < wanted):
            break
        at = least + (at - least) * float(np.clip(wanted / root, 0.3, 3.0))
    return found


def _excess(solution: Solution, k: int, at: float) -> float:
    """Chi squared over its scale above the least, parameter k fixed at a place of the unit interval
    and all others fitted, by Gauss-Newton steps with the slopes at the solution.
    """
    problem, others = solution.problem, np.arange(len(solution.u)) != k
    slopes = solution.slopes[:, others]
    steps = _resolved_steps(solution, slopes)
    u = np.where(others, solution.u, at)
    u[others] -= steps @ solution.slopes[:, k] * (at - solution.u[k])
    u = np.clip(u, 0, 1)
    best = np.inf
    for _ in range(STEPS):
        residual = problem.residual(u)
        best = min(best, float((residual**2).sum()))
        move = steps @ residual
        if np.linalg.norm(slopes @ move) <= 2 * CLOSE * np.sqrt(solution.scale):
            break
        u = u.copy()
        u[others] = np.clip(u[others] - move, 0, 1)
    return (best - solution.cost) / solution.scale


def _resolved_steps(solution: Solution, slopes: Floats) -> Floats:
    """Pseudo-inverse (k, n) of slopes (n, k), along the directions that the data resolve."""
    if not slopes.shape[1]:
        return slopes.T
    left, singular, right = np.linalg.svd(slopes, full_matrices=False)
    kept = singular >= 2 * width(solution) * np.sqrt(solution.scale)
    return np.asarray((right[kept].T / singular[kept]) @ left[:, kept].T)
