"""Statics and natural modes: K u = f, and K u = w^2 M u."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import numpy as np
from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigsh

from fem.assembly import Operators
from fem.linear_solver import Factor, factorise
from fem.transient import Diverged
from simple_model.typing import Floats


def static(operators: Operators, force: Floats, *, solver: str = "auto") -> Floats:
    """Return the static displacement under nodal forces.

    One step of iterative refinement follows the direct solution, whose residual may be 1e-5 for
    thin sheets.

    Parameters
    ----------
    force : (3 n,) or (3 n, k) float, N
    solver : backend of `factorise`

    Returns
    -------
    (3 n,) or (3 n, k) float
        Displacement, m.

    Raises
    ------
    ValueError
        If the body is unconstrained.

    Examples
    --------
    >>> import fem, meshes
    >>> mesh = meshes.block((0.02, 0.02, 0.01), 0.005)
    >>> ops = fem.assemble(mesh, fem.PRESETS["palm"], fixed="bottom")
    >>> u = fem.static(ops, fem.pressure_operator(mesh).sum(axis=1))  # 1 Pa on the whole top
    >>> (1e9 * (fem.probe_operator(mesh, [[0.0, 0.0]]) @ u)).round(1)  # nm
    array([93.])
    """
    factor = factorise(operators.K, backend=solver)
    f = force[operators.free]
    u = factor.solve(f)
    return operators.expand(u + factor.solve(f - operators.K @ u))


def modes(
    operators: Operators, n: int, *, solver: str = "auto", most_restarts: int = 40
) -> tuple[Floats, Floats]:
    """Return the undamped natural modes of lowest frequency.

    Rigid-body modes of a free body have frequencies near 0 Hz.

    Parameters
    ----------
    n : number of modes
    solver : backend of `factorise`
    most_restarts : largest number of restarts of the Lanczos method

    Returns
    -------
    frequencies : (n,) float, Hz
    shapes : (3 n_nodes, n) float, kg^-1/2, mass-normalised

    Raises
    ------
    Diverged
        If the modes do not converge.

    Examples
    --------
    >>> import fem, meshes
    >>> mesh = meshes.block((0.02, 0.02, 0.01), 0.005)
    >>> ops = fem.assemble(mesh, fem.PRESETS["palm"], fixed="bottom")
    >>> frequencies, shapes = fem.modes(ops, 2)
    >>> frequencies.round(1)  # Hz
    array([112.7, 112.7])
    """
    K, M = operators.K, operators.M
    for shift, factor in _inverses(operators, solver):
        inverse = LinearOperator(K.shape, factor.solve, dtype=np.float64)
        start = np.random.default_rng(0).standard_normal(K.shape[0])  # the same in each run
        try:
            squares, shapes = eigsh(
                K, n, M=M, sigma=-shift, OPinv=inverse, maxiter=most_restarts, v0=start
            )
        except ArpackNoConvergence:
            continue
        order = np.argsort(squares)
        frequencies = np.sqrt(np.maximum(squares[order], 0)) / (2 * np.pi)
        return frequencies, operators.expand(shapes[:, order])
    raise Diverged(
        f"the {n} lowest modes did not converge in {most_restarts} restarts because of round-off "
        "in a thin body; constrain it, compute more modes, or mesh a thicker equivalent"
    )


def _inverses(operators: Operators, solver: str) -> Iterator[tuple[float, Factor]]:
    """Yield shifts s and factorised K + s M: s = 0 for a constrained body; for a free one, smaller
    and smaller fractions of the square of the highest frequency of the mesh.
    """
    K, M = operators.K, operators.M
    scale = K.trace() / M.trace()
    rigid = 1e-14  # of that square: below it a mode is a rigid-body mode
    with suppress(ValueError):
        factor = factorise(K, backend=solver)
        # Inverse iteration approaches a rigid-body mode if there is one; its energy is round-off.
        u = factor.solve(M @ np.random.default_rng(0).standard_normal(len(operators.free)))
        if u @ (K @ u) > rigid * scale * (u @ (M @ u)):
            yield 0.0, factor
            return
    for part in (1e-6, 1e-9, 1e-12):
        yield part * scale, factorise(K + part * scale * M, backend=solver)
