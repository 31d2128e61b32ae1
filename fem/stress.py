"""Strain and stress at points of a body, as linear operators of its displacement.

Strain is recovered by least squares from the quadrature points of the elements about a point, where
the gradient of a quadratic displacement is most accurate: the superconvergent patch recovery of
Zienkiewicz and Zhu, Int J Numer Methods Eng 33:1331 (1992), with a patch for each point instead of
each node. Polynomials of third degree are fitted within one material, across which strain may jump.

Where a solid is nearly incompressible, div u oscillates from element to element: the dilatation is
taken from the macroelement projection and what is left beside it (`pressure_projection`), in the
proportions that they have in K. Stress by Hooke's law then has the pressure of the discrete
equations.

`nodal_strain` is of all nodes: polynomials about each corner node, of which a node of an edge has
the mean of those of its two ends. Nodes between two materials are doubled.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from fem.assembly import by_region, direct_part, elements_of
from fem.elements import shape_functions, tetrahedron_rule
from fem.geometry import gradients, shape_nodes
from fem.load_and_probe import locate
from fem.maxwell import NO_INTERNAL
from fem.pressure_projection import dilatation_operator
from fem.typing import Floats, Ints
from meshes import TetMesh
from meshes.tetmesh import EDGES
from simple_model.layers.material import Material
from simple_model.layers.tensors import DIAGONAL, MEAN, TENSOR

TOUCHING = 1e-6  # barycentric: an element touches a point that is so little outside it
POINTS = 4  # quadrature points of an element, of the rule for degree 2
LOCAL = 1.0  # weight exp(-LOCAL d^2) of a sample at d elements from the point: best of 0.7 to 5
AT_ONCE = 100  # corner nodes, whose elements are looked at together
DEGREES = (3, 2, 1, 0)  # of polynomials: the highest that the samples determine, twice over
INDEPENDENT = 1e-8  # of the largest singular value
# Symmetric gradient: e_c = sum_ij SYMMETRIC[c, i, j] u_j,i
SYMMETRIC = np.array([[[(i, j) in (c, c[::-1]) for j in range(3)] for i in range(3)]
                      for c in TENSOR]) / np.array([1, 1, 1, 2, 2, 2])[:, None, None]  # fmt: skip


def strain_operator(
    mesh: TetMesh, material: Material | Mapping[int, Material], points: ArrayLike
) -> sparse.csr_array:
    """Strain operator: the strain tensor at points of a body is this times its displacement.

    Parameters
    ----------
    mesh : TetMesh, of ten-node tetrahedra
    material : one Material, or region number -> Material
    points : (p, 3) float, metre, in the body or on its surface

    Returns
    -------
    (6 p, 3 n) sparse, 1/m; components xx, yy, zz, xy, xz, yz of the tensor, fastest

    Raises
    ------
    ValueError
        If a point is outside the body, or elements have four nodes, whose strain is constant.
    """
    if mesh.order == 1:
        raise ValueError("strain is recovered from ten-node tetrahedra; mesh with order 2")
    points = np.atleast_2d(np.asarray(points, np.float64))
    given, region = by_region(mesh, material)
    materials = [m.without_loss_factor() for m in given]
    owner, _ = locate(mesh, points)
    rows = sparse.csr_array((6 * len(points), mesh.n_dofs))
    for r in np.unique(region[owner]):
        here, own = np.flatnonzero(region[owner] == r), np.flatnonzero(region == r)
        part = elements_of(mesh, own)
        patches = [_patch(part, np.searchsorted(own, owner[p]), points[p]) for p in here]
        used = np.unique(np.concatenate(patches))
        fit = _fit(part, patches, used, points[here])
        into = sparse.csr_array(
            (np.ones(len(here)), (here, np.arange(len(here)))), shape=(len(points), len(here))
        )
        tensor = sparse.eye_array(6)
        sampled = _sampled_strain(part, used, materials[r])
        rows = rows + sparse.kron(into @ fit, tensor, format="csr") @ sampled
    return rows


def relaxation(material: Material, s: Any) -> Any:
    """Complex modulus of a material over its `shear_modulus`, at complex frequencies s in rad/s. A
    branch that is as fast as s, which moves no displacement, counts as 0.
    """
    mu = material.shear_modulus
    if material.law is not None:
        return material.complex_modulus(np.real_if_close(-1j * np.asarray(s))) / mu
    solid = material.without_loss_factor()
    with np.errstate(divide="ignore", invalid="ignore"):
        branches = solid.relaxing_modulus(-1j * np.asarray(s))
    branches = np.where(np.isfinite(branches), branches, 0.0)
    return (solid.shear_modulus + s * solid.viscosity + branches) / mu


def relaxed(stress: Floats, dt: float, material: Material) -> Floats:
    """Stress (t, ...) in Pa from rest by the `relaxation` in time, of one by the `shear_modulus` of
    a material without a modulus law of its own, in steps of dt: with rates by a cubic spline and
    branches that are exact where stress is linear between samples.
    """
    from scipy.interpolate import CubicSpline  # which take long to import
    from scipy.signal import lfilter

    if material.law is not None:
        raise ValueError(NO_INTERNAL)
    mu, material = material.shear_modulus, material.without_loss_factor()
    lag = material.viscosity / mu
    found = material.shear_modulus / mu * stress
    if lag:
        rate = CubicSpline(np.arange(len(stress)) * dt, stress).derivative()
        found = found + lag * rate(np.arange(len(stress)) * dt)
    for term in material.prony:  # d' = u' - d / tau
        kept = np.exp(-dt / term.time)
        gain = term.modulus / mu * (1 - kept) * term.time / dt
        found = found + lfilter([gain, -gain], [1.0, -kept], stress, axis=0)
    return found


def materials_at(
    mesh: TetMesh, material: Material | Mapping[int, Material], points: ArrayLike
) -> tuple[Material, ...]:
    """Material at each of points (p, 3) in a body, loss factors as Prony terms."""
    given, region = by_region(mesh, material)
    materials = [m.without_loss_factor() for m in given]
    return tuple(materials[r] for r in region[locate(mesh, points)[0]])


def _patch(mesh: TetMesh, owner: int, point: Floats) -> Ints:
    """Elements (k,) that share a corner with those that a point (3,) touches."""
    around = np.isin(mesh.tets[:, :4], mesh.tets[owner, :4]).any(axis=1)
    near = np.flatnonzero(around)
    corners = mesh.points[mesh.tets[near, :4]]
    edges = (corners[:, 1:] - corners[:, :1]).swapaxes(1, 2)
    inner = np.linalg.solve(edges, (point - corners[:, 0])[:, :, None])[:, :, 0]
    least = np.minimum(inner.min(axis=1), 1 - inner.sum(axis=1))
    touching = near[least > -TOUCHING]
    core = touching if len(touching) else np.array([owner])
    return np.flatnonzero(np.isin(mesh.tets[:, :4], mesh.tets[core, :4]).any(axis=1))


def _fit(mesh: TetMesh, patches: list[Ints], used: Ints, points: Floats) -> sparse.csr_array:
    """Weights (p, 4 k) of the samples in the used elements (k,): the value at each point of the
    polynomial that fits the samples in its patch best.
    """
    places = _sample_places(mesh, used)
    values, columns = [], []
    for patch, point in zip(patches, points, strict=True):
        chosen = np.searchsorted(used, patch)
        away = (places[chosen] - point).reshape(-1, 3) / _size(mesh, patch)
        values.append(fitted_polynomial(away)[0][0])
        columns.append((POINTS * chosen[:, None] + np.arange(POINTS)).ravel())
    starts = np.cumsum([0, *map(len, values)])
    shape = (len(points), POINTS * len(used))
    return sparse.csr_array((np.concatenate(values), np.concatenate(columns), starts), shape=shape)


def _sample_places(mesh: TetMesh, used: Ints) -> Floats:
    """Quadrature points (k, q, 3) of some elements (k,) in metre."""
    nodes = mesh.points[mesh.tets[used]]
    N = shape_functions(tetrahedron_rule(2)[0], nodes.shape[1])
    return np.asarray(np.einsum("qa,eai->eqi", N, nodes))


def _size(mesh: TetMesh, patch: Ints) -> Floats:
    """Mean extent (3,) of elements in metre."""
    return np.asarray(np.ptp(mesh.points[mesh.tets[patch, :4]], axis=1).mean(axis=0))


def fitted_polynomial(x: Floats) -> tuple[Floats, int]:
    """Polynomial that fits samples at places x (s, 2 or 3) about a point, in elements, best, of the
    highest of `DEGREES` that they determine twice over: its coefficients (n, s) of the
    `polynomials` by the values of the samples, the first of which is the value at the point; and
    the degree.
    """
    root = np.exp(-LOCAL / 2 * (x**2).sum(axis=1))  # of the weights
    for degree in DEGREES:
        fitted = root[:, None] * polynomials(x, degree)
        left, sizes, right = np.linalg.svd(fitted, full_matrices=False)
        enough = len(x) >= 2 * len(sizes) and sizes[-1] > INDEPENDENT * sizes[0]
        if enough or degree == DEGREES[-1]:
            break
    return np.asarray((right.T / sizes) @ left.T * root), degree


def polynomials(x: Floats, degree: int) -> Floats:
    """Monomials (s, n) up to a degree at places (s, 2 or 3)."""
    axes = range(x.shape[1])
    powers = (c for d in range(degree + 1) for c in combinations_with_replacement(axes, d))
    return np.column_stack([np.prod(x[:, list(power)], axis=1) for power in powers])


def _strain_rows(mesh: TetMesh, used: Ints) -> sparse.csr_array:
    """Strain (24 k, 3 n) at the quadrature points of some elements (k,), by shape functions."""
    part = elements_of(mesh, used)
    slopes, _ = gradients(shape_nodes(part), part.tets.shape[1], 2, 0)
    values = np.einsum("cij,eqia->eqcaj", SYMMETRIC, slopes)
    columns = 3 * part.tets[:, None, None, :, None] + np.arange(3)
    rows = np.arange(values[..., 0, 0].size).reshape(*values.shape[:3], 1, 1)
    places = np.broadcast_to(rows, values.shape), np.broadcast_to(columns, values.shape)
    shape = (values[..., 0, 0].size, mesh.n_dofs)
    return sparse.csr_array((values.ravel(), tuple(x.ravel() for x in places)), shape=shape)


def _projected_share(material: Material) -> float:
    """Share of lam that acts on the projected dilatation."""
    lam, mu = np.array(material.first_lame), np.array(material.shear_modulus)
    return float(1 - direct_part(lam, mu) / lam) if direct_part(lam, mu) < lam else 0.0


def _sampled_strain(mesh: TetMesh, used: Ints, material: Material) -> sparse.csr_array:
    """Strain (24 k, 3 n) at the quadrature points of some elements (k,) of one material, with the
    dilatation that its stiffness acts on.
    """
    strain, share = _strain_rows(mesh, used), _projected_share(material)
    if not share:
        return strain
    samples = sparse.eye_array(POINTS * len(used))
    whole = sparse.kron(samples, np.eye(6) - share * MEAN, format="csr") @ strain
    projected = dilatation_operator(mesh, used)
    return whole + sparse.kron(samples, share / 3 * DIAGONAL[:, None], format="csr") @ projected


@dataclass(frozen=True, kw_only=True, eq=False)
class SolidPart:
    """Elements of one material: `mesh` has them alone, among all its nodes; `nodes` (q,) are
    theirs, by which `tets` (m, 10) are numbered.
    """

    mesh: TetMesh
    material: Material
    nodes: Ints
    tets: Ints


def solid_parts(mesh: TetMesh, material: Material | Mapping[int, Material]) -> list[SolidPart]:
    """Parts of a mesh, one for each material. Four-node elements, whose strain is constant, raise a
    ValueError.
    """
    if mesh.order == 1:
        raise ValueError("strain is recovered from ten-node tetrahedra; mesh with order 2")
    given, region = by_region(mesh, material)
    materials = [m.without_loss_factor() for m in given]
    parts = []
    for r in np.unique(region):
        own = elements_of(mesh, region == r)
        nodes, tets = np.unique(own.tets, return_inverse=True)
        tets = tets.reshape(own.tets.shape)
        parts.append(SolidPart(mesh=own, material=materials[r], nodes=nodes, tets=tets))
    return parts


def nodal_strain(part: SolidPart, u: Floats, wanted: Ints | None = None) -> Floats:
    """Strain (w, 6, m), components xx, yy, zz, xy, xz, yz, at nodes of a part, those wanted (w,) or
    all, of displacements u (3 n, m) in metre of all nodes.
    """
    nodes = part.nodes if wanted is None else part.nodes[wanted]
    number = np.full(len(part.mesh.points), -1)
    number[nodes] = np.arange(len(nodes))
    at_corner, mesh, share = (
        _read_at_corners(part.mesh, number), part.mesh, _projected_share(part.material)
    )  # fmt: skip
    dilatation = None
    if share:
        each = np.arange(len(mesh.tets))
        dilatation = (dilatation_operator(mesh, each) @ u).reshape(len(each), POINTS, -1)
    found = np.zeros((len(nodes), 6, u.shape[1]))
    corners = np.array(sorted(at_corner), np.int64)
    for some in np.array_split(corners, -(-len(corners) // AT_ONCE)):
        patches = _patches(mesh, some)
        used = np.unique(np.concatenate(patches))
        samples = (_strain_rows(mesh, used) @ u).reshape(len(used), POINTS, 6, -1)
        if dilatation is not None:
            trace = samples[:, :, :3].sum(axis=2)
            samples[:, :, :3] += share / 3 * (dilatation[used] - trace)[:, :, None]
        places = _sample_places(mesh, used)
        for corner, patch in zip(some, patches, strict=True):
            own, size = np.searchsorted(used, patch), _size(mesh, patch)
            read, shares = at_corner[corner]
            fit, degree = fitted_polynomial(
                ((places[own] - mesh.points[corner]) / size).reshape(-1, 3)
            )
            values = fit @ samples[own].reshape(fit.shape[1], -1)
            at = polynomials((mesh.points[read] - mesh.points[corner]) / size, degree)
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
