"""Grids of boxes, each split into the six tetrahedra around a diagonal, mirrored at the middle.

The diagonals run outwards from the middle of the grid (Kuhn, or Freudenthal, triangulation of each
octant), so that both tetrahedra at an edge of the whole box have one facet on its boundary, and no
tetrahedron has two: a smooth surface may be wrapped around its edges and corners without a flat
element, as a sphere around a cube.
"""

from itertools import permutations

import numpy as np

from meshes.shapes.structured import check_size
from meshes.tetmesh import Ints


def kuhn_tets(cells: tuple[int, int, int]) -> Ints:
    """Tetrahedra (6 n, 4), with positive volume, of a grid of so many cells along three axes, whose
    nodes are numbered with the last axis fastest.

    Raises
    ------
    MeshError
        If there are too many cells.
    """
    check_size(cells)
    places = np.stack(np.meshgrid(*map(np.arange, cells), indexing="ij"), axis=-1).reshape(-1, 3)
    outwards = np.where(places >= np.array(cells) // 2, 1, -1)
    strides = np.array([(cells[1] + 1) * (cells[2] + 1), cells[2] + 1, 1])
    inner = (places + (outwards < 0)) @ strides
    steps = outwards * strides
    tets = []
    for order in permutations(range(3)):
        path = [inner, *(inner + np.cumsum(steps[:, order], axis=1).T)]
        turned = outwards.prod(axis=1) * np.linalg.det(np.eye(3)[list(order)]) < 0
        a, b, c, d = path
        tets.append(np.column_stack([a, b, np.where(turned, d, c), np.where(turned, c, d)]))
    return np.vstack(tets)
