"""Intervals of a fit from the covariance at its solution, and directions that data do not resolve.

At the solution the residual changes by its slopes J over the unit cube. With s^2 the scale of the
variances and J / s = U diag(S) V^T, a move by d along a column of V changes the residual by S d
standard errors. If the 95 % interval of a direction, or of a parameter, is wider than the limits,
the data do not resolve it (Transtrum, Machta and Sethna, Phys Rev E 83:036701 (2011)).

If residuals are not white, intervals are widened. An estimate moves by d = P e with the errors e, P
the pseudo-inverse of the slopes; for stationary e, the variance of d is a sandwich covariance, as
in `lines`, with the periodogram of the residuals, smoothed over the root of their number (Daniell).
A residual beyond the noise is systematic and widens them as in `misfit`. If it exceeds a share of
the motion, no estimate has an interval.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.stats import chi2, t

from skinwave.measure.misfit import LARGEST_MISFIT, beyond_noise, systematic, unexplained
from skinwave.measure.search import Solution
from skinwave.typing import Floats

CONFIDENCE = 0.95
WIDEST = 0.5  # of the unit interval, as half an interval


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """Estimate of a parameter with its 95 % interval, whose ends are nan if it is unknown."""

    key: str
    value: float
    low: float
    high: float
    at_limit: bool
    is_curved: bool

    @property
    def is_resolved(self) -> bool:
        """Whether the estimate has an interval."""
        return bool(np.isfinite(self.low))


@dataclass(frozen=True, kw_only=True, eq=False)
class Whiteness:
    """Ljung and Box's test of residuals."""

    correlations: Floats  # (lags,), autocorrelations
    p: float  # probability that those of white noise are as large

    @property
    def is_white(self) -> bool:
        """Whether the residuals may be white."""
        not_white = 0.01  # p-value
        return not self.p < not_white


@dataclass(frozen=True, kw_only=True, eq=False)
class Intervals:
    """Intervals of a solution."""

    estimates: tuple[Estimate, ...]  # one per parameter
    half: Floats  # (k,), half widths in the unit cube
    widenings: Floats  # (k,), factors in `half` for residuals that are not white noise
    correlations: Floats  # (k, k) of the estimates; nan for unresolved ones
    unresolved: tuple[tuple[str, ...], ...]  # keys of unresolved directions, the worst first
    whiteness: Whiteness
    misfit: float  # relative L2 norm of the unweighted residual
    unexplained: float  # the part of it beyond the noise

    @property
    def is_described(self) -> bool:
        """Whether the model describes the record well enough for intervals."""
        return self.unexplained <= LARGEST_MISFIT


def intervals(solution: Solution) -> Intervals:
    """Return the intervals of a solution; they are symmetric in logarithms where these vary."""
    scale, shape = max(solution.scale, 1e-300), solution.residual.shape
    back, singular, vt = np.linalg.svd(solution.slopes / np.sqrt(scale), full_matrices=False)
    round_off = 1e-7  # of the largest singular value, left by differences
    singular = np.maximum(singular, round_off * max(float(singular.max()), 1e-300))
    moves = (vt.T / singular) @ back.T  # of the parameters by each error
    covariance = moves @ moves.T
    error = np.sqrt(np.diag(covariance))
    test = whiteness(solution.residual)
    dof = np.inf if solution.problem.data.is_known else solution.dof
    width = float(t.ppf((1 + CONFIDENCE) / 2, dof))
    widenings, across = np.ones(len(moves)), np.ones(len(moves))
    if not test.is_white:
        widenings, across = (
            widening(solution.residual, rows.reshape(-1, *shape)) for rows in (moves, back.T)
        )
    # Correlated values count as fewer (Bayley and Hammersley, J R Stat Soc 8:184 (1946)).
    shared = 1 + 2 * float((test.correlations**2).sum())
    data = solution.problem.data
    beyond = shared * beyond_noise(solution.cost / shared, solution.dof / shared, data.freedom)
    away = np.linalg.norm(solution.problem.predict(solution.u) - data.values)
    misfit = float(away) / max(float(np.linalg.norm(data.values)), 1e-300)
    widenings = np.hypot(widenings, systematic(beyond / scale) / width)
    half = width * widenings * error
    hidden = half >= WIDEST
    correlations = covariance / np.outer(error, error)
    directions = np.abs(vt[singular < 2 * width * across][::-1])
    keys = solution.problem.parameters.keys
    member = 0.1  # of the largest part in a direction, of the keys that form it
    found = Intervals(
        estimates=tuple(
            _estimate(solution, k, half[k] * covariance[k] / covariance[k, k], width * widenings[k])
            for k in range(len(half))
        ),
        half=half, widenings=widenings, whiteness=test, misfit=misfit,
        unexplained=unexplained(misfit, beyond, solution.cost),
        correlations=np.where(hidden[:, None] | hidden, np.nan, correlations),
        unresolved=tuple(
            tuple(keys[k] for k in np.flatnonzero(parts > member * parts.max()))
            for parts in directions
        ),
    )  # fmt: skip
    if found.is_described:
        return found
    bare = (replace(e, low=np.nan, high=np.nan, is_curved=False) for e in found.estimates)
    none = np.full_like(correlations, np.nan)
    return replace(found, estimates=tuple(bare), correlations=none, unresolved=())


def _estimate(solution: Solution, k: int, to_end: Floats, away: float) -> Estimate:
    """Return the estimate of parameter k, whose interval ends `to_end` (k,) from the solution."""
    parameter, u, half = solution.problem.parameters.free[k], float(solution.u[k]), float(to_end[k])
    low, high, is_curved = np.nan, np.nan, False
    curved = 0.3  # relative difference of the root of chi squared from that of a linear model
    if half < WIDEST:
        low, high = max(u - half, 0.0), min(u + half, 1.0)
        ends = (solution.u - to_end, solution.u + to_end)
        is_curved = any(
            abs(_standard_errors(solution, end) / away - 1) > curved
            for end in ends if ((end >= 0) & (end <= 1)).all()
        )  # fmt: skip
    at_limit = 1e-3  # of the unit interval
    return Estimate(
        key=parameter.key, value=parameter.value(u), low=parameter.value(low),
        high=parameter.value(high), at_limit=not at_limit <= u <= 1 - at_limit,
        is_curved=is_curved,
    )  # fmt: skip


def _standard_errors(solution: Solution, u: Floats) -> float:
    """Return the distance of a point from the solution in standard errors, by chi squared."""
    more = float((solution.problem.residual(u) ** 2).sum()) - solution.cost
    return float(np.sqrt(max(more, 0.0) / max(solution.scale, 1e-300)))


def widening(residual: Floats, rows: Floats) -> Floats:
    """Return factors (k,) >= 1 for intervals of combinations (k, n, s) of the errors."""
    power = np.abs(np.fft.fft(residual, axis=0)) ** 2 / len(residual)
    power[0] = power[1:3].mean(axis=0)  # a fit may have removed the mean
    density = uniform_filter1d(power, int(np.sqrt(len(residual))) | 1, axis=0, mode="wrap")
    sandwich = [(density * np.abs(np.fft.fft(row, axis=0)) ** 2).sum() for row in rows]
    independent = (residual**2).sum() * (rows**2).sum(axis=(1, 2)) / residual.shape[1]
    return np.asarray(np.sqrt(np.maximum(sandwich / np.maximum(independent, 1e-300), 1.0)))


def whiteness(residual: Floats) -> Whiteness:
    """Return the test of residuals (n, s) (Ljung and Box, Biometrika 65:297 (1978))."""
    n, series = residual.shape
    most_lags = 20  # of the test of whiteness
    lags = min(most_lags, n // 5)
    if lags < 2:
        return Whiteness(correlations=np.empty(0), p=np.nan)
    x = residual - residual.mean(axis=0)
    power = np.maximum((x**2).sum(axis=0), 1e-300)
    each = np.array([(x[lag:] * x[:-lag]).sum(axis=0) / power for lag in range(1, lags + 1)])
    terms = n * (n + 2) * each**2 / (n - np.arange(1, lags + 1))[:, None]
    return Whiteness(correlations=each.mean(axis=1), p=float(chi2.sf(terms.sum(), lags * series)))
