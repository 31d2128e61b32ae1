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
PER_CELL = 24  # degrees of freedom of ten-node tetrahedra, in a large grid
EVEN = (2, 2, 1)  # numbers of cells along x, y and z are multiples of these

Lines = tuple[Floats, Floats, Floats]  # metre, increasing, along x, y and z


def equidistributed(
    lines: Sequence[Floats],
    cells: Ints,
    error: Floats,
    dofs: float,
    *,
    order: float = ORDER,
    multiples: Sequence[int] = EVEN,
    coarsest: Sequence[Floats | float] = (np.inf, np.inf, np.inf),
) -> Lines:
    """Grid lines of a mesh of so many degrees of freedom that has the least error.

    Parameters
    ----------
    lines : three (n_a,) float, metre, increasing, of the mesh whose error is known
    cells : (e, 3) int, the cell along each axis that each of its elements is in
    error : (e, 3) float, that each element leaves by its length along each axis, in any unit
    dofs : float, degrees of freedom of ten-node tetrahedra that are aimed at
    order : float, r, of convergence
    multiples : three int, of which the numbers of cells are multiples
    coarsest : three float or (n_a,) float, metre, largest cells in the place of those that there
        are; for them there may be more degrees of freedom

    Returns
    -------
    three (m_a,) float, metre; with even numbers of cells a line is near their middle
    """
    densities = _densities(lines, cells, error, order)
    sizes = [np.diff(line) for line in lines]
    rates = [density ** (1 / (1 + order)) for density in densities]
    sums = np.array([size @ rate for size, rate in zip(sizes, rates, strict=True)])
    shares = sums ** ((1 + order) / order)
    counts = shares * (dofs / PER_CELL / shares.prod()) ** (1 / 3)
    found = []
    for a, (line, size, rate) in enumerate(zip(lines, sizes, rates, strict=True)):
        per_metre = np.maximum(rate * counts[a] / sums[a], 1 / coarsest[a])
        measure = np.append(0.0, np.cumsum(size * per_metre))
        parts = _whole(measure[-1], multiples[a])
        found.append(np.interp(np.linspace(0, measure[-1], parts + 1), measure, line))
    return found[0], found[1], found[2]


def error_ratio(
    lines: Sequence[Floats],
    cells: Ints,
    error: Floats,
    others: Sequence[Floats],
    *,
    order: float = ORDER,
) -> float:
    """Error that a mesh on other grid lines is predicted to have, over that of the mesh.

    Parameters
    ----------
    lines, cells, error, order : as for `equidistributed`
    others : three (m_a,) float, metre, increasing, from the first to the last of the lines

    Returns
    -------
    float; the sum of magnitudes, so that errors of both signs do not cancel
    """
    left = 0.0
    densities = _densities(lines, cells, error, order)
    for line, density, other in zip(lines, densities, others, strict=True):
        within = np.append(0.0, np.cumsum(np.diff(line) * density))
        left += np.diff(np.interp(other, line, within)) @ np.diff(other) ** order
    return float(left / error.sum())


def _densities(lines: Sequence[Floats], cells: Ints, error: Floats, order: float) -> list[Floats]:
    """Error densities g_a of the cells along each axis, such that a cell of length h leaves
    g_a h^(1 + r).
    """
    found = []
    for line, cell, left in zip(lines, cells.T, error.T, strict=True):
        size = np.diff(line)
        density = np.bincount(cell, left, minlength=len(size)) / size ** (1 + order)
        found.append(np.maximum(density, LEAST * density.max()))
    return found


def _whole(count: float, each: int) -> int:
    """Nearest number of cells that is a multiple of some."""
    return max(1, round(count / each)) * each
