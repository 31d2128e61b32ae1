"""Samples of uncertain numbers, and the sensitivity of outputs to them.

Of an output Y of independent numbers X_k, the first-order Sobol' index, Var(E(Y | X_k)) / Var(Y),
is the share of its variance that goes if X_k becomes known, and the total index that which is left
if all others do (Saltelli et al., Comput Phys Commun 181:259 (2010), eq. 1 and 4). n (d + 2)
evaluations estimate them, with standard errors of about 1 / sqrt(n).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from meshes.tetmesh import Floats
from skinwave.scene.spreads import Spread

EDGE = 1e-9  # of the unit interval, which keeps quantiles finite
MOST = 100_000  # samples
ENDS = (0.05, 0.95)  # quantiles that a number is moved to
FIFTH = 0.2  # of the runs, at each end of a number
RESAMPLES = 200  # of the standard errors, by bootstrap
TAIL = 1.96  # standard errors of a 95 % interval
PERCENTILES = (5, 25, 50, 75, 95)


def percentiles(values: Floats) -> Floats:
    """Percentiles `PERCENTILES` (5, ...) of samples (n, ...), by linear interpolation."""
    return np.asarray(np.percentile(values, PERCENTILES, axis=0))


def samples(spreads: Sequence[Spread], n: int, seed: int = 0) -> Floats:
    """Latin hypercube of independent numbers (McKay et al., Technometrics 21:239 (1979)).

    Parameters
    ----------
    spreads : (d,) Spread
    n : how many
    seed : the same samples for the same seed

    Returns
    -------
    (n, d) float, each in the unit of its key

    Raises
    ------
    ValueError
        If nothing is uncertain, or there are too few or too many samples.
    """
    from scipy.stats import qmc

    check(spreads, n, seed)
    return quantiles(spreads, qmc.LatinHypercube(len(spreads), rng=seed).random(n))


def check(spreads: Sequence[Spread], n: int, seed: int) -> None:
    """Refuse, before any work, what cannot be sampled; raises a ValueError."""
    if not spreads:
        raise ValueError(
            "nothing in this scene is uncertain; give a number a spread, such as "
            "thickness_mm = { value = 15, spread = 0.2 }"
        )
    if not 2 <= n <= MOST:
        raise ValueError(f"{n:,} samples are outside 2..{MOST:,}; give another --samples")
    if seed < 0:
        raise ValueError(f"--seed = {seed} is below 0; give 0 or a whole number above")


def quantiles(spreads: Sequence[Spread], shares: Floats) -> Floats:
    """Quantiles (n, d) of numbers (d,), at shares (n, d) of 0 to 1."""
    clipped = np.clip(shares, EDGE, 1 - EDGE)
    columns = [s.distribution.quantile(s.value, u) for s, u in zip(spreads, clipped.T, strict=True)]
    return np.stack(columns, axis=1)


def one_at_a_time(spreads: Sequence[Spread]) -> Floats:
    """Samples (1 + 2 d, d): all central values, then for each number its quantiles `ENDS` with the
    others at their central values.
    """
    found = np.tile([s.value for s in spreads], (1 + 2 * len(spreads), 1))
    ends = quantiles(spreads, np.tile(np.array(ENDS)[:, None], len(spreads)))
    for k in range(len(spreads)):
        found[1 + 2 * k : 3 + 2 * k, k] = ends[:, k]
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


def tornado(
    evaluate: Callable[[Floats], Mapping[str, Floats]], spreads: Sequence[Spread]
) -> dict[str, Tornado]:
    """Outputs by name of a function of numbers (m, d), with one number at a time at its ends."""
    found = evaluate(one_at_a_time(spreads))
    return {
        name: Tornado(centre=float(y[0]), low=y[1::2], high=y[2::2]) for name, y in found.items()
    }


def tornado_of_fifths(numbers: Floats, output: Floats) -> Tornado:
    """Mean output (n,) over the fifths of runs in which each of the numbers (n, d) is least and
    largest.
    """
    part = max(1, round(FIFTH * len(output)))
    order = np.argsort(numbers, axis=0, kind="stable")
    return Tornado(
        centre=float(output.mean()),
        low=output[order[:part]].mean(axis=0),
        high=output[order[-part:]].mean(axis=0),
    )


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
    """Sobol' indices of one output, with their intervals by bootstrap.

    Parameters
    ----------
    values : (n (d + 2),) float, at the samples of `saltelli_shares`
    d : how many numbers
    seed : of the bootstrap

    Returns
    -------
    SobolIndices; all 0 of an output that does not vary

    Raises
    ------
    ValueError
        If there are not so many values, or one is not finite.
    """
    from scipy import stats

    n, rest = divmod(len(values), d + 2)
    if rest or not np.isfinite(values).all():
        raise ValueError(
            f"{len(values)} values are not those of {d} + 2 matrices, all finite; take a design of "
            "its own, and an output that has a value in each run"
        )
    a, b, *mixed = np.split(values, d + 2)
    if np.ptp(values) <= 1e-12 * np.abs(values).max(initial=0.0):
        none = np.zeros(d)
        return SobolIndices(first=none, total=none, first_error=none, total_error=none, n=n)
    mean = np.concatenate([a, b]).mean()  # the estimators lose digits to a large mean
    parts = {"f_A": a - mean, "f_B": b - mean, "f_AB": np.stack(mixed)[:, None] - mean}
    found = stats.sobol_indices(func={k: np.atleast_2d(v) for k, v in parts.items()}, n=n, rng=seed)
    errors = _bootstrap(parts, seed)
    return SobolIndices(
        first=np.atleast_1d(found.first_order), total=np.atleast_1d(found.total_order),
        first_error=TAIL * errors[0], total_error=TAIL * errors[1], n=n,
    )  # fmt: skip


def _bootstrap(parts: Mapping[str, Floats], seed: int) -> Floats:
    """Standard errors (2, d) of both indices, of samples drawn again; estimators of Saltelli et al.
    (2010), table 2 b and f.
    """
    a, b, mixed = parts["f_A"], parts["f_B"], parts["f_AB"][:, 0]
    drawn = np.random.default_rng(seed).integers(len(a), size=(RESAMPLES, len(a)))
    variance = np.concatenate([a[drawn], b[drawn]], axis=1).var(axis=1)
    first = (b[drawn] * (mixed[:, drawn] - a[drawn])).mean(axis=2) / variance
    total = ((a[drawn] - mixed[:, drawn]) ** 2).mean(axis=2) / (2 * variance)
    return np.stack([first.std(axis=1, ddof=1), total.std(axis=1, ddof=1)])
