"""Lagrange shape functions and quadrature on triangles and tetrahedra.

Both use barycentric coordinates, so one formula serves both shapes: the quadratic functions are
L_a (2 L_a - 1) at the corners and 4 L_a L_b at the mid-sides.
"""

from functools import cache
from itertools import permutations

import numpy as np

from meshes.tetmesh import EDGES
from meshes.typing import Floats, Ints

TRIANGLE_EDGES = np.array([[0, 1], [1, 2], [2, 0]])


def shape_functions(barycentric: Floats, n_nodes: int) -> Floats:
    """Return values (q, n_nodes) at barycentric points (q, 3) or (q, 4)."""
    corners = barycentric.shape[1]
    if n_nodes == corners:
        return barycentric
    a, b = _edges(corners).T
    quadratic = barycentric * (2 * barycentric - 1)
    return np.hstack([quadratic, 4 * barycentric[:, a] * barycentric[:, b]])


def shape_derivatives(barycentric: Floats, n_nodes: int) -> Floats:
    """Return derivatives (q, n_nodes, d) along the edges from corner 0 to the other corners."""
    points, corners = barycentric.shape
    by_coordinate = np.zeros((points, n_nodes, corners))
    if n_nodes == corners:
        by_coordinate[:] = np.eye(corners)
    else:
        corner = np.arange(corners)
        by_coordinate[:, corner, corner] = 4 * barycentric - 1
        for edge, (a, b) in enumerate(_edges(corners)):
            by_coordinate[:, corners + edge, a] = 4 * barycentric[:, b]
            by_coordinate[:, corners + edge, b] = 4 * barycentric[:, a]
    return by_coordinate[:, :, 1:] - by_coordinate[:, :, :1]


@cache
def tetrahedron_rule(degree: int) -> tuple[Floats, Floats]:
    """Return barycentric points (q, 4) and weights (q,) summing to 1, exact to `degree` (2 or 5).

    Degree 5 is the 14-point rule of Walkington, Quadrature on Simplices of Arbitrary Dimension
    (Carnegie Mellon University, 2000), all of whose weights are positive.
    """
    if degree <= 2:
        return _orbits((0.25, [(5 - 5**0.5) / 20] * 3))
    return _orbits(
        (0.11268792571801585, [0.3108859192633006] * 3),
        (0.07349304311636195, [0.0927352503108912] * 3),
        (0.042546020777081466, [0.04550370412564965] * 2 + [0.4544962958743504]),
    )


@cache
def triangle_rule(degree: int = 4) -> tuple[Floats, Floats]:
    """Return barycentric points (q, 3) and weights (q,) summing to 1, exact to `degree` (2 or 4).

    Three points and six: Dunavant, Int J Numer Methods Eng 21:1129 (1985).
    """
    if degree <= 2:
        return _orbits((1 / 3, [1 / 6, 1 / 6]))
    return _orbits(
        (0.22338158967801147, [0.4459484909159649] * 2),
        (0.10995174365532187, [0.09157621350977074] * 2),
    )


def _edges(corners: int) -> Ints:
    return EDGES if corners == 4 else TRIANGLE_EDGES


def _orbits(*orbits: tuple[float, list[float]]) -> tuple[Floats, Floats]:
    """Return all distinct permutations of each point, completed to the sum 1, and weights."""
    points: list[tuple[float, ...]] = []
    weights: list[float] = []
    for weight, leading in orbits:
        distinct: dict[tuple[float, ...], tuple[float, ...]] = {}
        for point in sorted(set(permutations([*leading, round(1 - sum(leading), 15)]))):
            distinct.setdefault(tuple(round(x, 9) for x in point), point)
        points += distinct.values()
        weights += [weight] * len(distinct)
    rule = np.array(points), np.array(weights) / sum(weights)
    for array in rule:
        array.setflags(write=False)
    return rule
