"""The remedy against locking: dilatation as a projection sees it.

Where a solid is nearly incompressible its stiffness against dilatation acts on the projection of
div u onto linear functions over clusters of elements, each of which has an edge inside it. The
middle of that edge can follow the slope of the pressure, which makes it a stable pair with errors
of the displacement's own orders, 3 in L2 and 2 in the H1 seminorm, at any Poisson's ratio
(macroelements: Stenberg, Math Comp 42:9, 1984, and Comput Methods Appl Mech Eng 63:261, 1987).
The pressure is condensed in its cluster: no unknowns are added, and K stays positive definite.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from fem.elements import shape_functions, tetrahedron_rule
from fem.geometry import gradients, is_straight
from meshes import TetMesh, boundary_facets
from meshes.tetmesh import EDGES, FACES, Floats, Ints


def projected_dilatation(mesh: TetMesh) -> sparse.bsr_array:
    """D (4 c, 3 n) of a mesh of ten-node tetrahedra in c clusters: |D u|^2 is the integral of the
    squared projection of div u.
    """
    cluster, sloping = clusters(mesh)
    barycentric, _ = tetrahedron_rule(2)
    nodes = mesh.points[mesh.tets[:, :4] if is_straight(mesh) else mesh.tets]
    slopes, volumes = gradients(nodes, 10, 2, 0)
    x = np.einsum("qa,eai->eqi", shape_functions(barycentric, nodes.shape[1]), nodes)
    q = _centred(x, volumes, cluster)
    q[..., 1:] *= sloping[cluster, None, None]  # elsewhere the mean alone

    products = np.einsum("eq,eqv,eqw->evw", volumes, q, q).reshape(-1, 16)
    moments = np.stack([np.bincount(cluster, p) for p in products.T], axis=1).reshape(-1, 4, 4)
    moments[~sloping, 1:, 1:] = np.eye(3)
    orthonormal = np.linalg.inv(np.linalg.cholesky(moments))

    values = np.einsum("eq,eqv,eqia->eavi", volumes, q, slopes, optimize=True).reshape(-1, 4, 3)
    starts = 10 * np.arange(len(cluster) + 1)
    by_element = sparse.bsr_array(
        (values, mesh.tets.ravel(), starts), shape=(4 * len(cluster), mesh.n_dofs)
    )
    order = np.argsort(cluster, kind="stable")
    starts = np.searchsorted(cluster[order], np.arange(len(moments) + 1))
    return sparse.bsr_array((orthonormal[cluster[order]], order, starts)) @ by_element


def clusters(mesh: TetMesh) -> tuple[Ints, NDArray[np.bool_]]:
    """Which cluster (e,) each element is in, and whether each cluster (c,) has an edge inside it.

    A cluster is all elements around an inner edge, the longest ones first: in a box that is split
    along a diagonal, the box. An element left between joins a neighbour, or stays alone without.
    """
    middles, ends = mesh.tets[:, 4:], mesh.points[mesh.tets[:, EDGES]]
    lengths = np.linalg.norm(ends[:, :, 0] - ends[:, :, 1], axis=2)
    around = np.bincount(middles.ravel(), minlength=len(mesh.points))
    around[boundary_facets(mesh.tets)[:, 3:]] = -1  # of edges that are not inside
    edge = np.full(len(middles), -1)  # what each element is around, by the edge's middle node
    while True:
        untaken = np.bincount(middles[edge < 0].ravel(), minlength=len(around)) == around
        reach = np.where(untaken[middles], lengths, 0.0)
        longest = middles[np.arange(len(reach)), reach.argmax(axis=1)]
        wishing = reach.any(axis=1)
        agreed = np.bincount(longest[wishing], minlength=len(around)) == around
        taken = wishing & agreed[longest]
        if not taken.any():
            break
        edge[taken] = longest[taken]
    beyond = _neighbours(mesh.tets)
    while True:
        theirs = np.where(beyond >= 0, edge[beyond], -1)
        size = np.where(theirs >= 0, np.bincount(edge[edge >= 0])[theirs], len(edge))
        smallest = size.argmin(axis=1)
        joining = (edge < 0) & (theirs >= 0).any(axis=1)
        if not joining.any():
            break
        edge[joining] = theirs[joining, smallest[joining]]
    alone = np.flatnonzero(edge < 0)
    edge[alone] = len(around) + alone
    names, cluster = np.unique(edge, return_inverse=True)
    return cluster, names < len(around)


def _centred(x: Floats, volumes: Floats, cluster: Ints) -> Floats:
    """1 and the coordinates from the middle of each cluster over its size (e, q, 4), at x."""
    size = np.bincount(cluster, volumes.sum(axis=1))
    moments = np.einsum("eq,eqi->ie", volumes, x)
    middle = np.stack([np.bincount(cluster, m) for m in moments], axis=1) / size[:, None]
    q = np.ones((*volumes.shape, 4))
    q[..., 1:] = (x - middle[cluster, None]) / np.cbrt(size)[cluster, None, None]
    return q


def _neighbours(tets: Ints) -> Ints:
    """The element (e, 4) beyond each facet, -1 where there is none."""
    facets = np.sort(tets[:, FACES[:, :3]].reshape(-1, 3), axis=1)
    order = np.lexsort(facets.T)
    same = (facets[order[1:]] == facets[order[:-1]]).all(axis=1)
    one, other = order[:-1][same], order[1:][same]
    beyond = np.full(len(facets), -1)
    beyond[one], beyond[other] = other // 4, one // 4
    return beyond.reshape(-1, 4)
