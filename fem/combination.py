"""Damping and relaxing stiffness as multiples of K, whose products need not be formed.

Where all materials share a ratio of viscosity to modulus, the damping matrix is a multiple of K,
plus that of absorbing boundaries. The same holds for Maxwell branches, minus the springs of a
support.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse

from fem.maxwell import Branch, DispersiveBranch, MaxwellBranch, property_of, relaxation_of
from simple_model.layers.material import Material
from simple_model.typing import Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class Combination:
    """Matrix `stiffness` K + `rest`, where a `rest` of None is zero."""

    stiffness: float = 0.0
    rest: Any = None

    def of(self, K: Any) -> Any:
        """Return the matrix, sparse or dense as K."""
        if self.rest is None:
            return _multiple(self.stiffness, K)
        return self.rest + _multiple(self.stiffness, K) if self.stiffness else self.rest


@dataclass(frozen=True, kw_only=True, eq=False)
class Laws:
    """C (`damping`) and branches as combinations of K, valid for the `matrices` K, C and K_j."""

    damping: Combination
    branches: tuple[Combination, ...]
    matrices: tuple[Any, ...]

    @property
    def parts(self) -> tuple[Combination, ...]:
        """Combinations of C and of the branches."""
        return self.damping, *self.branches

    def dynamic_stiffness(self, factors: Sequence[float], K: Any, M: Any) -> Any:
        """Return A = K + s C + s^2 M + sum_j h_j K_j for factors s in rad/s and h_j."""
        each = zip(factors, self.parts, strict=True)
        rests = [factor * part.rest for factor, part in each if factor and part.rest is not None]
        rests = [_multiple(factors[0] ** 2, M), *rests] if factors[0] else rests
        rest = sum(rests[1:], start=rests[0]) if rests else None
        return Combination(stiffness=self.multiple(factors), rest=rest).of(K)

    def multiple(self, factors: Sequence[Any]) -> Any:
        """Return the factor of K in the dynamic stiffness, for real or complex factors."""
        return 1 + sum(f * part.stiffness for f, part in zip(factors, self.parts, strict=True))

    def without_stiffness(
        self, factors: Sequence[float], vectors: Sequence[Floats], z: Floats
    ) -> tuple[Floats, Floats, list[Floats]]:
        """Write C y + sum_j K_j s_j + M z as A x + M m + sum_j rest_j r_j, without products with K.

        `factors` are those of the dynamic stiffness A, `vectors` are y and each s_j, of the shape
        of z. Returns x, m and the r_j.
        """
        each = zip(self.parts, vectors, strict=True)
        x = sum((part.stiffness * v for part, v in each), np.zeros_like(z))
        x = x / self.multiple(factors)
        rests = [v - factor * x for factor, v in zip(factors, vectors, strict=True)]
        return x, z - factors[0] ** 2 * x, rests


def _multiple(factor: float, A: Any) -> Any:
    """Return a multiple of a matrix; a sparse one shares its pattern, a third of its memory."""
    if factor == 1:
        return A
    if isinstance(A, sparse.csr_array):
        if not factor:
            return sparse.csr_array(A.shape)
        A.sort_indices()  # once for both: sorting the multiple would leave A's data unsorted
        return sparse.csr_array((factor * A.data, A.indices, A.indptr), shape=A.shape)
    return factor * A


def factors_at(branches: Sequence[Branch], s: float) -> tuple[float, ...]:
    """Return the factors of C and of each branch in the dynamic stiffness at a real s in rad/s."""
    return s, *(float(np.real(branch.share(s))) for branch in branches)


def viscoelastic(
    materials: list[Material],
    stiffness: Callable[[Floats], sparse.csr_array],
    mass: Callable[[Floats], sparse.csr_array],
    *,
    springs: sparse.csr_array | None = None,
    absorbing: sparse.csr_array | None = None,
) -> tuple[sparse.csr_array, sparse.csr_array, sparse.csr_array, tuple[Branch, ...], Laws]:
    """Return K, C, M, branches and laws of a body of r materials without loss factors.

    `stiffness` takes shares (r,) of the moduli, `mass` densities (r,) in kg/m3; both are linear.
    `springs` add to K alone, `absorbing` adds to C alone.
    """
    K, M = stiffness(np.ones(len(materials))), mass(property_of(materials, "density"))
    K = K if springs is None else K + springs

    def portion(share: Floats, *rests: sparse.csr_array | None) -> Combination:
        """Return the stiffness of shares (r,) of the moduli plus other matrices."""
        parts = [rest for rest in rests if rest is not None]
        multiple = 0.0 if np.ptp(share) else float(share[0])
        if np.ptp(share):
            summed = stiffness(share)
            summed.eliminate_zeros()
            parts.insert(0, summed)
        elif springs is not None and multiple:
            parts.append(-multiple * springs)
        return Combination(
            stiffness=multiple, rest=sum(parts[1:], start=parts[0]) if parts else None
        )

    lag, times, shares = relaxation_of(materials)
    damping, relaxing = portion(lag, absorbing), [portion(share) for share in shares]
    own = [r for r, m in enumerate(materials) if m.law is not None]
    dispersive = [portion(np.eye(len(materials))[r]) for r in own]
    C = damping.of(K)
    branches: tuple[Branch, ...] = (
        *(MaxwellBranch(K=part.of(K), time=float(time))
          for part, time in zip(relaxing, times, strict=True)),
        *(DispersiveBranch(K=part.of(K), modulus=_relative_modulus(materials[r]))
          for part, r in zip(dispersive, own, strict=True)),
    )  # fmt: skip
    matrices = K, C, *(branch.K for branch in branches)
    laws = Laws(damping=damping, branches=(*relaxing, *dispersive), matrices=matrices)
    return K, C, M, branches, laws


def _relative_modulus(material: Material) -> Callable[[Any], Any]:
    """Return the complex modulus over that at rest, a function of the angular frequency."""
    return lambda w: material.complex_modulus(w) / material.shear_modulus
