"""Map from the reference element to the elements of a mesh."""

from collections.abc import Callable, Iterator

import numpy as np

from fem.sparsity import slabs
from meshes import MeshError, TetMesh
from meshes.elements import shape_derivatives, tetrahedron_rule
from meshes.tetmesh import EDGES
from simple_model.typing import Floats


def shape_nodes(mesh: TetMesh) -> Floats:
    """Return the nodes (e, a, 3) that define each element: corners if all edges are straight."""
    corners = mesh.points[mesh.tets[:, :4]]
    if mesh.order == 1:
        return corners
    first, last = mesh.points[mesh.tets[:, EDGES]].swapaxes(0, 2).swapaxes(1, 2)
    bow = np.abs(2 * mesh.points[mesh.tets[:, 4:]] - first - last).max()
    return corners if bow < 1e-10 * np.abs(first - last).max() else mesh.points[mesh.tets]


def gradients(nodes: Floats, n_nodes: int, degree: int, first: int) -> tuple[Floats, Floats]:
    """Return shape gradients (e, q, i, a) in 1/m and quadrature volumes (e, q) in m3 of tetrahedra
    with nodes (e, a, i), for `n_nodes` shape functions and a quadrature degree.
    """
    derivatives = shape_derivatives(tetrahedron_rule(degree)[0], n_nodes)
    cofactors, determinants, volumes = jacobians(nodes, degree, first)
    inverse = cofactors / determinants[..., None, None]
    return np.matmul(inverse.swapaxes(2, 3), derivatives.transpose(0, 2, 1)), volumes


def gradient_integrals(
    mesh: TetMesh, coefficients: Callable[[slice, Floats], Floats]
) -> Iterator[tuple[slice, Floats]]:
    """Yield slabs of elements and their matrices (m, e, a, b) of int c_kl N_a,k N_b,l dV.

    `coefficients` maps a slab and G (k, l, e, x) to c_kl G_kl (m, e, x). x numbers pairs of edges
    of the reference element, at each quadrature point if elements are curved.
    """
    n_nodes, shapes = mesh.tets.shape[1], shape_nodes(mesh)
    barycentric, weights = tetrahedron_rule(2)
    slopes = shape_derivatives(barycentric, n_nodes).transpose(0, 2, 1)
    edges = slopes[:, :, None, :, None] * slopes[:, None, :, None, :]
    if shapes.shape[1] == 4:  # the map is the same at all points
        edges = np.tensordot(weights, edges, 1)
    edges = edges.reshape(-1, n_nodes**2)
    for slab in slabs(len(mesh.tets)):
        cofactors, determinants, volumes = jacobians(shapes[slab], 2, slab.start)
        inverse = (cofactors / determinants[..., None, None]).transpose(3, 0, 1, 2)  # (i, e, q, d)
        if shapes.shape[1] == 4:
            volumes = volumes.sum(axis=1, keepdims=True)
        G = (volumes[..., None] * inverse)[:, None, ..., None] * inverse[None, ..., None, :]
        matrices = coefficients(slab, G.reshape(3, 3, len(volumes), -1)) @ edges
        yield slab, matrices.reshape(*matrices.shape[:2], n_nodes, n_nodes)


def jacobians(nodes: Floats, degree: int, first: int) -> tuple[Floats, Floats, Floats]:
    """Return cofactors (e, q, d, i) in m2 and determinants (e, q) in m3 of the map from the
    reference element to those with nodes (e, a, i), and volumes (e, q) of the quadrature points.

    Elements with four nodes have one q. Raises a MeshError if an element is inverted; `first` is
    the number of the first element.
    """
    barycentric, weights = tetrahedron_rule(degree)
    at = barycentric[:1] if nodes.shape[1] == 4 else barycentric
    derivatives = shape_derivatives(at, nodes.shape[1])
    x, y, z = (np.tensordot(nodes[..., i], derivatives, (1, 1)) for i in range(3))  # (e, q, d)
    cofactors = np.empty((*x.shape, 3))
    for d in range(3):
        m, n = (d + 1) % 3, (d + 2) % 3
        cofactors[..., d, 0] = y[..., m] * z[..., n] - z[..., m] * y[..., n]
        cofactors[..., d, 1] = z[..., m] * x[..., n] - x[..., m] * z[..., n]
        cofactors[..., d, 2] = x[..., m] * y[..., n] - y[..., m] * x[..., n]
    determinants = (x * cofactors[..., 0]).sum(axis=-1)
    inverted = np.flatnonzero((determinants <= 0).any(axis=1))
    if len(inverted):
        raise MeshError(
            f"element {first + inverted[0]} is inverted, and {len(inverted) - 1} more near it; "
            "straighten its mid-side nodes or remesh"
        )
    return cofactors, determinants, determinants * weights / 6
