"""`grid.skinwave` of pyvista's unstructured grids, which imports this module where it is used."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from meshes import TetMesh

SHOWN = 0.05  # of the length of a grid, by which it is displaced at most where it is shown


@pv.register_dataset_accessor("skinwave", pv.UnstructuredGrid)
class GridAccessor:
    """Mesh and displaced shape of a grid of tetrahedra, in metre."""

    def __init__(self, grid: pv.UnstructuredGrid) -> None:
        self._grid = grid

    def to_mesh(self) -> TetMesh:
        """The mesh of a grid of tetrahedra of 4 nodes, or of 10.

        Raises
        ------
        MeshError, ValueError
            If it has other cells, or no element can be built on them.
        """
        return TetMesh.from_pyvista(self._grid)

    def displaced(self, factor: float | None = None) -> pv.UnstructuredGrid:
        """The grid moved by its `displacement` (n, 3) times a factor; if none is given, by so much
        that it is seen.

        Raises
        ------
        ValueError
            If it has no displacement.
        """
        if "displacement" not in self._grid.point_data:
            raise ValueError(
                "this grid has no point data of the name displacement; take that of a field, "
                "field.to_pyvista()"
            )
        largest = float(np.linalg.norm(self._grid["displacement"], axis=1).max(initial=0.0))
        if factor is None:
            factor = SHOWN * self._grid.length / largest if largest else 1.0
        return self._grid.warp_by_vector("displacement", factor=factor)
