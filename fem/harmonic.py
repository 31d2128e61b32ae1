"""Steady state at given frequencies: (K* + i w C - w^2 M) u = f, time exp(+i w t); K* is K with the
complex stiffness of the generalised Maxwell branches.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fem.assembly import Operators
from fem.combination import laws_of
from fem.linear_solver import SumFactoriser
from fem.maxwell import Branch, relaxing_stiffness
from fem.typing import Complex, Floats


def dynamic_stiffness(K: Any, C: Any, M: Any, branches: Sequence[Branch], s: Any) -> Any:
    """Dynamic stiffness K + s C + s^2 M in N/m and that of Maxwell branches, at a complex frequency
    s in rad/s; of a shape (f, 1, 1) for dense matrices, of (f, n, n).
    """
    return K + s * C + s**2 * M + relaxing_stiffness(branches, s)


class LineSolver:
    """Steady state of a body at one frequency after the other, by a factorisation for each."""

    def __init__(self, operators: Operators, solver: str = "auto") -> None:
        """Take `Operators`, and a solver of `linear_solver.factorise`."""
        K, C, branches = operators.K, operators.C, operators.branches
        self._laws, self._operators = laws_of(K, C, branches, operators.laws), operators
        rests = [part.rest for part in self._laws.parts if part.rest is not None]
        self._factorise = SumFactoriser([K, operators.M, *rests], backend=solver)

    def __call__(self, frequency: float, force: Any) -> Complex:
        """Displacement (3 n,) or (3 n, k) complex in metre at a frequency in Hz, under forces of
        the same shape in N.

        Raises
        ------
        ValueError
            If an unconstrained body is asked for at 0 Hz.
        """
        s = 2j * np.pi * frequency
        factors = s, *(branch.share(s) for branch in self._operators.branches)
        parts = zip(factors, self._laws.parts, strict=True)
        rests = [factor for factor, part in parts if part.rest is not None]
        weights = np.array([self._laws.multiple(factors), s**2, *rests], np.complex128)
        free = self._operators.free
        u = self._factorise(weights).solve(force[free].astype(np.complex128))
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
