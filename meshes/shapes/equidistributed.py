"""Grid lines that spread the error of a structured mesh evenly over its cells.

Of an error density g_a(x) h_a^r that cells leave along each axis, cells of length h_a ~
g_a^(-1 / (1 + r)) leave the least error for their number n_a, which is I_a^(1 + r) / n_a^r with
I_a = int g_a^(1 / (1 + r)) dx.
The product of the three numbers is used best where all three axes leave the same error.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from meshes.tetmesh import Floats, Ints

ORDER = 3.0  # of convergence of the motion at one line, measured 3 to 4
LEAST = 1e-4  # of the largest density: no axis has cells without bound


def equidistributed(
    lines: Sequence[Floats], cells: Ints, error: Floats, dofs: float, *, order: float = ORDER
) -> tuple[Floats, Floats, Floats]:
    """Grid lines of a mesh of so many degrees of freedom that has the least error.

    Parameters
    ----------
    lines : three (n_a,) float, metre, increasing, of the mesh whose error is known
    cells : (e, 3) int, the cell along each axis that each of its elements is in
    error : (e, 3) float, that each element leaves by its length along each axis, in any unit
    dofs : float, degrees of freedom of ten-node tetrahedra that are aimed at
    order : float, r, of convergence

    Returns
    -------
    three (m_a,) float, metre; even numbers of cells along x and y, with a line near their middle
    """
    measures, sums = [], []
    for line, cell, left in zip(lines, cells.T, error.T, strict=True):
        size = np.diff(line)
        density = np.bincount(cell, left, minlength=len(size)) / size ** (1 + order)
        density = np.maximum(density, LEAST * density.max())
        measures.append(np.append(0.0, np.cumsum(size * density ** (1 / (1 + order)))))
        sums.append(measures[-1][-1])
    shares = np.array(sums) ** ((1 + order) / order)
    counts = shares * (dofs / 24 / shares.prod()) ** (1 / 3)
    x, y, z = (
        np.interp(np.linspace(0, measure[-1], _whole(count, each) + 1), measure, line)
        for measure, line, count, each in zip(measures, lines, counts, (2, 2, 1), strict=True)
    )
    return x, y, z


def _whole(count: float, each: int) -> int:
    """Nearest number of cells that is a multiple of some."""
    return max(1, round(count / each)) * each
