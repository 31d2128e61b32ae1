"""Hands: a palm from its parameters, or the body in a file, meshed for the focus above it."""

import numpy as np

from meshes import (
    Grading,
    MeshError,
    TetMesh,
    body_from_file,
    boundary_facets,
    graded,
    named,
    palm_mesh,
    quadratic,
)
from meshes.facets import seen_from_above
from meshes.intake import FINE_RADIUS, GROWTH
from meshes.tetmesh import Floats, Ints
from skinwave.scene import Body

KINDS = ("palm", "mesh")
COARSEST = 2.0  # cells far from the middle, over those of h
DOWNWARDS = -0.7  # z of the normals of what rests on bone


def hand(body: Body, h: float) -> TetMesh:
    """Ten-node tetrahedra of h in metre about the middle of the palm, growing away from it.

    The facet sets are those of a slab: `top`, seen from above; `bottom`, which looks downwards and
    rests on bone; `sides`, where a palm ends at the wrist and the fingers and a body from a file
    was cut. A mesh in a file keeps its own, but for a `bottom` of all that is not seen from above,
    which is what `meshes.body_from_file` calls so: of that the part that looks downwards is taken.

    Raises
    ------
    MeshError
        If the body cannot be meshed, or its file tells regions apart.
    """
    if body.kind == "palm":
        # Cells wider than the rim is round would cut it off, and waves come back from the rim.
        coarsest = min(COARSEST * h, max(h, 2 * body.relief.edge_radius))
        sizing = graded(h, Grading(radius=FINE_RADIUS, growth=GROWTH, coarsest=coarsest))
        mesh = palm_mesh(body.palm, h, sizing=sizing)
        cut = [mesh.facets["wrist"], mesh.facets["fingers"]]
    else:
        mesh = quadratic(body_from_file(body.file, h, unit=body.unit, up=body.up))
        _check_regions(body.file, mesh)
        cut = [mesh.facets[name] for name in ("cut", "sides") if name in mesh.facets]
    facets = {"top": mesh.facets["top"], "sides": np.vstack([mesh.facets["top"][:0], *cut])}
    if body.kind == "palm" or _is_rest(mesh):
        mesh = named(mesh, bottom=lambda centroids, normals: normals[:, 2] < DOWNWARDS)
    facets["bottom"] = mesh.facets["bottom"]
    return TetMesh(points=mesh.points, tets=mesh.tets, facets=facets)


def _check_regions(file: str, mesh: TetMesh) -> None:
    if (count := len(np.unique(mesh.region))) > 1:
        raise MeshError(
            f"{file} has {count} regions, but a body from a file is of one material or of layers "
            "below its top; save it as one region and describe its layers in the scene"
        )


def _is_rest(mesh: TetMesh) -> bool:
    """Whether `bottom` is all that is not seen from above, but for what was cut."""
    unseen = boundary_facets(mesh.tets)[~seen_from_above(mesh)]
    cut = _corners(mesh.facets["cut"]) if "cut" in mesh.facets else set()
    return _corners(mesh.facets["bottom"]) | cut == _corners(unseen) | cut


def _corners(facets: Ints) -> set[tuple[int, ...]]:
    """The corners of each facet, in rising order."""
    return set(map(tuple, np.sort(facets[:, :3], axis=1).tolist()))


def depths(mesh: TetMesh) -> Floats:
    """How far (m,) in metre the middle of each tetrahedron lies below the top, along the beam."""
    from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

    seen = mesh.points[np.unique(mesh.facets["top"])]
    middles = mesh.points[mesh.tets[:, :4]].mean(axis=1)
    height = LinearNDInterpolator(seen[:, :2], seen[:, 2])(middles[:, :2])
    beside = np.isnan(height)
    height[beside] = NearestNDInterpolator(seen[:, :2], seen[:, 2])(middles[beside, :2])
    return height - middles[:, 2]
