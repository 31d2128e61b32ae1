"""Tetrahedral meshes of bodies: structured, from files, and of a parametric palm."""

from meshes.curved import curved
from meshes.facets import named, seen_from_above
from meshes.files import read, write
from meshes.intake import body_from_file
from meshes.palm import Palm, palm_mesh
from meshes.quality import dihedral_angles, edge_lengths, jacobian_ratios
from meshes.ready import ready
from meshes.structured import (
    Grading,
    block,
    extrude,
    extruded,
    graded_axis,
    middle_plane,
    sheet,
)
from meshes.surface import Surface, repaired
from meshes.surface_files import read_surface
from meshes.tetmesh import (
    MeshError,
    TetMesh,
    boundary_facets,
    corner_volumes,
    facet_set,
    half,
    part,
    quadratic,
)
from meshes.tetrahedralise import graded, tetrahedralise

__all__ = [
    "Grading",
    "MeshError",
    "Palm",
    "Surface",
    "TetMesh",
    "block",
    "body_from_file",
    "boundary_facets",
    "corner_volumes",
    "curved",
    "dihedral_angles",
    "edge_lengths",
    "extrude",
    "extruded",
    "facet_set",
    "graded",
    "graded_axis",
    "half",
    "jacobian_ratios",
    "middle_plane",
    "named",
    "palm_mesh",
    "part",
    "quadratic",
    "read",
    "read_surface",
    "ready",
    "repaired",
    "seen_from_above",
    "sheet",
    "tetrahedralise",
    "write",
]
