"""Samples of uncertain numbers, and the sensitivity of outputs to them.

For an output Y of independent numbers X_k, the first-order Sobol' index Var(E(Y | X_k)) / Var(Y) is
the share of the variance that vanishes if X_k becomes known. The total index is the share that
remains if all other numbers become known (Saltelli et al., Comput Phys Commun 181:259 (2010), eq. 1
and 4). n (d + 2) evaluations estimate them, with standard errors of about 1 / sqrt(n).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from skinwave.scene.distributions import Spread
from skinwave.scene.variation import MOST_RUNS, combinations
from skinwave.typing import Floats, Ints

ENDS = (0.05, 0.95)  # quantiles of a number that is varied alone
PERCENTILES = (5, 25, 50, 75, 95)


def percentiles(values: Floats) -> Floats:
    """Return the `PERCENTILES` (5, ...) of samples (n, ...), by linear interpolation."""
    return np.asarray(np.percentile(values, PERCENTILES, axis=0))


def samples(spreads: Sequence[Spread], n: int, seed: int = 0) -> Floats:
    """Return a Latin hypercube (n, d) of d independent numbers, each in the unit of its key."""
    check(spreads, n, seed)
    return np.array([list(each.values()) for each in combinations(spreads, "lhs", n, seed)])


def check(spreads: Sequence[Spread], n: int, seed: int) -> None:
    """Raise a ValueError if the numbers cannot be sampled."""
    if not spreads:
        raise ValueError(
            "no number of this scene is uncertain; give one a spread, such as "
            "thickness_mm = { value = 15, spread = 0.2 }"
        )
    if not 2 <= n <= MOST_RUNS:
        raise ValueError(f"--samples is {n:,}; give a number from 2 to {MOST_RUNS:,}")
    check_seed(seed)


def check_seed(seed: int) -> None:
    """Raise a ValueError if the seed of random samples is negative."""
    if seed < 0:
        raise ValueError(f"--seed is {seed}; give 0 or a positive whole number")


def one_at_a_time(spreads: Sequence[Spread]) -> Floats:
    """Return samples (1 + 2 d, d): central values, then each number at its quantiles `ENDS`."""
    values = np.tile([s.value for s in spreads], (1 + 2 * len(spreads), 1))
    for k, spread in enumerate(spreads):
        values[1 + 2 * k : 3 + 2 * k, k] = spread.at(ENDS)
    return values


@dataclass(frozen=True, kw_only=True, eq=False)
class SobolIndices:
    """Sobol' indices (d,) of one output from n samples of each matrix: `first` order and `total`,
    and half widths of their 95 % intervals, `first_error` and `total_error`.
    """

    first: Floats
    total: Floats
    first_error: Floats
    total_error: Floats
    n: int


def sobol_indices(values: Floats, d: int, seed: int = 0, resamples: int = 200) -> SobolIndices:
    """Estimate the Sobol' indices of one output from its values (n (d + 2),) at the samples of
    `saltelli_shares` of d numbers.

    Intervals are by bootstrap. All indices are 0 if the output is constant. Raises a ValueError if
    the number of values is wrong, or one is not finite.
    """
    n, rest = divmod(len(values), d + 2)
    if rest or not np.isfinite(values).all():
        raise ValueError(
            f"{len(values)} values do not fill {d} + 2 matrices of finite numbers; use the design "
            "sobol, and an output with a value in each run"
        )
    matrices = values.reshape(d + 2, n)
    matrices = matrices - matrices[:2].mean()  # a large mean costs digits
    matrices[np.abs(matrices) <= 1e-12 * np.abs(values).max(initial=0.0)] = 0.0  # round-off
    first, total = _estimates(matrices, np.arange(n)[None])[..., 0]
    picks = np.random.default_rng(seed).integers(n, size=(resamples, n))
    errors = 1.96 * _estimates(matrices, picks).std(axis=2, ddof=1)  # of 95 % intervals
    return SobolIndices(first=first, total=total, first_error=errors[0], total_error=errors[1], n=n)


def _estimates(matrices: Floats, picks: Ints) -> Floats:
    """Return both indices (2, d, r) for picks of rows (r, n) of matrices (d + 2, n): A, B, and A
    with columns of B; 0 where A and B do not vary. Saltelli et al. (2010), table 2 b and f.
    """
    a, b, *mixed = matrices[:, picks]
    variance = np.concatenate([a, b], axis=1).var(axis=1)
    scale = np.divide(1, variance, out=np.zeros_like(variance), where=variance > 0)
    first = [(b * (each - a)).mean(axis=1) * scale for each in mixed]
    total = [((a - each) ** 2).mean(axis=1) / 2 * scale for each in mixed]
    return np.array([first, total])
