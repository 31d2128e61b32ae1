"""K, C, M and the Maxwell branches of parts that each scale with the moduli of one material."""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy import sparse

from fem.maxwell import Branch, DispersiveBranch, MaxwellBranch
from fem.typing import Floats
from simple_model.layers.material import Material

Matrices = tuple[sparse.csr_array, sparse.csr_array, sparse.csr_array, tuple[Branch, ...]]


def property_of(materials: list[Material], name: str) -> Floats:
    """A property (r,) of the materials."""
    return np.array([getattr(m, name) for m in materials], np.float64)


def viscoelastic(
    materials: list[Material],
    stiffness: Callable[[Floats], sparse.csr_array],
    mass: Callable[[Floats], sparse.csr_array],
) -> Matrices:
    """K, C, M and the branches of all materials.

    Parameters
    ----------
    materials : list of Material, r, without loss factors
    stiffness : shares (r,) of each material's moduli -> their stiffness, linear in the shares
    mass : densities (r,) in kg/m3 -> their mass, linear in them

    Returns
    -------
    K in N/m, C in N s/m, M in kg, and branches
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
