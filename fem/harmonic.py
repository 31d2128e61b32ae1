"""Steady state at given frequencies: (K* + i w C - w^2 M) u = f, time exp(+i w t); K* is K with the
complex stiffness of the generalised Maxwell branches.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fem.assembly import Operators
from fem.combination import laws_of
from fem.linear_solver import Factor, factoriser
from fem.maxwell import Branch, relaxing_stiffness
from fem.sparsity import on_one_pattern
from fem.typing import Complex, Floats


def dynamic_stiffness(K: Any, C: Any, M: Any, branches: Sequence[Branch], s: Any) -> Any:
    """Dynamic stiffness K + s C + s^2 M in N/m and that of Maxwell branches, at a complex frequency
    s in rad/s; of a shape (f, 1, 1) for dense matrices, of (f, n, n).
    """
    return K + s * C + s**2 * M + relaxing_stiffness(branches, s)


class LineSolver:
    """Steady state of a body at one frequency after the other, by a factorisation for each.

    The dynamic stiffness at all frequencies has one sparsity pattern, which is analysed once.
    """

    def __init__(self, operators: Operators, solver: str = "auto") -> None:
        """Take `Operators`, and a solver of `linear_solver.factorise`."""
        K, C, branches = operators.K, operators.C, operators.branches
        self._laws = laws_of(K, C, branches, operators.laws)
        self._branches, self._operators, self._solver = branches, operators, solver
        rests = [part.rest for part in self._laws.parts if part.rest is not None]
        self._values, self._indices, self._indptr = on_one_pattern([K, operators.M, *rests])
        self._factorise: Callable[[Any], Factor] | None = None

    def __getstate__(self) -> dict[str, Any]:
        """State for other processes, without what a solver has analysed."""
        return {**vars(self), "_factorise": None}

    def __call__(self, frequency: float, force: Any) -> Complex:
        """Displacement (3 n,) or (3 n, k) complex in metre at a frequency in Hz, under forces of
        the same shape in N.

        Raises
        ------
        ValueError
            If an unconstrained body is asked for at 0 Hz.
        """
        s = 2j * np.pi * frequency
        factors = s, *(branch.share(s) for branch in self._branches)
        parts = zip(factors, self._laws.parts, strict=True)
        rests = [factor for factor, part in parts if part.rest is not None]
        weights = np.array([self._laws.multiple(factors), s**2, *rests], np.complex128)
        A = np.empty(self._values.shape[1], np.complex128)
        A.real, A.imag = weights.real @ self._values, weights.imag @ self._values
        if self._factorise is None:
            self._factorise = factoriser(self._indices, self._indptr, backend=self._solver)
        u = self._factorise(A).solve(force[self._operators.free].astype(np.complex128))
        return np.asarray(self._operators.expand(u), np.complex128)


def harmonic(
    operators: Operators, force: Floats, frequencies: ArrayLike, *, solver: str = "auto"
) -> Complex:
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
    solve = LineSolver(operators, solver)
    return np.array([solve(f, force) for f in np.atleast_1d(np.asarray(frequencies, np.float64))])
