"""Strain and stress at points of a body, as linear operators of its displacement.

Strain is recovered by least squares from the quadrature points of the elements around a point,
where the gradient of a quadratic displacement is most accurate: the superconvergent patch recovery
of Zienkiewicz and Zhu, Int J Numer Methods Eng 33:1331 (1992), with one patch per point. Cubic
polynomials are fitted within one material; strain may jump between materials.

In a nearly incompressible solid, div u oscillates from element to element. The dilatation then
mixes the macroelement projection and div u (`pressure_projection`) in the proportions of K, so that
stress by Hooke's law has the pressure of the discrete equations.

`nodal_strain` computes the strain at all nodes from polynomials around each corner node; a mid-side
node has the mean of its two ends. Nodes between two materials have one value in each.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from fem.assembly import by_region, direct_part, elements_of
from fem.geometry import gradients, shape_nodes
from fem.load_and_probe import locate, straight_coordinates
from fem.maxwell import refuse_own_law
from fem.pressure_projection import dilatation_operator
from fem.sparsity import dofs_of, from_entries
from meshes import TetMesh
from meshes.elements import shape_functions, tetrahedron_rule
from meshes.tetmesh import EDGES
from simple_model.layers.material import Material
from simple_model.layers.tensors import DIAGONAL, MEAN, TENSOR
from simple_model.typing import Floats, Ints

POINTS = 4  # quadrature points of an element, of the rule for degree 2


def strain_operator(
    mesh: TetMesh, material: Material | Mapping[int, Material], points: ArrayLike
) -> sparse.csr_array:
    """Return the strain operator: strain tensors at points of a body per displacement.

    Parameters
    ----------
    mesh : TetMesh of ten-node tetrahedra
    material : Material, or mapping of region numbers to Materials
    points : (p, 3) float, m, in the body or on its surface

    Returns
    -------
    (6 p, 3 n) sparse, 1/m
        Components xx, yy, zz, xy, xz, yz of the tensor, component fastest.

    Raises
    ------
    ValueError
        If a point is outside the body, or elements have four nodes, whose strain is constant.
    """
    materials, region = _materials(mesh, material)
    points = np.atleast_2d(np.asarray(points, np.float64))
    owner, _ = locate(mesh, points)
    rows = sparse.csr_array((6 * len(points), mesh.n_dofs))
    for r in np.unique(region[owner]):
        here, own = np.flatnonzero(region[owner] == r), np.flatnonzero(region == r)
        part = elements_of(mesh, own)
        patches = [_patch(part, np.searchsorted(own, owner[p]), points[p]) for p in here]
        used = np.unique(np.concatenate(patches))
        fit = _fit(part, patches, used, points[here])
        into = from_entries(1.0, here, np.arange(len(here)), (len(points), len(here)))
        sampled = _sampled_strain(part, used, materials[r])
        rows = rows + sparse.kron(into @ fit, sparse.eye_array(6), format="csr") @ sampled
    return rows


def _materials(
    mesh: TetMesh, material: Material | Mapping[int, Material]
) -> tuple[list[Material], Ints]:
    """Return the materials of a mesh of ten-node tetrahedra, with Prony terms instead of loss
    factors, and the index (e,) of each element's.
    """
    if mesh.order == 1:
        raise ValueError("strain needs ten-node tetrahedra; make the mesh with order=2")
    given, region = by_region(mesh, material)
    return [m.without_loss_factor() for m in given], region


def relaxation(material: Material, s: Any) -> Any:
    """Return the complex modulus of a material over its `shear_modulus`, at complex frequencies s
    in rad/s. A branch with a pole at s is omitted: it moves nothing.
    """
    mu = material.shear_modulus
    if material.law is not None:
        return material.complex_modulus(np.real_if_close(-1j * np.asarray(s))) / mu
    solid = material.without_loss_factor()
    with np.errstate(divide="ignore", invalid="ignore"):
        branches = solid.relaxing_modulus(-1j * np.asarray(s))
    branches = np.where(np.isfinite(branches), branches, 0.0)
    return (solid.shear_modulus + s * solid.viscosity + branches) / mu


def relaxed_stress(stress: Floats, dt: float, material: Material) -> Floats:
    """Return the viscoelastic stress (t, ...) in Pa from rest, given the stress by the
    `shear_modulus` alone in steps of dt.

    The material must not have a modulus law of its own. Rates are those of a cubic spline; Maxwell
    branches are exact for stress that is linear between samples.
    """
    from scipy.interpolate import CubicSpline  # slow to import
    from scipy.signal import lfilter

    refuse_own_law(material.law is not None)
    mu, material = material.shear_modulus, material.without_loss_factor()
    lag = material.viscosity / mu
    total = material.shear_modulus / mu * stress
    if lag:
        times = np.arange(len(stress)) * dt
        total = total + lag * CubicSpline(times, stress).derivative()(times)
    for term in material.prony:  # d' = u' - d / tau
        decay = np.exp(-dt / term.time)
        gain = term.modulus / mu * (1 - decay) * term.time / dt
        total = total + lfilter([gain, -gain], [1.0, -decay], stress, axis=0)
    return total


def materials_at(
    mesh: TetMesh, material: Material | Mapping[int, Material], points: ArrayLike
) -> tuple[Material, ...]:
    """Return the material at each point (p, 3), with Prony terms instead of loss factors."""
    materials, region = _materials(mesh, material)
    return tuple(materials[r] for r in region[locate(mesh, points)[0]])


def _patch(mesh: TetMesh, owner: int, point: Floats) -> Ints:
    """Return the elements (k,) that share a corner with those that a point (3,) touches."""
    tets = mesh.tets[:, :4]
    near = np.flatnonzero(np.isin(tets, tets[owner]).any(axis=1))
    depth = straight_coordinates(mesh.points[tets[near]], point).min(axis=1)
    margin = 1e-6  # barycentric: points this close outside an element touch it
    touching = near[depth > -margin]
    core = touching if len(touching) else np.array([owner])
    return np.flatnonzero(np.isin(tets, tets[core]).any(axis=1))


def _fit(mesh: TetMesh, patches: list[Ints], used: Ints, points: Floats) -> sparse.csr_array:
    """Return weights (p, 4 k) of the samples in the used elements (k,). They give the value at each
    point of the polynomial that best fits the samples in its patch.
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
    """Return the quadrature points (k, q, 3) of some elements (k,) in m."""
    nodes = mesh.points[mesh.tets[used]]
    N = shape_functions(tetrahedron_rule(2)[0], nodes.shape[1])
    return np.asarray(np.einsum("qa,eai->eqi", N, nodes))


def _size(mesh: TetMesh, patch: Ints) -> Floats:
    """Return the mean extent (3,) of elements in m."""
    return np.asarray(np.ptp(mesh.points[mesh.tets[patch, :4]], axis=1).mean(axis=0))


def fitted_polynomial(
    x: Floats, degrees: Sequence[int] = (3, 2, 1, 0), locality: float = 1.0
) -> tuple[Floats, int]:
    """Fit a polynomial to samples at positions x (s, 2 or 3) relative to a point, in element sizes.

    The degree is the first of `degrees` with at most half as many coefficients as samples and a
    well-conditioned fit, or else the last. A sample d elements from the point has the weight
    exp(-locality d^2). Returns a matrix (n, s) that maps values of the samples to coefficients of
    `polynomials`, and the degree. The first coefficient is the value at the point.
    """
    root = np.exp(-locality / 2 * (x**2).sum(axis=1))  # of the weights
    independent = 1e-8  # of the largest singular value
    for degree in degrees:
        fitted = root[:, None] * polynomials(x, degree)
        left, sizes, right = np.linalg.svd(fitted, full_matrices=False)
        enough = len(x) >= 2 * len(sizes) and sizes[-1] > independent * sizes[0]
        if enough or degree == degrees[-1]:
            break
    return np.asarray((right.T / sizes) @ left.T * root), degree


def polynomials(x: Floats, degree: int) -> Floats:
    """Return monomials (s, n) up to a degree at places (s, 2 or 3)."""
    axes = range(x.shape[1])
    powers = (c for d in range(degree + 1) for c in combinations_with_replacement(axes, d))
    return np.column_stack([np.prod(x[:, list(power)], axis=1) for power in powers])


def _strain_rows(mesh: TetMesh, used: Ints) -> sparse.csr_array:
    """Return the strain (24 k, 3 n) at the quadrature points of some elements (k,)."""
    part = elements_of(mesh, used)
    slopes, _ = gradients(shape_nodes(part), part.tets.shape[1], 2, 0)
    # Symmetric gradient: e_c = sum_ij symmetric[c, i, j] u_j,i
    both = [[[(i, j) in (c, c[::-1]) for j in range(3)] for i in range(3)] for c in TENSOR]
    symmetric = np.array(both) / np.array([1, 1, 1, 2, 2, 2])[:, None, None]
    values = np.einsum("cij,eqia->eqcaj", symmetric, slopes)
    rows = np.arange(values[..., 0, 0].size).reshape(*values.shape[:3], 1, 1)
    columns = dofs_of(part.tets)[:, None, None]
    return from_entries(values, rows, columns, (values[..., 0, 0].size, mesh.n_dofs))


def _projected_share(material: Material) -> float:
    """Return the share of lam that acts on the projected dilatation."""
    lam, mu = np.array(material.first_lame), np.array(material.shear_modulus)
    direct = direct_part(lam, mu)
    return float(1 - direct / lam) if direct < lam else 0.0


def _sampled_strain(mesh: TetMesh, used: Ints, material: Material) -> sparse.csr_array:
    """Return the strain (24 k, 3 n) at the quadrature points of some elements (k,) of one material,
    with the dilatation that its stiffness acts on.
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
    """Elements of one material: a `mesh`, their `nodes` (q,), and `tets` by these nodes."""

    mesh: TetMesh
    material: Material
    nodes: Ints
    tets: Ints


def solid_parts(mesh: TetMesh, material: Material | Mapping[int, Material]) -> list[SolidPart]:
    """Return the parts of a mesh of ten-node tetrahedra, one for each material."""
    materials, region = _materials(mesh, material)
    parts = []
    for r in np.unique(region):
        own = elements_of(mesh, region == r)
        nodes, tets = np.unique(own.tets, return_inverse=True)
        tets = tets.reshape(own.tets.shape)
        parts.append(SolidPart(mesh=own, material=materials[r], nodes=nodes, tets=tets))
    return parts


def nodal_strain(part: SolidPart, u: Floats, wanted: Ints | None = None) -> Floats:
    """Return the strain (w, 6, m), components xx, yy, zz, xy, xz, yz, at some or all nodes (w,) of
    a part, for displacements u (3 n, m) in m of all nodes.
    """
    nodes = part.nodes if wanted is None else part.nodes[wanted]
    number = np.full(len(part.mesh.points), -1)
    number[nodes] = np.arange(len(nodes))
    mesh, share = part.mesh, _projected_share(part.material)
    by_corner = _nodes_by_corner(mesh, number)
    dilatation = None
    if share:
        each = np.arange(len(mesh.tets))
        dilatation = (dilatation_operator(mesh, each) @ u).reshape(len(each), POINTS, -1)
    strain = np.zeros((len(nodes), 6, u.shape[1]))
    corners = np.array(sorted(by_corner), np.int64)
    at_once = 100  # corner nodes whose elements are processed together
    for some in np.array_split(corners, -(-len(corners) // at_once)):
        patches = _patches(mesh, some)
        used = np.unique(np.concatenate(patches))
        samples = (_strain_rows(mesh, used) @ u).reshape(len(used), POINTS, 6, -1)
        if dilatation is not None:
            trace = samples[:, :, :3].sum(axis=2)
            samples[:, :, :3] += share / 3 * (dilatation[used] - trace)[:, :, None]
        places = _sample_places(mesh, used)
        for corner, patch in zip(some, patches, strict=True):
            own, size = np.searchsorted(used, patch), _size(mesh, patch)
            read, shares = by_corner[corner]
            fit, degree = fitted_polynomial(
                ((places[own] - mesh.points[corner]) / size).reshape(-1, 3)
            )
            values = fit @ samples[own].reshape(fit.shape[1], -1)
            at = polynomials((mesh.points[read] - mesh.points[corner]) / size, degree)
            terms = (shares[:, None] * (at @ values)).reshape(-1, *strain.shape[1:])
            strain[number[read]] += terms
    return strain


def _nodes_by_corner(mesh: TetMesh, number: Ints) -> dict[int, tuple[Ints, Floats]]:
    """Return for each corner node the wanted nodes that use its polynomial, and its share in each;
    `number` (n,) is negative for nodes that are not wanted.
    """
    middles, first = np.unique(mesh.tets[:, 4:], return_index=True)
    ends = mesh.tets[:, EDGES].reshape(-1, 2)[first]
    corners = np.unique(mesh.tets[:, :4])
    owner = np.concatenate([corners, ends[:, 0], ends[:, 1]])
    read = np.concatenate([corners, middles, middles])
    share = np.concatenate([np.ones(len(corners)), np.full(2 * len(middles), 0.5)])
    wanted = number[read] >= 0
    order = np.argsort(owner[wanted], kind="stable")
    owner, read, share = (array[wanted][order] for array in (owner, read, share))
    names, starts = np.unique(owner, return_index=True)
    each = zip(np.split(read, starts[1:]), np.split(share, starts[1:]), strict=True)
    return dict(zip(names.tolist(), each, strict=True))


def _patches(mesh: TetMesh, corners: Ints) -> list[Ints]:
    """Return the elements (k,) around each corner node, and those that share a corner with them."""
    tets = mesh.tets[:, :4]
    shape = len(tets), len(mesh.points)
    incidence = from_entries(np.ones(tets.shape), np.arange(len(tets))[:, None], tets, shape)
    around = sparse.csc_array(incidence @ (incidence.T @ incidence.tocsc()[:, corners]))
    around.sort_indices()
    return np.split(around.indices, around.indptr[1:-1])
