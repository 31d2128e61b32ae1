"""Generalised Maxwell branches (Prony terms): springs in series with dashpots.

    f = K_j d,  d' = u' - d / tau,  at time exp(s t):  f = s tau / (1 + s tau) K_j u

The internal variable d is the stretch of the spring. One branch in parallel with the equilibrium K
is the standard linear (Zener) solid: C. Zener, Elasticity and Anelasticity of Metals (1948); Simo
and Hughes, Computational Inelasticity (1998), chapter 10.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse

from meshes.tetmesh import Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class MaxwellBranch:
    """Generalised Maxwell branch: stiffness `K` (n, n) of its springs, N/m, sparse or dense, and
    relaxation `time` in s.
    """

    K: Any
    time: float

    def share(self, s: Any) -> Any:
        """Fraction s tau / (1 + s tau) of K at complex frequencies s in rad/s, of any shape: 0 in
        slow, 1 in fast motion.
        """
        return s * self.time / (1 + s * self.time)


def relaxing_stiffness(branches: Sequence[MaxwellBranch], s: Any) -> Any:
    """Complex stiffness that branches add to K at the complex frequency s in rad/s; 0 if there are
    none.
    """
    return sum(branch.share(s) * branch.K for branch in branches)


def branch_force(branches: Sequence[MaxwellBranch], stretch: Floats) -> Any:
    """Forces (n,) in N of branches at internal variables (j, n) in metre; 0 without branches."""
    return sum(branch.K @ d for branch, d in zip(branches, stretch, strict=True))


def factors(branch: MaxwellBranch) -> tuple[Floats, float]:
    """Low-rank factor L (n, k) of a branch, K = L L^T, as many columns as K has rank; and its time
    in s.

    With z = L^T (u - d) the branch is z' = (L^T u - z) / tau with the force L (L^T u - z): it has
    an internal variable only where it has a spring.
    """
    squares, vectors = np.linalg.eigh(branch.K)
    kept = squares > 1e-12 * squares.max()
    return vectors[:, kept] * np.sqrt(squares[kept]), branch.time


def on_free(branches: Sequence[MaxwellBranch], free: Any) -> tuple[MaxwellBranch, ...]:
    """Branches restricted to some of the degrees of freedom."""
    return tuple(
        MaxwellBranch(K=sparse.csr_array(branch.K)[free][:, free], time=branch.time)
        for branch in branches
    )
