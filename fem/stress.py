"""Strain and stress at points of a body, as linear operators of its displacement.

Strain is recovered by least squares from the quadrature points of the elements about a point, where
the gradient of a quadratic displacement is most accurate: the superconvergent patch recovery of
Zienkiewicz and Zhu, Int J Numer Methods Eng 33:1331 (1992), with a patch for each point instead of
each node. Polynomials of third degree are fitted there, within one material, across which strain
may jump.

Where a solid is nearly incompressible, div u itself oscillates from element to element and is not
what the stiffness acts on: the dilatation is taken from the macroelement projection and what is
left beside it (`pressure_projection`), in the proportions that they have in K. Stress by Hooke's
law, lam tr(e) I + 2 mu e, then has the pressure of the discrete equations.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from fem.assembly import by_region, direct_part, elements_of
from fem.elements import shape_functions, tetrahedron_rule
from fem.geometry import gradients, shape_nodes
from fem.interior import locate
from fem.maxwell import NO_INTERNAL
from fem.pressure_projection import dilatation_operator
from fem.typing import Floats, Ints
from meshes import TetMesh
from simple_model.layers.material import Material
from simple_model.layers.tensors import DIAGONAL, MEAN, TENSOR, hooke

TOUCHING = 1e-6  # barycentric: an element touches a point that is so little outside it
POINTS = 4  # quadrature points of an element, of the rule for degree 2
LOCAL = 1.0  # weight exp(-LOCAL d^2) of a sample at d elements from the point: best of 0.7 to 5
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
    materials, region = by_region(mesh, material)
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


def stress_operator(
    mesh: TetMesh, material: Material | Mapping[int, Material], points: ArrayLike
) -> sparse.csr_array:
    """Stress operator: the Cauchy stress of the moduli at rest, tension positive, is this times the
    displacement. In motion it relaxes as the modulus does: sigma(w) = mu(w) / mu sigma.

    Parameters
    ----------
    mesh, material, points : as for `strain_operator`, with its errors

    Returns
    -------
    (6 p, 3 n) sparse, Pa/m; components xx, yy, zz, xy, xz, yz, fastest
    """
    solids = materials_at(mesh, material, points)
    moduli = sparse.block_diag([hooke(solid) for solid in solids], format="csr")
    return moduli @ strain_operator(mesh, material, points)


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
    """Stress from rest by the `relaxation` in time, with rates by a cubic spline and branches that
    are exact where stress is linear between samples.

    Parameters
    ----------
    stress : (t, ...) float, Pa, by the `shear_modulus` of the material
    dt : float, s, between samples, the first of which is at rest
    material : Material

    Returns
    -------
    (t, ...) float, Pa

    Raises
    ------
    ValueError
        If the material has a modulus law of its own.
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
    """Material at each of some points.

    Parameters
    ----------
    mesh, material, points : as for `strain_operator`; raises what `locate` does

    Returns
    -------
    p materials, their loss factors as Prony terms
    """
    materials, region = by_region(mesh, material)
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
    nodes = mesh.points[mesh.tets[used]]
    N = shape_functions(tetrahedron_rule(2)[0], nodes.shape[1])
    places = np.einsum("qa,eai->eqi", N, nodes)
    values, columns = [], []
    for patch, point in zip(patches, points, strict=True):
        chosen = np.searchsorted(used, patch)
        size = np.ptp(mesh.points[mesh.tets[patch, :4]], axis=1).mean(axis=0)
        away = (places[chosen] - point).reshape(-1, 3) / size
        root = np.exp(-LOCAL / 2 * (away**2).sum(axis=1))  # of the weight
        values.append(fitted_polynomial(away, root)[0][0])
        columns.append((POINTS * chosen[:, None] + np.arange(POINTS)).ravel())
    starts = np.cumsum([0, *map(len, values)])
    shape = (len(points), POINTS * len(used))
    return sparse.csr_array((np.concatenate(values), np.concatenate(columns), starts), shape=shape)


def fitted_polynomial(x: Floats, root: Floats) -> tuple[Floats, int]:
    """Polynomial that fits samples best, of the highest of `DEGREES` that they determine: its
    coefficients (n, s) of the `polynomials` by the values of the samples, the first of which is
    the value at the point; and the degree.

    `x` (s, 2 or 3) are places of the samples about the point, in elements, and `root` (s,) roots of
    their weights in the fit.
    """
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


def _sampled_strain(mesh: TetMesh, used: Ints, material: Material) -> sparse.csr_array:
    """Strain (24 k, 3 n) at the quadrature points of some elements (k,) of one material, with the
    dilatation that its stiffness acts on.
    """
    part = elements_of(mesh, used)
    slopes, _ = gradients(shape_nodes(part), part.tets.shape[1], 2, 0)
    values = np.einsum("cij,eqia->eqcaj", SYMMETRIC, slopes)
    columns = 3 * part.tets[:, None, None, :, None] + np.arange(3)
    rows = np.arange(values[..., 0, 0].size).reshape(*values.shape[:3], 1, 1)
    places = np.broadcast_to(rows, values.shape), np.broadcast_to(columns, values.shape)
    shape = (values[..., 0, 0].size, mesh.n_dofs)
    strain = sparse.csr_array((values.ravel(), tuple(x.ravel() for x in places)), shape=shape)
    lam, mu = np.array(material.first_lame), np.array(material.shear_modulus)
    if not (direct := direct_part(lam, mu)) < lam:
        return strain
    share = float(1 - direct / lam)
    samples = sparse.eye_array(POINTS * len(used))
    whole = sparse.kron(samples, np.eye(6) - share * MEAN, format="csr") @ strain
    projected = dilatation_operator(mesh, used)
    return whole + sparse.kron(samples, share / 3 * DIAGONAL[:, None], format="csr") @ projected
