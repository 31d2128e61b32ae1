"""Intervals of a fit by the covariance at its solution, and what the data do not resolve.

At the solution the residual r changes by its slopes J over the unit cube. With s^2 the scale of the
variances and J / s = U diag(S) V^T, a move by d along a column of V changes the residual by S d of
its standard errors. Where the 95 % interval of such a direction is wider than the limits, the data
do not resolve it, and of a parameter no interval is given whose own is as wide (Transtrum, Machta
and Sethna, Phys Rev E 83:036701 (2011), of such sloppy directions).

Where residuals are not white, intervals are widened. Least squares moves an estimate by d = P e
with the errors e of variance s^2, P the pseudo-inverse of the slopes. If e is stationary along the
axis, the variance of d is that of a sandwich covariance, as in `lines`, instead of s^2 |P|^2, with
the residuals' periodogram, smoothed over the square root of their number (Daniell).
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.stats import chi2, t

from skinwave.measure.search import Solution
from skinwave.typing import Floats

LEVEL = 0.95
ROUND_OFF = 1e-7  # of the largest singular value: what differences leave of one that is 0
AT_LIMIT = 1e-3  # of the unit interval
UNRESOLVED = 0.5  # of the unit interval, from which half an interval is none
MEMBER = 0.1  # of the largest part in a direction: keys that it is of
LAGS = 20  # of a test of whiteness
SIGNIFICANT = 0.01
CURVED = (
    0.3  # by which chi squared's root at an end of an interval may differ from a linear model's
)


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """Estimate of a parameter: its `value`, the limits `low` and `high` of its 95 % interval, nan
    if the data do not resolve it, whether it is at a limit of its range, and whether chi squared at
    the ends of the interval is not that of a linear model, so that the interval is approximate.
    """

    key: str
    value: float
    low: float
    high: float
    at_limit: bool
    is_curved: bool

    @property
    def is_resolved(self) -> bool:
        """Whether it has an interval."""
        return bool(np.isfinite(self.low))


@dataclass(frozen=True, kw_only=True, eq=False)
class Whiteness:
    """Test of residuals by Ljung and Box: autocorrelations (lags,), and the probability `p` of as
    large ones in white noise.
    """

    correlations: Floats
    p: float

    @property
    def is_white(self) -> bool:
        """Whether nothing speaks against it."""
        return not self.p < SIGNIFICANT


@dataclass(frozen=True, kw_only=True, eq=False)
class Intervals:
    """Intervals of a solution.

    Parameters
    ----------
    estimates : one a parameter
    half : (k,) float, halves of the 95 % intervals over the unit cube
    widenings : (k,) float, factors in these for residuals that are not white
    correlations : (k, k) float, of the estimates; nan with those that are not resolved
    unresolved : keys of each direction that the data do not resolve, the least resolved first
    whiteness : Whiteness of the residuals
    """

    estimates: tuple[Estimate, ...]
    half: Floats
    widenings: Floats
    correlations: Floats
    unresolved: tuple[tuple[str, ...], ...]
    whiteness: Whiteness


def intervals(solution: Solution) -> Intervals:
    """Intervals by the covariance; those of logarithms are symmetric in these."""
    scale, shape = max(solution.scale, 1e-300), solution.residual.shape
    left, singular, vt = np.linalg.svd(solution.slopes / np.sqrt(scale), full_matrices=False)
    singular = np.maximum(singular, ROUND_OFF * max(float(singular.max()), 1e-300))
    moves = (vt.T / singular) @ left.T  # of the parameters by each error
    covariance = moves @ moves.T
    error = np.sqrt(np.diag(covariance))
    test, width = whiteness(solution.residual), _width(solution)
    widenings, across = np.ones(len(moves)), np.ones(len(moves))
    if not test.is_white:
        widenings, across = (
            widening(solution.residual, rows.reshape(-1, *shape)) for rows in (moves, left.T)
        )
    half = width * widenings * error
    hidden = half >= UNRESOLVED
    correlations = covariance / np.outer(error, error)
    lost = vt[singular < 2 * width * across][::-1]
    return Intervals(
        estimates=tuple(
            _estimate(solution, k, half[k] * covariance[k] / covariance[k, k], width * widenings[k])
            for k in range(len(half))
        ),
        half=half, widenings=widenings, whiteness=test,
        correlations=np.where(hidden[:, None] | hidden, np.nan, correlations),
        unresolved=tuple(_members(solution, parts) for parts in lost),
    )  # fmt: skip


def _width(solution: Solution) -> float:
    """Half of a 95 % interval, in standard errors: normal where the errors are known, else
    Student's t of the residual's degrees of freedom.
    """
    dof = np.inf if solution.problem.data.is_known else solution.dof
    return float(t.ppf((1 + LEVEL) / 2, dof))


def _estimate(solution: Solution, k: int, to_end: Floats, away: float) -> Estimate:
    """Estimate of parameter k, whose interval ends so far (k,) from the solution, and so many
    standard errors.
    """
    parameter, u, half = solution.problem.parameters.free[k], float(solution.u[k]), float(to_end[k])
    low, high = (max(u - half, 0.0), min(u + half, 1.0)) if half < UNRESOLVED else (np.nan, np.nan)
    ends = [solution.u + sign * to_end for sign in (-1, 1) if half < UNRESOLVED]
    is_curved = any(
        abs(_excess(solution, end) / away - 1) > CURVED
        for end in ends if ((end >= 0) & (end <= 1)).all()
    )  # fmt: skip
    return Estimate(
        key=parameter.key, value=parameter.value(u), low=parameter.value(low),
        high=parameter.value(high), at_limit=not AT_LIMIT <= u <= 1 - AT_LIMIT,
        is_curved=is_curved,
    )  # fmt: skip


def _excess(solution: Solution, u: Floats) -> float:
    """How many standard errors a point is away, by chi squared."""
    more = float((solution.problem.residual(u) ** 2).sum()) - solution.cost
    return float(np.sqrt(max(more, 0.0) / max(solution.scale, 1e-300)))


def _members(solution: Solution, parts: Floats) -> tuple[str, ...]:
    """Keys of the parameters with a large part in a direction."""
    at = np.flatnonzero(np.abs(parts) > MEMBER * np.abs(parts).max())
    return tuple(solution.problem.parameters.keys[k] for k in at)


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
