"""Steady state at given frequencies: (K* + i w C - w^2 M) u = f, time exp(+i w t).

K* is K plus the complex stiffness of the generalised Maxwell branches.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fem.assembly import Operators
from fem.linear_solver import SumFactoriser
from fem.maxwell import Branch, relaxing_stiffness
from simple_model.typing import Complex, Floats


def dynamic_stiffness(K: Any, C: Any, M: Any, branches: Sequence[Branch], s: Any) -> Any:
    """Return K + s C + s^2 M plus the stiffness of branches, in N/m, at a complex frequency s in
    rad/s. For dense matrices, s of shape (f, 1, 1) gives (f, n, n).
    """
    return K + s * C + s**2 * M + relaxing_stiffness(branches, s)


class LineSolver:
    """Steady state of a body, by one factorisation per frequency with a backend of `factorise`;
    `accuracy` is the largest residual over the force.
    """

    def __init__(
        self, operators: Operators, solver: str = "auto", *, accuracy: float = 1e-10
    ) -> None:
        self._laws, self._operators = operators.combinations(), operators
        rests = [part.rest for part in self._laws.parts if part.rest is not None]
        matrices = [operators.K, operators.M, *rests]
        self._factorise = SumFactoriser(matrices, backend=solver, accuracy=accuracy)

    def __call__(self, frequency: float, force: Any) -> Complex:
        """Return the complex displacement (3 n,) or (3 n, k) in m at a frequency in Hz under forces
        of the same shape in N. Raises a ValueError if the body is unconstrained and the frequency
        is 0 Hz.
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
    """Return the frequency response of a body, by one factorisation per frequency.

    Parameters
    ----------
    force : (3 n,) or (3 n, k) float or complex, N, the same at each frequency
    frequencies : (f,) float, Hz
    solver : backend of `factorise`

    Returns
    -------
    (f, 3 n) or (f, 3 n, k) complex
        Displacement, m.

    Raises
    ------
    ValueError
        If the body is unconstrained and a frequency is 0 Hz.

    Examples
    --------
    >>> import fem, meshes
    >>> mesh = meshes.block((0.02, 0.02, 0.01), 0.005)
    >>> ops = fem.assemble(mesh, fem.PRESETS["palm"], fixed="bottom")
    >>> force = fem.pressure_operator(mesh).sum(axis=1)  # 1 Pa on the whole top
    >>> u = fem.harmonic(ops, force, [140.0])[0]
    >>> (1e9 * abs(fem.probe_operator(mesh, [[0.0, 0.0]]) @ u)).round(1)  # nm
    array([156.4])
    """
    solve = LineSolver(operators, solver)
    return np.array([solve(f, force) for f in np.atleast_1d(np.asarray(frequencies, np.float64))])
