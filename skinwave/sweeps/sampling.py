"""Samples of uncertain numbers, and the sensitivity of outputs to them.

Of an output Y of independent numbers X_k, the first-order Sobol' index, Var(E(Y | X_k)) / Var(Y),
is the share of its variance that goes if X_k becomes known, and the total index that which is left
if all others do (Saltelli et al., Comput Phys Commun 181:259 (2010), eq. 1 and 4). n (d + 2)
evaluations estimate them, with standard errors of about 1 / sqrt(n).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from skinwave.scene.distributions import Spread
from skinwave.scene.variation import MOST_RUNS, combinations
from skinwave.typing import Floats, Ints

ENDS = (0.05, 0.95)  # quantiles that a number is moved to
RESAMPLES = 200  # of the standard errors, by bootstrap
TAIL = 1.96  # standard errors of a 95 % interval
PERCENTILES = (5, 25, 50, 75, 95)


def percentiles(values: Floats) -> Floats:
    """Percentiles `PERCENTILES` (5, ...) of samples (n, ...), by linear interpolation."""
    return np.asarray(np.percentile(values, PERCENTILES, axis=0))


def samples(spreads: Sequence[Spread], n: int, seed: int = 0) -> Floats:
    """Latin hypercube (n, d) of independent numbers (d,), each in the unit of its key."""
    check(spreads, n, seed)
    return np.array([list(each.values()) for each in combinations(spreads, "lhs", n, seed)])


def check(spreads: Sequence[Spread], n: int, seed: int) -> None:
    """Refuse, before any work, what cannot be sampled; raises a ValueError."""
    if not spreads:
        raise ValueError(
            "nothing in this scene is uncertain; give a number a spread, such as "
            "thickness_mm = { value = 15, spread = 0.2 }"
        )
    if not 2 <= n <= MOST_RUNS:
        raise ValueError(f"{n:,} samples are outside 2..{MOST_RUNS:,}; give another --samples")
    if seed < 0:
        raise ValueError(f"--seed = {seed} is below 0; give 0 or a whole number above")


def one_at_a_time(spreads: Sequence[Spread]) -> Floats:
    """Samples (1 + 2 d, d): all central values, then for each number its quantiles `ENDS` with the
    others at their central values.
    """
    found = np.tile([s.value for s in spreads], (1 + 2 * len(spreads), 1))
    for k, spread in enumerate(spreads):
        found[1 + 2 * k : 3 + 2 * k, k] = spread.at(ENDS)
    return found


@dataclass(frozen=True, kw_only=True, eq=False)
class Tornado:
    """One output: its `centre`, and its value where each number is `low` and `high` (d,)."""

    centre: float
    low: Floats
    high: Floats

    @property
    def order(self) -> list[int]:
        """Numbers by the width of their bars, the widest first."""
        return [int(k) for k in np.argsort(-np.abs(self.high - self.low), kind="stable")]


def tornado(outputs: Mapping[str, Floats]) -> dict[str, Tornado]:
    """Chart of each output (1 + 2 d,) by name, of the samples of `one_at_a_time`."""
    return {
        name: Tornado(centre=float(y[0]), low=y[1::2], high=y[2::2]) for name, y in outputs.items()
    }


@dataclass(frozen=True, kw_only=True, eq=False)
class SobolIndices:
    """Sobol' indices of one output: of `first` order and `total` (d,), the half width of 95 %
    intervals of both, `first_error` and `total_error` (d,), from samples `n` of each matrix.
    """

    first: Floats
    total: Floats
    first_error: Floats
    total_error: Floats
    n: int


def sobol_indices(values: Floats, d: int, seed: int = 0) -> SobolIndices:
    """Sobol' indices of one output (n (d + 2),) at the samples of `saltelli_shares` of d numbers,
    all 0 if it does not vary, with their intervals by bootstrap.
    """
    n, rest = divmod(len(values), d + 2)
    if rest or not np.isfinite(values).all():
        raise ValueError(
            f"{len(values)} values are not those of {d} + 2 matrices, all finite; take a design of "
            "its own, and an output that has a value in each run"
        )
    if np.ptp(values) <= 1e-12 * np.abs(values).max(initial=0.0):
        none = np.zeros(d)
        return SobolIndices(first=none, total=none, first_error=none, total_error=none, n=n)
    matrices = values.reshape(d + 2, n)
    matrices = matrices - matrices[:2].mean()  # the estimators lose digits to a large mean
    first, total = _estimates(matrices, np.arange(n)[None])[..., 0]
    drawn = np.random.default_rng(seed).integers(n, size=(RESAMPLES, n))
    errors = TAIL * _estimates(matrices, drawn).std(axis=2, ddof=1)
    return SobolIndices(first=first, total=total, first_error=errors[0], total_error=errors[1], n=n)


def _estimates(matrices: Floats, drawn: Ints) -> Floats:
    """Both indices (2, d, r) of rows (r, n) of matrices (d + 2, n): A, B, and A with columns of B.

    Saltelli et al. (2010), table 2 b and f.
    """
    a, b, *mixed = matrices[:, drawn]
    variance = np.concatenate([a, b], axis=1).var(axis=1)
    first = [(b * (each - a)).mean(axis=1) / variance for each in mixed]
    total = [((a - each) ** 2).mean(axis=1) / (2 * variance) for each in mixed]
    return np.array([first, total])
