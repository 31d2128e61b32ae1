"""Element quality of tetrahedra: angles, sizes, and distortion by curved sides."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from meshes.tetmesh import EDGES, Floats, Ints, TetMesh, corner_volumes


def dihedral_angles(mesh: TetMesh) -> Floats:
    """Angles (m, 6) in degrees between the faces of each straight tetrahedron."""
    return angles_between_faces(mesh.points, mesh.tets)


def angles_between_faces(points: Floats, tets: Ints) -> Floats:
    """Dihedral angles (m, 6) in degrees of tetrahedra (m, 4 or 10) with positive volume."""
    corners = points[tets[:, :4]]
    faces = corners[:, [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]]]
    normals = np.cross(faces[:, :, 1] - faces[:, :, 0], faces[:, :, 2] - faces[:, :, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), 1e-300)
    a, b = np.array(list(combinations(range(4), 2))).T
    cosine = np.einsum("eki,eki->ek", normals[:, a], normals[:, b])
    return np.degrees(np.pi - np.arccos(np.clip(cosine, -1, 1)))


def edge_lengths(mesh: TetMesh) -> Floats:
    """Lengths (m, 6) in metre of the straight edges of each tetrahedron."""
    ends = mesh.points[mesh.tets[:, EDGES]]
    return np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)


def _determinants(nodes: Floats, at: Floats) -> Floats:
    """det J (m,) of 10-node elements (m, 10, 3) at barycentric coordinates (4,)."""
    by_corner = np.zeros((10, 4))  # dN / dl: l_a (2 l_a - 1) at corners, 4 l_a l_b at edges
    by_corner[range(4), range(4)] = 4 * at - 1
    by_corner[np.arange(4, 10), EDGES[:, 0]] = 4 * at[EDGES[:, 1]]
    by_corner[np.arange(4, 10), EDGES[:, 1]] = 4 * at[EDGES[:, 0]]
    slopes = np.einsum("eai,al->eli", nodes, by_corner[:, 1:] - by_corner[:, :1])
    return np.asarray(np.linalg.det(slopes))


def jacobian_ratios(points: Floats, tets: Ints) -> Floats:
    """Least ratio (m,) of det J of each 10-node element to that of the straight one.

    Taken at the corners, the middles of the edges and the four Gauss points; 1 without curved
    edges, 0 or below where the element is folded.
    """
    nodes, ratio = points[tets], np.full(len(tets), np.inf)
    straight = 6 * corner_volumes(points, tets)
    corners = np.eye(4)
    middles = (corners[EDGES[:, 0]] + corners[EDGES[:, 1]]) / 2
    gauss = np.full((4, 4), (5 - 5**0.5) / 20) + corners * 5**-0.5
    for at in np.vstack([corners, middles, gauss]):
        ratio = np.minimum(ratio, _determinants(nodes, at) / straight)
    return ratio
