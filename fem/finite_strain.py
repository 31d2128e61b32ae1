"""Total Lagrangian finite strain: tetrahedra, and a membrane between their nodes.

    F_ki = T_ki + G_ka u_ai,  E = (F F^T - 1) / 2,  S = lam tr(E) 1 + 2 mu E
    f_ai = int G_ka S_kl F_li dV,  W = int (lam tr(E)^2 / 2 + mu E : E) dV

The material is St. Venant-Kirchhoff: Bonet and Wood, Nonlinear Continuum Mechanics for Finite
Element Analysis (1997), chapters 5 and 7. Rows k, l of F are directions at rest: three for a solid,
two for a horizontal membrane. T are the first rows of the unit matrix. Gradients are at four points
of a tetrahedron and three of a triangle. Orthotropic sheets add (Q - Q_iso) to the in-plane stress,
and tension adds forces on the normal displacement, as in `plane_stiffness`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from fem.assembly import assemble, by_region
from fem.energy import Elastic, Relaxing
from fem.geometry import gradients, shape_nodes
from fem.maxwell import MaxwellBranch, property_of, relaxation_of
from fem.plane_stiffness import SIDES, Tension, directional_parts, tension_stiffness
from fem.sparsity import UPPER, SparsityPattern, from_entries, restrict, slabs
from meshes import MeshError, TetMesh
from meshes.elements import shape_derivatives, triangle_rule
from simple_model.layers.material import Material
from simple_model.typing import Floats, Ints


@dataclass(frozen=True, kw_only=True, eq=False)
class Membrane:
    """Horizontal membrane without bending stiffness or mass.

    Parameters
    ----------
    triangles : (k, 3) or (k, 6) int, nodes of the tetrahedral mesh, corners first
    thickness : m
    material : Material
    """

    triangles: Ints
    thickness: float
    material: Material


@dataclass(frozen=True, kw_only=True, eq=False)
class Part:
    """Elements of one kind: nodes (e, a), gradients G (e, q, k, a) and volumes (e, q) at the
    quadrature points, Lame's parameters lam and mu (e,), and D (e q k, n) with D u = G_ka u_a.
    `orthotropic` (e, 3, 3) in Pa adds stiffness for the strains xx, yy and 2 xy, or is None.
    """

    nodes: Ints
    G: Floats
    volume: Floats
    lam: Floats
    mu: Floats
    D: sparse.csr_array
    D_transposed: sparse.csr_array
    pattern: SparsityPattern
    orthotropic: Floats | None = None

    @staticmethod
    def of(
        nodes: Ints, G: Floats, volume: Floats, n: int, materials: list[Material], region: Ints,
        lam: Floats,
    ) -> Part:  # fmt: skip
        """Return the part of a mesh of n nodes. `region` (e,) has the index of each element's
        material, and `lam` (r,) Lame's first parameter of each material in Pa.
        """
        rows = np.arange(G[..., 0].size).reshape(*G.shape[:-1], 1)
        D = from_entries(G, rows, nodes[:, None, None], (G[..., 0].size, n))
        mu, added = property_of(materials, "shear_modulus"), directional_parts(materials)
        each = np.array([added.get(m, np.zeros((3, 3))) for m in range(len(materials))])
        return Part(
            nodes=nodes, G=G, volume=volume, lam=lam[region], mu=mu[region], D=D,
            D_transposed=D.T.tocsr(), pattern=SparsityPattern.of(nodes, n),
            orthotropic=each[region] if added else None,
        )  # fmt: skip


def finite_strain(
    mesh: TetMesh,
    material: Material | Mapping[int, Material],
    *,
    fixed: str | Mapping[str, str] | ArrayLike = "clamped",
    membrane: Membrane | None = None,
    tension: Tension | None = None,
) -> Elastic:
    """Return a hyperelastic body of tetrahedra, with or without a membrane, at large displacement.

    Mass, damping and Maxwell branches of the tetrahedra are those of `assemble`, linear and
    constant, which holds for small rotations. In a membrane the viscous stress follows the rate of
    E, and the branches are stretched by E.

    Parameters
    ----------
    mesh, material, fixed : see `assemble`
    membrane : Membrane between the nodes of the mesh, or None
    tension : in-plane tension at rest of a horizontal sheet along x and y, or None

    Returns
    -------
    Elastic
        Forces in N and their tangent in N/m on the free degrees of freedom.

    Raises
    ------
    ValueError
        If a Poisson's ratio exceeds 0.45, or a material has its own modulus law; and the errors of
        `assemble`.
    """
    n = len(mesh.points)
    parts = [solid_part(mesh, material)]
    linear = assemble(mesh, material, fixed=fixed, tension=tension)
    free, operators, relaxing = linear.free, linear, Elastic.linear(linear).relaxing
    T = sparse.csr_array((len(free), len(free)))
    if tension is not None:
        T = restrict(tension_stiffness(mesh, parts[0].pattern, tension, SIDES), free)

    def spread(u: Floats) -> Floats:
        return operators.expand(u).reshape(n, 3)

    viscous = Elastic.linear(linear).viscous
    if membrane is not None:
        part, (lag, times, shares) = membrane_part(mesh, membrane), losses(membrane.material)
        parts.append(part)
        K = restrict(tangent(part, np.zeros((n, 3))), free)
        each = zip(shares.tolist(), times.tolist(), strict=True)
        branches = (MaxwellBranch(K=share * K, time=time) for share, time in each)
        operators = replace(
            linear, K=linear.K + K, C=linear.C + lag * K, laws=None,
            branches=(*linear.branches, *branches),
        )  # fmt: skip

        def relaxing_force(u: Floats, d: Floats) -> Floats:
            return stress_force(part, spread(u), np.tensordot(shares, d, 1)).ravel()[free]

        def viscous(u: Floats, v: Floats) -> Floats:
            return linear.C @ v + lag * rate_force(part, spread(u), spread(v)).ravel()[free]

        stretched = Relaxing(
            times=times,
            strain=lambda u: deformation(part, spread(u))[1],
            force=relaxing_force,
            tangent=lambda u, x: shares @ x * restrict(tangent(part, spread(u)), free),
            energy=lambda d: shares * np.array([strain_energy(part, e) for e in d]),
        )
        relaxing = (*relaxing, stretched) if len(times) else relaxing

    return Elastic(
        operators=operators,
        internal=lambda u: sum(
            (internal_force(part, spread(u)).ravel()[free] for part in parts), start=T @ u
        ),
        tangent=lambda u: sum((restrict(tangent(part, spread(u)), free) for part in parts), T),
        viscous=viscous,
        energy=lambda u: sum(
            (strain_energy(part, deformation(part, spread(u))[1]) for part in parts),
            start=float(u @ (T @ u)) / 2,
        ),
        relaxing=relaxing,
    )


def losses(material: Material) -> tuple[float, Floats, Floats]:
    """Return the viscosity in s of a material over its modulus at rest, and the times (j,) in s and
    relative moduli (j,) of its Maxwell branches.
    """
    lag, times, shares = relaxation_of([material.without_loss_factor()])
    return float(lag[0]), times, shares[:, 0]


def solid_part(mesh: TetMesh, material: Material | Mapping[int, Material]) -> Part:
    """Return the tetrahedra of a mesh."""
    given, region = by_region(mesh, material)
    materials = [m.without_loss_factor() for m in given]
    largest = 0.45  # because the dilatation is not projected here
    for m in materials:
        if m.poisson > largest:
            raise ValueError(
                f"poisson is {m.poisson}, but elements at large displacement lock above {largest}; "
                "use the linear model fem"
            )
    lam = property_of(materials, "first_lame")
    G, volume = gradients(shape_nodes(mesh), mesh.tets.shape[1], 2, 0)
    return Part.of(mesh.tets, G, volume, len(mesh.points), materials, region, lam)


def membrane_part(mesh: TetMesh, membrane: Membrane) -> Part:
    """Return the triangles of a membrane in plane stress, lam = 2 lam mu / (lam + 2 mu). Raises a
    MeshError unless they lie in one horizontal plane, anticlockwise from above.
    """
    nodes, m = membrane.triangles, membrane.material.without_loss_factor()
    corners = mesh.points[nodes[:, :3]]
    edges = corners[:, 1:, :2] - corners[:, :1, :2]  # (e, d, k)
    area = np.linalg.det(edges) / 2
    if np.ptp(corners[..., 2]) > 1e-9 * np.abs(edges).max() or (area <= 0).any():
        raise MeshError(
            "the triangles of a membrane must lie in one horizontal plane, anticlockwise seen from "
            "above; use those of meshes.middle_plane"
        )
    barycentric, weights = triangle_rule(2)
    derivatives = shape_derivatives(barycentric, nodes.shape[1])
    G = np.einsum("ekd,qad->eqka", np.linalg.inv(edges), derivatives)
    volume = membrane.thickness * area[:, None] * weights
    lam = 2 * m.first_lame * m.shear_modulus / (m.first_lame + 2 * m.shear_modulus)
    region = np.zeros(len(nodes), np.int64)
    return Part.of(nodes, G, volume, len(mesh.points), [m], region, np.array([lam]))


def internal_force(part: Part, u: Floats) -> Floats:
    """Return internal nodal forces (n, 3) in N at the displacement u (n, 3) in m."""
    F, E = deformation(part, u)
    return spread_stress(part, stress(part, E) @ F)


def stress_force(part: Part, u: Floats, strain: Floats) -> Floats:
    """Return nodal forces (n, 3) in N of the stress of a strain, at displacements (n, 3)."""
    return spread_stress(part, stress(part, strain) @ deformation(part, u)[0])


def rate_force(part: Part, u: Floats, v: Floats) -> Floats:
    """Return nodal forces (n, 3) in N/s of the stress of the rate of E, at u and v (n, 3)."""
    F = deformation(part, u)[0]
    rate = F @ (part.D @ v).reshape(F.shape).swapaxes(2, 3)
    return stress_force(part, u, (rate + rate.swapaxes(2, 3)) / 2)


def strain_energy(part: Part, E: Floats) -> float:
    """Return the energy in J of the strain E (e, q, k, l)."""
    return float((part.volume[..., None, None] * stress(part, E) * E).sum() / 2)


def deformation(part: Part, u: Floats) -> tuple[Floats, Floats]:
    """Return F (e, q, k, i) and E (e, q, k, l), without cancellation at small u."""
    H = (part.D @ u).reshape(*part.G.shape[:3], 3)
    k = H.shape[2]
    E = H @ H.swapaxes(2, 3) / 2
    E += (H[..., :k] + H[..., :k].swapaxes(2, 3)) / 2
    return H + np.eye(3)[:k], E


def stress(part: Part, E: Floats) -> Floats:
    """Return the second Piola-Kirchhoff stress (e, q, k, l) in Pa of the strain E."""
    S = 2 * part.mu[:, None, None, None] * E
    pressure = part.lam[:, None] * np.trace(E, axis1=2, axis2=3)
    for k in range(E.shape[2]):
        S[..., k, k] += pressure
    if part.orthotropic is not None:
        strains = np.stack([E[..., 0, 0], E[..., 1, 1], 2 * E[..., 0, 1]], axis=-1)
        xx, yy, xy = np.moveaxis(np.einsum("evw,eqw->eqv", part.orthotropic, strains), -1, 0)
        S[..., 0, 0] += xx
        S[..., 1, 1] += yy
        S[..., 0, 1] += xy
        S[..., 1, 0] += xy
    return S


def spread_stress(part: Part, P: Floats) -> Floats:
    """Return nodal forces (n, 3) of a stress P (e, q, k, i): int G_ka P_ki dV."""
    return part.D_transposed @ (part.volume[..., None, None] * P).reshape(-1, P.shape[3])


def tangent(part: Part, u: Floats) -> sparse.bsr_array:
    """Return the consistent tangent d internal_force / d u (3 n, 3 n) in N/m, symmetric.

    K_ab,ij = int lam A_ai A_bj + mu (A_aj A_bi + G_ka G_kb F_li F_lj) + delta_ij G_ka S_kl G_lb,
    A_ai = G_ka F_ki
    """
    F, E = deformation(part, u)
    S = stress(part, E)
    blocks = (
        (slab, tangent_blocks(part, slab, F[slab], S[slab])) for slab in slabs(len(part.nodes))
    )
    return part.pattern.blocks(blocks)


def tangent_blocks(part: Part, slab: slice, F: Floats, S: Floats) -> Floats:
    """Return blocks (6, e, a, b) in N/m of the tangent of a slab of elements with deformation
    gradient F (e, q, k, i) and stress S (e, q, k, l).
    """
    V, G = part.volume[slab, :, None, None], part.G[slab]
    G_transposed = G.swapaxes(2, 3)
    A = G_transposed @ F  # (e, q, a, i)
    slopes = V * (G_transposed @ G)  # (e, q, a, b)
    stretch = part.mu[slab, None, None, None] * (F.swapaxes(2, 3) @ F)
    geometric = (V * (G_transposed @ (S @ G))).sum(axis=1)
    lam, mu = part.lam[slab, None, None], part.mu[slab, None, None]
    added = None if part.orthotropic is None else part.orthotropic[slab]
    blocks = np.empty((6, *geometric.shape))
    for block, (i, j) in zip(blocks, UPPER, strict=True):
        across = np.einsum("eqa,eqb->eab", V[..., 0] * A[..., i], A[..., j], optimize=True)
        block[:] = lam * across + mu * across.swapaxes(1, 2)
        block += np.einsum("eqab,eq->eab", slopes, stretch[..., i, j])
        if i == j:
            block += geometric
        if added is not None:
            one, other = (_plane_strains(G, F[..., c]) for c in (i, j))
            block += np.einsum("eqva,evw,eqwb->eab", V * one, added, other, optimize=True)
    return blocks


def _plane_strains(G: Floats, F: Floats) -> Floats:
    """Return derivatives (e, q, 3, a) of the strains xx, yy and 2 xy by one displacement component,
    for gradients (e, q, k, a) and that column (e, q, k) of the deformation gradient.
    """
    (x, y), (along, across) = (np.moveaxis(G, 2, 0)[:2], np.moveaxis(F, 2, 0)[:2, ..., None])
    return np.stack([x * along, y * across, x * across + y * along], axis=2)


def shell_stiffness(
    mesh: TetMesh, membrane: Membrane, slopes: Callable[[Floats], Floats], *, meshed: float = 0.0
) -> sparse.bsr_array:
    """Return the membrane stiffness (3 n, 3 n) in N/m of a shallow shell, a slightly curved sheet.

    For a middle surface with height z0(x, y), the membrane strains are (Marguerre, Proc 5th Int
    Congr Appl Mech (1938))

        e_kl = (u_k,l + u_l,k + z0_,k w_,l + z0_,l w_,k) / 2

    those of a membrane whose deformation gradient at rest has the slopes of z0. `slopes` maps
    points (..., 2) to slopes along x and y, well below 1. The mesh stays flat; `meshed` is the
    fraction of the membrane stiffness that its elements have, which is subtracted.
    """
    part = membrane_part(mesh, membrane)
    corners = mesh.points[membrane.triangles[:, :3], :2]
    at = np.einsum("qa,eai->eqi", triangle_rule(2)[0], corners)
    flat = np.broadcast_to(np.eye(3)[:2], (*at.shape[:2], 2, 3))
    curved, unstressed = flat.copy(), np.zeros((*at.shape[:2], 2, 2))
    curved[..., 2] = slopes(at)

    def blocks(slab: slice) -> Floats:
        bent, plane = (
            tangent_blocks(part, slab, F[slab], unstressed[slab]) for F in (curved, flat)
        )
        return bent - meshed * plane

    return part.pattern.blocks((slab, blocks(slab)) for slab in slabs(len(part.nodes)))
