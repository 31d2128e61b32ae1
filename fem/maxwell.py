"""Generalised Maxwell branches (Prony terms): springs in series with dashpots.

    f = K_j d,  d' = u' - d / tau,  at time exp(s t):  f = s tau / (1 + s tau) K_j u

The internal variable d is the stretch of the spring. One branch in parallel with the equilibrium K
is the standard linear (Zener) solid: C. Zener, Elasticity and Anelasticity of Metals (1948); Simo
and Hughes, Computational Inelasticity (1998), chapter 10. A material with a modulus law of its own
adds a part of the stiffness that depends on frequency and has no internal variable.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import sparse

from fem.typing import Floats
from simple_model.layers.material import Material

NO_INTERNAL = (
    "a material with a modulus law of its own has no internal variables, which motion from rest "
    "and reduced-order models need; take its Prony series, material.relaxing(), or fem.harmonic"
)


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

    def lag(self, w: Any) -> Any:
        """Loss part of the share over w, in s, in steady motion at w in rad/s."""
        return self.time / (1 + (w * self.time) ** 2)


@dataclass(frozen=True, kw_only=True, eq=False)
class DispersiveBranch:
    """Part of the stiffness whose modulus is any function of frequency: `K` (n, n) at rest, N/m,
    and `modulus`, angular frequencies in rad/s -> complex modulus over that at rest.
    """

    K: Any
    modulus: Callable[[Any], Any]

    def share(self, s: Any) -> Any:
        """Factor of K in what is added to K, at complex frequencies s in rad/s."""
        return self.modulus(np.real_if_close(-1j * s)) - 1

    def lag(self, w: Any) -> Any:
        """Loss part of the share over w, in s, in steady motion at w in rad/s; 0 at rest."""
        return np.imag(self.modulus(w)) / np.where(w == 0, np.inf, w)


Branch = MaxwellBranch | DispersiveBranch
Matrices = tuple[sparse.csr_array, sparse.csr_array, sparse.csr_array, tuple[Branch, ...]]


def with_internal(branches: Sequence[Branch]) -> tuple[MaxwellBranch, ...]:
    """The branches, which must each have an internal variable, or raise a ValueError."""
    found = tuple(branch for branch in branches if isinstance(branch, MaxwellBranch))
    if len(found) < len(branches):
        raise ValueError(NO_INTERNAL)
    return found


def relaxing_stiffness(branches: Sequence[Branch], s: Any) -> Any:
    """Complex stiffness that branches add to K at the complex frequency s in rad/s; 0 if there are
    none.
    """
    return sum(branch.share(s) * branch.K for branch in branches)


def branch_force(branches: Sequence[Branch], stretch: Floats) -> Any:
    """Forces (n,) in N of branches at internal variables (j, n) in metre; 0 without branches."""
    return sum(branch.K @ d for branch, d in zip(branches, stretch, strict=True))


def on_free(branches: Sequence[Branch], free: Any) -> tuple[Branch, ...]:
    """Branches restricted to some of the degrees of freedom."""
    return tuple(
        replace(branch, K=sparse.csr_array(branch.K)[free][:, free]) for branch in branches
    )


def property_of(materials: list[Material], name: str) -> Floats:
    """A property (r,) of the materials."""
    return np.array([getattr(m, name) for m in materials], np.float64)


def viscoelastic(
    materials: list[Material],
    stiffness: Callable[[Floats], sparse.csr_array],
    mass: Callable[[Floats], sparse.csr_array],
) -> Matrices:
    """K, C, M and branches of r materials without loss factors, by the `stiffness` of a share of
    each material's moduli (r,) and the `mass` of densities (r,) in kg/m3, both linear.
    """
    rho, mu = (property_of(materials, name) for name in ("density", "shear_modulus"))
    K, M = stiffness(np.ones(len(materials))), mass(rho)

    def portion(share: Floats) -> sparse.csr_array:
        """Stiffness of shares, a multiple of K if all materials have one share."""
        if not np.ptp(share):
            return share[0] * K if share[0] else sparse.csr_array(K.shape)
        summed = stiffness(share)
        summed.eliminate_zeros()
        return summed

    C = portion(property_of(materials, "viscosity") / mu)
    return K, C, M, _branches(materials, portion)


def _branches(
    materials: list[Material], portion: Callable[[Floats], sparse.csr_array]
) -> tuple[Branch, ...]:
    """A Maxwell branch of each relaxation time, and one of each material with a law of its own;
    `portion` of shares (r,) of the materials' moduli is their stiffness.
    """
    terms = [(r, term) for r, m in enumerate(materials) for term in m.prony if term.modulus]
    shares: dict[float, Floats] = {
        time: np.zeros(len(materials)) for time in sorted({term.time for _, term in terms})
    }
    for r, term in terms:
        shares[term.time][r] += term.modulus / materials[r].shear_modulus
    own = [(np.eye(len(materials))[r], m) for r, m in enumerate(materials) if m.law is not None]
    return (
        *(MaxwellBranch(K=portion(share), time=time) for time, share in shares.items()),
        *(DispersiveBranch(K=portion(only), modulus=_relative(m)) for only, m in own),
    )


def _relative(material: Material) -> Callable[[Any], Any]:
    """Complex modulus over that at rest, as a function of the angular frequency in rad/s."""
    return lambda w: material.complex_modulus(w) / material.shear_modulus


def together(one: Matrices, other: Matrices) -> Matrices:
    """Matrices of two parts on the same degrees of freedom; branches of one time are one."""
    K, C, M = ((a + b).tocsr() for a, b in zip(one[:3], other[:3], strict=True))
    branches = [*one[3], *other[3]]
    stiffness: dict[float, Any] = {}
    for branch in branches:
        if isinstance(branch, MaxwellBranch):
            stiffness[branch.time] = branch.K + stiffness.get(branch.time, 0)
    own = [branch for branch in branches if isinstance(branch, DispersiveBranch)]
    return K, C, M, (*(MaxwellBranch(K=k, time=time) for time, k in stiffness.items()), *own)
