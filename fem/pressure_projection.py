"""Macroelement pressure projection (B-bar family) against volumetric locking.

In a nearly incompressible solid, the stiffness against dilatation acts on the L2 projection of
div u onto linear functions over macroelements, each with an edge inside it. The mid-side node of
that edge can follow the slope of the pressure, which makes this a stable mixed u-p pair with the
orders of the displacement element, 3 in L2 and 2 in the H1 seminorm, at any Poisson's ratio
(macroelements: Stenberg, Math Comp 42:9, 1984, and Comput Methods Appl Mech Eng 63:261, 1987). The
pressure is condensed in its macroelement: there are no further degrees of freedom, and K stays
positive definite.
"""

import numpy as np
from scipy import sparse

from fem.geometry import gradients, jacobians, shape_nodes
from fem.sparsity import from_entries
from meshes import TetMesh
from meshes.elements import shape_functions, tetrahedron_rule
from meshes.tetmesh import EDGES, FACES, neighbours
from simple_model.typing import Bools, Floats, Ints


def projected_divergence(mesh: TetMesh) -> sparse.bsr_array:
    """Return the matrix D (4 c, 3 n) of ten-node tetrahedra in c macroelements: D u are the
    coefficients of the projected div u in the `linear_functions`, and |D u|^2 is the integral of
    its square.
    """
    cluster, sloping = macroelements(mesh)
    return _coefficients(mesh, cluster, linear_functions(mesh, cluster, sloping))


def dilatation_operator(mesh: TetMesh, elements: Ints) -> sparse.csr_array:
    """Return the projected dilatation, a matrix (4 k, 3 n) in 1/m, at the quadrature points for
    degree 2 of some elements (k,): sum_v q_v (D u)_v.
    """
    cluster, sloping = macroelements(mesh)
    q = linear_functions(mesh, cluster, sloping)
    D = _coefficients(mesh, cluster, q)
    rows = np.arange(4 * len(elements)).reshape(-1, 4, 1)
    columns = 4 * cluster[elements, None, None] + np.arange(4)
    Q = from_entries(q[elements], rows, columns, (4 * len(elements), D.shape[0]))
    return (Q @ D).tocsr()


def _coefficients(mesh: TetMesh, cluster: Ints, q: Floats) -> sparse.bsr_array:
    """Return D of `projected_divergence` for macroelements (e,) and functions (e, q, v)."""
    slopes, volumes = gradients(shape_nodes(mesh), 10, 2, 0)
    values = np.einsum("eq,eqv,eqia->eavi", volumes, q, slopes, optimize=True).reshape(-1, 4, 3)
    starts = 10 * np.arange(len(cluster) + 1, dtype=np.int32)
    by_element = sparse.bsr_array(
        (values, mesh.tets.ravel().astype(np.int32), starts), shape=(4 * len(cluster), mesh.n_dofs)
    )
    order = np.argsort(cluster, kind="stable").astype(np.int32)
    ones = np.broadcast_to(np.eye(4), (len(cluster), 4, 4))
    starts = np.searchsorted(cluster[order], np.arange(cluster.max() + 2)).astype(np.int32)
    return sparse.bsr_array((ones, order, starts)) @ by_element


def linear_functions(mesh: TetMesh, cluster: Ints, sloping: Bools) -> Floats:
    """Return orthonormal linear pressure functions (e, q, 4) in m^-3/2 over the macroelement (e,)
    of each element, at the quadrature points for degree 2. Only the constant is nonzero in
    macroelements (c,) that are not `sloping`.
    """
    nodes = shape_nodes(mesh)
    volumes = jacobians(nodes, 2, 0)[2]
    N = shape_functions(tetrahedron_rule(2)[0], nodes.shape[1])
    x = np.einsum("qa,eai->eqi", N, nodes)
    size = np.bincount(cluster, volumes.sum(axis=1))
    moments = np.einsum("eq,eqi->ie", volumes, x)
    middle = np.stack([np.bincount(cluster, m) for m in moments], axis=1) / size[:, None]
    q = np.ones((*volumes.shape, 4))
    q[..., 1:] = (x - middle[cluster, None]) / np.cbrt(size)[cluster, None, None]
    q[..., 1:] *= sloping[cluster, None, None]
    products = np.einsum("eq,eqv,eqw->vwe", volumes, q, q).reshape(16, -1)
    products = np.stack([np.bincount(cluster, p) for p in products], axis=1).reshape(-1, 4, 4)
    products[~sloping, 1:, 1:] = np.eye(3)
    return q @ np.linalg.inv(np.linalg.cholesky(products)).swapaxes(1, 2)[cluster]


def macroelements(mesh: TetMesh) -> tuple[Ints, Bools]:
    """Return the macroelement (e,) of each element, and whether each macroelement (c,) has an inner
    edge.

    A macroelement consists of all elements around an inner edge, with the longest edges first: in a
    box split along a diagonal, the box. Remaining elements join a neighbour or stay alone.
    """
    points = mesh.points if mesh.unmoved is None else mesh.unmoved
    middles, ends = mesh.tets[:, 4:], points[mesh.tets[:, EDGES]]
    lengths = np.linalg.norm(ends[:, :, 0] - ends[:, :, 1], axis=2)
    around = np.bincount(middles.ravel(), minlength=len(mesh.points))
    beyond = neighbours(mesh.tets)
    around[mesh.tets[:, FACES[:, 3:]][beyond < 0]] = -1  # of edges on the surface
    edge = np.full(len(middles), -1)  # of each element's macroelement, by its middle node
    while True:
        is_open = np.bincount(middles[edge < 0].ravel(), minlength=len(around)) == around
        reach = np.where(is_open[middles], lengths, 0.0)
        longest = middles[np.arange(len(reach)), reach.argmax(axis=1)]
        can_join = reach.any(axis=1)
        agreed = np.bincount(longest[can_join], minlength=len(around)) == around
        joining = can_join & agreed[longest]
        if not joining.any():
            break
        edge[joining] = longest[joining]
    while True:
        theirs = np.where(beyond >= 0, edge[beyond], -1)
        size = np.bincount(edge[edge >= 0], minlength=len(around))
        smallest = np.where(theirs >= 0, size[theirs], len(edge)).argmin(axis=1)
        joining = (edge < 0) & (theirs >= 0).any(axis=1)
        if not joining.any():
            break
        edge[joining] = theirs[joining, smallest[joining]]
    alone = np.flatnonzero(edge < 0)
    edge[alone] = len(around) + alone
    names, cluster = np.unique(edge, return_inverse=True)
    return cluster, names < len(around)
