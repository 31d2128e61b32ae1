"""Strain at the nodes of a body, recovered by the polynomials of `stress` about each corner node.

A node of an edge has the mean of the polynomials of the edge's two ends. Strain jumps where the
material does: each material has its own nodes, of which those between two of them are doubled.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from fem.assembly import by_region, direct_part, elements_of
from fem.elements import shape_functions, tetrahedron_rule
from fem.geometry import gradients, shape_nodes
from fem.pressure_projection import projected_dilatation
from fem.stress import LOCAL, SYMMETRIC, fitted_polynomial, polynomials
from fem.typing import Floats, Ints
from meshes import TetMesh
from meshes.tetmesh import EDGES
from simple_model.layers.material import Material

AT_ONCE = 100  # corner nodes, whose elements are looked at together


@dataclass(frozen=True, kw_only=True, eq=False)
class SolidPart:
    """Elements of one material: `mesh` has them alone, among all its nodes; `nodes` (q,) of these
    are theirs, and `tets` (m, 10) number them among these.
    """

    mesh: TetMesh
    material: Material
    nodes: Ints
    tets: Ints


def solid_parts(mesh: TetMesh, material: Material | Mapping[int, Material]) -> list[SolidPart]:
    """The parts of a mesh of ten-node tetrahedra, one for each material.

    Raises
    ------
    ValueError
        If elements have four nodes, whose strain is constant.
    """
    if mesh.order == 1:
        raise ValueError("strain is recovered from ten-node tetrahedra; mesh with order 2")
    materials, region = by_region(mesh, material)
    parts = []
    for r in np.unique(region):
        own = elements_of(mesh, region == r)
        nodes, tets = np.unique(own.tets, return_inverse=True)
        tets = tets.reshape(own.tets.shape)
        parts.append(SolidPart(mesh=own, material=materials[r], nodes=nodes, tets=tets))
    return parts


def nodal_strain(part: SolidPart, u: Floats, wanted: Ints | None = None) -> Floats:
    """Strain at nodes of a part of a body.

    Parameters
    ----------
    part : SolidPart
    u : (3 n, m) float, metre, m displacements of all nodes
    wanted : (w,) int, which of `part.nodes`; all of them if not given

    Returns
    -------
    (w, 6, m) float; components xx, yy, zz, xy, xz, yz of the tensor
    """
    nodes = part.nodes if wanted is None else part.nodes[wanted]
    number = np.full(len(part.mesh.points), -1)
    number[nodes] = np.arange(len(nodes))
    at_corner = _read_at_corners(part.mesh, number)
    dilatation = _projected(part, u)
    found = np.zeros((len(nodes), 6, u.shape[1]))
    corners = np.array(sorted(at_corner), np.int64)
    for some in np.array_split(corners, -(-len(corners) // AT_ONCE)):
        patches = _patches(part.mesh, some)
        used = np.unique(np.concatenate(patches))
        samples = _samples(part, u, used, None if dilatation is None else dilatation[used])
        places = _sample_places(part.mesh, used)
        for corner, patch in zip(some, patches, strict=True):
            own = np.searchsorted(used, patch)
            read, shares = at_corner[corner]
            x = part.mesh.points
            size = np.ptp(x[part.mesh.tets[patch, :4]], axis=1).mean(axis=0)
            away = ((places[own] - x[corner]) / size).reshape(-1, 3)
            fit, degree = fitted_polynomial(away, np.exp(-LOCAL / 2 * (away**2).sum(axis=1)))
            values = fit @ samples[own].reshape(len(away), -1)
            at = polynomials((x[read] - x[corner]) / size, degree)
            found[number[read]] += (shares[:, None] * (at @ values)).reshape(-1, *found.shape[1:])
    return found


def _read_at_corners(mesh: TetMesh, number: Ints) -> dict[int, tuple[Ints, Floats]]:
    """By corner node, the nodes that are wanted of its polynomial, and its share in each."""
    middles, first = np.unique(mesh.tets[:, 4:], return_index=True)
    ends = mesh.tets[:, EDGES].reshape(-1, 2)[first]
    corners = np.unique(mesh.tets[:, :4])
    owner = np.concatenate([corners, ends[:, 0], ends[:, 1]])
    read = np.concatenate([corners, middles, middles])
    share = np.concatenate([np.ones(len(corners)), np.full(2 * len(middles), 0.5)])
    kept = number[read] >= 0
    order = np.argsort(owner[kept], kind="stable")
    owner, read, share = (array[kept][order] for array in (owner, read, share))
    names, starts = np.unique(owner, return_index=True)
    each = zip(np.split(read, starts[1:]), np.split(share, starts[1:]), strict=True)
    return dict(zip(names.tolist(), each, strict=True))


def _patches(mesh: TetMesh, corners: Ints) -> list[Ints]:
    """Elements (k,) around each corner node, and those that share a corner with one of them."""
    tets = mesh.tets[:, :4]
    rows = np.repeat(np.arange(len(tets)), 4)
    shape = len(tets), len(mesh.points)
    incidence = sparse.csr_array((np.ones(tets.size), (rows, tets.ravel())), shape=shape)
    around = sparse.csc_array(incidence @ (incidence.T @ incidence.tocsc()[:, corners]))
    around.sort_indices()
    return np.split(around.indices, around.indptr[1:-1])


def _projected(part: SolidPart, u: Floats) -> Floats | None:
    """Projected dilatation (e, q, m), where the stiffness acts on it; else None."""
    lam, mu = np.array(part.material.first_lame), np.array(part.material.shear_modulus)
    return projected_dilatation(part.mesh, u) if direct_part(lam, mu) < lam else None


def _samples(part: SolidPart, u: Floats, used: Ints, dilatation: Floats | None) -> Floats:
    """Strain (e, q, 6, m) at the quadrature points of some elements (e,), with the dilatation that
    their stiffness acts on, of which (e, q, m) is projected.
    """
    mesh = elements_of(part.mesh, used)
    slopes, _ = gradients(shape_nodes(mesh), mesh.tets.shape[1], 2, 0)
    moved = u.reshape(len(mesh.points), 3, -1)[mesh.tets]
    gradient = np.einsum("eqia,eajm->eqijm", slopes, moved, optimize=True)
    strain = np.einsum("cij,eqijm->eqcm", SYMMETRIC, gradient, optimize=True)
    if dilatation is not None:
        lam, mu = np.array(part.material.first_lame), np.array(part.material.shear_modulus)
        share = float(1 - direct_part(lam, mu) / lam)
        trace = strain[:, :, :3].sum(axis=2)
        strain[:, :, :3] += share / 3 * (dilatation - trace)[:, :, None]
    return np.asarray(strain)


def _sample_places(mesh: TetMesh, used: Ints) -> Floats:
    """Quadrature points (e, q, 3) of some elements (e,) in metre."""
    nodes = mesh.points[mesh.tets[used]]
    N = shape_functions(tetrahedron_rule(2)[0], nodes.shape[1])
    return np.asarray(np.einsum("qa,eai->eqi", N, nodes))
