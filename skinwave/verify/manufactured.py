"""Manufactured solutions: convergence orders of ten-node tetrahedra up to nu = 0.4999."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

import fem
import meshes
from fem.elements import shape_derivatives, shape_functions, tetrahedron_rule
from skinwave.verify.case import Case, Plot, below, order, slope
from skinwave.verify.elements import DisplacementField, solver_held, unit
from skinwave.verify.references import Floats

CURL = np.cross(np.eye(3), [1.0, 0.0, 0.0]).T  # CURL @ grad = grad x e_x
# What is 0 on the middle planes of the cube, by the symmetry of the fields.
OUTSIDE = {"left": "xyz", "front": "xyz", "bottom": "xyz"}
TURNING = OUTSIDE | {"right": "x", "back": "xz", "top": "xy"}
ALONG = OUTSIDE | {"right": "yz", "back": "y", "top": "z"}
ORDERS = (3, 2)  # in L2 and H1
MANUFACTURED = "Roache, Verification and Validation in Computational Science and Engineering (1998)"


@dataclass(frozen=True, kw_only=True)
class Manufactured:
    """A field (..., 3), its gradient (..., i, j), the body force (..., 3) that it needs, and what
    is prescribed on an eighth of the unit cube.
    """

    u: DisplacementField
    gradient: DisplacementField
    force: DisplacementField
    fixed: Mapping[str, str]


Field = Callable[[float, float], Manufactured]  # by Lame's parameters


def divergence_free(mu: float, lam: float) -> Manufactured:
    """curl(psi e_x) with psi = sin pi x sin pi y sin pi z: no pressure at any nu."""
    return Manufactured(
        u=lambda x: _psi_gradient(x) @ CURL.T,
        gradient=lambda x: CURL @ _psi_hessian(x),
        force=lambda x: 3 * np.pi**2 * mu * (_psi_gradient(x) @ CURL.T),
        fixed=TURNING,
    )


def dilating(mu: float, lam: float) -> Manufactured:
    """psi e_x: its dilatation is as large as its shear, its pressure lam times that."""
    along = np.array([1.0, 0.0, 0.0])
    return Manufactured(
        u=lambda x: _psi(x)[..., None] * along,
        gradient=lambda x: along[:, None] * _psi_gradient(x)[..., None, :],
        force=lambda x: (
            3 * np.pi**2 * mu * _psi(x)[..., None] * along - (lam + mu) * _psi_hessian(x)[..., 0]
        ),
        fixed=ALONG,
    )


def balanced(mu: float, lam: float) -> Manufactured:
    """The first plus 5 grad sin pi x cos pi y cos pi z / (1 + lam / mu): pressure and shear of like
    size at any nu, and both with the same symmetry.
    """
    free, share, shift = divergence_free(mu, lam), 5 / (1 + lam / mu), np.array([0.0, 0.5, 0.5])
    pushed = (lam + 2 * mu) * 3 * np.pi**2 * share
    return Manufactured(
        u=lambda x: free.u(x) + share * _psi_gradient(x + shift),
        gradient=lambda x: free.gradient(x) + share * _psi_hessian(x + shift),
        force=lambda x: free.force(x) + pushed * _psi_gradient(x + shift),
        fixed=TURNING,
    )


def no_locking() -> Case:
    """Errors on one mesh do not grow towards incompressibility."""
    ratios = (0.3, 0.45, 0.49, 0.499, 0.4999, 0.49999)
    errors = []
    for poisson in ratios:
        material = unit(poisson)
        errors += _errors(5, material, [balanced(1.0, material.first_lame)])
    values, slopes = np.array(errors).T
    at = [1 / (1 - 2 * poisson) for poisson in ratios]
    return Case(
        title="No locking: pressure and shear of like size, nu = 0.3 to 0.49999",
        source=f"{MANUFACTURED}; Brenner and Sung, Math Comp 59:321 (1992): uniform in lambda "
        "(linear elements in the plane)",
        mesh=_described((5,)),
        checks=(
            below("relative error in L2, worst", values.max(), 3e-3),
            below("relative error in H1 seminorm, worst", slopes.max(), 3e-2),
        ),
        plot=Plot(
            x="1 / (1 - 2 nu)", y="relative error", log=True,
            lines={"L2": (at, values), "H1 seminorm": (at, slopes)},
        ),
    )  # fmt: skip


def manufactured(
    poisson: float, cells: tuple[int, ...], fields: Mapping[str, tuple[Field, tuple[float, float]]]
) -> Case:
    """Errors in L2 and H1 on three meshes of an eighth of the unit cube.

    Parameters
    ----------
    poisson : Poisson's ratio
    cells : of each mesh, along half a side of the cube
    fields : name -> the field, and what its errors in L2 and H1 may be on the finest mesh

    Returns
    -------
    Case
    """
    material, sizes = unit(poisson), 0.5 / np.array(cells)
    problems = [field(1.0, material.first_lame) for field, _ in fields.values()]
    errors = np.array([_errors(n, material, problems) for n in cells])  # (meshes, fields, norms)
    norms = ("L2", "H1 seminorm")
    named = {
        (name, norm): errors[:, k, j]
        for k, name in enumerate(fields)
        for j, norm in enumerate(norms)
    }
    lines = {f"{name}, {norm}": (sizes, e) for (name, norm), e in named.items()}
    guides = {
        f"slope {p:g}": (sizes, errors[-1, 0, j] * (sizes / sizes[-1]) ** p)
        for j, p in enumerate(ORDERS)
    }
    checks = []
    for name, (_, ceilings) in fields.items():
        for p, ceiling, norm in zip(ORDERS, ceilings, norms, strict=True):
            e = named[name, norm]
            checks.append(order(f"{name}: order in {norm}", sizes, e, p, 0.1))
            what = f"{name}: relative error in {norm}, finest mesh"
            checks.append(below(what, e[-1], ceiling))
    last = (f"{what} {slope(sizes[-2:], e[-2:]):.2f}" for what, (_, e) in lines.items())
    return Case(
        title=f"Manufactured fields, {' and '.join(fields)}, nu = {poisson:g}",
        source=f"{MANUFACTURED}; orders: Ciarlet, The Finite Element Method for Elliptic "
        "Problems (1978), section 3.2; near 1/2 Stenberg, Math Comp 42:9 (1984)",
        mesh=_described(cells),
        checks=tuple(checks),
        plot=Plot(
            x="h / side", y="relative error", lines=lines | guides, drawn=tuple(guides), log=True
        ),
        note=f"Orders of the last pair of meshes: {'; '.join(last)}.",
    )


def _errors(
    n: int, material: fem.Material, problems: Sequence[Manufactured]
) -> list[tuple[float, float]]:
    """Relative errors in L2 and in the H1 seminorm of each field, by the 14-point rule."""
    mesh = meshes.extrude(*[np.linspace(0, 0.5, n + 1)] * 3)
    solver = cache(lambda fixed: solver_held(mesh, material.poisson, dict(fixed)))
    barycentric, weights = tetrahedron_rule(5)
    N, D = shape_functions(barycentric, 10), shape_derivatives(barycentric, 10)
    corners = mesh.points[mesh.tets[:, :4]]
    edges = corners[:, 1:] - corners[:, :1]
    W = np.linalg.det(edges)[:, None] / 6 * weights
    x = np.einsum("qa,eai->eqi", barycentric, corners)

    def size(values: Floats) -> float:
        return float(np.sqrt((W * (values.reshape(*W.shape, -1) ** 2).sum(axis=-1)).sum()))

    errors = []
    for problem in problems:
        local = np.einsum("eq,qa,eqi->eai", W, N, problem.force(x), optimize=True)
        force = np.zeros_like(mesh.points)
        np.add.at(force, mesh.tets, local)
        solve = solver(tuple(problem.fixed.items()))
        found = solve(problem.u(mesh.points).ravel(), force.ravel())
        u = found.reshape(-1, 3)[mesh.tets]
        slopes = np.einsum("eai,qal,ejl->eqij", u, D, np.linalg.inv(edges), optimize=True)
        exact, gradient = problem.u(x), problem.gradient(x)
        value = size(np.einsum("qa,eai->eqi", N, u) - exact) / size(exact)
        errors.append((value, size(slopes - gradient) / size(gradient)))
    return errors


def _described(cells: tuple[int, ...]) -> str:
    every = ", ".join(str(2 * n) for n in cells)
    return f"an eighth of the unit cube, {every} cells a side of the cube, six tetrahedra a cell"


def _psi(x: Floats) -> Floats:
    return np.prod(np.sin(np.pi * x), axis=-1)


def _psi_gradient(x: Floats) -> Floats:
    s, c = np.sin(np.pi * x), np.cos(np.pi * x)
    return np.pi * np.stack([np.prod(np.where(np.eye(3)[i], c, s), axis=-1) for i in range(3)], -1)


def _psi_hessian(x: Floats) -> Floats:
    s, c = np.sin(np.pi * x), np.cos(np.pi * x)
    hessian = np.empty((*x.shape, 3))
    for i in range(3):
        for j in range(3):
            turned = np.prod(np.where(np.eye(3)[i] + np.eye(3)[j], c, s), axis=-1)
            hessian[..., i, j] = -_psi(x) if i == j else turned
    return np.pi**2 * hessian
