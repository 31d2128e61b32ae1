"""Search from several starts: variable projection, a local search, scans that leave its minimum.

At each of some points the parameters that cost no run of the model are placed first: the delay by a
scan of its range, the gain or the peak pressure as linear least squares at each delay (variable
projection; Golub and Pereyra, SIAM J Numer Anal 10:413 (1973)). From the best one a trust-region
method takes over. It may end in another minimum: of a softer body, whose waves are a period later
at the places. Each other parameter is therefore scanned through its range, delay and gain projected
out, and from the minima of that scan the search goes on, until none leads lower. Starts that end in
one minimum share its scans.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from meshes.tetmesh import Floats
from skinwave.measure.parameters import DELAY
from skinwave.measure.problem import Problem
from skinwave.system.effort import Progress

MOST_EVALUATIONS = 40  # steps of one local search
TOLERANCE = 1e-5  # of chi squared, where a search ends
CANDIDATES = 4  # points of the hypercube, of which the best one is a start
DELAYS = 4  # of a scan, to a period of the highest frequency
MOST_DELAYS = 400
FACTOR = 1.25  # from a place of a scan to the next, of parameters by their logarithm
LEAST_PLACES, MOST_PLACES = 12, 40
FEW = 8  # steps from a minimum of a scan, after which it leads lower, or does not
MOST_HOPS = 5  # from one minimum to a lower one
SAME_PLACE = 1e-3  # of the unit interval: minima as near are one
LOWER = 1e-4  # of chi squared: what is less may be a search that has not quite ended


@dataclass(frozen=True, kw_only=True, eq=False)
class Start:
    """Start of a search: where it `begun` and `ended` (k,), chi squared there, and whether it
    converged.
    """

    begun: Floats
    ended: Floats
    cost: float
    converged: bool


def search(problem: Problem, starts: Sequence[Floats], progress: Progress) -> list[Start]:
    """Solutions of several starts, in their order.

    Parameters
    ----------
    problem : Problem
    starts : candidates (c, k) of each, points of the unit cube
    progress : called with the name of the phase and the fraction done

    Returns
    -------
    list of Start
    """
    found: list[Start] = []
    lowest: list[tuple[Start, Start]] = []  # of each minimum the one that scans lead to
    for n, candidates in enumerate(starts):
        progress("search from several starts", n / len(starts))
        local = refine(problem, best_placed(problem, candidates))
        after = next((end for start, end in lowest if _is_same(start, local)), None)
        if after is None:
            after = descended(problem, local)
            lowest.append((local, after))
        found.append(replace(after, begun=local.begun))
    return found


def _is_same(one: Start, other: Start) -> bool:
    return bool(np.abs(one.ended - other.ended).max() <= SAME_PLACE)


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
    free_of_cost = (DELAY, *problem.linear)
    for k, key in enumerate(problem.parameters.keys):
        if key in free_of_cost:
            continue
        for u in minima(problem, found, k):
            tried = refine(problem, u, FEW)
            if tried.cost < (1 - LOWER) * found.cost:
                return tried if tried.converged else refine(problem, tried.ended)
    return None


def minima(problem: Problem, local: Start, k: int) -> list[Floats]:
    """Points at the minima of chi squared along a parameter, delay and linear factor the best at
    each place and all others as they are; the lowest first.

    Parameters
    ----------
    problem : Problem
    local : Start, through whose end the scan goes; of it only a better delay is a minimum
    k : int, which parameter

    Returns
    -------
    list of (k,) float
    """
    free, u = problem.parameters.free[k], local.ended
    count = int(np.ceil(free.span / np.log(FACTOR))) if free.is_log else LEAST_PLACES
    places = np.linspace(0, 1, int(np.clip(count, LEAST_PLACES, MOST_PLACES)))
    places = np.sort(np.append(places, u[k]))
    found = [placed(problem, np.where(np.arange(len(u)) == k, at, u)) for at in places]
    costs = np.array([np.inf, *(cost for cost, _ in found), np.inf])
    lowest = np.flatnonzero((costs[1:-1] <= costs[:-2]) & (costs[1:-1] < costs[2:]))
    new = [n for n in lowest if places[n] != u[k] or found[n][0] < local.cost]
    return [found[n][1] for n in sorted(new, key=lambda n: found[n][0])]


def refine(
    problem: Problem, u: Floats, most: int = MOST_EVALUATIONS, tolerance: float = TOLERANCE
) -> Start:
    """Local solution from a point of the unit cube.

    Parameters
    ----------
    problem : Problem
    u : (k,) float
    most : steps
    tolerance : relative change of chi squared, below which they end

    Returns
    -------
    Start
    """
    inside = np.clip(u, 1e-6, 1 - 1e-6)
    found = least_squares(
        problem.residual, inside, problem.forward, bounds=(0, 1), x_scale="jac", xtol=1e-8,
        ftol=tolerance, gtol=1e-8, max_nfev=most,
    )  # fmt: skip
    return Start(begun=u, ended=found.x, cost=2 * float(found.cost), converged=found.status > 0)


def best_placed(problem: Problem, candidates: Floats) -> Floats:
    """The best of candidates (c, k), of each the parameters that cost no run placed."""
    return min((placed(problem, u) for u in candidates), key=lambda trial: trial[0])[1]


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
    predicted, values = data.weighted(problem.predicted(u)), data.weighted(data.values)
    factor = 1.0
    if at is not None:
        linear = problem.parameters.free[at]
        now = linear.value(float(u[at]))
        best = float((predicted * values).sum() / max((predicted**2).sum(), 1e-300))
        place = linear.place(best * now)
        factor = linear.value(place) / now if now else 1.0
        u = np.where(np.arange(len(u)) == at, place, u)
    return float(((factor * predicted - values) ** 2).sum()), u
