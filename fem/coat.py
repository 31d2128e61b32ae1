"""Coat: thin elastic layers at a surface, as a laminated Kirchhoff shell on its facets.

A layer thinner than elements resolve keeps its normals straight, normal and of one length,

    u(z) = u + z d,   d = -t^k (n . u,k),   -thickness <= z <= 0 along the outward normal n,

and carries plane stress, with lam* = 2 lam mu / (lam + 2 mu). With the stiffness K(z) of a membrane
per thickness at z and the change d = T u of the normal at each node of a facet, its stiffness is

    A + B T + (B T)^T + T^T D T,    A, B, D = int (1, z, z^2) K(z) dz

(Reddy, Mechanics of Laminated Composite Plates and Shells (2004), chapter 3). The volume is meshed
up to the surface with its own material, which is subtracted in K(z) and carries the normal stress:
an effective boundary condition of first order in the thickness (Bovik, J Appl Mech 61:162 (1994)).

The slope is not continuous between facets. The turn [d] of one facet against the next is bound by
the interior penalty method (Engel et al., Comput Methods Appl Mech Eng 191:3669 (2002); Brenner and
Sung, J Sci Comput 22:83 (2005)),

    - int {m} [d] ds - (int {m} [d] ds)^T + int a [d] [d] ds,    m = n . int z s dz . n,

of the bending moment m across the edge, with its normal n in the surface, the mean {} of both
sides, and a penalty a. Rotary inertia is left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from fem.boundary import owners
from fem.elements import TRIANGLE_EDGES, shape_derivatives, shape_functions, triangle_rule
from fem.load_and_probe import facet_areas
from fem.maxwell import Matrices, property_of, viscoelastic
from fem.typing import Bools, Floats, Ints
from meshes import TetMesh, facet_set
from simple_model.layers.material import Material

QUADRATIC = 6  # nodes of a facet
STATIONS, STATION_WEIGHTS = np.polynomial.legendre.leggauss(2)  # through each layer, along edges
# Penalty over D L / A, D the bending stiffness of a facet of area A and L its edge's length. From
# this on the stiffness of a facet bounds its moments at three edges: int m^2 ds <= L/A int m^2 dA
# of the constant moments of quadratic facets. More of it makes bending stiffer than it is, to
# three times the error of a coat of 1 mm on elements of 3 mm; with 0.85 some modes are negative.
PENALTY = 3 / 4


@dataclass(frozen=True, kw_only=True, eq=False)
class Coat:
    """Coat of thin layers just below the surface of a mesh, in place of the material there:
    materials and thicknesses in metre from the surface downwards, on facets, a set's name or nodes
    (e, a). Layers that do not match or thicknesses that are not finite and above 0 raise a
    ValueError.
    """

    materials: tuple[Material, ...]
    thicknesses: tuple[float, ...]
    facets: str | Ints = "top"

    def __post_init__(self) -> None:
        if not self.materials or len(self.materials) != len(self.thicknesses):
            raise ValueError(
                f"a coat has {len(self.materials)} materials and {len(self.thicknesses)} "
                "thicknesses; give as many of each, one or more, from the surface downwards"
            )
        if not all(0 < thickness < np.inf for thickness in self.thicknesses):
            raise ValueError(
                f"thicknesses of a coat are {self.thicknesses} m; each must be finite and above 0"
            )

    @property
    def stations(self) -> tuple[Floats, Floats, Ints]:
        """Gauss points through the layers: heights z (s,) and weights (s,) in metre, and the layer
        (s,) of each.
        """
        t = np.array(self.thicknesses)
        middles = t / 2 - np.cumsum(t)
        z, weight = middles[:, None] + t[:, None] / 2 * STATIONS, t[:, None] / 2 * STATION_WEIGHTS
        return z.ravel(), weight.ravel(), np.arange(len(t)).repeat(len(STATIONS))


@dataclass(frozen=True, kw_only=True, eq=False)
class Surface:
    """Surface of a coat: `nodes` (n,) of the mesh and `facets` (e, a) among them, with the `points`
    (e, a, i) and unit `normals` (e, a, i) of each facet at its nodes, its operator `turn`
    (e, 3 a, 3 a), T, and its `edges`.
    """

    nodes: Ints
    facets: Ints
    points: Floats
    normals: Floats
    turn: Floats
    edges: Edges


@dataclass(frozen=True, kw_only=True, eq=False)
class Edges:
    """Edges across which a coat bends, from each side h: the `facet` (h,) and the number of the
    `edge` (h,); at points q of it, the same from both sides, the `slopes` (h, q, a, d) of the shape
    functions, unit `conormals` (h, q, i) out of the facet, `lengths` (h, q) in metre and the turn
    `outwards` (h, q, 3 a) of the facet's normal; `sides` (h,) is 2 where a mirror image is the
    other side, else 1.
    """

    facet: Ints
    edge: Ints
    slopes: Floats
    conormals: Floats
    lengths: Floats
    outwards: Floats
    sides: Ints


def surface_of(mesh: TetMesh, coat: Coat, fixed: Bools) -> Surface:
    """Surface of a coat on ten-node tetrahedra, whose normals do not turn at a border that is fixed
    in the direction across it, by the fixed dofs (3 n,). Linear facets raise a ValueError.
    """
    of_mesh = facet_set(mesh, coat.facets)
    if of_mesh.shape[1] != QUADRATIC:
        raise ValueError(
            f"facets of a coat have {of_mesh.shape[1]} nodes, and bend with {QUADRATIC}; make the "
            "mesh with order=2"
        )
    nodes, facets = np.unique(of_mesh, return_inverse=True)
    facets, points = facets.reshape(of_mesh.shape), mesh.points[of_mesh]
    at_nodes = np.vstack([np.eye(3), np.eye(3)[TRIANGLE_EDGES].mean(axis=1)])
    slopes = np.broadcast_to(shape_derivatives(at_nodes, QUADRATIC), (len(facets), 6, 6, 2))
    tangents, normals = _frames(points, slopes)
    size = 3 * QUADRATIC
    turn = -np.einsum("eaid,eabd,eaj->eaibj", np.linalg.pinv(tangents), slopes, normals)
    return Surface(
        nodes=nodes, facets=facets, points=points, normals=normals,
        turn=turn.reshape(-1, size, size),
        edges=_edges(facets, points, fixed.reshape(-1, 3)[of_mesh]),
    )  # fmt: skip


def _frames(points: Floats, slopes: Floats) -> tuple[Floats, Floats]:
    """Tangents (e, q, d, i) and unit normals (e, q, i) where shape functions have the slopes
    (e, q, a, d), of facets with nodes at points (e, a, i).
    """
    tangents = np.einsum("eqad,eai->eqdi", slopes, points)
    normals = np.cross(tangents[:, :, 0], tangents[:, :, 1])
    return tangents, normals / np.linalg.norm(normals, axis=2, keepdims=True)


def _edges(facets: Ints, points: Floats, held: Bools) -> Edges:
    """Edges of facets (e, a) with nodes at points (e, a, i), of which components (e, a, i) are
    held: all but the free border.
    """
    ends = facets[:, TRIANGLE_EDGES].reshape(-1, 2)
    _, edge, sides = np.unique(
        np.sort(ends, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    edge = edge.ravel()
    facet, k = np.divmod(np.arange(len(ends)), 3)
    # From the end with the lower number to the other, so that both sides have the same points.
    s = np.where((ends[:, 0] < ends[:, 1])[:, None], STATIONS, -STATIONS)[..., None]
    start, end = np.eye(3)[TRIANGLE_EDGES[k]].swapaxes(0, 1)[:, :, None]
    at = ((1 - s) * start + (1 + s) * end) / 2
    slopes = shape_derivatives(at.reshape(-1, 3), QUADRATIC).reshape(*at.shape[:2], QUADRATIC, 2)
    tangents, normals = _frames(points[facet], slopes)
    along = np.einsum("hd,hqdi->hqi", (end - start)[:, 0, 1:], tangents)
    length = np.linalg.norm(along, axis=2)
    conormals = np.cross(along / length[..., None], normals)
    gradient = np.einsum("hqid,hqi,hqad->hqa", np.linalg.pinv(tangents), conormals, slopes)
    outwards = -np.einsum("hqa,hqj->hqaj", gradient, normals)
    border = sides[edge] == 1
    across = np.abs(conormals).sum(axis=1).argmax(axis=1)
    of_edge = np.c_[TRIANGLE_EDGES, 3 + np.arange(3)][k]
    mirrored = border & held[facet[:, None], of_edge, across[:, None]].all(axis=1)
    kept = mirrored | ~border
    return Edges(
        facet=facet[kept], edge=np.unique(edge[kept], return_inverse=True)[1],
        slopes=slopes[kept], conormals=conormals[kept],
        lengths=length[kept] * STATION_WEIGHTS / 2,
        outwards=outwards[kept].reshape(kept.sum(), len(STATIONS), -1),
        sides=np.where(mirrored, 2, 1)[kept],
    )  # fmt: skip


def coat_stiffness(surface: Surface, coat: Coat, mu: Floats, lam: Floats) -> sparse.csr_array:
    """Stiffness (3 n, 3 n) in N/m of a coat on a surface of n nodes, by Lame's parameters (layers,
    e) in Pa, of plane stress, less those of the material that it replaces.
    """
    T, local = surface.turn, np.zeros_like(surface.turn)
    for z, weight, layer in zip(*coat.stations, strict=True):
        points = surface.points + z * surface.normals
        K = weight * membrane_stiffness(points, mu[layer], lam[layer])
        KT = z * K @ T
        local += K + KT + KT.swapaxes(1, 2) + z * T.swapaxes(1, 2) @ KT
    within = _summed(local, surface.facets, len(surface.nodes))
    return (within + _edge_stiffness(surface, coat, mu, lam)).tocsr()


def _edge_stiffness(surface: Surface, coat: Coat, mu: Floats, lam: Floats) -> sparse.csr_array:
    """Stiffness (3 n, 3 n) of the edges of a coat, by the jump [d] and the mean moment {m} at
    points of each, in rows.
    """
    edges, points = surface.edges, len(STATIONS)
    moment, bending = _moments(surface, coat, mu, lam)
    corners = surface.points[edges.facet, :3]
    area = np.linalg.norm(np.cross(*np.diff(corners, axis=1).swapaxes(0, 1)), axis=1) / 2
    penalty = PENALTY * edges.sides * bending * edges.lengths.sum(axis=1) / area
    lengths = np.zeros((edges.edge.max(initial=-1) + 1, points))
    lengths[edges.edge] = edges.lengths / edges.sides[:, None]
    weights = lengths * np.bincount(edges.edge, penalty, len(lengths))[:, None]

    dofs = _dofs(surface.facets[edges.facet]).reshape(len(edges.facet), 1, -1)
    rows = points * edges.edge[:, None, None] + np.arange(points)[:, None]
    size = np.broadcast_shapes(dofs.shape, rows.shape)
    at = [np.broadcast_to(x, size).astype(np.int32).ravel() for x in (rows, dofs)]

    def of_both(values: Floats) -> sparse.csr_array:
        """Sum (edges q, 3 n) of values (h, q, 3 a) of both sides."""
        whole = (edges.sides[:, None, None] * values).ravel()
        return sparse.csr_array((whole, at), shape=(lengths.size, 3 * len(surface.nodes)))

    jump, mean = of_both(edges.outwards), of_both(moment / 2)
    work = jump.T @ mean.multiply(lengths.reshape(-1, 1))
    return (jump.T @ jump.multiply(weights.reshape(-1, 1)) - work - work.T).tocsr()


def _moments(surface: Surface, coat: Coat, mu: Floats, lam: Floats) -> tuple[Floats, Floats]:
    """Bending moments across edges (h, q, 3 a), newton per displacement, and bending stiffnesses
    (h,) in N m, from each side.
    """
    edges, facet = surface.edges, surface.edges.facet
    moment, bending = np.zeros_like(edges.outwards), np.zeros(len(facet))
    for z, weight, layer in zip(*coat.stations, strict=True):
        points = (surface.points + z * surface.normals)[facet]
        tangents, _ = _frames(points, edges.slopes)
        dual = np.linalg.pinv(tangents)
        gradient = np.einsum("hqid,hqad->hqai", dual, edges.slopes)
        # In the tangent plane there, so that a rotation strains nothing.
        across = np.einsum("hqi,hqid,hqdj->hqj", edges.conormals, dual, tangents)
        gradient_across = np.einsum("hqai,hqi->hqa", gradient, across)[..., None]
        two_mu, lam_there = 2 * mu[layer, facet], lam[layer, facet]
        per = (slice(None), None, None, None)
        stress = lam_there[per] * gradient + two_mu[per] * gradient_across * across[:, :, None]
        stress = stress.reshape(moment.shape)
        moment += weight * z * (stress + z * stress @ surface.turn[facet])
        bending += weight * z**2 * (lam_there + two_mu)
    return moment, bending


def membrane_stiffness(points: Floats, mu: Floats, lam: Floats) -> Floats:
    """Stiffness (e, 3 a, 3 a) in Pa, N/m per thickness, of curved membranes with nodes at points
    (e, a, 3), by Lame's parameters (e,) of plane stress.

        K_ai,bj = int lam A_ai A_bj + mu (A_aj A_bi + G_ka G_kb F_ki F_kj) dA,  A_ai = G_ka F_ki

    with an orthonormal tangent frame F and the slopes G along it.
    """
    barycentric, weights = triangle_rule()
    derivatives = shape_derivatives(barycentric, points.shape[1])
    tangents = np.einsum("qad,eai->eqid", derivatives, points)
    F, J = np.linalg.qr(tangents)  # t_d = F_k J_kd
    area = np.abs(np.linalg.det(J)) / 2 * weights
    G = np.einsum("eqdk,qad->eqka", np.linalg.inv(J), derivatives)
    A = np.einsum("eqka,eqik->eqai", G, F)
    K = np.einsum("eq,eqai,eqbj->eaibj", lam[:, None] * area, A, A, optimize=True)
    mu_area = mu[:, None] * area
    K += np.einsum("eq,eqaj,eqbi->eaibj", mu_area, A, A, optimize=True)
    along, across = F @ F.swapaxes(2, 3), G.swapaxes(2, 3) @ G
    K += np.einsum("eq,eqab,eqij->eaibj", mu_area, across, along, optimize=True)
    size = 3 * points.shape[1]
    return K.reshape(-1, size, size)


def coat_mass(surface: Surface, coat: Coat, density: Floats) -> sparse.csr_array:
    """Mass (3 n, 3 n) in kg of a coat, int rho N_a N_b dA dz, by the density (layers, e), less that
    of the material that it replaces.
    """
    facets = surface.facets
    N = shape_functions(triangle_rule()[0], facets.shape[1])
    local = np.zeros((*facets.shape, facets.shape[1]))
    for z, weight, layer in zip(*coat.stations, strict=True):
        normals = facet_areas(surface.points + z * surface.normals)[1]
        area = weight * density[layer][:, None] * np.linalg.norm(normals, axis=2)
        local += np.einsum("eq,qa,qb->eab", area, N, N, optimize=True)
    return _summed(np.einsum("eab,ij->eaibj", local, np.eye(3)), facets, len(surface.nodes))


def coat_operators(
    mesh: TetMesh,
    coat: Coat,
    materials: list[Material],
    region: Ints,
    fixed: Bools,
) -> Matrices:
    """Contribution of a coat to K, C, M and the branches of a body of materials, by the index (m,)
    of each element's, on all dofs of its mesh, of which some (3 n,) are fixed.
    """
    surface, layers = surface_of(mesh, coat, fixed), len(coat.materials)
    behind = region[owners(mesh, facet_set(mesh, coat.facets))]
    all_of_them = [*(m.without_loss_factor() for m in coat.materials), *materials]
    mu, lam = (property_of(all_of_them, name) for name in ("shear_modulus", "first_lame"))
    lam = 2 * lam * mu / (lam + 2 * mu)

    def excess(values: Floats) -> Floats:
        """Values (layers, e) of the coat, less those of the material that it replaces."""
        return values[:layers, None] - values[layers:][behind]

    def stiffness(share: Floats) -> sparse.csr_array:
        K = coat_stiffness(surface, coat, excess(share * mu), excess(share * lam))
        return _on_mesh(surface, K, mesh.n_dofs)

    def mass(density: Floats) -> sparse.csr_array:
        return _on_mesh(surface, coat_mass(surface, coat, excess(density)), mesh.n_dofs)

    return viscoelastic(all_of_them, stiffness, mass)


def _on_mesh(surface: Surface, operator: sparse.csr_array, n_dofs: int) -> sparse.csr_array:
    """An operator (3 n, 3 n) of a surface on the dofs of the whole mesh."""
    dofs = _dofs(surface.nodes).ravel()
    part = operator.tocoo()
    return sparse.csr_array((part.data, (dofs[part.row], dofs[part.col])), shape=(n_dofs, n_dofs))


def _summed(local: Floats, facets: Ints, n: int) -> sparse.csr_array:
    """Sum (3 n, 3 n) of matrices (e, a, i, b, j) of facets (e, a) among n nodes."""
    dofs = _dofs(facets).reshape(len(facets), -1)
    size = (*dofs.shape, dofs.shape[1])
    rows, columns = np.broadcast_to(dofs[:, :, None], size), np.broadcast_to(dofs[:, None], size)
    return sparse.csr_array((local.ravel(), (rows.ravel(), columns.ravel())), shape=(3 * n, 3 * n))


def _dofs(nodes: Ints) -> Ints:
    """Dofs (..., 3) of nodes (...), of a type that keeps the indices of matrices small."""
    first = 3 * nodes[..., None].astype(np.int32)
    return np.asarray(first + np.arange(3, dtype=np.int32), np.int32)
