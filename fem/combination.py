"""Damping and relaxing stiffness as combinations of K and M, of which no product has to be formed.

The damping matrix of one material is a multiple of K but for what absorbs at the surface, and so
are its Maxwell branches but for the springs that it rests on.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import sparse

from fem.materials import Material
from fem.maxwell import Branch
from meshes.tetmesh import Floats

ALIKE, ROUND_OFF = 1e-9, 1e-14  # of a product with a vector, and of its terms without their signs


@dataclass(frozen=True, kw_only=True, eq=False)
class Combination:
    """Matrix `stiffness` K + `mass` M + `rest`, the last sparse or None for nothing."""

    stiffness: float = 0.0
    mass: float = 0.0
    rest: Any = None

    def of(self, K: Any, M: Any) -> Any:
        """The matrix itself, of the kind of K and M; K if it is nothing else."""
        nothing = not self.stiffness and self.rest is None
        terms = [_multiple(self.mass, M)] if self.mass or nothing else []
        terms += [] if self.rest is None else [self.rest]
        if self.stiffness:  # the largest last: each sum copies what it adds to
            terms.append(_multiple(self.stiffness, K))
        return sum(terms[1:], start=terms[0])

    def times(self, v: Floats, Kv: Floats, Mv: Floats) -> Floats:
        """The matrix times v (n, k), with its products with K and M."""
        found = self.stiffness * Kv + self.mass * Mv
        return found if self.rest is None else found + self.rest @ v


@dataclass(frozen=True, kw_only=True, eq=False)
class Laws:
    """C and the stiffness of each Maxwell branch as combinations of K and M."""

    damping: Combination
    branches: tuple[Combination, ...]

    @property
    def parts(self) -> tuple[Combination, ...]:
        """That of C, and those of the branches."""
        return self.damping, *self.branches

    def hold(self, K: Any, C: Any, M: Any, branches: Sequence[Branch]) -> bool:
        """Whether these are the combinations, seen by what they make of two vectors, a smooth one
        and one that is not: a body's matrices may have been replaced since.
        """
        matrices = (C, *(branch.K for branch in branches))
        if len(matrices) != len(self.parts):
            return False
        n = K.shape[0]
        v = np.column_stack([np.ones(n), np.random.default_rng(0).standard_normal(n)])
        Kv, Mv = K @ v, M @ v
        for A, part in zip(matrices, self.parts, strict=True):
            Av, size = A @ v, abs(A) @ np.abs(v)
            apart, known, all_of_it = (
                np.linalg.norm(x, axis=0) for x in (Av - part.times(v, Kv, Mv), Av, size)
            )
            if (apart > ALIKE * known + ROUND_OFF * all_of_it).any():
                return False
        return True

    def at(self, factors: Sequence[float]) -> Combination:
        """Dynamic stiffness A = K + s C + s^2 M + sum_j h_j K_j of factors s in rad/s and h_j."""
        each = list(zip(factors, self.parts, strict=True))
        rests = [factor * part.rest for factor, part in each if factor and part.rest is not None]
        stiffness, mass = self.multiples(factors)
        rest = sum(rests[1:], start=rests[0]) if rests else None
        return Combination(stiffness=stiffness, mass=mass, rest=rest)

    def multiples(self, factors: Sequence[Any]) -> tuple[Any, Any]:
        """Multiples of K and of M in the dynamic stiffness of real or complex factors."""
        each = list(zip(factors, self.parts, strict=True))
        stiffness = 1 + sum(factor * part.stiffness for factor, part in each)
        return stiffness, factors[0] ** 2 + sum(factor * part.mass for factor, part in each)

    def without_stiffness(
        self, factors: Sequence[float], acted_on: Sequence[Floats], z: Floats
    ) -> tuple[Floats, Floats, list[Floats]]:
        """Forces C y + sum_j K_j s_j + M z as A x + M m + sum_j rest_j r_j, which takes no product
        with K.

        Parameters
        ----------
        factors : as of `at`
        acted_on : y and each s_j (r, k), vectors or their coordinates
        z : (r, k)

        Returns
        -------
        x, m and the r_j, (r, k) each
        """
        stiffness, mass = self.multiples(factors)
        each = list(zip(self.parts, acted_on, strict=True))
        x = sum((part.stiffness * v for part, v in each), np.zeros_like(z)) / stiffness
        m = sum((part.mass * v for part, v in each), z) - mass * x
        return x, m, [v - factor * x for factor, v in zip(factors, acted_on, strict=True)]


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


def laws_of(K: Any, C: Any, M: Any, branches: Sequence[Branch], known: Laws | None) -> Laws:
    """C and branches as the combinations of K and M that are known, if they are, else as what they
    are.

    Parameters
    ----------
    K, C, M, branches : of `Operators`
    known : Laws that may be theirs, or None

    Returns
    -------
    Laws
    """
    return known if known and known.hold(K, C, M, branches) else unrelated(C, branches)


def unrelated(C: Any, branches: Sequence[Branch]) -> Laws:
    """Laws of matrices that are no combinations."""
    return Laws(
        damping=Combination(rest=C), branches=tuple(Combination(rest=b.K) for b in branches)
    )


def with_added(laws: Laws, added: tuple[Any, Any, Any], further: Sequence[Any]) -> Laws:
    """Laws of a body to which few entries are added, such as those of a coat.

    Parameters
    ----------
    laws : Laws of the body
    added : (K, C, M), sparse, what is added to each
    further : sparse, what is added to each branch; beyond the body's own, new ones

    Returns
    -------
    Laws
    """
    K, C, M = added
    own = (*laws.parts, *(Combination() for _ in further[len(laws.branches) :]))

    def rest(part: Combination, more: Any) -> Any:
        """`rest`, and what of `more` is not that of K and M."""
        apart = more - part.stiffness * K - part.mass * M
        apart.eliminate_zeros()
        if not apart.nnz:
            return part.rest
        return apart if part.rest is None else part.rest + apart

    damping, *branches = (
        replace(part, rest=rest(part, more)) for part, more in zip(own, (C, *further), strict=True)
    )
    return Laws(damping=damping, branches=tuple(branches))


def proportional(m: Material, rests: tuple[Any, Any]) -> tuple[Laws, tuple[float, ...]]:
    """Laws of a body of one material, and the relaxation times of its branches.

    Parameters
    ----------
    m : Material, without a modulus law of its own or a loss factor
    rests : (n, n) each, sparse: what K has beside the stiffness of the material, and C beside its
        damping

    Returns
    -------
    Laws, and times in s
    """
    springs, absorbing = rests
    shares: dict[float, float] = {}
    for term in m.prony:
        shares[term.time] = shares.get(term.time, 0.0) + term.modulus / m.shear_modulus
    times = tuple(sorted(time for time, share in shares.items() if share))
    lag = m.viscosity / m.shear_modulus

    def multiple(share: float, rest: Any = None) -> Combination:
        if springs.nnz and share:
            rest = -share * springs if rest is None else rest - share * springs
        return Combination(stiffness=share, rest=rest)

    laws = Laws(
        damping=multiple(lag, absorbing if absorbing.nnz else None),
        branches=tuple(multiple(shares[time]) for time in times),
    )
    return laws, times
