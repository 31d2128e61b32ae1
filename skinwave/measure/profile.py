"""Profile likelihood: the least chi squared at each value of a parameter, over all the others.

Its 95 % interval is where it exceeds the least by the square of Student's t (Venzon and Moolgavkar,
Appl Stat 37:87 (1988)); unlike that by the covariance it need not be symmetric. Where residuals are
not white that level is as much higher as the variance of a sandwich covariance is (Kent, Biometrika
69:19 (1982)). The other parameters follow by Gauss-Newton steps with the slopes at the solution, a
run of the model each.
"""

from dataclasses import dataclass

import numpy as np

from meshes.tetmesh import Floats
from skinwave.measure.identify import half_widths, widenings, width
from skinwave.measure.solve import CLOSE, Solution
from skinwave.system.effort import Progress

STEPS = 3  # of the other parameters at each value
ATTEMPTS = 4  # at the end of an interval
ACCURATE = 0.03  # of the excess there, as a root


@dataclass(frozen=True, kw_only=True, eq=False)
class Profile:
    """Profile of a parameter.

    Parameters
    ----------
    key : str
    values, excess : (n,) float, values of the parameter, ascending, and twice the log of the
        likelihood ratio there
    level : float, the excess at the ends of its 95 % interval
    low, high : these ends, a limit of the range where one is not reached
    is_open : bool, whether one of these is such a limit
    """

    key: str
    values: Floats
    excess: Floats
    level: float
    low: float
    high: float
    is_open: bool


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
        found.append((at, excess(solution, k, at)))
        root = np.sqrt(max(found[-1][1], 1e-12))
        if abs(root - wanted) <= ACCURATE * wanted or (at in (0.0, 1.0) and root < wanted):
            break
        at = least + (at - least) * float(np.clip(wanted / root, 0.3, 3.0))
    return found


def excess(solution: Solution, k: int, at: float) -> float:
    """Chi squared over its scale above the least, one parameter fixed and all others fitted.

    Parameters
    ----------
    solution : Solution
    k : int, which parameter
    at : float, its place in the unit interval

    Returns
    -------
    float
    """
    problem, others = solution.problem, np.arange(len(solution.u)) != k
    slopes = solution.slopes[:, others]
    steps = resolved_steps(solution, slopes)
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


def resolved_steps(solution: Solution, slopes: Floats) -> Floats:
    """Pseudo-inverse (k, n) of slopes (n, k), along the directions that the data resolve."""
    if not slopes.shape[1]:
        return slopes.T
    left, singular, right = np.linalg.svd(slopes, full_matrices=False)
    kept = singular >= 2 * width(solution) * np.sqrt(solution.scale)
    return np.asarray((right[kept].T / singular[kept]) @ left[:, kept].T)
