"""Elements: patch tests on distorted meshes, and manufactured solutions."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

import fem
import meshes
from fem.boundary import fixed_dofs
from meshes import TetMesh
from meshes.elements import shape_derivatives, shape_functions, tetrahedron_rule
from skinwave.typing import Floats
from skinwave.verify.case import Check, Checks, below, case, order
from skinwave.verify.setups import push, unit_solid

PATCH = (
    "Irons and Razzaque (1972); Zienkiewicz and Taylor, The Finite Element Method, volume 1 "
    "(2000), chapter 10"
)
CUBE = "unit cube of 3 by 3 by 3 cells"
RATIO = "largest error / largest displacement"


@case(f"{PATCH}: must be exact", mesh=f"{CUBE}, inner corners moved")
def patch() -> Checks:
    """Patch test: a linear field on distorted tetrahedra."""
    mesh = distorted_cube()
    return (_linear_field(mesh, nu, 1e-10, f", nu = {nu:g}") for nu in (0.0, 0.3, 0.49, 0.4999))


@case(f"{PATCH}: exact for elements of second order", mesh=f"{CUBE}, inner corners moved")
def patch_quadratic() -> Checks:
    """Patch test: a quadratic field with its body force, nu = 0.3."""
    mesh, mu, lam = distorted_cube(), 1.0, 1.5
    x = mesh.points
    field = np.stack([x[:, 0] ** 2 + x[:, 1] * x[:, 2], x[:, 1] ** 2, x[:, 0] * x[:, 2]], axis=1)
    minus_force = np.array([(lam + mu) * 3 + 2 * mu, (lam + mu) * 2 + 2 * mu, 0.0])
    force = np.broadcast_to(-minus_force, x.shape)
    M = fem.assemble(mesh, unit_solid(0.3), fixed=np.zeros(x.shape, bool)).M
    u = _with_boundary_values(mesh, 0.3, field.ravel(), M @ force.ravel())
    yield below(RATIO, _largest_error(u, field), 1e-9)


@case(f"{PATCH}: must be exact on any mesh", mesh=f"{CUBE}, one corner moved near a facet")
def slivers() -> Checks:
    """Slivers with a dihedral angle of half a degree."""
    mesh = cube_with_slivers()
    ops, force = fem.assemble(mesh, unit_solid(0.3), fixed="bottom"), push(mesh)
    f = force[ops.free]
    residual = f - ops.K @ fem.static(ops, force)[ops.free]
    yield _linear_field(mesh, 0.3, 1e-8)
    yield below("residual / load", np.linalg.norm(residual) / np.linalg.norm(f), 1e-8)


@dataclass(frozen=True, kw_only=True)
class Manufactured:
    """Functions of points: a field (..., 3), its gradient (..., i, j) and its body force (..., 3).

    `fixed` are its fixed components on an eighth of the unit cube.
    """

    u: Callable[[Floats], Floats]
    gradient: Callable[[Floats], Floats]
    force: Callable[[Floats], Floats]
    fixed: Mapping[str, str]


# Fixed components: by symmetry, some are 0 on the middle planes of the cube.
OUTSIDE = {"left": "xyz", "front": "xyz", "bottom": "xyz"}


def _divergence_free(lam: float) -> Manufactured:
    """Return curl(psi e_x), psi = sin pi x sin pi y sin pi z: no pressure at any nu; mu = 1."""
    curl = np.cross(np.eye(3), [1.0, 0.0, 0.0]).T  # curl @ grad = grad x e_x
    return Manufactured(
        u=lambda x: _psi_gradient(x) @ curl.T,
        gradient=lambda x: curl @ _psi_hessian(x),
        force=lambda x: 3 * np.pi**2 * (_psi_gradient(x) @ curl.T),
        fixed=OUTSIDE | {"right": "x", "back": "xz", "top": "xy"},
    )


def _dilating(lam: float) -> Manufactured:
    """Return psi e_x: its dilatation is as large as its shear, its pressure lam times that."""
    along = np.array([1.0, 0.0, 0.0])
    return Manufactured(
        u=lambda x: _psi(x)[..., None] * along,
        gradient=lambda x: along[:, None] * _psi_gradient(x)[..., None, :],
        force=lambda x: (
            3 * np.pi**2 * _psi(x)[..., None] * along - (lam + 1) * _psi_hessian(x)[..., 0]
        ),
        fixed=OUTSIDE | {"right": "yz", "back": "y", "top": "z"},
    )


@case(
    "Roache, Verification and Validation in Computational Science and Engineering (1998); orders: "
    "Ciarlet, The Finite Element Method for Elliptic Problems (1978), section 3.2; near 1/2 "
    "Stenberg, Math Comp 42:9 (1984)",
    mesh="an eighth of the unit cube on three meshes, 4 to 18 cells along a side of the cube",
)
def manufactured() -> Checks:
    """Manufactured fields converge with orders 3 and 2, nu = 0.3 to 0.4999."""
    fields = {"divergence-free": _divergence_free, "dilating": _dilating}
    ceilings = (("L2", 5e-4), ("H1 seminorm", 1e-2))  # of errors on the finest mesh
    # Poisson's ratio, cells along half a side, and fields.
    convergence = (
        (0.3, (2, 4, 7), ("divergence-free",)),
        (0.3, (3, 5, 8), ("dilating",)),
        (0.49, (3, 5, 9), ("divergence-free", "dilating")),
        (0.4999, (3, 5, 9), ("divergence-free", "dilating")),
    )
    for nu, cells, names in convergence:
        problems = [fields[name](unit_solid(nu).first_lame) for name in names]
        errors = np.array([_errors(n, nu, problems) for n in cells])  # (meshes, fields, norms)
        for k, name in enumerate(names):
            for j, (norm, ceiling) in enumerate(ceilings):
                e, what = errors[:, k, j], f"{name}, nu = {nu:g}"
                yield order(f"{what}: order in {norm}", 0.5 / np.array(cells), e, 3 - j, 0.1)
                last = f"{what}: error in {norm} over stress / modulus, finest mesh"
                yield below(last, e[-1], ceiling)


def distorted_cube() -> TetMesh:
    """Return a unit cube of ten-node tetrahedra with randomly moved inner corners."""
    straight = meshes.extrude(*[np.linspace(0, 1, 4)] * 3, order=1)
    points = straight.points.copy()
    inner = ((points > 1e-9) & (points < 1 - 1e-9)).all(axis=1)
    points[inner] += np.random.default_rng(3).uniform(-0.08, 0.08, (inner.sum(), 3))
    return meshes.quadratic(replace(straight, points=points))


def cube_with_slivers() -> TetMesh:
    """Return a unit cube with an inner corner close to a facet: one dihedral angle is 0.5°."""
    straight = meshes.extrude(*[np.linspace(0, 1, 4)] * 3, order=1)
    corner = int(np.argmin(np.linalg.norm(straight.points - 1 / 3, axis=1)))
    tet = next(t for t in straight.tets if corner in t)
    points = straight.points.copy()
    facet = points[[n for n in tet if n != corner]].mean(axis=0)
    points[corner] += 0.985 * (facet - points[corner])
    return meshes.quadratic(replace(straight, points=points))


def _linear_field(mesh: TetMesh, poisson: float, bar: float, where: str = "") -> Check:
    """Check the linear field that is prescribed on the boundary of a mesh."""
    exact = mesh.points @ np.random.default_rng(0).standard_normal((3, 3)).T
    u = _with_boundary_values(mesh, poisson, exact.ravel(), np.zeros(mesh.n_dofs))
    return below(f"{RATIO}{where}", _largest_error(u, exact), bar)


def _with_boundary_values(mesh: TetMesh, poisson: float, field: Floats, force: Floats) -> Floats:
    """Return the displacement (3 n,) with the field prescribed on the boundary."""
    fixed = np.zeros(mesh.points.shape, bool)
    fixed[np.unique(meshes.boundary_facets(mesh.tets))] = True
    return _solver(mesh, poisson, fixed)(field, force)


def _solver(
    mesh: TetMesh, poisson: float, fixed: Mapping[str, str] | ArrayLike
) -> Callable[[Floats, Floats], Floats]:
    """Factorise once; return a function of a field, prescribed where `fixed`, and a force."""
    is_fixed = fixed_dofs(mesh, fixed)
    K = fem.assemble(mesh, unit_solid(poisson), fixed=np.zeros(mesh.points.shape, bool)).K
    inner = np.flatnonzero(~is_fixed)
    factor = fem.factorise(K[inner][:, inner])

    def solve(field: Floats, force: Floats) -> Floats:
        u = np.where(is_fixed, field, 0.0)
        u[inner] = factor.solve((force - K @ u)[inner])
        return u

    return solve


def _largest_error(u: Floats, exact: Floats) -> float:
    return float(np.abs(u - exact.ravel()).max() / np.abs(exact).max())


def _errors(n: int, nu: float, problems: Iterable[Manufactured]) -> list[tuple[float, float]]:
    """Return errors in L2 and in the H1 seminorm of each field, by the 14-point rule.

    They are relative to the field, and divided by the ratio of its stress to its gradient. This
    ratio reaches thousands for dilating fields near Poisson's ratio 1/2. The shear modulus is 1.
    """
    first_lame = unit_solid(nu).first_lame
    mesh = meshes.extrude(*[np.linspace(0, 0.5, n + 1)] * 3)
    solver = cache(lambda fixed: _solver(mesh, nu, dict(fixed)))
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
        u = solve(problem.u(mesh.points).ravel(), force.ravel()).reshape(-1, 3)[mesh.tets]
        slopes = np.einsum("eai,qal,ejl->eqij", u, D, np.linalg.inv(edges), optimize=True)
        exact, gradient = problem.u(x), problem.gradient(x)
        dilatation = np.trace(gradient, axis1=-2, axis2=-1)[..., None, None]
        stress = gradient + gradient.swapaxes(-1, -2) + first_lame * dilatation * np.eye(3)
        ratio = size(stress) / size(gradient)
        value = size(np.einsum("qa,eai->eqi", N, u) - exact) / size(exact)
        errors.append((value / ratio, size(slopes - gradient) / size(gradient) / ratio))
    return errors


def _psi(x: Floats) -> Floats:
    return np.prod(np.sin(np.pi * x), axis=-1)


def _psi_gradient(x: Floats) -> Floats:
    # A derivative turns the sine of its axis by a quarter.
    return np.pi * np.prod(np.sin(np.pi * (x[..., None, :] + np.eye(3) / 2)), axis=-1)


def _psi_hessian(x: Floats) -> Floats:
    turns = (np.eye(3)[:, None] + np.eye(3)) / 2
    return np.pi**2 * np.prod(np.sin(np.pi * (x[..., None, None, :] + turns)), axis=-1)
