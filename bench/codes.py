"""Assembly of K and M and factorisation of M + c K by each code, as in its documentation.

All codes share the time loop, loads and probes, which refer to the nodes of the mesh; `to_nodes`
maps them to a code's own dofs. Only assembly and factorisation differ.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu, spsolve
from scipy.spatial import cKDTree

Solve = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, kw_only=True)
class Problem:
    """A body of straight 10-node tetrahedra.

    `nodes` (n, 3) in metres, corners first; `cells` (m, 10) in VTK's order; `surface` (k, 3), the
    corners of boundary facets; `mu` in Pa, `nu`, `rho` in kg/m3, for scikit-fem also (m, 1).
    """

    nodes: np.ndarray
    cells: np.ndarray
    surface: np.ndarray
    mu: Any
    nu: Any
    rho: Any

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
    import fem
    import meshes

    mesh = meshes.TetMesh(points=p.nodes, tets=p.cells)
    material = fem.Material(density=p.rho, shear_modulus=p.mu, poisson=p.nu)
    started = time.perf_counter()
    ops = fem.assemble(mesh, material, fixed=np.zeros(mesh.points.shape, bool))
    seconds = time.perf_counter() - started
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
    for face in p.surface.tolist():
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

    class Product:
        def __init__(self, matrix: Any) -> None:
            self._of = _of_arrays(matrix)

        def __matmul__(self, x: np.ndarray) -> np.ndarray:
            return self._of(x)

    products = (Product(matrix.mat) for matrix in (K, M))
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

    return Assembled(seconds, K, M, _renumber(numbers), factorise)


def _superlu(A: Any) -> Solve:
    return splu(A.tocsc()).solve


def _renumber(numbers: np.ndarray) -> sparse.csr_array:
    n = len(numbers)
    return sparse.csr_array((np.ones(n), (numbers, np.arange(n))), shape=(n, n))


def _match_nodes(points: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Return the number of the node at each point."""
    distance, number = cKDTree(nodes).query(points)
    if distance.max() > 1e-9:
        raise ValueError(f"a point lies {distance.max():g} m from every node")
    return number


# Assembly of each code, and its package.
CODES = {
    "skinwave": (skinwave, "skinwave"),
    "scikit-fem": (scikit_fem, "scikit-fem"),
    "ngsolve": (ngsolve, "ngsolve"),
    "felupe": (felupe, "felupe"),
}
