"""The map from the reference element to the elements of a mesh."""

from collections.abc import Iterator

import numpy as np

from fem.elements import shape_derivatives, tetrahedron_rule
from fem.sparsity import slabs
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
    """Shape gradients and quadrature volumes of tetrahedra.

    Parameters
    ----------
    nodes : (e, a, i) float, metre, that give the elements their shape
    n_nodes : number of shape functions, 4 or 10
    degree : of the quadrature
    first : number of the first element, for messages

    Returns
    -------
    gradients : (e, q, i, a) float, 1/m
    volumes : (e, q) float, m3

    Raises
    ------
    MeshError
        If an element is inverted.
    """
    derivatives = shape_derivatives(tetrahedron_rule(degree)[0], n_nodes)
    cofactors, determinants, volumes = jacobians(nodes, degree, first)
    inverse = cofactors / determinants[..., None, None]
    return np.matmul(inverse.swapaxes(2, 3), derivatives.transpose(0, 2, 1)), volumes


def gradient_products(mesh: TetMesh) -> Iterator[tuple[slice, Floats]]:
    """Integrals of products of shape gradients, some elements at a time.

    Yields
    ------
    slice of the elements
    H : (e, i, a, j, b) float, metre, int N_a,i N_b,j dV
    """
    n_nodes, shapes = mesh.tets.shape[1], shape_nodes(mesh)
    for slab in slabs(len(mesh.tets)):
        slopes, volumes = gradients(shapes[slab], n_nodes, 2, slab.start)
        e, q = volumes.shape
        G = (np.sqrt(volumes)[:, :, None, None] * slopes).reshape(e, q, 3 * n_nodes)
        yield slab, np.matmul(G.transpose(0, 2, 1), G).reshape(e, 3, n_nodes, 3, n_nodes)


def jacobians(nodes: Floats, degree: int, first: int) -> tuple[Floats, Floats, Floats]:
    """Cofactors and determinants of the map from the reference element.

    Parameters
    ----------
    nodes : (e, a, i) float, metre; four nodes span a straight element
    degree : of the quadrature
    first : number of the first element, for messages

    Returns
    -------
    cofactors : (e, q, d, i) float, m2
    determinants : (e, q) float, m3
    volumes : (e, q) float, m3, of the quadrature points

    q is 1 for the first two if elements are straight.

    Raises
    ------
    MeshError
        If an element is inverted.
    """
    barycentric, weights = tetrahedron_rule(degree)
    at = barycentric[:1] if nodes.shape[1] == 4 else barycentric
    jacobian = np.einsum(
        "qad,eai->eqdi", shape_derivatives(at, nodes.shape[1]), nodes, optimize=True
    )
    x, y, z = (jacobian[..., i] for i in range(3))
    cofactors = np.empty_like(jacobian)
    for d in range(3):
        m, n = (d + 1) % 3, (d + 2) % 3
        cofactors[..., d, 0] = y[..., m] * z[..., n] - z[..., m] * y[..., n]
        cofactors[..., d, 1] = z[..., m] * x[..., n] - x[..., m] * z[..., n]
        cofactors[..., d, 2] = x[..., m] * y[..., n] - y[..., m] * x[..., n]
    determinants = (jacobian[..., 0, :] * cofactors[..., 0, :]).sum(axis=-1)
    inverted = np.flatnonzero((determinants <= 0).any(axis=1))
    if len(inverted):
        raise MeshError(
            f"element {first + inverted[0]} is inverted (and {len(inverted) - 1} more near it); "
            "straighten its mid-side nodes or remesh"
        )
    return cofactors, determinants, determinants * weights / 6
