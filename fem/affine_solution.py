"""Steady state of a full body whose operators are affine sums, at one line.

The added mass F of a fluid can only be applied. With the weights w of a line

    (A + w F) u = f,   (P + w F - E) u = f,   P = A + E

where E is the equivalent added mass of the line's bending waves, 2 rho/k per area (`added_mass`),
as so much more of the body's own mass. P is sparse and factorised. Waves of other wavenumbers than
k have another added mass, but do not resonate at the line: P^-1 (P + w F - E) is near the identity,
and GMRES takes some iterations with it, in the norm of the displacement. Factors are in single
precision, refined in double.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, gmres

from fem.affine import AffineOperators
from fem.linear_solver import available, factoriser
from fem.sparsity import on_one_pattern
from fem.transient import Diverged

Complex = NDArray[np.complex128]

RESIDUAL = 1e-8  # relative, of GMRES: a resonance makes some hundred times as much of it
RESTART, CYCLES = 60, 5


def line_solution(
    affine: AffineOperators,
    weights: Complex,
    force: Complex,
    *,
    solver: str = "auto",
    fluid_share: float = 0.0,
) -> Complex:
    """Steady state of a full body at one line.

    Parameters
    ----------
    affine : AffineOperators, sparse, of q matrices
    weights : (q,) complex, of the matrices at the line
    force : (n_free,) complex, N
    solver : a backend of `linear_solver`
    fluid_share : equivalent added mass of the fluid at the line over the body's own mass

    Returns
    -------
    (n_free,) complex, metre

    Raises
    ------
    Diverged
        If the equations with the added mass of a fluid are not solved to a residual of `RESIDUAL`.
    """
    dry = len(affine.parts) - len(affine.fluid)
    values, *pattern = on_one_pattern([sparse.csr_array(part) for part in affine.parts[:dry]])
    backend = solver if solver in available(complex_valued=True) else "auto"
    own = slice(len(affine.stiffness), len(affine.stiffness) + len(affine.mass))
    heavier = weights[:dry].copy()
    heavier[own] *= 1 + fluid_share
    factor = factoriser(*pattern, backend=backend)(heavier @ values)
    force = force.astype(np.complex128)
    if not affine.fluid:
        return factor.solve(force)
    E = fluid_share * sum(w * M for w, M in zip(weights[own], affine.mass, strict=True))
    (F,), w = affine.fluid, weights[-1]

    def preconditioned(u: Complex) -> Complex:
        fluid = F @ np.column_stack([u.real, u.imag])  # of real fields
        return u + factor.solve(w * (fluid @ [1, 1j]) - E @ u)

    n = len(force)
    system = LinearOperator((n, n), matvec=preconditioned, dtype=np.complex128)
    u, failed = gmres(
        system, factor.solve(force), rtol=RESIDUAL, restart=RESTART, maxiter=CYCLES
    )  # fmt: skip
    if failed:
        raise Diverged(
            f"a line in air is not solved to a residual of {RESIDUAL:g} by {RESTART * CYCLES} "
            "iterations; take a smaller sheet or larger elements, or leave air out"
        )
    return u
