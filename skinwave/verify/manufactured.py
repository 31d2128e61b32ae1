"""Manufactured solutions: convergence orders of ten-node tetrahedra up to nu = 0.4999."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import fem
import meshes
from fem.elements import shape_derivatives, shape_functions, tetrahedron_rule
from skinwave.verify.case import Case, Plot, below, order, slope
from skinwave.verify.elements import DisplacementField, held_outside, unit
from skinwave.verify.references import Floats

DIRECTION = np.array([1.0, 2.0, 3.0])
CURL = np.cross(np.eye(3), DIRECTION).T  # CURL @ grad = grad x DIRECTION
ORDERS = (3, 2)  # in L2 and H1
MANUFACTURED = "Roache, Verification and Validation in Computational Science and Engineering (1998)"


@dataclass(frozen=True, kw_only=True)
class Manufactured:
    """A field (..., 3), its gradient (..., i, j) and the body force (..., 3) that it needs."""

    u: DisplacementField
    gradient: DisplacementField
    force: DisplacementField


def divergence_free(mu: float, lam: float) -> Manufactured:
    """curl(psi a) = grad psi x a with psi = sin pi x sin pi y sin pi z: no pressure at any nu."""
    return Manufactured(
        u=lambda x: _psi_gradient(x) @ CURL.T,
        gradient=lambda x: CURL @ _psi_hessian(x),
        force=lambda x: 3 * np.pi**2 * mu * (_psi_gradient(x) @ CURL.T),
    )


def dilating(mu: float, lam: float) -> Manufactured:
    """psi a: its dilatation is as large as its shear, its pressure lam times that."""
    return Manufactured(
        u=lambda x: _psi(x)[..., None] * DIRECTION,
        gradient=lambda x: DIRECTION[:, None] * _psi_gradient(x)[..., None, :],
        force=lambda x: (
            3 * np.pi**2 * mu * _psi(x)[..., None] * DIRECTION
            - (lam + mu) * _psi_hessian(x) @ DIRECTION
        ),
    )


def balanced(mu: float, lam: float) -> Manufactured:
    """The first plus 5 grad psi / (1 + lam / mu): pressure and shear of like size at any nu."""
    free, share = divergence_free(mu, lam), 5 / (1 + lam / mu)
    return Manufactured(
        u=lambda x: free.u(x) + share * _psi_gradient(x),
        gradient=lambda x: free.gradient(x) + share * _psi_hessian(x),
        force=lambda x: free.force(x) + (lam + 2 * mu) * 3 * np.pi**2 * share * _psi_gradient(x),
    )


def no_locking() -> Case:
    """Errors on one mesh do not grow towards incompressibility."""
    ratios = (0.3, 0.45, 0.49, 0.499, 0.4999, 0.49999)
    errors = []
    for poisson in ratios:
        material = unit(poisson)
        errors.append(_errors(10, material, balanced(1.0, material.first_lame)))
    values, slopes = np.array(errors).T
    at = [1 / (1 - 2 * poisson) for poisson in ratios]
    return Case(
        title="No locking: pressure and shear of like size, nu = 0.3 to 0.49999",
        source=f"{MANUFACTURED}; Brenner and Sung, Math Comp 59:321 (1992): uniform in lambda "
        "(linear elements in the plane)",
        mesh="unit cube, 10 cells a side, six tetrahedra a cell",
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
    kind: str,
    poisson: float,
    field: Callable[[float, float], Manufactured],
    cells: tuple[int, ...],
    ceilings: tuple[float, float],
) -> Case:
    """Errors in L2 and H1 on three meshes of the unit cube."""
    material = unit(poisson)
    problem = field(material.shear_modulus, material.first_lame)
    errors = np.array([_errors(n, material, problem) for n in cells])
    sizes = 1 / np.array(cells)
    named = {"L2": errors[:, 0], "H1 seminorm": errors[:, 1]}
    lines = {name: (sizes, values) for name, values in named.items()}
    lines |= {
        f"slope {p:g}": (sizes, e[-1] * (sizes / sizes[-1]) ** p)
        for p, e in zip(ORDERS, named.values(), strict=True)
    }
    checks = [
        order(f"order in {name}", sizes, e, p, 0.1)
        for p, (name, e) in zip(ORDERS, named.items(), strict=True)
    ]
    checks += [
        below(f"relative error in {name}, finest mesh", e[-1], ceiling)
        for ceiling, (name, e) in zip(ceilings, named.items(), strict=True)
    ]
    return Case(
        title=f"Manufactured field, {kind}, nu = {poisson:g}",
        source=f"{MANUFACTURED}; orders: Ciarlet, The Finite Element Method for Elliptic "
        "Problems (1978), section 3.2; near 1/2 Stenberg, Math Comp 42:9 (1984)",
        mesh=f"unit cube, {', '.join(map(str, cells))} cells a side, six tetrahedra a cell",
        checks=tuple(checks),
        plot=Plot(
            x="h / side", y="relative error", lines=lines, drawn=tuple(list(lines)[2:]), log=True
        ),
        note=f"Last pair of meshes: order {slope(sizes[-2:], errors[-2:, 0]):.2f} in L2, "
        f"{slope(sizes[-2:], errors[-2:, 1]):.2f} in H1.",
    )


def _errors(n: int, material: fem.Material, problem: Manufactured) -> tuple[float, float]:
    """Relative errors in L2 and in the H1 seminorm, by the 14-point rule."""
    mesh = meshes.extrude(*[np.linspace(0, 1, n + 1)] * 3)
    barycentric, weights = tetrahedron_rule(5)
    N, D = shape_functions(barycentric, 10), shape_derivatives(barycentric, 10)
    corners = mesh.points[mesh.tets[:, :4]]
    edges = corners[:, 1:] - corners[:, :1]
    W = np.linalg.det(edges)[:, None] / 6 * weights
    x = np.einsum("qa,eai->eqi", barycentric, corners)
    local = np.einsum("eq,qa,eqi->eai", W, N, problem.force(x), optimize=True)
    force = np.zeros_like(mesh.points)
    np.add.at(force, mesh.tets, local)
    found = held_outside(mesh, material.poisson, problem.u(mesh.points).ravel(), force.ravel())
    u = found.reshape(-1, 3)[mesh.tets]
    slopes = np.einsum("eai,qal,ejl->eqij", u, D, np.linalg.inv(edges), optimize=True)

    def size(values: Floats) -> float:
        return float(np.sqrt((W * (values.reshape(*W.shape, -1) ** 2).sum(axis=-1)).sum()))

    exact, gradient = problem.u(x), problem.gradient(x)
    value = size(np.einsum("qa,eai->eqi", N, u) - exact) / size(exact)
    return value, size(slopes - gradient) / size(gradient)


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
