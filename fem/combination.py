"""Damping and relaxing stiffness as multiples of K, of which no product has to be formed.

The damping matrix of one material is a multiple of K but for what absorbs at the surface, and so
are its Maxwell branches but for the springs that it rests on.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse

from fem.maxwell import Branch, MaxwellBranch
from fem.typing import Floats
from simple_model.layers.material import Material


@dataclass(frozen=True, kw_only=True, eq=False)
class Combination:
    """Matrix `stiffness` K + `rest`, the last sparse or None for nothing."""

    stiffness: float = 0.0
    rest: Any = None

    def of(self, K: Any) -> Any:
        """The matrix itself, of the kind of K."""
        if self.rest is None:
            return _multiple(self.stiffness, K)
        return self.rest + _multiple(self.stiffness, K) if self.stiffness else self.rest


@dataclass(frozen=True, kw_only=True, eq=False)
class Laws:
    """C and the stiffness of each Maxwell branch as combinations of K; and the `matrices` K, C and
    K_j that they are combinations of.
    """

    damping: Combination
    branches: tuple[Combination, ...]
    matrices: tuple[Any, ...]

    @property
    def parts(self) -> tuple[Combination, ...]:
        """That of C, and those of the branches."""
        return self.damping, *self.branches

    def dynamic_stiffness(self, factors: Sequence[float], K: Any, M: Any) -> Any:
        """Dynamic stiffness A = K + s C + s^2 M + sum_j h_j K_j of factors s in rad/s and h_j."""
        each = zip(factors, self.parts, strict=True)
        rests = [factor * part.rest for factor, part in each if factor and part.rest is not None]
        rests = [_multiple(factors[0] ** 2, M), *rests] if factors[0] else rests
        rest = sum(rests[1:], start=rests[0]) if rests else None
        return Combination(stiffness=self.multiple(factors), rest=rest).of(K)

    def multiple(self, factors: Sequence[Any]) -> Any:
        """Multiple of K in the dynamic stiffness of real or complex factors."""
        return 1 + sum(f * part.stiffness for f, part in zip(factors, self.parts, strict=True))

    def without_stiffness(
        self, factors: Sequence[float], acted_on: Sequence[Floats], z: Floats
    ) -> tuple[Floats, Floats, list[Floats]]:
        """Forces C y + sum_j K_j s_j + M z as A x + M m + sum_j rest_j r_j, which takes no product
        with K: x, m and the r_j, by the factors of `dynamic_stiffness`, y and each s_j, and z, of
        one shape.
        """
        each = zip(self.parts, acted_on, strict=True)
        x = sum((part.stiffness * v for part, v in each), np.zeros_like(z))
        x = x / self.multiple(factors)
        rests = [v - factor * x for factor, v in zip(factors, acted_on, strict=True)]
        return x, z - factors[0] ** 2 * x, rests


def _multiple(factor: float, A: Any) -> Any:
    """Multiple of a matrix; a sparse one shares its pattern, a third of its memory."""
    if factor == 1:
        return A
    if isinstance(A, sparse.csr_array):
        A.sort_indices()  # once for both: sorting the multiple would sort them, and not A's data
        return sparse.csr_array((factor * A.data, A.indices, A.indptr), shape=A.shape)
    return factor * A


def factors_at(branches: Sequence[Branch], s: float) -> tuple[float, ...]:
    """Factors of C and of each branch in the dynamic stiffness at a real s in rad/s."""
    return s, *(float(np.real(branch.share(s))) for branch in branches)


def laws_of(K: Any, C: Any, branches: Sequence[Branch], known: Laws | None) -> Laws:
    """Combinations of K that are known, unless a matrix has been replaced since; else C and the
    stiffness of branches as they are.
    """
    matrices = K, C, *(branch.K for branch in branches)
    if known and [*map(id, known.matrices)] == [*map(id, matrices)]:
        return known
    return Laws(
        damping=Combination(rest=C), matrices=matrices,
        branches=tuple(Combination(rest=branch.K) for branch in branches),
    )  # fmt: skip


def proportional(
    m: Material, K: Any, springs: Any, absorbing: Any
) -> tuple[Any, tuple[Branch, ...], Laws | None]:
    """C, branches and laws of a body of one material, without a modulus law of its own or a loss
    factor, by its K (n, n), what K has beside the material's stiffness, `springs`, and what C has
    beside its damping, `absorbing`.
    """
    shares: dict[float, float] = {}
    for term in m.prony:
        shares[term.time] = shares.get(term.time, 0.0) + term.modulus / m.shear_modulus

    def multiple(share: float, rest: Any = None) -> Combination:
        if springs.nnz and share:
            rest = -share * springs if rest is None else rest - share * springs
        return Combination(stiffness=share, rest=rest)

    lag = m.viscosity / m.shear_modulus
    damping = multiple(lag, absorbing if absorbing.nnz else None)
    relaxing = {time: multiple(share) for time, share in sorted(shares.items()) if share}
    C = damping.of(K)
    branches = tuple(MaxwellBranch(K=part.of(K), time=t) for t, part in relaxing.items())
    matrices = K, C, *(branch.K for branch in branches)
    return C, branches, Laws(
        damping=damping, branches=tuple(relaxing.values()), matrices=matrices
    )  # fmt: skip
