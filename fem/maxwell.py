"""Generalised Maxwell branches (Prony terms): springs in series with dashpots.

    f = K_j d,  d' = u' - d / tau,  at time exp(s t):  f = s tau / (1 + s tau) K_j u

The internal variable d is the stretch of the spring. One branch in parallel with the equilibrium K
is the standard linear (Zener) solid: C. Zener, Elasticity and Anelasticity of Metals (1948); Simo
and Hughes, Computational Inelasticity (1998), chapter 10. A material with its own modulus law adds
a stiffness that depends on frequency and has no internal variable.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse

from simple_model.layers.material import Material
from simple_model.typing import Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class MaxwellBranch:
    """Generalised Maxwell branch.

    Parameters
    ----------
    K : (n, n) sparse or dense, stiffness of the springs, N/m
    time : relaxation time, s
    """

    K: Any
    time: float

    def share(self, s: Any) -> Any:
        """Return the factor s tau / (1 + s tau) of K at complex frequencies s in rad/s."""
        return s * self.time / (1 + s * self.time)

    def lag(self, w: Any) -> Any:
        """Return the imaginary part of the share over w, in s, in steady motion at w in rad/s."""
        return self.time / (1 + (w * self.time) ** 2)


@dataclass(frozen=True, kw_only=True, eq=False)
class DispersiveBranch:
    """Part of the stiffness with any modulus law: `K` (n, n) at rest in N/m, and `modulus`, the
    complex modulus over that at rest as a function of the angular frequency in rad/s.
    """

    K: Any
    modulus: Callable[[Any], Any]

    def share(self, s: Any) -> Any:
        """Return the factor of K in what adds to K at complex frequencies s in rad/s."""
        return self.modulus(np.real_if_close(-1j * s)) - 1

    def lag(self, w: Any) -> Any:
        """Return the imaginary part of the share over w, in s, at w in rad/s; 0 at rest."""
        return np.imag(self.modulus(w)) / np.where(w == 0, np.inf, w)


Branch = MaxwellBranch | DispersiveBranch
Matrices = tuple[sparse.csr_array, sparse.csr_array, sparse.csr_array, tuple[Branch, ...]]


def maxwell_only(branches: Sequence[Branch]) -> tuple[MaxwellBranch, ...]:
    """Return the branches; raise a ValueError unless each has an internal variable."""
    maxwell = tuple(branch for branch in branches if isinstance(branch, MaxwellBranch))
    refuse_own_law(len(maxwell) < len(branches))
    return maxwell


def refuse_own_law(has_own: bool) -> None:
    """Raise a ValueError if a material has its own modulus law."""
    if has_own:
        raise ValueError(
            "a material with its own modulus law has no internal variables, which motion from rest "
            "and reduced-order models need; use its Prony series, material.relaxing(), or "
            "fem.harmonic"
        )


def relaxing_stiffness(branches: Sequence[Branch], s: Any) -> Any:
    """Return the complex stiffness that branches add to K at the complex frequency s in rad/s."""
    return sum(branch.share(s) * branch.K for branch in branches)


def branch_force(branches: Sequence[Branch], stretch: Floats) -> Any:
    """Return the forces (n,) of branches in N for internal variables (j, n) in m."""
    return sum(branch.K @ d for branch, d in zip(branches, stretch, strict=True))


def property_of(materials: Sequence[Material], name: str) -> Floats:
    """Return one property (r,) of the materials."""
    return np.array([getattr(m, name) for m in materials], np.float64)


def relaxation_of(materials: Sequence[Material]) -> tuple[Floats, Floats, Floats]:
    """Return viscosities over shear moduli (r,) in s, relaxation times (j,) in s, and the moduli
    (j, r) of the Prony terms with these times over the shear moduli. Loss factors must be terms.
    """
    mu = property_of(materials, "shear_modulus")
    terms = [(r, term) for r, m in enumerate(materials) for term in m.prony if term.modulus]
    times = sorted({term.time for _, term in terms})
    shares = np.zeros((len(times), len(materials)))
    for r, term in terms:
        shares[times.index(term.time), r] += term.modulus / mu[r]
    return property_of(materials, "viscosity") / mu, np.array(times), shares


def add_matrices(one: Matrices, other: Matrices) -> Matrices:
    """Add the matrices of two parts on the same dofs, and merge branches of equal time."""
    K, C, M = ((a + b).tocsr() for a, b in zip(one[:3], other[:3], strict=True))
    branches = [*one[3], *other[3]]
    stiffness: dict[float, Any] = {}
    for branch in branches:
        if isinstance(branch, MaxwellBranch):
            stiffness[branch.time] = branch.K + stiffness.get(branch.time, 0)
    own = [branch for branch in branches if isinstance(branch, DispersiveBranch)]
    return K, C, M, (*(MaxwellBranch(K=k, time=time) for time, k in stiffness.items()), *own)
