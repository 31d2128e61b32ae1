"""Stiffness that relaxes: springs that each stand in series with a dashpot (Maxwell's branches).

    f = K_j d,  d' = u' - d / tau,  at time exp(s t):  f = s tau / (1 + s tau) K_j u

One branch beside the lasting K is the standard linear solid, or Zener's: C. Zener, Elasticity and
Anelasticity of Metals (1948); Simo and Hughes, Computational Inelasticity (1998), chapter 10.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse

from meshes.tetmesh import Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class Branch:
    """`K` (n, n), N/m: stiffness of the springs, sparse or dense; `time` in s: of relaxation."""

    K: Any
    time: float

    def share(self, s: Any) -> Any:
        """What of K is felt at the complex frequency s in rad/s, of any shape: 0 slow, 1 fast."""
        return s * self.time / (1 + s * self.time)


def relaxing_stiffness(branches: Sequence[Branch], s: Any) -> Any:
    """What branches add to K at the complex frequency s in rad/s; 0 if there are none."""
    return sum(branch.share(s) * branch.K for branch in branches)


def pull(branches: Sequence[Branch], stretch: Floats) -> Any:
    """Forces (n,) in N of springs that are stretched by (j, n) metre; 0 if there are none."""
    return sum(branch.K @ d for branch, d in zip(branches, stretch, strict=True))


def factors(branch: Branch) -> tuple[Floats, float]:
    """L (n, k) with K = L L^T, as many columns as K has rank, and the time in s.

    With z = L^T (u - d) the branch is z' = (L^T u - z) / tau and pulls by L (L^T u - z): where a
    spring is missing there is nothing to follow.
    """
    squares, vectors = np.linalg.eigh(branch.K)
    kept = squares > 1e-12 * squares.max()
    return vectors[:, kept] * np.sqrt(squares[kept]), branch.time


def on_free(branches: Sequence[Branch], free: Any) -> tuple[Branch, ...]:
    """The same on some of the degrees of freedom only."""
    return tuple(
        Branch(K=sparse.csr_array(branch.K)[free][:, free], time=branch.time) for branch in branches
    )
