"""Weighted least squares within limits, from several starts.

At each start the parameters that cost no run of the model are placed first: the delay by a scan of
its range, the gain or the peak pressure as linear least squares at each delay (variable projection;
Golub and Pereyra, SIAM J Numer Anal 10:413 (1973)). A trust-region method goes on from there. It
may end in another minimum: of a softer body, whose waves are a period later at the places.
Therefore each other parameter is scanned through its range, with the best delay and gain at each
place, and the search goes on from the minima of that scan until none leads lower. Starts that end
in one minimum share its scans. They search on rough data, if there are any; the best one goes on
with the data themselves.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import qmc

from skinwave.measure.alignment import AS_GOOD
from skinwave.measure.observed import Data
from skinwave.measure.parameters import DELAY, Parameters
from skinwave.system.effort import Progress
from skinwave.typing import Floats

FORWARD, CENTRAL = 1e-5, 1e-3  # steps of differences, of the unit interval
MOST_EVALUATIONS = 40  # steps of one local search
TOLERANCE, FINE = 1e-5, 1e-8  # of chi squared, where a search ends: on rough data, and on all
CANDIDATES = 4  # points of the hypercube, of which the best one is a start
DELAYS, MOST_DELAYS = 4, 400  # of a scan: to a period of the highest frequency, and in all
FACTOR = 1.25  # from a place of a scan to the next, of parameters by their logarithm
LEAST_PLACES, MOST_PLACES = 12, 40
FEW = 8  # steps from a minimum of a scan, after which it leads lower, or does not
MOST_HOPS = 5  # from one minimum to a lower one
SAME_PLACE = 1e-3  # of the unit interval: minima as near are one
LOWER = 1e-4  # of chi squared: a smaller gain may be a search that has not quite ended
SAME_COST = 1.0  # of twice the log-likelihood: starts as near to the best reached it


@dataclass(frozen=True, kw_only=True, eq=False)
class Problem:
    """Weighted residuals over the unit cube of the parameters, by the data, and the `linear` keys
    that the model is in proportion to.
    """

    parameters: Parameters
    data: Data
    linear: tuple[str, ...]

    def residual(self, u: Floats) -> Floats:
        """Weighted residual (n s,) at a point u (k,) of the unit cube."""
        return self.data.weighted(self.predicted(u) - self.data.values).ravel()

    def predicted(self, u: Floats) -> Floats:
        """Prediction (n, s)."""
        return self.data.predict(self.parameters.values(u))

    def slopes(self, u: Floats) -> Floats:
        """Derivatives (n s, k) of the residual, by central differences within the limits."""
        columns = []
        for k in range(len(u)):
            ends = np.clip([u[k] - CENTRAL, u[k] + CENTRAL], 0, 1)
            low, high = (_with(u, k, end) for end in ends)
            columns.append((self.residual(high) - self.residual(low)) / (ends[1] - ends[0]))
        return np.array(columns).T

    def forward(self, u: Floats) -> Floats:
        """The same by differences towards the middle, which cost half."""
        at = self.residual(u)
        steps = np.where(u < 0.5, FORWARD, -FORWARD)
        each = (self.residual(u + moved) for moved in np.diag(steps))
        return np.array([(moved - at) / step for moved, step in zip(each, steps, strict=True)]).T

    @property
    def rough(self) -> "Problem":
        """The problem of the rough data, if there are any."""
        return replace(self, data=self.data.rough) if self.data.rough else self


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
    may_be_turned : bool, whether the measurement with its sign turned fits as well
    converged : bool
    """

    problem: Problem
    u: Floats
    residual: Floats
    slopes: Floats
    starts: tuple[Start, ...]
    may_be_turned: bool
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
        """Factor of the variances: chi squared over its degrees of freedom, of known errors no less
        than 1, so that a misfit of the model widens the intervals.
        """
        found = self.cost / self.dof
        return max(found, 1.0) if self.problem.data.is_known else found

    @property
    def reached(self) -> int:
        """How many starts ended where the best did."""
        best = self.starts[0].cost
        return sum(start.cost - best <= SAME_COST * self.scale for start in self.starts)


def solve(problem: Problem, starts: int, seed: int, progress: Progress) -> Solution:
    """Best of so many starts, which a Latin hypercube of that seed spreads between the limits;
    raises a ValueError if there are fewer data than parameters, or no start.
    """
    k = len(problem.parameters.free)
    if starts < 1:
        raise ValueError(f"{starts} starts are too few; give at least 1")
    if problem.data.values.size < k:
        raise ValueError(
            f"{problem.data.values.size} values cannot determine {k} parameters; vary fewer keys"
        )
    hypercube = qmc.LatinHypercube(k, rng=seed)
    points = [hypercube.random(CANDIDATES) for _ in range(starts)]
    found = sorted(search(problem.rough, points, progress), key=lambda start: start.cost)
    progress("fit to all data", 0.0)
    best = refine(problem, found[0].ended, tolerance=FINE)
    progress("derivatives", 0.0)
    return Solution(
        problem=problem, u=best.ended,
        residual=problem.residual(best.ended).reshape(problem.data.values.shape),
        slopes=problem.slopes(best.ended), starts=tuple(found),
        may_be_turned=_may_be_turned(problem.rough, found[0], points[0]), converged=best.converged,
    )  # fmt: skip


def _may_be_turned(problem: Problem, best: Start, candidates: Floats) -> bool:
    """Whether a linear factor is negative or, if none may be, the measurement with its sign turned
    fits better, or as well at a lesser delay.
    """
    data, parameters = problem.data, problem.parameters
    linear = [each for each in parameters.free if each.key in problem.linear]
    values = parameters.values(best.ended)
    if not data.has_sign or any(each.low < 0 for each in linear):
        return any(values[each.key] < 0 for each in linear)
    turned = replace(problem, data=replace(data, values=-data.values))
    other = refine(turned, best_placed(turned, np.vstack([candidates, best.ended])))
    more, scale = other.cost - best.cost, best.cost / max(data.values.size - len(best.ended), 1)
    late = abs(parameters.values(other.ended).get(DELAY, 0.0))
    return more < AS_GOOD * scale and (late < abs(values.get(DELAY, 0.0)) or more < 0)


def search(problem: Problem, starts: Sequence[Floats], progress: Progress) -> list[Start]:
    """Solutions of several starts in their order, each with candidates (c, k) in the unit cube."""
    found: list[Start] = []
    lowest: list[tuple[Start, Start]] = []  # of each minimum the one that scans lead to
    for n, candidates in enumerate(starts):
        progress("search from several starts", n / len(starts))
        local = refine(problem, best_placed(problem, candidates))
        after = next((end for start, end in lowest
                      if np.abs(start.ended - local.ended).max() <= SAME_PLACE), None)  # fmt: skip
        if after is None:
            after = descended(problem, local)
            lowest.append((local, after))
        found.append(replace(after, begun=local.begun))
    return found


def descended(problem: Problem, found: Start) -> Start:
    """The lowest minimum that scans of one parameter after the other lead to."""
    for _ in range(MOST_HOPS):
        lower = _lower(problem, found)
        if lower is None:
            break
        found = lower
    return found


def _lower(problem: Problem, found: Start) -> Start | None:
    """A lower minimum that begins at one of a scan, if there is any."""
    for k, key in enumerate(problem.parameters.keys):
        if key in (DELAY, *problem.linear):
            continue
        for u in _minima(problem, found, k):
            tried = refine(problem, u, FEW)
            if tried.cost < (1 - LOWER) * found.cost:
                return tried if tried.converged else refine(problem, tried.ended)
    return None


def _minima(problem: Problem, local: Start, k: int) -> list[Floats]:
    """Points (k,) at the minima of chi squared along a parameter through the end of a local search,
    delay and linear factor the best at each place and all others as they are; the lowest first. At
    that end itself only a better delay is a minimum.
    """
    free, u = problem.parameters.free[k], local.ended
    count = int(np.ceil(free.span / np.log(FACTOR))) if free.is_log else LEAST_PLACES
    places = np.linspace(0, 1, int(np.clip(count, LEAST_PLACES, MOST_PLACES)))
    places = np.sort(np.append(places, u[k]))
    found = [_placed(problem, _with(u, k, at)) for at in places]
    costs = np.array([np.inf, *(cost for cost, _ in found), np.inf])
    lowest = np.flatnonzero((costs[1:-1] <= costs[:-2]) & (costs[1:-1] < costs[2:]))
    new = [n for n in lowest if places[n] != u[k] or found[n][0] < local.cost]
    return [found[n][1] for n in sorted(new, key=lambda n: found[n][0])]


def refine(
    problem: Problem, u: Floats, most: int = MOST_EVALUATIONS, tolerance: float = TOLERANCE
) -> Start:
    """Local solution from a point (k,) of the unit cube, by at most so many steps, until the
    relative change of chi squared is below the tolerance.
    """
    found = least_squares(
        problem.residual, np.clip(u, 1e-6, 1 - 1e-6), problem.forward, bounds=(0, 1),
        x_scale="jac", xtol=1e-8, ftol=tolerance, gtol=1e-8, max_nfev=most,
    )  # fmt: skip
    return Start(begun=u, ended=found.x, cost=2 * float(found.cost), converged=found.status > 0)


def best_placed(problem: Problem, candidates: Floats) -> Floats:
    """The best of candidates (c, k), each with the parameters placed that cost no run."""
    return min((_placed(problem, u) for u in candidates), key=lambda trial: trial[0])[1]


def _placed(problem: Problem, u: Floats) -> tuple[float, Floats]:
    """Chi squared and the point with the best delay and linear factor, all others as they are."""
    keys = problem.parameters.keys
    trials = [u]
    if DELAY in keys:
        at = keys.index(DELAY)
        trials = [_with(u, at, x) for x in _delays(problem, at)]
    linear = next((keys.index(key) for key in problem.linear if key in keys), None)
    return min((_in_proportion(problem, u, linear) for u in trials), key=lambda pair: pair[0])


def _delays(problem: Problem, at: int) -> list[float]:
    """Places of delays that resolve the periods of the data."""
    delay, data = problem.parameters.free[at], problem.data
    highest = 0.1 / np.diff(data.axis).min() if data.is_in_time else data.axis.max()
    count = int(np.ceil(DELAYS * highest * (delay.high - delay.low) / 1e3)) + 2
    return [delay.place(x) for x in np.linspace(delay.low, delay.high, min(count, MOST_DELAYS))]


def _in_proportion(problem: Problem, u: Floats, at: int | None) -> tuple[float, Floats]:
    """Chi squared and the point with the linear parameter, if any is free, of least squares."""
    data = problem.data
    predicted, values = data.weighted(problem.predicted(u)), data.weighted(data.values)
    factor = 1.0
    if at is not None:
        linear = problem.parameters.free[at]
        now = linear.value(float(u[at]))
        best = float((predicted * values).sum() / max((predicted**2).sum(), 1e-300))
        place = linear.place(best * now)
        factor = linear.value(place) / now if now else 1.0
        u = _with(u, at, place)
    return float(((factor * predicted - values) ** 2).sum()), u


def _with(u: Floats, k: int, value: float) -> Floats:
    """A point (k,) with another coordinate."""
    moved = u.copy()
    moved[k] = value
    return moved
