"""Sensitivity of scalar outputs to uncertain numbers: Sobol' indices, and one number at a time.

Of an output Y of independent numbers X_k, the first-order index S_k = Var(E(Y | X_k)) / Var(Y) is
the share of its variance that goes if X_k becomes known, and the total index T_k that which is left
if all others do (Saltelli et al., Comput Phys Commun 181:259 (2010), eq. 1 and 4). n (d + 2)
evaluations estimate them, with standard errors of about 1 / sqrt(n).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from meshes.tetmesh import Floats
from skinwave.scene.saltelli import saltelli_shares
from skinwave.scene.spreads import Spread
from skinwave.sweeps.sampling import one_at_a_time, quantiles

Outputs = Mapping[str, Floats]  # samples (n,) by name
Evaluate = Callable[[Floats], Outputs]  # of numbers (n, d)
ENDS = (0.05, 0.95)  # quantiles that a number is moved to
RESAMPLES = 200  # of the standard errors, by bootstrap
TAIL = 1.96  # standard errors of a 95 % interval


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


@dataclass(frozen=True, kw_only=True, eq=False)
class Tornado:
    """One output with all numbers at their central values, `centre`, and with one of them at each
    of its `ENDS`, `low` and `high` (d,).
    """

    centre: float
    low: Floats
    high: Floats

    @property
    def order(self) -> list[int]:
        """Numbers by the width of their bars, the widest first."""
        return [int(k) for k in np.argsort(-np.abs(self.high - self.low), kind="stable")]


def saltelli(spreads: Sequence[Spread], n: int, seed: int = 0) -> Floats:
    """Samples (n (d + 2), d) for Sobol' indices; raises a ValueError if n is no power of two."""
    return quantiles(spreads, saltelli_shares(len(spreads), n, seed))


def sobol_indices(values: Floats, d: int, seed: int = 0) -> SobolIndices:
    """Sobol' indices of one output at the samples of `saltelli`, with their intervals by bootstrap.

    Parameters
    ----------
    values : (n (d + 2),) float
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


def indices_of(
    evaluate: Evaluate, spreads: Sequence[Spread], n: int, seed: int = 0
) -> dict[str, SobolIndices]:
    """Sobol' indices of each output of a function.

    Parameters
    ----------
    evaluate : numbers (m, d) -> outputs (m,) by name
    spreads : (d,) Spread
    n : a power of two, samples of each of d + 2 matrices
    seed : of the samples

    Returns
    -------
    SobolIndices by name of the output

    Raises
    ------
    ValueError
        As `saltelli` does.
    """
    found = evaluate(saltelli(spreads, n, seed))
    return {name: sobol_indices(y, len(spreads), seed) for name, y in found.items()}


def tornado(evaluate: Evaluate, spreads: Sequence[Spread]) -> dict[str, Tornado]:
    """Outputs of a function with one number at a time at its quantiles `ENDS`.

    Parameters
    ----------
    evaluate : numbers (m, d) -> outputs (m,) by name
    spreads : (d,) Spread

    Returns
    -------
    Tornado by name of the output
    """
    found = evaluate(one_at_a_time(spreads, ENDS))
    return {
        name: Tornado(centre=float(y[0]), low=y[1::2], high=y[2::2]) for name, y in found.items()
    }
