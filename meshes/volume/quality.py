"""Quality of tetrahedra: angles, sizes and distortion, and whether they are one body."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations

import numpy as np

from meshes.elements import shape_derivatives, tetrahedron_rule
from meshes.surface.repair import check_crossings, check_manifold, in_mm
from meshes.surface.triangulation import compact, connected_components
from meshes.tetmesh import (
    EDGES,
    FACES,
    MeshError,
    TetMesh,
    boundary_facets,
    corner_volumes,
    neighbours,
    part,
)
from meshes.typing import Floats, Ints


def dihedral_angles(mesh: TetMesh) -> Floats:
    """Return the angles (m, 6) in degrees between the faces of each straight tetrahedron."""
    return angles_between_faces(mesh.points, mesh.tets)


def angles_between_faces(points: Floats, tets: Ints) -> Floats:
    """Return the dihedral angles (m, 6) in degrees of tetrahedra (m, 4 or 10), not inverted."""
    faces = points[tets[:, FACES[:, :3]]]
    normals = np.cross(faces[:, :, 1] - faces[:, :, 0], faces[:, :, 2] - faces[:, :, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), 1e-300)
    a, b = np.array(list(combinations(range(4), 2))).T
    cosine = np.einsum("eki,eki->ek", normals[:, a], normals[:, b])
    return np.degrees(np.pi - np.arccos(np.clip(cosine, -1, 1)))


def edge_lengths(mesh: TetMesh) -> Floats:
    """Return the lengths (m, 6) in m of the straight edges of each tetrahedron."""
    ends = mesh.points[mesh.tets[:, EDGES]]
    return np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)


def jacobian_ratios(points: Floats, tets: Ints) -> Floats:
    """Return the smallest ratio (m,) of det J of each 10-node element to that of its straight
    element.

    It is evaluated at the corners, the edge middles and the four Gauss points: 1 without curved
    edges, 0 or negative for a folded element.
    """
    nodes, ratio = points[tets], np.full(len(tets), np.inf)
    straight = 6 * corner_volumes(points, tets)
    corners, gauss = np.eye(4), tetrahedron_rule(2)[0]
    at = np.vstack([corners, corners[EDGES].mean(axis=1), gauss])
    for derivatives in shape_derivatives(at, 10):
        jacobians = np.einsum("eai,ad->edi", nodes, derivatives)
        ratio = np.minimum(ratio, np.linalg.det(jacobians) / straight)
    return ratio


def restore_bad(
    points: Floats, moved: Floats, tets: Ints, are_bad: Callable[[Floats], np.ndarray]
) -> tuple[Floats, int]:
    """Return moved points (n, 3), restored until no element (m, a) is bad, and how many were."""
    count = 0
    while True:
        nodes = np.unique(tets[are_bad(moved)])
        nodes = nodes[(moved[nodes] != points[nodes]).any(axis=1)]
        if not len(nodes):
            return moved, count
        moved[nodes] = points[nodes]
        count += len(nodes)


def check_one_body(
    mesh: TetMesh, *, keep_largest: bool = False, say: Callable[[str], None] = print
) -> TetMesh:
    """Return a mesh, or its largest body if `keep_largest`.

    Raises a MeshError if tetrahedra overlap or form several bodies, or if their boundary is open,
    touches itself at a point, or intersects itself.
    """
    _check_overlaps(mesh)
    beyond = neighbours(mesh.tets)
    tet, face = np.nonzero(beyond >= 0)
    body = connected_components(len(mesh.tets), np.column_stack([tet, beyond[tet, face]]))
    volumes = np.bincount(body, corner_volumes(mesh.points, mesh.tets))
    if len(volumes) > 1 and not keep_largest:
        listed = ", ".join(f"{1e6 * volume:.3g}" for volume in np.sort(volumes)[::-1][:5])
        raise MeshError(
            f"the mesh consists of {len(volumes)} separate bodies ({listed} cm3); join them, or "
            "keep the largest with skinwave mesh FILE --keep largest"
        )
    if len(volumes) > 1:
        share = volumes.max() / volumes.sum()
        say(f"kept the largest of {len(volumes)} bodies, {100 * share:.1f} % of the volume")
        mesh = part(mesh, body == volumes.argmax())[0]
    boundary = compact(mesh.points, boundary_facets(mesh.tets)[:, :3])
    check_manifold(boundary)
    check_crossings(boundary)
    return mesh


def _check_overlaps(mesh: TetMesh) -> None:
    """Refuse tetrahedra that lie on the same side of a common facet."""
    faces = mesh.tets[:, FACES[:, :3]].reshape(-1, 3)
    low = faces.argmin(axis=1)[:, None]
    cyclic = np.take_along_axis(faces, (low + np.arange(3)) % 3, axis=1)  # from the lowest node
    _, place, count = np.unique(cyclic, axis=0, return_index=True, return_counts=True)
    twice = place[count > 1]
    if len(twice):
        middle = in_mm(mesh.points[faces[twice[0]]].mean(axis=0))
        raise MeshError(
            f"tetrahedra of the mesh overlap at {len(twice):,} of their faces, first near "
            f"{middle}; mesh the body again"
        )
