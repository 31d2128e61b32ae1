"""Samples of the posterior of a fit, uniform between the limits, by emcee's walkers.

An affine-invariant ensemble (Foreman-Mackey et al., Publ Astron Soc Pac 125:306 (2013)); of the
likelihood of independent normal errors with the scale that the fit found, of errors that are not
independent flattened by the largest factor of the variances.
"""

from dataclasses import dataclass

import numpy as np

from meshes.tetmesh import Floats
from skinwave.measure.identify import LEVEL, covariance, widenings
from skinwave.measure.solve import Solution
from skinwave.system.effort import Progress

WALKERS = 4  # a parameter
BURNED = 0.3  # of the steps, which are left out
WIDEST = 0.2  # of the unit interval, spread of the walkers at their start
LONG = 50  # autocorrelation times that a chain is to have


@dataclass(frozen=True, kw_only=True, eq=False)
class Posterior:
    """Samples (n, k) in the unit of each key, 95 % intervals (k, 2), and how many `steps` each
    walker made over the autocorrelation time.
    """

    samples: Floats
    intervals: Floats
    lengths: float

    @property
    def is_long(self) -> bool:
        """Whether the chains are long enough to be relied on."""
        return self.lengths >= LONG


def posterior(solution: Solution, steps: int, seed: int, progress: Progress) -> Posterior:
    """Samples of the posterior about a solution.

    Parameters
    ----------
    solution : Solution
    steps : of each walker
    seed : of the walkers
    progress : called with the name of the phase and the fraction done

    Returns
    -------
    Posterior

    Raises
    ------
    ValueError
        If emcee is not installed, or there are too few steps.
    """
    try:
        import emcee
    except ImportError:
        raise ValueError('samples need emcee; pip install "skinwave[measure]"') from None
    if steps < 10:
        raise ValueError(f"{steps} steps of each walker are too few; give at least 10")
    problem, k = solution.problem, len(solution.u)
    scale = solution.scale * float(widenings(solution).max()) ** 2

    def log_posterior(u: Floats) -> float:
        if not ((u >= 0) & (u <= 1)).all():
            return -np.inf
        return -0.5 * float((problem.residual(u) ** 2).sum()) / scale

    sampler = emcee.EnsembleSampler(WALKERS * k + 2, k, log_posterior)
    rng = np.random.RandomState(seed)  # the generator that emcee takes
    state = emcee.State(_spread(solution, WALKERS * k + 2, rng), random_state=rng.get_state())
    for n, _ in enumerate(sampler.sample(state, iterations=steps)):
        progress("samples of the posterior", n / steps)
    chain = sampler.get_chain(discard=int(BURNED * steps), flat=True)
    values = np.array([[p.value(x) for p, x in zip(problem.parameters.free, u, strict=True)]
                       for u in chain])  # fmt: skip
    tail = 100 * (1 - LEVEL) / 2
    time = float(np.max(sampler.get_autocorr_time(quiet=True, tol=0)))
    return Posterior(
        samples=values, intervals=np.percentile(values, [tail, 100 - tail], axis=0).T,
        lengths=steps / time if np.isfinite(time) else 0.0,
    )  # fmt: skip


def _spread(solution: Solution, count: int, rng: np.random.RandomState) -> Floats:
    """Points (count, k) about the solution, as the covariance spreads them, within the limits."""
    values, v = np.linalg.eigh(covariance(solution))
    spread = np.minimum(np.sqrt(np.maximum(values, 1e-20)), WIDEST)
    points = solution.u + (rng.standard_normal((count, len(values))) * spread) @ v.T
    return np.asarray(np.abs(1 - np.abs(1 - np.mod(points, 2.0))))
