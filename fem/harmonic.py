"""Steady state at given frequencies: (K* + i w C - w^2 M) u = f, time exp(+i w t); K* is K with the
complex stiffness of the generalised Maxwell branches.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fem.assembly import Operators
from fem.linear_solver import factorise
from fem.maxwell import Branch, relaxing_stiffness
from meshes.tetmesh import Floats


def dynamic_stiffness(K: Any, C: Any, M: Any, branches: Sequence[Branch], s: Any) -> Any:
    """Dynamic stiffness K + s C + s^2 M and that of Maxwell branches.

    Parameters
    ----------
    K, C, M : (n, n), sparse or dense, N/m, N s/m, kg
    branches : of (n, n) each
    s : complex frequency in rad/s; of a shape (f, 1, 1) for dense matrices

    Returns
    -------
    (n, n) or (f, n, n), N/m

    Raises
    ------
    ValueError
        If the matrices are of different sizes.
    """
    return K + s * C + s**2 * M + relaxing_stiffness(branches, s)


def harmonic(
    operators: Operators, force: Floats, frequencies: ArrayLike, *, solver: str = "auto"
) -> NDArray[np.complex128]:
    """Frequency response by one factorisation per frequency.

    Parameters
    ----------
    operators : Operators, of the body
    force : (3 n,) or (3 n, k), float or complex, N, the same at each frequency
    frequencies : (f,) float, Hz
    solver : of `linear_solver.factorise`

    Returns
    -------
    (f, 3 n) or (f, 3 n, k) complex, metre

    Raises
    ------
    ValueError
        If an unconstrained body is asked for at 0 Hz.
    """
    K, C, M, branches = operators.K, operators.C, operators.M, operators.branches
    fields = []
    for w in 2 * np.pi * np.atleast_1d(np.asarray(frequencies, np.float64)):
        factor = factorise(dynamic_stiffness(K, C, M, branches, 1j * w), backend=solver)
        u = factor.solve(force[operators.free].astype(np.complex128))
        fields.append(operators.expand(u))
    return np.array(fields)
