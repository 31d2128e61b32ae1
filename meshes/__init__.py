"""Tetrahedral meshes of bodies: structured, from files, and of a parametric palm."""

from meshes.facets import tag_boundary, visible_from_above
from meshes.files.import_body import body_from_file
from meshes.files.mesh_files import read, write
from meshes.shapes.palm import Palm
from meshes.shapes.structured import (
    Grading,
    block,
    extrude,
    extrude_plane,
    graded_axis,
    middle_plane,
    sheet,
)
from meshes.surface.repair import repair
from meshes.surface.triangulation import Surface
from meshes.tetmesh import (
    MeshError,
    TetMesh,
    boundary_facets,
    corner_volumes,
    facet_set,
    half,
    interface_facets,
    part,
    quadratic,
)
from meshes.volume.curving import curve_boundary
from meshes.volume.fingertip import Fingertip, fingertip_mesh
from meshes.volume.mapped_palm import mapped_palm
from meshes.volume.quality import dihedral_angles, edge_lengths, jacobian_ratios
from meshes.volume.tetrahedralise import graded_sizing, tetrahedralise

__all__ = [
    "Fingertip", "Grading", "MeshError", "Palm", "Surface", "TetMesh", "block", "body_from_file",
    "boundary_facets", "corner_volumes", "curve_boundary", "dihedral_angles", "edge_lengths",
    "extrude", "extrude_plane", "facet_set", "fingertip_mesh", "graded_axis", "graded_sizing",
    "half", "interface_facets", "jacobian_ratios", "mapped_palm", "middle_plane", "part",
    "quadratic", "read", "repair", "sheet", "tag_boundary", "tetrahedralise", "visible_from_above",
    "write",
]  # fmt: skip
