"""Steady state at given frequencies: (K* + i w C - w^2 M) u = f, time exp(+i w t); K* is K with the
complex stiffness of the generalised Maxwell branches.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fem.assembly import Operators
from fem.linear_solver import factorise
from fem.maxwell import relaxing_stiffness
from meshes.tetmesh import Floats


def harmonic(
    operators: Operators, force: Floats, frequencies: ArrayLike, *, solver: str = "auto"
) -> NDArray[np.complex128]:
    """Frequency response: complex displacement (f, 3 n) in metre, one factorisation per frequency.

    Parameters
    ----------
    force : (3 n,) float or complex, N, the same at each frequency
    frequencies : (f,) float, Hz
    """
    K, C, M = operators.K, operators.C, operators.M
    answers = []
    for w in 2 * np.pi * np.atleast_1d(np.asarray(frequencies, np.float64)):
        Z = K + 1j * w * C - w**2 * M + relaxing_stiffness(operators.branches, 1j * w)
        factor = factorise(Z, backend=solver)
        u = factor.solve(force[operators.free].astype(np.complex128))
        answers.append(operators.expand(u))
    return np.array(answers)
