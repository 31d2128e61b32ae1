"""Tetrahedral bodies: what the moving pressure drives."""

from meshes.structured import (
    Grading,
    block,
    extrude,
    extruded,
    graded_axis,
    middle_plane,
    sheet,
)
from meshes.tetmesh import (
    MeshError,
    TetMesh,
    boundary_facets,
    corner_volumes,
    facet_set,
    half,
    quadratic,
)

__all__ = [
    "Grading",
    "MeshError",
    "TetMesh",
    "block",
    "boundary_facets",
    "corner_volumes",
    "extrude",
    "extruded",
    "facet_set",
    "graded_axis",
    "half",
    "middle_plane",
    "quadratic",
    "sheet",
]
