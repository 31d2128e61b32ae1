"""Weighted least squares within limits, from several starts.

At each start the parameters that cost no run of the model are placed first: the delay by a scan of
its range, the gain or the peak pressure as linear least squares at each delay (variable projection;
Golub and Pereyra, SIAM J Numer Anal 10:413 (1973)). From there a trust-region method takes over.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import qmc

from meshes.tetmesh import Floats
from skinwave.effort import Progress
from skinwave.fits.observed import Data
from skinwave.fits.parameters import DELAY, Parameters

FORWARD, CENTRAL = 1e-5, 1e-3  # steps of differences, of the unit interval
MOST_EVALUATIONS = 40  # steps of one start
TOLERANCE = 1e-8
CANDIDATES = 8  # points of the hypercube, of which the best one is a start
DELAYS = 4  # of a scan, to a period of the highest frequency
MOST_DELAYS = 400
POLISHED = 6  # steps, which get closer by a digit each
CLOSE = 0.01  # of a standard error: a step that no longer matters
AT_LIMIT = 1e-3  # of the unit interval
SAME_COST = 1.0  # of twice the log-likelihood: starts as near to the best reached it


@dataclass(frozen=True, kw_only=True, eq=False)
class Problem:
    """Problem of a fit: parameters, data, and the keys that the model is in proportion to."""

    parameters: Parameters
    data: Data
    linear: tuple[str, ...]

    def residual(self, u: Floats) -> Floats:
        """Weighted residual (n s,) at a point u (k,) of the unit cube."""
        return self._weighted(self.predicted(u) - self.data.values)

    def predicted(self, u: Floats) -> Floats:
        """Prediction (n, s)."""
        return self.data.predict(self.parameters.values(u))

    def slopes(self, u: Floats, step: float = CENTRAL) -> Floats:
        """Derivatives (n s, k) of the residual, by central differences within the limits."""
        columns = []
        for k in range(len(u)):
            ends = np.clip([u[k] - step, u[k] + step], 0, 1)
            low, high = (np.where(np.arange(len(u)) == k, end, u) for end in ends)
            columns.append((self.residual(high) - self.residual(low)) / (ends[1] - ends[0]))
        return np.array(columns).T

    def forward(self, u: Floats) -> Floats:
        """Derivatives (n s, k) of the residual, by differences towards the middle."""
        at = self.residual(u)
        steps = np.where(u < 0.5, FORWARD, -FORWARD)
        each = (self.residual(u + moved) for moved in np.diag(steps))
        return np.array([(moved - at) / step for moved, step in zip(each, steps, strict=True)]).T

    def _weighted(self, difference: Floats) -> Floats:
        return np.asarray((difference / self.data.error).ravel())


@dataclass(frozen=True, kw_only=True, eq=False)
class Start:
    """Start of a search: where it `begun` and `ended` (k,), chi squared there, and whether it
    converged.
    """

    begun: Floats
    ended: Floats
    cost: float
    converged: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class Solution:
    """Solution of a fit.

    Parameters
    ----------
    problem : Problem
    u : (k,) float, the best point of the unit cube
    residual : (n, s) float, weighted
    slopes : (n s, k) float, derivatives of the residual
    starts : of the search, the best first
    converged : bool
    runs : int, predictions that were asked for
    """

    problem: Problem
    u: Floats
    residual: Floats
    slopes: Floats
    starts: tuple[Start, ...]
    converged: bool
    runs: int

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
        """Factor of the variances: chi squared over its degrees of freedom, of known errors no less
        than 1, so that a misfit of the model widens the intervals.
        """
        found = self.cost / self.dof
        return max(found, 1.0) if self.problem.data.is_known else found

    @property
    def at_limits(self) -> tuple[str, ...]:
        """Keys whose estimates are at a limit."""
        near = (self.u < AT_LIMIT) | (self.u > 1 - AT_LIMIT)
        return tuple(
            key for key, is_near in zip(self.problem.parameters.keys, near, strict=True) if is_near
        )

    @property
    def reached(self) -> int:
        """How many starts ended where the best did."""
        best = self.starts[0].cost
        return sum(start.cost - best <= SAME_COST * self.scale for start in self.starts)


def solve(problem: Problem, starts: int, seed: int, progress: Progress) -> Solution:
    """Best of several starts, which a Latin hypercube spreads between the limits.

    They search on the rough data, if there are any; the best one goes on with the data themselves.

    Parameters
    ----------
    problem : Problem
    starts : how many
    seed : of the hypercube
    progress : called with the name of the phase and the fraction done

    Returns
    -------
    Solution

    Raises
    ------
    ValueError
        If there are fewer data than parameters, or no start.
    """
    k = len(problem.parameters.free)
    if starts < 1:
        raise ValueError(f"{starts} starts are too few; give at least 1")
    if problem.data.values.size < k:
        raise ValueError(
            f"{problem.data.values.size} values cannot determine {k} parameters; measure more, or "
            "vary fewer keys"
        )
    problem, calls = _counted(problem)
    rough = replace(problem, data=problem.data.rough) if problem.data.rough else problem
    found = []
    points = qmc.LatinHypercube(k, rng=seed).random(starts * CANDIDATES)
    for n, candidates in enumerate(np.split(points, starts)):
        progress("search from several starts", n / starts)
        found.append(search(rough, candidates))
    found.sort(key=lambda start: start.cost)
    best = found[0]
    if rough is not problem:
        progress("fit to all data", 0.0)
        best = polished(problem, best.ended)
    progress("derivatives", 0.0)
    return Solution(
        problem=problem, u=best.ended,
        residual=problem.residual(best.ended).reshape(problem.data.values.shape),
        slopes=problem.slopes(best.ended), starts=tuple(found), converged=best.converged,
        runs=len(calls),
    )  # fmt: skip


def _counted(problem: Problem) -> tuple[Problem, list[None]]:
    """The problem, and a list that grows with each prediction."""
    calls: list[None] = []

    def counting(data: Data) -> Data:
        predict: Callable[..., Floats] = data.predict

        def counted(values: Mapping[str, float]) -> Floats:
            calls.append(None)
            return predict(values)

        rough = counting(data.rough) if data.rough else None
        return replace(data, predict=counted, rough=rough)

    return replace(problem, data=counting(problem.data)), calls


def search(problem: Problem, candidates: Floats) -> Start:
    """Local solution from the best of candidates (c, k), of each the parameters that cost no run
    placed first.
    """
    trials = [placed(problem, u) for u in candidates]
    return refine(problem, min(trials, key=lambda trial: trial[0])[1])


def refine(problem: Problem, u: Floats) -> Start:
    """Local solution from a point of the unit cube."""
    inside = np.clip(u, 1e-6, 1 - 1e-6)
    found = least_squares(
        problem.residual, inside, problem.forward, bounds=(0, 1), x_scale="jac", xtol=TOLERANCE,
        ftol=TOLERANCE, gtol=TOLERANCE, max_nfev=MOST_EVALUATIONS,
    )  # fmt: skip
    return Start(begun=u, ended=found.x, cost=2 * float(found.cost), converged=found.status > 0)


def polished(problem: Problem, u: Floats) -> Start:
    """Local solution from a point next to it: Gauss-Newton steps with the slopes there, a run of
    the model each; by `refine` if they do not get closer.
    """
    slopes = problem.slopes(u)
    inverse = np.linalg.pinv(slopes, rcond=1e-7)
    ended, cost = u, np.inf
    for _ in range(POLISHED):
        residual = problem.residual(ended)
        if not (residual**2).sum() <= cost * (1 + TOLERANCE):
            break
        cost = float((residual**2).sum())
        move = inverse @ residual
        if np.linalg.norm(slopes @ move) <= CLOSE * np.sqrt(cost / residual.size):
            return Start(begun=u, ended=ended, cost=cost, converged=True)
        ended = np.clip(ended - move, 0, 1)
    return refine(problem, u)


def placed(problem: Problem, u: Floats) -> tuple[float, Floats]:
    """Chi squared and the point with the best delay and linear factor, all others as they are."""
    keys = problem.parameters.keys
    trials = [u]
    if DELAY in keys:
        at = keys.index(DELAY)
        trials = [np.where(np.arange(len(u)) == at, x, u) for x in _delays(problem, at)]
    linear = next((keys.index(key) for key in problem.linear if key in keys), None)
    found = [_in_proportion(problem, trial, linear) for trial in trials]
    return min(found, key=lambda pair: pair[0])


def _delays(problem: Problem, at: int) -> Floats:
    """Places of delays that resolve the periods of the data."""
    delay = problem.parameters.free[at]
    axis = problem.data.axis
    highest = axis.max() if problem.data.unit == "Hz" else 0.1 / np.diff(axis).min()
    count = int(np.ceil(DELAYS * highest * (delay.high - delay.low) / 1e3)) + 2
    delays = np.linspace(delay.low, delay.high, min(count, MOST_DELAYS))
    return np.array([delay.place(x) for x in delays])


def _in_proportion(problem: Problem, u: Floats, at: int | None) -> tuple[float, Floats]:
    """Chi squared and the point with the linear parameter, if any is free, of least squares."""
    data = problem.data
    predicted, values = problem.predicted(u) / data.error, data.values / data.error
    factor = 1.0
    if at is not None:
        linear = problem.parameters.free[at]
        now = linear.value(float(u[at]))
        best = float((predicted * values).sum() / max((predicted**2).sum(), 1e-300))
        place = linear.place(best * now)
        factor = linear.value(place) / now if now else 1.0
        u = np.where(np.arange(len(u)) == at, place, u)
    return float(((factor * predicted - values) ** 2).sum()), u
