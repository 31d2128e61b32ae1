"""Tetrahedral mesh of a palm, with its boundary nodes on the level set."""

from __future__ import annotations

from collections.abc import Callable

from meshes.facets import seen_from_above, tag_boundary
from meshes.shapes.palm import EPSILON, Palm, level_set_and_gradient, surface
from meshes.surface.level_set import project_to_level_set
from meshes.tetmesh import Floats, TetMesh, quadratic
from meshes.volume.curving import curve_boundary
from meshes.volume.smoothing import smoothed
from meshes.volume.tetrahedralise import tetrahedralise


def palm_mesh(
    palm: Palm,
    h: float,
    *,
    sizing: Callable[[Floats], Floats] | None = None,
    timeout: float = 600.0,
) -> TetMesh:
    """Ten-node tetrahedra of a palm whose boundary nodes lie on its true surface.

    Parameters
    ----------
    palm : Palm
    h, sizing, timeout : as for `tetrahedralise`, with its errors

    Returns
    -------
    TetMesh with the facet sets `surface` (all of it), `top` (what the device sees), `wrist` and
    `fingers` (the ends, which look along the hand) and `back`, the rest
    """
    # Facets of the contour must be finer than elements, or the mesher keeps its corners.
    body = surface(palm, min(h / 1.5, palm.thickness / 8))
    # Coarser than the surface of a file may be, because boundary nodes are moved onto it.
    epsilon = EPSILON * min(h, palm.thickness / 4)
    mesh = tetrahedralise(body, h, sizing=sizing, timeout=timeout, epsilon=epsilon)
    level_set = level_set_and_gradient(palm)
    even = smoothed(mesh, sizing, lambda points: project_to_level_set(points, *level_set))
    return curved_palm(palm, even)


def curved_palm(palm: Palm, mesh: TetMesh) -> TetMesh:
    """The same palm of straight tetrahedra with curved ones, and the facet sets named."""
    mesh = curve_boundary(quadratic(mesh), *level_set_and_gradient(palm))
    ends = {
        "wrist": lambda centroids, normals: normals[:, 1] < -(0.5**0.5),
        "fingers": lambda centroids, normals: normals[:, 1] > 0.5**0.5,
    }
    return tag_boundary(mesh, rest="back", top=seen_from_above(mesh), **ends)
