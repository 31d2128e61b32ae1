"""Weighted least squares within limits, from several starts.

Each searches as `starts` says, on data that cost less if there are any; the best one goes on with
the data themselves. The measurement with its sign turned is searched, too, from one start.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import qmc

from meshes.tetmesh import Floats
from skinwave.measure.alignment import AS_GOOD
from skinwave.measure.observed import Data
from skinwave.measure.parameters import DELAY
from skinwave.measure.problem import Problem
from skinwave.measure.starts import CANDIDATES, Start, best_placed, refine, search
from skinwave.system.effort import Progress

ROUND_OFF = 1e-8  # of chi squared
POLISHED = 6  # steps, which get closer by a digit each
CLOSE = 0.01  # of a standard error: a step that no longer matters
AT_LIMIT = 1e-3  # of the unit interval
CLOSE_FIT = 0.1  # of the power of the data: a fit that leaves less is close
SAME_COST = 1.0  # of twice the log-likelihood: starts as near to the best reached it


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
    turned : of the measurement with its sign turned, if that makes a difference and no linear
        factor may be negative
    converged : bool
    runs : int, of the model: predictions that differ by more than a delay or a linear factor
    """

    problem: Problem
    u: Floats
    residual: Floats
    slopes: Floats
    starts: tuple[Start, ...]
    turned: Start | None
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

    @property
    def may_be_turned(self) -> bool:
        """Whether the measurement with its sign turned fits as well, at a lesser delay or better;
        or a linear factor is negative.
        """
        parameters, best = self.problem.parameters, self.starts[0]
        values, other = (parameters.values(u) for u in (self.u, (self.turned or best).ended))
        if self.turned is None:
            return any(values.get(key, 1.0) < 0 for key in self.problem.linear)
        scale = best.cost / max(self.problem.rough.data.values.size - len(self.u), 1)
        more = self.turned.cost - best.cost
        nearer = abs(other.get(DELAY, 0.0)) < abs(values.get(DELAY, 0.0))
        return more < AS_GOOD * scale and (nearer or more < 0)


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
    problem, seen = _counted(problem)
    rough, hypercube = problem.rough, qmc.LatinHypercube(k, rng=seed)
    points = [hypercube.random(CANDIDATES) for _ in range(starts)]
    found = sorted(search(rough, points, progress), key=lambda start: start.cost)
    turned = _turned(rough, found[0], points[0], progress)
    best = found[0]
    progress("fit to all data", 0.0)
    best = polished(problem, best.ended)
    progress("derivatives", 0.0)
    return Solution(
        problem=problem, u=best.ended,
        residual=problem.residual(best.ended).reshape(problem.data.values.shape),
        slopes=problem.slopes(best.ended), starts=tuple(found), turned=turned,
        converged=best.converged, runs=len(seen),
    )  # fmt: skip


def polished(problem: Problem, u: Floats) -> Start:
    """Local solution from a point next to it: Gauss-Newton steps with the slopes there, a run of
    the model each; by `refine` if they do not get closer.
    """
    slopes = problem.slopes(u)
    inverse = np.linalg.pinv(slopes, rcond=1e-7)
    ended, cost = u, np.inf
    for _ in range(POLISHED):
        residual = problem.residual(ended)
        if not (residual**2).sum() <= cost * (1 + ROUND_OFF):
            break
        cost = float((residual**2).sum())
        move = inverse @ residual
        if np.linalg.norm(slopes @ move) <= CLOSE * np.sqrt(cost / residual.size):
            return Start(begun=u, ended=ended, cost=cost, converged=True)
        ended = np.clip(ended - move, 0, 1)
    return refine(problem, u, tolerance=ROUND_OFF)


def _turned(problem: Problem, best: Start, candidates: Floats, progress: Progress) -> Start | None:
    """Solution for the measurement with its sign turned, if no linear factor may turn it: where the
    best one is close, next to it.
    """
    linear = (each for each in problem.parameters.free if each.key in problem.linear)
    if not problem.data.has_sign or any(each.low < 0 for each in linear):
        return None
    power = float((problem.data.weighted(problem.data.values) ** 2).sum())
    if best.cost <= CLOSE_FIT * power:
        return refine(problem.turned, best_placed(problem.turned, best.ended[None]))
    return search(problem.turned, [candidates], progress)[0]


def _counted(problem: Problem) -> tuple[Problem, set[tuple[tuple[str, float], ...]]]:
    """The problem, and a set that grows with each prediction that is not of one run of the model
    with another delay or linear factor.
    """
    seen: set[tuple[tuple[str, float], ...]] = set()
    free_of_cost = {DELAY, *problem.linear}

    def counting(data: Data) -> Data:
        predict: Callable[..., Floats] = data.predict

        def counted(values: Mapping[str, float]) -> Floats:
            seen.add(tuple((key, x) for key, x in values.items() if key not in free_of_cost))
            return predict(values)

        rough = counting(data.rough) if data.rough else None
        return replace(data, predict=counted, rough=rough)

    return replace(problem, data=counting(problem.data)), seen
