"""Goal-oriented error estimate: the share of every element in the error of a probe's motion.

With the solution u of a load and the dual solution z of a probe, A z = s, the error of the motion
s^T u is A applied to the errors of both (Becker and Rannacher, Acta Numerica 10:1, 2001). The
errors of strain and pressure are those to polynomials fitted about each corner node, as Zienkiewicz
and Zhu's (Int J Numer Methods Eng 33:1331, 1992), within one material. In the mixed form that a
nearly incompressible solid has, with the pressure p = lam_r theta of the projected dilatation,

    error = int 2 mu e(u) : e(z) + lam_d d(u) d(z) + p(u) d(z) + p(z) d(u) - p(u) p(z) / lam_r dV

where e, d and p are the errors of strain, dilatation and pressure. It is an estimate, no bound:
inertia is left out, because errors of displacement are an order higher, and so is the phase that
waves lose on their way.

What cells that are shorter along one axis would gain is told by the curvatures of the same
polynomials: along an axis, in which an element is h long, the strain leaves h^2 d^2 e. Each
element's share is divided among the axes as the products of those of both solutions.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from fem.assembly import by_region, direct_part, elements_of
from fem.elements import shape_functions, tetrahedron_rule
from fem.geometry import gradients, shape_nodes
from fem.materials import Material
from fem.pressure_projection import projected_dilatation
from fem.stress import SYMMETRIC
from meshes import TetMesh
from meshes.tetmesh import Floats, Ints

TWICE_SHEAR = np.array([1.0, 1, 1, 2, 2, 2])  # of the components xx, yy, zz, xy, xz, yz in e : e
# Weight in a fit, over that of all samples, of slopes and of curvatures, which few elements leave
# undetermined.
RIDGE = np.array([0.0, *3 * [1e-12], *6 * [1e-2]])
SQUARES = [4, 7, 9]  # of the monomials, those of one coordinate
TINY = 1e-300  # of a field without curvature

Values = NDArray[Any]  # float64 or complex128


@dataclass(frozen=True, kw_only=True, eq=False)
class GoalError:
    """Error of goals by element, in the unit of the goals.

    `shares` (e, g), float or complex: their sum over the elements estimates s^T u less that of the
    mesh; `along` (e, 3): the magnitudes of all goals' shares, divided among the axes x, y and z.
    """

    shares: Values
    along: Floats


def goal_error(
    mesh: TetMesh,
    material: Material | Mapping[int, Material],
    fields: tuple[Values, Values],
    frequency: float = 0.0,
) -> GoalError:
    """Estimate of the error that each element leaves in goals.

    Parameters
    ----------
    mesh : TetMesh, of ten-node tetrahedra
    material : one Material, or region number -> Material
    fields : solution (3 n,) and dual solutions (3 n, g), metre and metre/N, float or complex
    frequency : Hz, of the steady state that they are

    Returns
    -------
    GoalError, in metre
    """
    u = np.column_stack(fields)
    materials, region = by_region(mesh, material)
    shares = np.zeros((len(mesh.tets), u.shape[1] - 1), u.dtype)
    along = np.zeros((len(mesh.tets), 3))
    for r, solid in enumerate(materials):
        own = np.flatnonzero(region == r)
        shares[own], along[own] = _of_solid(elements_of(mesh, own), solid, u, frequency)
    return GoalError(shares=shares, along=along)


def _of_solid(mesh: TetMesh, solid: Material, u: Values, frequency: float) -> tuple[Values, Floats]:
    """Shares (e, g) of the elements of one material, and their magnitudes (e, 3) along the axes."""
    lam, mu = np.array(solid.first_lame), np.array(solid.shear_modulus)
    direct = direct_part(lam, mu)
    slopes, volumes = gradients(shape_nodes(mesh), 10, 2, 0)
    moved = u.reshape(len(mesh.points), 3, -1)[mesh.tets]
    gradient = np.einsum("eqia,eajm->eqijm", slopes, moved, optimize=True)
    strain = np.einsum("cij,eqijm->eqcm", SYMMETRIC, gradient, optimize=True)
    trace = strain[:, :, :3].sum(axis=2, keepdims=True)
    projected = trace
    if direct < lam:
        projected = _by_parts(lambda part: projected_dilatation(mesh, part), u)[:, :, None]
    # Recovered strain has the dilatation that the stiffness acts on.
    strain[:, :, :3] += (projected - trace) / 3
    samples = np.concatenate([strain, projected], axis=2)
    smooth, curvature = _recovered(mesh, samples)
    error = smooth - samples
    error[:, :, :3] += (projected - trace) / 3
    e, d, p = error[:, :, :6], error[:, :, :3].sum(axis=2), error[:, :, 6]
    relative = (
        solid.complex_modulus(2 * np.pi * frequency) / solid.shear_modulus if frequency else 1
    )
    shear = 2 * mu * np.einsum("c,eqc,eqcp->eqp", TWICE_SHEAR, e[..., 0], e[..., 1:])
    rest = lam - direct
    mixed = direct * d[..., :1] * d[..., 1:] + rest * (
        p[..., :1] * d[..., 1:] + d[..., :1] * p[..., 1:] - p[..., :1] * p[..., 1:]
    )
    shares = np.asarray(relative * np.einsum("eq,eqp->ep", volumes, shear + mixed))
    return shares, np.einsum("eip,ep->ei", _by_axis(mesh, curvature), np.abs(shares))


def _by_axis(mesh: TetMesh, curvature: Floats) -> Floats:
    """Parts (e, 3, g) of each element's share that its length along each axis leaves, by the
    curvatures (e, 3, m) of the strain of all fields.
    """
    left = curvature * np.ptp(mesh.points[mesh.tets[:, :4]], axis=1)[:, :, None] ** 2
    products = left[..., :1] * left[..., 1:] + TINY
    return np.asarray(products / products.sum(axis=1, keepdims=True))


def _by_parts(of: Any, u: Values) -> Values:
    return of(u.real) + 1j * of(u.imag) if np.iscomplexobj(u) else of(u)


def _recovered(mesh: TetMesh, samples: Values) -> tuple[Values, Floats]:
    """Samples (e, q, c, m) at quadrature points, smoothed there: the mean of the polynomials of
    second degree that fit them about each of an element's corners; and the norm (e, 3, m) of the
    second derivatives of all components along each axis.
    """
    tets, nodes = mesh.tets[:, :4], shape_nodes(mesh)
    N = shape_functions(tetrahedron_rule(2)[0], nodes.shape[1])
    near = shape_functions(tetrahedron_rule(2)[0], 4)
    places = np.einsum("qa,eai->eqi", N, nodes)
    away = places[:, None] - mesh.points[tets][:, :, None]  # (e, a, q, i)
    into = _into_corners(tets)
    size = np.sqrt((into @ (away**2).mean(axis=(2, 3)).ravel()) / into.sum(axis=1))
    corner = np.unique(tets, return_inverse=True)[1].reshape(tets.shape)
    P = _quadratic(away / size[corner][..., None, None])
    values = samples.reshape(*samples.shape[:2], -1)
    normal = into @ np.einsum("eaqj,eaqk->eajk", P, P, optimize=True).reshape(tets.size, -1)
    right = into @ np.einsum("eaqj,eqv->eajv", P, values, optimize=True).reshape(tets.size, -1)
    normal = normal.reshape(-1, 10, 10) + np.diag(RIDGE) * normal[:, :1, None]
    fits = np.linalg.solve(normal, right.reshape(len(normal), 10, -1))
    smooth = np.einsum("qa,eaqj,eajv->eqv", near, P, fits[corner], optimize=True)
    curved = fits[:, SQUARES].reshape(len(fits), 3, *samples.shape[2:])
    curvature = np.linalg.norm(curved, axis=2) / (size**2)[:, None, None]
    return np.asarray(smooth.reshape(samples.shape)), curvature[corner].mean(axis=1)


def _into_corners(tets: Ints) -> sparse.csr_array:
    """Sum (c, 4 e) over the elements' corners at each node that is one."""
    corner = np.unique(tets, return_inverse=True)[1].ravel()
    return sparse.csr_array((np.ones(len(corner)), (corner, np.arange(len(corner)))))


def _quadratic(x: Floats) -> Floats:
    """Monomials (..., 10) of points (..., 3) up to the second degree."""
    first, second = [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]
    return np.concatenate([np.ones((*x.shape[:-1], 1)), x, x[..., first] * x[..., second]], axis=-1)
