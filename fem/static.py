"""Rest and free vibration: K u = f, and K u = w^2 M u."""

import numpy as np
from scipy.sparse.linalg import LinearOperator, eigsh

from fem.assembly import Operators
from fem.linear_solver import factorise
from meshes.tetmesh import Floats


def static(operators: Operators, force: Floats, *, solver: str = "auto") -> Floats:
    """Displacement (3 n,) or (3 n, k) in metre under nodal forces (3 n,) or (3 n, k) in N.

    One step of iterative refinement: thin sheets are conditioned so badly that a direct
    solution alone leaves residuals near 1e-5.

    Raises
    ------
    ValueError
        If the body can move freely.
    """
    factor = factorise(operators.K, backend=solver)
    f = force[operators.free]
    u = factor.solve(f)
    return operators.expand(u + factor.solve(f - operators.K @ u))


def modes(operators: Operators, n: int, *, solver: str = "auto") -> tuple[Floats, Floats]:
    """The n lowest natural frequencies (n,) in Hz and mass-normalised shapes (3 n, n).

    Rigid motions of a free body come out near 0 Hz. Damping is left out.
    """
    # A shift well below the first bending mode of any body worth meshing, yet far enough from 0
    # for a body that floats: (1e-3)^2 of the highest frequency of the mesh.
    shift = 1e-6 * operators.K.trace() / operators.M.trace()
    factor = factorise(operators.K + shift * operators.M, backend=solver)
    inverse = LinearOperator(operators.K.shape, factor.solve, dtype=np.float64)
    squares, shapes = eigsh(operators.K, n, M=operators.M, sigma=-shift, OPinv=inverse)
    order = np.argsort(squares)
    frequencies = np.sqrt(np.maximum(squares[order], 0)) / (2 * np.pi)
    return frequencies, operators.expand(shapes[:, order])
