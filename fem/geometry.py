"""The map from the reference element to the elements of a mesh."""

import numpy as np

from fem.elements import shape_derivatives, tetrahedron_rule
from meshes import MeshError, TetMesh
from meshes.tetmesh import EDGES, Floats


def is_straight(mesh: TetMesh) -> bool:
    """Whether every mid-side node lies in the middle of its edge."""
    if mesh.order == 1:
        return True
    ends = mesh.points[mesh.tets[:, EDGES]]
    middles = mesh.points[mesh.tets[:, 4:]]
    bow = np.abs(2 * middles - ends[:, :, 0] - ends[:, :, 1]).max()
    return bool(bow < 1e-10 * np.abs(ends[:, :, 0] - ends[:, :, 1]).max())


def shape_nodes(mesh: TetMesh) -> Floats:
    """The nodes (e, a, 3) that give each element its shape: the corners of straight ones."""
    return mesh.points[mesh.tets[:, :4] if is_straight(mesh) else mesh.tets]


def gradients(nodes: Floats, n_nodes: int, degree: int, first: int) -> tuple[Floats, Floats]:
    """Shape gradients (e, q, i, a) and quadrature volumes (e, q); `nodes` (e, a, i) give shape."""
    derivatives = shape_derivatives(tetrahedron_rule(degree)[0], n_nodes)
    cofactors, determinants, volumes = jacobians(nodes, degree, first)
    inverse = cofactors / determinants[..., None, None]
    return np.matmul(inverse.swapaxes(2, 3), derivatives.transpose(0, 2, 1)), volumes


def jacobians(nodes: Floats, degree: int, first: int) -> tuple[Floats, Floats, Floats]:
    """Cofactors (e, q, l, i) and determinants (e, q) of the map from the reference element, and
    quadrature volumes (e, q). Four nodes span a straight element, where q is 1 for the first two.
    """
    barycentric, weights = tetrahedron_rule(degree)
    at = barycentric[:1] if nodes.shape[1] == 4 else barycentric
    jacobian = np.einsum(
        "qal,eai->eqli", shape_derivatives(at, nodes.shape[1]), nodes, optimize=True
    )
    x, y, z = (jacobian[..., i] for i in range(3))
    cofactors = np.empty_like(jacobian)
    for l in range(3):  # noqa: E741 - the letter of the derivatives
        m, n = (l + 1) % 3, (l + 2) % 3
        cofactors[..., l, 0] = y[..., m] * z[..., n] - z[..., m] * y[..., n]
        cofactors[..., l, 1] = z[..., m] * x[..., n] - x[..., m] * z[..., n]
        cofactors[..., l, 2] = x[..., m] * y[..., n] - y[..., m] * x[..., n]
    determinants = (jacobian[..., 0, :] * cofactors[..., 0, :]).sum(axis=-1)
    inverted = np.flatnonzero((determinants <= 0).any(axis=1))
    if len(inverted):
        raise MeshError(
            f"element {first + inverted[0]} is inverted (and {len(inverted) - 1} more near it); "
            "straighten its mid-side nodes or remesh"
        )
    return cofactors, determinants, determinants * weights / 6
