"""Tetrahedra as an unstructured grid of VTK, and back; node order and numbers stay the same."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int_]

NODES = {4: 10, 10: 24}  # of a tetrahedron -> VTK's number of its type
EMPTY = -1  # as the nodes of a facet: of a set that has none, as no array of VTK is empty
SETS = "facets:"  # begins the names of facet sets among a grid's field data


def to_grid(points: Floats, tets: Ints, region: Ints, facets: Mapping[str, Ints]) -> Any:
    """Build an UnstructuredGrid of pyvista.

    Parameters
    ----------
    points : (n, 3) float, metre
    tets : (m, 4) or (m, 10) int
    region : (m,) int, which becomes the cell data "region"
    facets : name -> (k, 3) or (k, 6) int, which become field data, "facets:" before the name

    Returns
    -------
    pyvista.UnstructuredGrid
    """
    import pyvista as pv

    nodes = tets.shape[1]
    width = 3 if nodes == 4 else 6
    cells = np.insert(tets, 0, nodes, axis=1).ravel()
    grid = pv.UnstructuredGrid(cells, np.full(len(tets), NODES[nodes], np.uint8), points.copy())
    grid.cell_data["region"] = region.copy()
    for name, each in facets.items():
        grid.field_data[SETS + name] = each.copy() if len(each) else np.full((1, width), EMPTY)
    return grid


def of_grid(grid: Any) -> dict[str, Any]:
    """Points, tetrahedra, regions and facet sets of an UnstructuredGrid.

    Raises
    ------
    ValueError
        If it has cells other than tetrahedra of 4 nodes, or of 10.
    """
    cells = {int(kind): nodes for kind, nodes in grid.cells_dict.items()}
    if len(cells) != 1 or not set(cells) <= set(NODES.values()):
        found = ", ".join(map(str, sorted(cells))) or "none"
        raise ValueError(
            f"the grid has cells of VTK type {found}; give tetrahedra of 4 nodes (10) or of 10 (24)"
        )
    tets = next(iter(cells.values()))
    sets = {n.removeprefix(SETS): _facets(grid.field_data[n]) for n in list(grid.field_data)
            if n.startswith(SETS)}  # fmt: skip
    region = np.array(grid.cell_data["region"]) if "region" in grid.cell_data else np.zeros(0, int)
    return {"points": np.array(grid.points), "tets": tets, "region": region, "facets": sets}


def _facets(array: Any) -> Ints:
    """Facets of a set, as they were given."""
    facets = np.array(array)
    return facets[facets[:, 0] != EMPTY]
