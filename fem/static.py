"""Statics and natural modes: K u = f, and K u = w^2 M u."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigsh

from fem.assembly import Operators
from fem.linear_solver import Factor, factorise
from fem.transient import Diverged
from fem.typing import Floats

FLOATING = (1e-6, 1e-9, 1e-12)  # of the square of the highest frequency: shifts of free bodies
RIGID = 1e-14  # of it: a mode below is a rigid-body mode
MOST_RESTARTS = 40  # of Lanczos' method


def static(operators: Operators, force: Floats, *, solver: str = "auto") -> Floats:
    """Static displacement under nodal forces.

    One step of iterative refinement: thin sheets are so ill-conditioned that a direct solution
    alone leaves residuals near 1e-5.

    Parameters
    ----------
    operators : Operators
    force : (3 n,) or (3 n, k) float, N
    solver : of `linear_solver.factorise`

    Returns
    -------
    (3 n,) or (3 n, k) float, metre

    Raises
    ------
    ValueError
        If the body is unconstrained.
    """
    factor = factorise(operators.K, backend=solver)
    f = force[operators.free]
    u = factor.solve(f)
    return operators.expand(u + factor.solve(f - operators.K @ u))


def modes(operators: Operators, n: int, *, solver: str = "auto") -> tuple[Floats, Floats]:
    """Natural modes of lowest frequency, without damping.

    Rigid-body modes of a free body are found near 0 Hz.

    Parameters
    ----------
    operators : Operators
    n : number of modes
    solver : of `linear_solver.factorise`

    Returns
    -------
    frequencies : (n,) float, Hz
    shapes : (3 n_nodes, n) float, kg^-1/2, mass-normalised

    Raises
    ------
    Diverged
        If they do not converge.
    """
    K, M = operators.K, operators.M
    for shift, factor in _inverses(operators, solver):
        inverse = LinearOperator(K.shape, factor.solve, dtype=np.float64)
        start = np.random.default_rng(0).standard_normal(K.shape[0])  # the same in each run
        try:
            squares, shapes = eigsh(
                K, n, M=M, sigma=-shift, OPinv=inverse, maxiter=MOST_RESTARTS, v0=start
            )
        except ArpackNoConvergence:
            continue
        order = np.argsort(squares)
        frequencies = np.sqrt(np.maximum(squares[order], 0)) / (2 * np.pi)
        return frequencies, operators.expand(shapes[:, order])
    raise Diverged(
        f"the {n} lowest modes did not converge in {MOST_RESTARTS} restarts: the body is so thin "
        "that round-off hides them; constrain it, ask for more modes, or mesh a thicker equivalent"
    )


def _inverses(operators: Operators, solver: str) -> Iterator[tuple[float, Factor]]:
    """Shifts s and factorised K + s M: 0 for a constrained body; for a free one, smaller and
    smaller fractions of the square of the mesh's highest frequency, above which only a solid
    body's first modes lie.
    """
    K, M = operators.K, operators.M
    scale = K.trace() / M.trace()
    try:
        factor = factorise(K, backend=solver)
    except ValueError:
        held = False
    else:
        # An inverse iteration ends near a rigid-body mode if there is one, whose K is round-off.
        u = factor.solve(M @ np.random.default_rng(0).standard_normal(len(operators.free)))
        held = bool(u @ (K @ u) > RIGID * scale * (u @ (M @ u)))
    if held:
        yield 0.0, factor
        return
    for part in FLOATING:
        yield part * scale, factorise(K + part * scale * M, backend=solver)
