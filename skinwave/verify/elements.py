"""Element tests: patch tests on distorted meshes, and input that must be refused."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

import fem
import meshes
from fem.assembly import element_stiffness
from fem.boundary import fixed_dofs
from meshes import MeshError, TetMesh
from meshes.tetmesh import EDGES
from skinwave.verify.case import Case, Check, below, described, yes
from skinwave.verify.references import Floats

DisplacementField = Callable[[Floats], Floats]
FLATTEST_ANGLE = 0.5  # degrees
ZIENKIEWICZ = "Zienkiewicz and Taylor, The Finite Element Method, volume 1 (2000)"
PATCH = f"Irons and Razzaque (1972); {ZIENKIEWICZ}, chapter 10"


def distorted_cube() -> TetMesh:
    """A unit cube of ten-node tetrahedra whose inner corners are shaken."""
    straight = meshes.extrude(*[np.linspace(0, 1, 4)] * 3, order=1)
    points = straight.points.copy()
    inner = ((points > 1e-9) & (points < 1 - 1e-9)).all(axis=1)
    points[inner] += np.random.default_rng(3).uniform(-0.08, 0.08, (inner.sum(), 3))
    return meshes.quadratic(replace(straight, points=points))


def cube_with_slivers() -> TetMesh:
    """The same with one inner corner so near a facet that a dihedral angle is half a degree."""
    straight = meshes.extrude(*[np.linspace(0, 1, 4)] * 3, order=1)
    corner = int(np.argmin(np.linalg.norm(straight.points - 1 / 3, axis=1)))
    tet = next(t for t in straight.tets if corner in t)
    others = straight.points[[n for n in tet if n != corner]]
    start, end = straight.points[corner], others.mean(axis=0)

    def bent(fraction: float) -> TetMesh:
        points = straight.points.copy()
        points[corner] = start + fraction * (end - start)
        return replace(straight, points=points)

    low, high = 0.0, 0.9999
    for _ in range(40):
        middle = (low + high) / 2
        flat = dihedral_angles(bent(middle)).min() < FLATTEST_ANGLE
        low, high = (low, middle) if flat else (middle, high)
    return meshes.quadratic(bent(low))


def dihedral_angles(mesh: TetMesh) -> Floats:
    """The six angles (m, 6) between the sides of each tetrahedron, degrees."""
    x = mesh.points[mesh.tets[:, :4]]
    gradients = np.linalg.inv(x[:, 1:] - x[:, :1]).transpose(0, 2, 1)
    normals = np.concatenate([-gradients.sum(axis=1, keepdims=True), gradients], axis=1)
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    pairs = np.einsum("eki,eki->ek", normals[:, EDGES[:, 0]], normals[:, EDGES[:, 1]])
    return np.degrees(np.arccos(np.clip(-pairs, -1, 1)))


def patch() -> Case:
    """A linear field on distorted tetrahedra."""
    mesh = distorted_cube()
    return Case(
        title="Patch test: a linear field on distorted tetrahedra",
        source=f"{PATCH}: must be exact",
        mesh=described(mesh, f"least dihedral angle {dihedral_angles(mesh).min():.0f} degrees"),
        checks=tuple(
            _followed(mesh, nu, 1e-10, f", nu = {nu:g}") for nu in (0.0, 0.3, 0.49, 0.4999)
        ),
    )


def quadratic_patch() -> Case:
    """A quadratic field with its body force, which ten nodes represent exactly."""
    mesh, mu, lam = distorted_cube(), 1.0, 1.5
    x = mesh.points
    field = np.stack([x[:, 0] ** 2 + x[:, 1] * x[:, 2], x[:, 1] ** 2, x[:, 0] * x[:, 2]], axis=1)
    minus_force = np.array([(lam + mu) * 3 + 2 * mu, (lam + mu) * 2 + 2 * mu, 0.0])
    force = np.broadcast_to(-minus_force, x.shape)
    M = fem.assemble(mesh, unit(0.3), fixed=np.zeros(x.shape, bool)).M
    found = held_outside(mesh, 0.3, field.ravel(), M @ force.ravel())
    return Case(
        title="Patch test: a quadratic field with its body force, nu = 0.3",
        source=f"{PATCH}: exact for elements of second order",
        mesh=described(mesh),
        checks=(below("largest error / largest displacement", _gap(found, field), 1e-9),),
    )


def slivers() -> Case:
    """A patch test among nearly flat tetrahedra, and a solution under load."""
    mesh = cube_with_slivers()
    ops = fem.assemble(mesh, unit(0.3), fixed="bottom")
    P = fem.load_operator(mesh)
    f = (P @ np.ones(P.shape[1]))[ops.free]
    left = f - ops.K @ fem.static(ops, P @ np.ones(P.shape[1]))[ops.free]
    flattest = float(dihedral_angles(mesh).min())
    return Case(
        title=f"Slivers: a dihedral angle of {flattest:.2f} degrees",
        source=f"{PATCH}: must be exact on any mesh",
        mesh=described(mesh, f"least dihedral angle {flattest:.2f} degrees"),
        checks=(
            _followed(mesh, 0.3, 1e-8),
            below("residual under load / load", np.linalg.norm(left) / np.linalg.norm(f), 1e-8),
        ),
    )


def inverted() -> Case:
    """An element turned inside out by a mid-side node."""
    mesh = meshes.block((1.0, 1.0, 1.0), 1.0)
    points = mesh.points.copy()
    points[mesh.tets[3, 4]] += 2.0
    bent = replace(mesh, points=points)
    case = refused(
        "Expected invalid: an inverted element is refused with its number",
        f"{ZIENKIEWICZ}, chapter 9: det J > 0",
        described(mesh, "one mid-side node moved by two edge lengths"),
        lambda: next(element_stiffness(bent, *np.ones((2, len(mesh.tets))))),
        MeshError,
        "is inverted",
    )
    touched = np.flatnonzero((mesh.tets == mesh.tets[3, 4]).any(axis=1))
    named = any(case.said.startswith(f"element {e} ") for e in touched)
    check = yes("the element that it names has the moved node", named)
    return replace(case, checks=(*case.checks, check))


def incompressible() -> Case:
    """Poisson's ratio 1/2, beyond a pure displacement formulation."""
    return refused(
        "Expected invalid: Poisson's ratio 0.5 is refused with the limit",
        "Hughes, The Finite Element Method (1987), chapter 4: lambda is infinite",
        "none",
        lambda: unit(0.5),
        ValueError,
        "-1 < poisson < 0.5",
    )


def refused(
    title: str, source: str, mesh: str, act: Callable[[], object], kind: type[ValueError], said: str
) -> Case:
    """A case of invalid input: it passes if the program refuses and names the limit."""
    try:
        act()
        sentence = "nothing: it was accepted"
    except kind as error:
        sentence = str(error)
    check = yes(f'refused, naming "{said}"', said in sentence)
    return Case(title=title, source=source, mesh=mesh, checks=(check,), said=sentence)


def _followed(mesh: TetMesh, poisson: float, bar: float, where: str = "") -> Check:
    exact = mesh.points @ np.random.default_rng(0).standard_normal((3, 3)).T
    found = held_outside(mesh, poisson, exact.ravel(), np.zeros(mesh.n_dofs))
    return below(f"largest error / largest displacement{where}", _gap(found, exact), bar)


def held_outside(mesh: TetMesh, poisson: float, field: Floats, force: Floats) -> Floats:
    """Displacement (3 n,) of the mesh with the field prescribed on its boundary."""
    fixed = np.zeros(mesh.points.shape, bool)
    fixed[np.unique(meshes.boundary_facets(mesh.tets))] = True
    return solver_held(mesh, poisson, fixed)(field, force)


def solver_held(
    mesh: TetMesh, poisson: float, fixed: Mapping[str, str] | ArrayLike
) -> Callable[[Floats, Floats], Floats]:
    """The same for any field and force by one factor, where `fixed` is prescribed."""
    held = fixed_dofs(mesh, fixed)
    K = fem.assemble(mesh, unit(poisson), fixed=np.zeros(mesh.points.shape, bool)).K
    inner = np.flatnonzero(~held)
    factor = fem.factorise(K[inner][:, inner])

    def solve(field: Floats, force: Floats) -> Floats:
        u = np.where(held, field, 0.0)
        u[inner] = factor.solve((force - K @ u)[inner])
        return u

    return solve


def _gap(found: Floats, exact: Floats) -> float:
    return float(np.abs(found - exact.ravel()).max() / np.abs(exact).max())


def unit(poisson: float) -> fem.Material:
    """Density 1 and shear modulus 1."""
    return fem.Material(density=1, shear_modulus=1, poisson=poisson)
