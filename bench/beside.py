"""Cost of other codes to assemble and to step in time, and their motion of a fingertip.

Each code assembles K and M and factorises M + c K as in its documentation, in a process of its own.
The time loop, loads and probes are shared; they refer to the nodes of the mesh, and `to_nodes` maps
them to a code's own dofs. The skin slab has free sides, because not every code has absorbing ones,
and Poisson's ratio 0.45, up to which plain quadratic tetrahedra do not lock.
"""

import argparse
import contextlib
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from importlib.metadata import version
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, splu, spsolve
from scipy.spatial import cKDTree

import fem
import meshes
from bench import in_process, table, timed
from skinwave.bodies.build import build
from skinwave.models.options import SolveOptions
from skinwave.models.reduced import answer, reduce_scene
from skinwave.scene import paper15
from skinwave.scene.scene import PROBES, Body
from skinwave.verify import statics

Solve = Callable[[np.ndarray], np.ndarray]
SKIN = replace(fem.PRESETS["palm"], poisson=0.45)
BODY = Body(material=SKIN, sides="free")
TACTON = "am140-stm20"
ACROSS = (8, 40)  # cells of the blocks of the assembly, the first a warm-up
SIZE = 4.7e-3  # m, elements of the waves
RATE, STEPS = 10_000, 1000  # steps per second, for an error of 1 %; steps that are timed


@dataclass(frozen=True, kw_only=True)
class Problem:
    """A body of straight 10-node tetrahedra: `nodes` (n, 3) in m, corners first; `cells` (m, 10)
    in VTK's order; `mu` in Pa, `nu`, `rho` in kg/m3, for scikit-fem also (m, 1).
    """

    nodes: np.ndarray
    cells: np.ndarray
    mu: Any = SKIN.shear_modulus
    nu: Any = SKIN.poisson
    rho: Any = SKIN.density

    @property
    def tets(self) -> np.ndarray:
        return self.cells[:, :4]

    @property
    def points(self) -> np.ndarray:
        """The corners, which most codes take."""
        return self.nodes[: self.tets.max() + 1]

    @property
    def lam(self) -> Any:
        return 2 * self.mu * self.nu / (1 - 2 * self.nu)


@dataclass
class Assembled:
    """Operators of a code: `K` and `M` multiply vectors of its own dofs by `@`.

    `to_nodes` (3 n, dofs) gives the displacement of the nodes, component fastest. `factorise(c,
    free)` returns a function that solves with M + c K on the free dofs and returns 0 on the others.
    """

    seconds: float
    K: Any
    M: Any
    to_nodes: sparse.csr_array
    factorise: Callable[[float, np.ndarray], Solve]

    def check(self, nodes: np.ndarray) -> tuple[float, float]:
        """Return the strain energy in J of u = (x^2, x y, 0) and the mass in kg."""
        x, y, _ = nodes.T
        bent, moved = np.zeros((2, *nodes.shape))
        bent[:, 0], bent[:, 1], moved[:, 0] = x * x, x * y, 1
        transfer = sparse.csc_matrix(self.to_nodes)  # spsolve needs a matrix, not an array
        u, one = (spsolve(transfer, values.ravel()) for values in (bent, moved))
        return float(u @ (self.K @ u) / 2), float(one @ (self.M @ one))


def skinwave(p: Problem) -> Assembled:
    mesh = meshes.TetMesh(points=p.nodes, tets=p.cells)
    material = fem.Material(density=p.rho, shear_modulus=p.mu, poisson=p.nu)
    free = np.zeros(mesh.points.shape, bool)
    ops, seconds = timed(fem.assemble, mesh, material, fixed=free)
    return _scipy(seconds, ops.K, ops.M, np.arange(mesh.n_dofs), lambda A: fem.factorise(A).solve)


def scikit_fem(p: Problem) -> Assembled:
    from skfem import Basis, BilinearForm, ElementTetP2, ElementVector, MeshTet
    from skfem.helpers import ddot, dot, eye, sym_grad, trace

    mesh = MeshTet(np.ascontiguousarray(p.points.T), np.ascontiguousarray(p.tets.T))

    @BilinearForm
    def stiffness(u: Any, v: Any, w: Any) -> Any:
        e = sym_grad(u)
        return ddot(2 * p.mu * e + p.lam * eye(trace(e), 3), sym_grad(v))

    @BilinearForm
    def mass(u: Any, v: Any, w: Any) -> Any:
        return p.rho * dot(u, v)

    started = time.perf_counter()
    basis = Basis(mesh, ElementVector(ElementTetP2()), intorder=2)
    K = stiffness.assemble(basis)
    M = mass.assemble(Basis(mesh, basis.elem, intorder=4))
    seconds = time.perf_counter() - started
    component = np.empty(K.shape[0], int)
    for i in range(3):
        component[basis.nodal_dofs[i]] = component[basis.edge_dofs[i]] = i
    # Its example 19 steps in time with SciPy's splu.
    return _scipy(seconds, K, M, 3 * _match_nodes(basis.doflocs.T, p.nodes) + component, _superlu)


def ngsolve(p: Problem) -> Assembled:
    import ngsolve as ng
    from netgen.meshing import Element2D, Element3D, FaceDescriptor, MeshPoint, Pnt
    from netgen.meshing import Mesh as NetgenMesh

    raw = NetgenMesh(dim=3)
    numbers = [raw.Add(MeshPoint(Pnt(*point))) for point in p.points.tolist()]
    for tet in p.tets.tolist():
        raw.Add(Element3D(1, [numbers[i] for i in tet]))
    raw.Add(FaceDescriptor(surfnr=1, domin=1, bc=1))
    for face in meshes.boundary_facets(p.tets).tolist():
        raw.Add(Element2D(1, [numbers[i] for i in face]))
    mesh = ng.Mesh(raw)
    started = time.perf_counter()
    space = ng.VectorH1(mesh, order=2)
    u, v = space.TnT()

    def strain(w: Any) -> Any:
        return ng.Sym(ng.Grad(w))

    elastic = 2 * p.mu * ng.InnerProduct(strain(u), strain(v)) + p.lam * ng.div(u) * ng.div(v)
    with ng.TaskManager():
        K = ng.BilinearForm(elastic * ng.dx).Assemble()
        M = ng.BilinearForm(p.rho * u * v * ng.dx).Assemble()
    seconds = time.perf_counter() - started

    def factorise(c: float, free: np.ndarray) -> Solve:
        A = M.mat.CreateMatrix()
        A.AsVector().data = M.mat.AsVector() + c * K.mat.AsVector()
        return _of_arrays(A.Inverse(ng.BitArray(free.tolist()), inverse="sparsecholesky"))

    shape = (space.ndof, space.ndof)
    products = (LinearOperator(shape, _of_arrays(each.mat), dtype=float) for each in (K, M))
    return Assembled(seconds, *products, _from_hierarchical(p, mesh), factorise)


def _of_arrays(operator: Any) -> Solve:
    """Wrap an operator of NGSolve for numpy arrays; copies take a few thousandths of its time."""
    x, y = operator.CreateColVector(), operator.CreateRowVector()

    def apply(values: np.ndarray) -> np.ndarray:
        x.FV().NumPy()[:] = values
        y.data = operator * x
        return y.FV().NumPy().copy()

    return apply


def _from_hierarchical(p: Problem, mesh: Any) -> sparse.csr_array:
    """Map NGSolve's dofs, values at corners and one bubble for each edge, to nodal values."""
    import ngsolve as ng

    ends = np.array([[vertex.nr for vertex in edge.vertices] for edge in mesh.edges])
    middles = (p.points[ends[:, 0]] + p.points[ends[:, 1]]) / 2
    node, corners, edges = _match_nodes(middles, p.nodes), len(p.points), len(ends)
    bubble = ng.GridFunction(ng.H1(mesh, order=2))
    bubble.vec[corners] = 1
    height = bubble(mesh(*middles[0]))
    rows = np.concatenate([np.arange(corners), node, node, node])
    columns = np.concatenate([np.arange(corners), *ends.T, corners + np.arange(edges)])
    values = np.concatenate([np.ones(corners), np.full(2 * edges, 0.5), np.full(edges, height)])
    scalar = sparse.csr_array((values, (rows, columns)), shape=(len(p.nodes), corners + edges))
    # NGSolve orders dofs component by component, skinwave node by node.
    by_component = sparse.csr_array(sparse.kron(np.eye(3), scalar))
    return by_component[np.arange(3 * len(p.nodes)).reshape(3, -1).T.ravel()]


def felupe(p: Problem) -> Assembled:
    import felupe as fe

    mesh = fe.Mesh(p.nodes, p.cells, "tetra10")
    started = time.perf_counter()
    region = fe.RegionQuadraticTetra(mesh)
    field = fe.FieldContainer([fe.Field(region, dim=3)])
    umat = fe.LinearElastic(E=2 * p.mu * (1 + p.nu), nu=p.nu)
    K = fe.SolidBody(umat, field).assemble.matrix()
    fine = fe.RegionQuadraticTetra(mesh, quadrature=fe.quadrature.Tetrahedron(order=5))
    heavy = fe.FieldContainer([fe.Field(fine, dim=3)])
    M = fe.SolidBody(umat, heavy, density=p.rho).assemble.mass()
    seconds = time.perf_counter() - started
    # Its Newton solver calls SciPy's spsolve, which uses splu for a single right-hand side.
    return _scipy(seconds, K, M, np.arange(K.shape[0]), _superlu)


def _scipy(
    seconds: float, K: Any, M: Any, numbers: np.ndarray, factorised: Callable[[Any], Solve]
) -> Assembled:
    """Return matrices of SciPy; dof i is component `numbers[i]` of the mesh."""

    def factorise(c: float, free: np.ndarray) -> Solve:
        dofs = np.flatnonzero(free)
        solve = factorised(sparse.csr_array(M + c * K)[dofs][:, dofs])

        def on_all(b: np.ndarray) -> np.ndarray:
            x = np.zeros(len(b))
            x[dofs] = solve(b[dofs])
            return x

        return on_all

    to_nodes = sparse.csr_array((np.ones(len(numbers)), (numbers, np.arange(len(numbers)))))
    return Assembled(seconds, K, M, to_nodes, factorise)


def _superlu(A: Any) -> Solve:
    return splu(A.tocsc()).solve


def _match_nodes(points: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Return the number of the node at each point."""
    distance, number = cKDTree(nodes).query(points)
    if distance.max() > 1e-9:
        raise ValueError(f"a point lies {distance.max():g} m from every node")
    return number


# Assembly of each code, by the name of its package.
CODES = {
    "skinwave": skinwave, "scikit-fem": scikit_fem, "ngsolve": ngsolve, "felupe": felupe
}  # fmt: skip


def assembly() -> None:
    """Print the time of each code to assemble K and M of a block."""
    small, large = (problem(block(n)) for n in ACROSS)
    print(f"K and M of {len(large.cells):,} ten-node tetrahedra")
    row = table("code", "version", "time", "ratio", "energy", "mass")
    first = None
    for name, seconds, energy, mass in each_code(time_assembly, small, large):
        first = first or seconds
        ratio, package = seconds / first, version(name)[:11]
        row(name, package, f"{seconds:.2f} s", f"{ratio:.1f}", f"{energy:.6e} J", f"{mass:.6f} kg")


def waves() -> None:
    """Print the time of one and of fifteen Tactons of 1 s on the skin slab, extrapolated."""
    tacton = dict(paper15.tactons())[TACTON]
    scene = paper15.scenes("bench", tacton, {"slab": BODY})["slab"]
    mesh, times = build(BODY, SIZE).mesh, np.arange(STEPS + 1) / RATE
    P, points = fem.pressure_operator(mesh), fem.facet_points(mesh)
    load = {
        "fixed": mesh.facets["bottom"],
        "forces": sparse.csr_array(P @ scene.pressure(points, times).T),
        "probes": fem.probe_operator(mesh, PROBES),
    }
    prepared, offline = timed(reduce_scene, scene, SolveOptions(h=SIZE))
    online = timed(answer, prepared, scene)[1]
    one, fifteen = offline + online, offline + 15 * online
    print(f"{mesh.n_dofs:,} dofs, {RATE:,} steps a second")
    row = table("code", "assemble, s", "factorise, s", "step, ms", "1 Tacton, s", "ratio", "15, s",
                "ratio", "to ours")  # fmt: skip
    row("skinwave, reduced", "", "", "", f"{one:.1f}", "1", f"{fifteen:.1f}", "1", "")
    ours = None
    for name, assembled, factorised, step, motion in each_code(time_steps, problem(mesh), load):
        once, second = assembled + factorised, step * RATE
        ours = motion if ours is None else ours
        apart = np.linalg.norm(motion - ours) / np.linalg.norm(ours)
        row(name, f"{assembled:.2f}", f"{factorised:.2f}", f"{1e3 * step:.2f}",
            f"{once + second:.0f}", f"{(once + second) / one:.0f}", f"{once + 15 * second:.0f}",
            f"{(once + 15 * second) / fifteen:.0f}", f"{apart:.1e}")  # fmt: skip


def fingertip() -> None:
    """Print the motion of the fingertip with and without bone, by scikit-fem."""
    mesh = statics.fingertip()
    for name, materials in statics.FINGERTIPS.items():
        solids = [materials[r] for r in mesh.region.tolist()]
        mu, nu, rho, viscosity = (
            np.array([getattr(m, key) for m in solids])[:, None]
            for key in ("shear_modulus", "poisson", "density", "viscosity")
        )
        tip = problem(mesh, mu=mu, nu=nu, rho=rho)
        body, C = CODES["scikit-fem"](tip), CODES["scikit-fem"](replace(tip, mu=viscosity)).K
        free = np.flatnonzero(free_dofs(body, mesh.facets["sides"]))
        force, w = body.to_nodes.T @ statics.fingertip_push(mesh), 2 * np.pi * statics.FREQUENCY
        motions = zip(statics.fingertip_motion(mesh, materials),
                      (body.K, body.K + 1j * w * C - w**2 * body.M), strict=True)  # fmt: skip
        for own, A in motions:
            found = np.zeros(len(force), A.dtype)
            factor = splu(sparse.csc_matrix(A)[free][:, free])
            found[free] = factor.solve(force[free].astype(A.dtype))
            other = body.to_nodes @ found
            apart = np.abs(own - other).max() / np.abs(other).max()
            print(f"{name}: largest difference {apart:.1e}")
            print(statics.fingertip_summary(mesh, other).tolist())


def time_assembly(name: str, small: Problem, large: Problem) -> tuple[float, float, float]:
    """Return the seconds of a code after a warm-up, with strain energy in J and mass in kg."""
    with threads(name):
        CODES[name](small)
        body = CODES[name](large)
        return body.seconds, *body.check(large.nodes)


def time_steps(
    name: str, given: Problem, load: dict[str, Any]
) -> tuple[float, float, float, np.ndarray]:
    """Return the seconds of assembly, factorisation and a step of average acceleration from rest,
    and the displacement (t, p) of the probes.
    """
    with threads(name):
        body, dt, lag = CODES[name](given), 1 / RATE, SKIN.viscosity / SKIN.shear_modulus
        free = free_dofs(body, load["fixed"])
        forces, read = body.to_nodes.T @ load["forces"], load["probes"] @ body.to_nodes
        solve, factorised = timed(body.factorise, dt / 2 * lag + dt**2 / 4, free)
        u = v = np.zeros(len(free))
        a = body.factorise(0.0, free)(forces[:, [0]].toarray().ravel())  # at rest
        motion, seconds = [read @ u], []
        for k in range(1, STEPS + 1):
            force, started = forces[:, [k]].toarray().ravel(), time.perf_counter()
            u, v = u + dt * v + dt**2 / 4 * a, v + dt / 2 * a
            a = solve(force - body.K @ (u + lag * v))
            u, v = u + dt**2 / 4 * a, v + dt / 2 * a
            motion.append(read @ u)
            seconds.append(time.perf_counter() - started)
    # The median ignores steps delayed by other processes.
    return body.seconds, factorised, float(np.median(seconds)), np.array(motion)


def free_dofs(body: Assembled, facets: np.ndarray) -> np.ndarray:
    """Return which dofs of a code do not move the nodes of some facets."""
    return abs(body.to_nodes[(3 * np.unique(facets)[:, None] + range(3)).ravel()]).sum(axis=0) == 0


def threads(name: str) -> contextlib.AbstractContextManager[Any]:
    if name != "ngsolve":
        return contextlib.nullcontext()
    from ngsolve import TaskManager

    return TaskManager()


def block(across: int) -> meshes.TetMesh:
    line = np.linspace(-0.05, 0.05, across + 1)
    return meshes.extrude(line, line, np.linspace(-0.02, 0, across // 4 + 1))


def problem(mesh: meshes.TetMesh, **material: Any) -> Problem:
    return Problem(nodes=np.array(mesh.points), cells=np.array(mesh.tets), **material)


def each_code(run: Callable[..., tuple], *given: Any) -> Iterator[tuple]:
    """Yield the name and the measurements of each installed code, from a process of its own."""
    for name in CODES:
        try:
            yield name, *in_process(run, name, *given)
        except ImportError as error:
            print(f"{name}: not measured: {error}", flush=True)


if __name__ == "__main__":
    tables = {"assembly": assembly, "waves": waves, "fingertip": fingertip}
    parser = argparse.ArgumentParser(description=__doc__, prog="python -m bench.beside")
    parser.add_argument("table", nargs="*", choices=tables, default=[*tables])
    for name in parser.parse_args().table:
        tables[name]()
