"""Weighted least squares within limits, from several starts.

The delay, by a scan of its range, and the gain or the pressure, by linear least squares at each
delay (Golub and Pereyra, SIAM J Numer Anal 10:413 (1973)), need no run of the model and are
determined first. A trust-region method continues from there. It may end in another minimum, such as
a softer body whose waves are one period later. Therefore each other parameter is scanned through
its range, and the search continues from the minima of the scan until none leads lower. Searches use
rough data if there are any; the best start continues with all data.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import qmc

from skinwave.measure.alignment import AS_GOOD
from skinwave.measure.observed import Data
from skinwave.measure.parameters import DELAY, Parameters
from skinwave.system.effort import Progress
from skinwave.system.failures import failure_text, or_failed
from skinwave.typing import Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class Problem:
    """Weighted residuals over the unit cube, of a model that is proportional to `linear` keys."""

    parameters: Parameters
    data: Data
    linear: tuple[str, ...]

    def residual(self, u: Floats) -> Floats:
        """Return the weighted residual (n s,) at a point u (k,) of the unit cube."""
        return self.data.whiten(self.predict(u) - self.data.values).ravel()

    def predict(self, u: Floats) -> Floats:
        """Return the prediction (n, s)."""
        return self.data.predict(self.parameters.values(u))

    def slopes(self, u: Floats) -> Floats:
        """Return derivatives (n s, k) of the residual by central differences within the limits."""
        columns = []
        central_step = 1e-3  # of differences, in the unit interval
        for k in range(len(u)):
            ends = np.clip([u[k] - central_step, u[k] + central_step], 0, 1)
            low, high = (self.residual(_with(u, k, end)) for end in ends)
            columns.append((high - low) / (ends[1] - ends[0]))
        return np.array(columns).T

    def forward_slopes(self, u: Floats) -> Floats:
        """Return the derivatives by one-sided differences towards the middle, at half the cost."""
        at = self.residual(u)
        forward_step = 1e-5  # of differences, in the unit interval
        steps = np.where(u < 0.5, forward_step, -forward_step)
        each = (self.residual(u + moved) for moved in np.diag(steps))
        return np.array([(moved - at) / step for moved, step in zip(each, steps, strict=True)]).T

    @property
    def rough(self) -> "Problem":
        """The problem with rough data, if there are any."""
        return replace(self, data=self.data.rough) if self.data.rough else self


@dataclass(frozen=True, kw_only=True, eq=False)
class LocalMinimum:
    """End of a local search."""

    ended: Floats  # (k,)
    cost: float  # chi squared
    converged: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class Solution:
    """Solution of a fit."""

    problem: Problem
    u: Floats  # (k,), the best point of the unit cube
    residual: Floats  # (n, s), weighted
    slopes: Floats  # (n s, k), derivatives of the residual
    starts: tuple[LocalMinimum, ...]  # the best first
    failures: Mapping[str, str]  # reasons of other starts
    may_be_flipped: bool  # whether the opposite sign of the measurement fits as well
    converged: bool

    @property
    def cost(self) -> float:
        """Chi squared."""
        return float((self.residual**2).sum())

    @property
    def dof(self) -> int:
        """Degrees of freedom of the residual."""
        return max(self.residual.size - len(self.u), 1)

    @property
    def scale(self) -> float:
        """Factor of the variances: chi squared per degree of freedom, >= 1 for known errors."""
        ratio = self.cost / self.dof
        return max(ratio, 1.0) if self.problem.data.is_known else ratio

    @property
    def agreeing_starts(self) -> int:
        """Number of starts that ended with the best chi squared."""
        best = self.starts[0].cost
        same_cost = 1.0  # of twice the log-likelihood, of starts that reached the best minimum
        return sum(start.cost - best <= same_cost * self.scale for start in self.starts)


def minimise(problem: Problem, starts: int, seed: int, progress: Progress) -> Solution:
    """Return the best result of several starts, from a Latin hypercube between the limits."""
    k, count = len(problem.parameters.free), problem.data.values.size
    if starts < 1:
        raise ValueError(f"{starts} starts are too few; give at least 1")
    if count < k:
        raise ValueError(f"{count} values cannot determine {k} parameters; vary fewer keys")
    hypercube = qmc.LatinHypercube(k, rng=seed)
    candidates = 4  # points of the hypercube per start
    points = [hypercube.random(candidates) for _ in range(starts)]
    failures: dict[str, str] = {}
    found = search(problem.rough, points, progress, failures)
    if not found:
        raise ValueError(failure_text(failures))
    ordered = sorted(found, key=lambda start: start.cost)
    progress("fit to all data", 0.0)
    fine_tolerance = 1e-8  # of chi squared
    best = refine(problem, ordered[0].ended, tolerance=fine_tolerance)
    progress("derivatives", 0.0)
    return Solution(
        problem=problem, u=best.ended,
        residual=problem.residual(best.ended).reshape(problem.data.values.shape),
        slopes=problem.slopes(best.ended), starts=tuple(ordered), failures=failures,
        may_be_flipped=_may_be_flipped(problem.rough, ordered[0], points[0]),
        converged=best.converged,
    )  # fmt: skip


def _may_be_flipped(problem: Problem, best: LocalMinimum, candidates: Floats) -> bool:
    """Whether the opposite sign of the measurement fits better, or with a smaller delay."""
    data, parameters = problem.data, problem.parameters
    linear = [each for each in parameters.free if each.key in problem.linear]
    values = parameters.values(best.ended)
    if data.kind == "amplitudes" or any(each.low < 0 for each in linear):
        return any(values[each.key] < 0 for each in linear)
    flipped = replace(problem, data=replace(data, values=-data.values))
    other = refine(flipped, best_candidate(flipped, np.vstack([candidates, best.ended])))
    more, scale = other.cost - best.cost, best.cost / max(data.values.size - len(best.ended), 1)
    delay = abs(parameters.values(other.ended).get(DELAY, 0.0))
    is_better = more < 0 or delay < abs(values.get(DELAY, 0.0))
    return more < AS_GOOD * scale and is_better


def search(
    problem: Problem, starts: Sequence[Floats], progress: Progress, failures: dict[str, str]
) -> list[LocalMinimum]:
    """Return the results of starts that do not fail, in order, each with candidates (c, k)."""
    results: list[LocalMinimum] = []
    minima: list[
        tuple[LocalMinimum, LocalMinimum]
    ] = []  # each with the lowest one that its scans lead to
    same_minimum = 1e-3  # in the unit interval
    for n, candidates in enumerate(starts):
        progress("search from several starts", n / len(starts))
        with or_failed(failures, f"start {n + 1}"):
            local = refine(problem, best_candidate(problem, candidates))
            near = (end for start, end in minima
                    if np.abs(start.ended - local.ended).max() <= same_minimum)  # fmt: skip
            lowest = next(near, None)
            if lowest is None:
                lowest = descend(problem, local)
                minima.append((local, lowest))
            results.append(lowest)
    return results


def descend(problem: Problem, local: LocalMinimum) -> LocalMinimum:
    """Return the lowest minimum that scans of one parameter after another lead to."""
    most_hops = 5  # from one minimum to a lower one
    for _ in range(most_hops):
        lower = _lower(problem, local)
        if lower is None:
            break
        local = lower
    return local


def _lower(problem: Problem, local: LocalMinimum) -> LocalMinimum | None:
    """Return a lower minimum near a minimum of a scan, if there is any."""
    short_search = 8  # evaluations that show whether a minimum of a scan leads lower
    least_gain = 1e-4  # of chi squared, of a lower minimum
    for k, key in enumerate(problem.parameters.keys):
        if key in (DELAY, *problem.linear):
            continue
        for u in _scan_minima(problem, local, k):
            trial = refine(problem, u, short_search)
            if trial.cost < (1 - least_gain) * local.cost:
                return trial if trial.converged else refine(problem, trial.ended)
    return None


def _scan_minima(problem: Problem, local: LocalMinimum, k: int) -> list[Floats]:
    """Return the minima (k,) along a parameter through the end of a local search."""
    free, u = problem.parameters.free[k], local.ended
    scan_ratio = 1.25  # of neighbouring values in a scan of a logarithm
    fewest_scanned, most_scanned = 12, 40  # positions
    count = int(np.ceil(free.span / np.log(scan_ratio))) if free.is_log else fewest_scanned
    positions = np.linspace(0, 1, int(np.clip(count, fewest_scanned, most_scanned)))
    positions = np.sort(np.append(positions, u[k]))
    scan = [_with_cheap_parameters(problem, _with(u, k, at)) for at in positions]
    costs = np.array([np.inf, *(cost for cost, _ in scan), np.inf])
    lowest = np.flatnonzero((costs[1:-1] <= costs[:-2]) & (costs[1:-1] < costs[2:]))
    new = [n for n in lowest if positions[n] != u[k] or scan[n][0] < local.cost]
    return [scan[n][1] for n in sorted(new, key=lambda n: scan[n][0])]


def refine(problem: Problem, u: Floats, most: int = 40, tolerance: float = 1e-5) -> LocalMinimum:
    """Search locally from a point (k,) to a relative tolerance of chi squared."""
    result = least_squares(
        problem.residual, np.clip(u, 1e-6, 1 - 1e-6), problem.forward_slopes, bounds=(0, 1),
        x_scale="jac", xtol=1e-8, ftol=tolerance, gtol=1e-8, max_nfev=most,
    )  # fmt: skip
    cost = 2 * float(result.cost)
    return LocalMinimum(ended=result.x, cost=cost, converged=result.status > 0)


def best_candidate(problem: Problem, candidates: Floats) -> Floats:
    """Return the best of candidates (c, k), each with its best delay and linear factor."""
    trials = [_with_cheap_parameters(problem, u) for u in candidates]
    return min(trials, key=lambda trial: trial[0])[1]


def _with_cheap_parameters(problem: Problem, u: Floats) -> tuple[float, Floats]:
    """Return chi squared and the point with the best delay and linear factor."""
    keys = problem.parameters.keys
    trials = [u]
    if DELAY in keys:
        at = keys.index(DELAY)
        trials = [_with(u, at, x) for x in _delays(problem, at)]
    linear = next((keys.index(key) for key in problem.linear if key in keys), None)
    return min((_with_factor(problem, u, linear) for u in trials), key=lambda trial: trial[0])


def _delays(problem: Problem, at: int) -> list[float]:
    """Return positions of delays, close enough to resolve the periods of the data."""
    delay, data = problem.parameters.free[at], problem.data
    highest = 0.1 / np.diff(data.axis).min() if data.is_in_time else data.axis.max()
    delays_per_period, most_delays = 4, 400  # of a scan; periods of the highest frequency
    count = int(np.ceil(delays_per_period * highest * (delay.high - delay.low) / 1e3)) + 2
    return [delay.position(x) for x in np.linspace(delay.low, delay.high, min(count, most_delays))]


def _with_factor(problem: Problem, u: Floats, at: int | None) -> tuple[float, Floats]:
    """Return chi squared and the point, with the best linear parameter at index `at`, if any."""
    data = problem.data
    predicted, values = data.whiten(problem.predict(u)), data.whiten(data.values)
    factor = 1.0
    if at is not None:
        linear = problem.parameters.free[at]
        now = linear.value(float(u[at]))
        best = float((predicted * values).sum() / max((predicted**2).sum(), 1e-300))
        position = linear.position(best * now)
        factor = linear.value(position) / now if now else 1.0
        u = _with(u, at, position)
    return float(((factor * predicted - values) ** 2).sum()), u


def _with(u: Floats, k: int, value: float) -> Floats:
    moved = u.copy()
    moved[k] = value
    return moved
