"""Design of Sobol' indices: matrices A, B and, for each number, A with its column of B.

Saltelli et al., Comput Phys Commun 181:259 (2010), section 3.
"""

import numpy as np

from meshes.tetmesh import Floats

EDGE = 1e-9  # of the unit interval, which keeps quantiles finite


def saltelli_shares(d: int, n: int, seed: int = 0) -> Floats:
    """Quantiles' shares (n (d + 2), d), above 0 and below 1, from a Sobol' sequence of 2 d numbers.

    Parameters
    ----------
    d : how many numbers
    n : rows of each matrix, a power of two
    seed : of the scrambling (Owen, J Complex 14:466 (1998))

    Returns
    -------
    A, B, then A with column k of B for each k, one above the other

    Raises
    ------
    ValueError
        If n is no power of two, which balances the sequence.
    """
    from scipy.stats import qmc

    if n < 2 or n & (n - 1):
        near = 2 ** max(1, round(np.log2(max(n, 2))))
        raise ValueError(f"{n} samples of each matrix are no power of two; take {near}")
    a, b = np.split(qmc.Sobol(2 * d, rng=seed).random(n), 2, axis=1)
    mixed = np.tile(a, (d, 1, 1))
    for k in range(d):
        mixed[k, :, k] = b[:, k]
    return np.clip(np.vstack([a, b, *mixed]), EDGE, 1 - EDGE)
