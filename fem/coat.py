"""Coat: thin elastic layers at a surface, as a laminated Kirchhoff shell on its facets.

A layer thinner than the elements keeps its normals straight, perpendicular and of constant length,

    u(z) = u + z d,   d = -t^k (n . u,k),   -thickness <= z <= 0 along the outward normal n,

and carries plane stress, with lam* = 2 lam mu / (lam + 2 mu). With the stiffness K(z) of a membrane
per thickness at z and the change d = T u of the normal at each node of a facet, its stiffness is

    A + B T + (B T)^T + T^T D T,    A, B, D = int (1, z, z^2) K(z) dz

(Reddy, Mechanics of Laminated Composite Plates and Shells (2004), chapter 3). The volume is meshed
up to the surface with its own material. K(z) subtracts that material, which carries the normal
stress: an effective boundary condition of first order in the thickness (Bovik, J Appl Mech 61:162
(1994)).

The slope is discontinuous between facets. The interior penalty method (Engel et al., Comput Methods
Appl Mech Eng 191:3669 (2002); Brenner and Sung, J Sci Comput 22:83 (2005)) penalises the jump [d],

    - int {m} [d] ds - (int {m} [d] ds)^T + int a [d] [d] ds,    m = n . int z s dz . n,

with the bending moment m across the edge, the edge's normal n in the surface, the mean {} of both
sides, and the penalty a. Rotary inertia is neglected.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from fem.boundary import owners
from fem.combination import viscoelastic
from fem.load_and_probe import facet_geometry
from fem.maxwell import Matrices, property_of
from fem.sparsity import dofs_of, from_entries
from meshes import TetMesh, facet_set
from meshes.elements import TRIANGLE_EDGES, shape_derivatives, shape_functions, triangle_rule
from simple_model.layers.material import Material
from simple_model.typing import Bools, Floats, Ints

STATIONS, STATION_WEIGHTS = np.polynomial.legendre.leggauss(2)  # through each layer, along edges


@dataclass(frozen=True, kw_only=True, eq=False)
class Coat:
    """Thin layers just below the surface of a mesh, in place of the material there.

    Parameters
    ----------
    materials : materials of the layers, from the surface downwards
    thicknesses : thicknesses of the layers in m, finite and above 0
    facets : name of a facet set, or nodes (e, a)

    Raises
    ------
    ValueError
        If there are no layers, or numbers of materials and thicknesses differ.
    """

    materials: tuple[Material, ...]
    thicknesses: tuple[float, ...]
    facets: str | Ints = "top"

    def __post_init__(self) -> None:
        if not self.materials or len(self.materials) != len(self.thicknesses):
            raise ValueError(
                f"a coat has {len(self.materials)} materials and {len(self.thicknesses)} "
                "thicknesses; give one thickness for each material, at least one"
            )
        if not all(0 < thickness < np.inf for thickness in self.thicknesses):
            raise ValueError(
                f"a coat has thicknesses {self.thicknesses} m; give finite numbers above 0"
            )

    @property
    def stations(self) -> tuple[Floats, Floats, Ints]:
        """Gauss points through the layers: heights z and weights (s,) in m, and layers (s,)."""
        t = np.array(self.thicknesses)
        middles = t / 2 - np.cumsum(t)
        z, weight = middles[:, None] + t[:, None] / 2 * STATIONS, t[:, None] / 2 * STATION_WEIGHTS
        return z.ravel(), weight.ravel(), np.arange(len(t)).repeat(len(STATIONS))


@dataclass(frozen=True, kw_only=True, eq=False)
class Surface:
    """Surface of a coat: nodes of its `facets` (e, a) among the n nodes of a mesh with `n_dofs`,
    their `points` and unit `normals` (e, a, i), T as `turn` (e, 3 a, 3 a), and the `edges`.
    """

    n_dofs: int
    facets: Ints
    points: Floats
    normals: Floats
    turn: Floats
    edges: Edges


@dataclass(frozen=True, kw_only=True, eq=False)
class Edges:
    """Edges across which a coat bends, one entry per side h: the `facet` (h,) and number of the
    `edge` (h,). At points q, the same for both sides: the `slopes` (h, q, a, d) of the shape
    functions, unit `conormals` (h, q, i) out of the facet, `lengths` (h, q) in m, and the rotation
    `outwards` (h, q, 3 a) of the normal. `sides` (h,) is 2 at a plane of symmetry, else 1.
    """

    facet: Ints
    edge: Ints
    slopes: Floats
    conormals: Floats
    lengths: Floats
    outwards: Floats
    sides: Ints


def surface_of(mesh: TetMesh, coat: Coat, fixed: Bools) -> Surface:
    """Return the surface of a coat on ten-node tetrahedra. Its normals do not turn at a border
    where `fixed` (3 n,) holds the direction across it.
    """
    facets = facet_set(mesh, coat.facets)
    if (a := facets.shape[1]) != 6:
        raise ValueError(f"facets of a coat have {a} nodes and need 6; make the mesh with order=2")
    points = mesh.points[facets]
    at_nodes = np.vstack([np.eye(3), np.eye(3)[TRIANGLE_EDGES].mean(axis=1)])
    slopes = np.broadcast_to(shape_derivatives(at_nodes, a), (len(facets), a, a, 2))
    tangents, normals = _frames(points, slopes)
    turn = -np.einsum("eaid,eabd,eaj->eaibj", np.linalg.pinv(tangents), slopes, normals)
    return Surface(
        n_dofs=mesh.n_dofs, facets=facets, points=points, normals=normals,
        turn=turn.reshape(-1, 3 * a, 3 * a),
        edges=_edges(facets, points, fixed.reshape(-1, 3)[facets]),
    )  # fmt: skip


def _frames(points: Floats, slopes: Floats) -> tuple[Floats, Floats]:
    """Return tangents (e, q, d, i) and unit normals (e, q, i) of facets with nodes at points
    (e, a, i), where their shape functions have slopes (e, q, a, d).
    """
    tangents = np.einsum("eqad,eai->eqdi", slopes, points)
    normals = np.cross(tangents[:, :, 0], tangents[:, :, 1])
    return tangents, normals / np.linalg.norm(normals, axis=2, keepdims=True)


def _edges(facets: Ints, points: Floats, fixed: Bools) -> Edges:
    """Return the edges of facets (e, a) with nodes at points (e, a, i), without the free border."""
    ends = facets[:, TRIANGLE_EDGES].reshape(-1, 2)
    _, edge, sides = np.unique(
        np.sort(ends, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    edge = edge.ravel()
    facet, k = np.divmod(np.arange(len(ends)), 3)
    # From the end with the lower number to the other, so that both sides use the same points.
    s = np.where((ends[:, 0] < ends[:, 1])[:, None], STATIONS, -STATIONS)[..., None]
    start, end = np.eye(3)[TRIANGLE_EDGES[k]].swapaxes(0, 1)[:, :, None]
    at = ((1 - s) * start + (1 + s) * end) / 2
    slopes = shape_derivatives(at.reshape(-1, 3), 6).reshape(*at.shape[:2], 6, 2)
    tangents, normals = _frames(points[facet], slopes)
    along = np.einsum("hd,hqdi->hqi", (end - start)[:, 0, 1:], tangents)
    length = np.linalg.norm(along, axis=2)
    conormals = np.cross(along / length[..., None], normals)
    gradient = np.einsum("hqid,hqi,hqad->hqa", np.linalg.pinv(tangents), conormals, slopes)
    outwards = -np.einsum("hqa,hqj->hqaj", gradient, normals)
    border = sides[edge] == 1
    across = np.abs(conormals).sum(axis=1).argmax(axis=1)
    of_edge = np.c_[TRIANGLE_EDGES, 3 + np.arange(3)][k]
    mirrored = border & fixed[facet[:, None], of_edge, across[:, None]].all(axis=1)
    kept = mirrored | ~border
    return Edges(
        facet=facet[kept], edge=np.unique(edge[kept], return_inverse=True)[1],
        slopes=slopes[kept], conormals=conormals[kept],
        lengths=length[kept] * STATION_WEIGHTS / 2,
        outwards=outwards[kept].reshape(kept.sum(), len(STATIONS), -1),
        sides=np.where(mirrored, 2, 1)[kept],
    )  # fmt: skip


def coat_stiffness(surface: Surface, coat: Coat, mu: Floats, lam: Floats) -> sparse.csr_array:
    """Return the stiffness (3 n, 3 n) in N/m of a coat for Lame's parameters of plane stress
    (layers, e) in Pa, minus those of the replaced material.
    """
    T, local = surface.turn, np.zeros_like(surface.turn)
    for z, weight, layer in zip(*coat.stations, strict=True):
        points = surface.points + z * surface.normals
        K = weight * membrane_stiffness(points, mu[layer], lam[layer])
        KT = z * K @ T
        local += K + KT + KT.swapaxes(1, 2) + z * T.swapaxes(1, 2) @ KT
    within = _sum_elements(local, surface)
    return (within + _edge_stiffness(surface, coat, mu, lam)).tocsr()


def _edge_stiffness(surface: Surface, coat: Coat, mu: Floats, lam: Floats) -> sparse.csr_array:
    """Return the stiffness (3 n, 3 n) of the edges: the jump [d] and mean moment {m} at points."""
    edges, points = surface.edges, len(STATIONS)
    moment, bending = _moments(surface, coat, mu, lam)
    corners = surface.points[edges.facet, :3]
    area = np.linalg.norm(np.cross(*np.diff(corners, axis=1).swapaxes(0, 1)), axis=1) / 2
    # Penalty over D L / A, with bending stiffness D and area A of a facet and length L of its edge:
    # the smallest for which the stiffness of a facet bounds its moments at three edges, int m^2 ds
    # <= L/A int m^2 dA for the constant moments of quadratic facets. A larger penalty makes bending
    # too stiff; with 0.85 of this one some modes have negative stiffness.
    penalty_factor = 3 / 4
    penalty = penalty_factor * edges.sides * bending * edges.lengths.sum(axis=1) / area
    lengths = np.zeros((edges.edge.max(initial=-1) + 1, points))
    lengths[edges.edge] = edges.lengths / edges.sides[:, None]
    weights = lengths * np.bincount(edges.edge, penalty, len(lengths))[:, None]

    dofs = dofs_of(surface.facets[edges.facet]).reshape(len(edges.facet), 1, -1)
    rows = points * edges.edge[:, None, None] + np.arange(points)[:, None]

    def of_both(values: Floats) -> sparse.csr_array:
        """Return the sum (edges q, 3 n) of values (h, q, 3 a) over both sides."""
        whole = edges.sides[:, None, None] * values
        return from_entries(whole, rows, dofs, (lengths.size, surface.n_dofs))

    jump, mean = of_both(edges.outwards), of_both(moment / 2)
    work = jump.T @ mean.multiply(lengths.reshape(-1, 1))
    return (jump.T @ jump.multiply(weights.reshape(-1, 1)) - work - work.T).tocsr()


def _moments(surface: Surface, coat: Coat, mu: Floats, lam: Floats) -> tuple[Floats, Floats]:
    """Return bending moments (h, q, 3 a) per displacement and stiffnesses (h,) in N m per side."""
    edges, facet = surface.edges, surface.edges.facet
    moment, bending = np.zeros_like(edges.outwards), np.zeros(len(facet))
    for z, weight, layer in zip(*coat.stations, strict=True):
        points = (surface.points + z * surface.normals)[facet]
        tangents, _ = _frames(points, edges.slopes)
        dual = np.linalg.pinv(tangents)
        gradient = np.einsum("hqid,hqad->hqai", dual, edges.slopes)
        # In the tangent plane there, so that a rotation makes no strain.
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
    """Return the stiffness (e, 3 a, 3 a) per thickness, in Pa, of curved membranes with nodes at
    points (e, a, 3) and Lame's parameters (e,) of plane stress.

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
    """Return the mass (3 n, 3 n) in kg of a coat, int rho N_a N_b dA dz, for densities (layers, e)
    minus those of the replaced material.
    """
    k, a = surface.facets.shape
    N, local = shape_functions(triangle_rule()[0], a), np.zeros((k, a, a))
    for z, weight, layer in zip(*coat.stations, strict=True):
        normals = facet_geometry(surface.points + z * surface.normals)[1]
        area = weight * density[layer][:, None] * np.linalg.norm(normals, axis=2)
        local += np.einsum("eq,qa,qb->eab", area, N, N, optimize=True)
    return _sum_elements(np.einsum("eab,ij->eaibj", local, np.eye(3)), surface)


def coat_operators(
    mesh: TetMesh, coat: Coat, materials: list[Material], region: Ints, fixed: Bools
) -> Matrices:
    """Return what a coat adds to K, C, M and the branches of a body, on all dofs of its mesh.

    `region` (m,) has the index of each element's material, `fixed` (3 n,) the fixed dofs.
    """
    surface, layers = surface_of(mesh, coat, fixed), len(coat.materials)
    behind = region[owners(mesh, facet_set(mesh, coat.facets))]
    both = [*(m.without_loss_factor() for m in coat.materials), *materials]
    mu, lam = (property_of(both, name) for name in ("shear_modulus", "first_lame"))
    lam = 2 * lam * mu / (lam + 2 * mu)

    def excess(values: Floats) -> Floats:
        """Return values (layers, e) of the coat minus those of the replaced material."""
        return values[:layers, None] - values[layers:][behind]

    def stiffness(share: Floats) -> sparse.csr_array:
        return coat_stiffness(surface, coat, excess(share * mu), excess(share * lam))

    def mass(density: Floats) -> sparse.csr_array:
        return coat_mass(surface, coat, excess(density))

    K, C, M, branches, _ = viscoelastic(both, stiffness, mass)
    return K, C, M, branches


def _sum_elements(local: Floats, surface: Surface) -> sparse.csr_array:
    """Return the sum (3 n, 3 n) of matrices (e, a, i, b, j) of the facets of a surface."""
    dofs = dofs_of(surface.facets).reshape(len(surface.facets), -1)
    local = local.reshape(*dofs.shape, dofs.shape[1])
    return from_entries(local, dofs[:, :, None], dofs[:, None], 2 * (surface.n_dofs,))
