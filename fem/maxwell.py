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


def with_internal(branches: Sequence[Branch]) -> tuple[MaxwellBranch, ...]:
    """Branches that each have an internal variable.

    Raises
    ------
    ValueError
        If one has none.
    """
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
