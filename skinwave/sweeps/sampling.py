"""Samples of the uncertain numbers of a scene."""

from collections.abc import Sequence

import numpy as np

from meshes.tetmesh import Floats
from simple_model.choices import choose
from skinwave.scene.spreads import Spread

METHODS = ("lhs", "sobol")
EDGE = 1e-9  # of the unit interval, which keeps quantiles finite
MOST = 100_000  # samples


def samples(spreads: Sequence[Spread], n: int, seed: int = 0, method: str = "lhs") -> Floats:
    """Samples of independent numbers.

    Parameters
    ----------
    spreads : (d,) Spread
    n : how many; of a Sobol' sequence best a power of two
    seed : the same samples for the same seed
    method : "lhs", a Latin hypercube (McKay, Beckman and Conover, Technometrics 21:239 (1979)), or
        "sobol", a scrambled Sobol' sequence (Owen, J Complex 14:466 (1998))

    Returns
    -------
    (n, d) float, each in the unit of its key

    Raises
    ------
    ValueError
        If nothing is uncertain, or there are too few or too many samples.
    """
    from scipy.stats import qmc

    choose("sampling", method, METHODS)
    check(spreads, n, seed)
    engine = qmc.LatinHypercube if method == "lhs" else qmc.Sobol
    return quantiles(spreads, engine(len(spreads), rng=seed).random(n))


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


def one_at_a_time(spreads: Sequence[Spread], shares: tuple[float, float]) -> Floats:
    """Samples (1 + 2 d, d): all central values, then for each number its quantiles at two shares
    with the others at their central values.
    """
    centre = np.array([s.value for s in spreads])
    found = np.tile(centre, (1 + 2 * len(spreads), 1))
    ends = quantiles(spreads, np.tile(np.array(shares)[:, None], len(spreads)))
    for k in range(len(spreads)):
        found[1 + 2 * k : 3 + 2 * k, k] = ends[:, k]
    return found
