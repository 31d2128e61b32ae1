"""Assembly of K and M on the same mesh of 10-node tetrahedra, by every code that is installed.

Each code is given the same corner points and tetrahedra and the same elastic material, assembles
its stiffness and its mass once to warm up on a small mesh, and then on the large one. The checks
are the strain energy of one given displacement and the total mass, so that all assemble the same.
"""

import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

MU, NU, RHO = 25e3, 0.45, 1000.0
LAM = 2 * MU * NU / (1 - 2 * NU)

Check = tuple[float, float]  # strain energy in J of u = (x^2, x y, 0); mass in kg
Timed = tuple[float, Check]


def stretched(x: np.ndarray) -> np.ndarray:
    """The displacement (n, 3) by which stiffnesses are compared."""
    return np.column_stack([x[:, 0] ** 2, x[:, 0] * x[:, 1], np.zeros(len(x))])


def skinwave(points: np.ndarray, tets: np.ndarray) -> Timed:
    import fem
    import meshes

    mesh = meshes.quadratic(meshes.TetMesh(points=points, tets=tets))
    material = fem.Material(density=RHO, shear_modulus=MU, poisson=NU)
    started = time.perf_counter()
    ops = fem.assemble(mesh, material, fixed=np.zeros(mesh.points.shape, bool))
    seconds = time.perf_counter() - started
    u = stretched(mesh.points).ravel()
    return seconds, (float(u @ ops.K @ u / 2), float(ops.M.sum() / 3))


def scikit_fem(points: np.ndarray, tets: np.ndarray) -> Timed:
    from skfem import Basis, BilinearForm, ElementTetP2, ElementVector, MeshTet
    from skfem.helpers import ddot, dot, eye, sym_grad, trace

    mesh = MeshTet(np.ascontiguousarray(points.T), np.ascontiguousarray(tets.T))

    @BilinearForm
    def stiffness(u: Any, v: Any, w: Any) -> Any:
        e = sym_grad(u)
        return ddot(2 * MU * e + LAM * eye(trace(e), 3), sym_grad(v))

    @BilinearForm
    def mass(u: Any, v: Any, w: Any) -> Any:
        return RHO * dot(u, v)

    started = time.perf_counter()
    basis = Basis(mesh, ElementVector(ElementTetP2()), intorder=2)
    K = stiffness.assemble(basis)
    M = mass.assemble(Basis(mesh, basis.elem, intorder=4))
    seconds = time.perf_counter() - started
    u = np.zeros(K.shape[0])
    where = basis.doflocs
    values = stretched(where.T)
    for dofs, component in zip(_component_dofs(basis), range(3), strict=True):
        u[dofs] = values[dofs, component]
    one = np.zeros_like(u)
    one[next(_component_dofs(basis))] = 1.0
    return seconds, (float(u @ K @ u / 2), float(one @ M @ one))


def _component_dofs(basis: Any) -> Iterator[np.ndarray]:
    for component in range(3):
        yield np.concatenate(
            [basis.nodal_dofs[component].ravel(), basis.edge_dofs[component].ravel()]
        )


def ngsolve(points: np.ndarray, tets: np.ndarray) -> Timed:
    import ngsolve as ng
    from netgen.meshing import Element2D, Element3D, FaceDescriptor, MeshPoint, Pnt
    from netgen.meshing import Mesh as NetgenMesh

    import meshes

    raw = NetgenMesh(dim=3)
    numbers = [raw.Add(MeshPoint(Pnt(*point))) for point in points.tolist()]
    for tet in tets.tolist():
        raw.Add(Element3D(1, [numbers[i] for i in tet]))
    raw.Add(FaceDescriptor(surfnr=1, domin=1, bc=1))
    for face in meshes.boundary_facets(tets).tolist():
        raw.Add(Element2D(1, [numbers[i] for i in face]))
    mesh = ng.Mesh(raw)
    started = time.perf_counter()
    space = ng.VectorH1(mesh, order=2)
    u, v = space.TnT()

    def strain(w: Any) -> Any:
        return ng.Sym(ng.Grad(w))

    elastic = 2 * MU * ng.InnerProduct(strain(u), strain(v)) + LAM * ng.div(u) * ng.div(v)
    with ng.TaskManager():
        K = ng.BilinearForm(space, symmetric=False)
        K += elastic * ng.dx
        K.Assemble()
        M = ng.BilinearForm(RHO * u * v * ng.dx).Assemble()
    seconds = time.perf_counter() - started
    field, one = ng.GridFunction(space), ng.GridFunction(space)
    field.Set(ng.CF((ng.x * ng.x, ng.x * ng.y, 0)))
    one.Set(ng.CF((1, 0, 0)))
    energy = ng.InnerProduct(field.vec, (K.mat * field.vec).Evaluate()) / 2
    return seconds, (energy, ng.InnerProduct(one.vec, (M.mat * one.vec).Evaluate()))


def felupe(points: np.ndarray, tets: np.ndarray) -> Timed:
    import felupe as fe

    import meshes

    quadratic = meshes.quadratic(meshes.TetMesh(points=points, tets=tets))
    mesh = fe.Mesh(np.array(quadratic.points), np.array(quadratic.tets), "tetra10")
    started = time.perf_counter()
    region = fe.RegionQuadraticTetra(mesh)
    field = fe.FieldContainer([fe.Field(region, dim=3)])
    umat = fe.LinearElastic(E=2 * MU * (1 + NU), nu=NU)
    K = fe.SolidBody(umat, field).assemble.matrix()
    fine = fe.RegionQuadraticTetra(mesh, quadrature=fe.quadrature.Tetrahedron(order=5))
    heavy = fe.FieldContainer([fe.Field(fine, dim=3)])
    M = fe.SolidBody(umat, heavy, density=RHO).assemble.mass()
    seconds = time.perf_counter() - started
    u = stretched(quadratic.points).ravel()
    return seconds, (float(u @ K @ u / 2), float(M.sum() / 3))


def sfepy(points: np.ndarray, tets: np.ndarray) -> Timed:
    from sfepy.base.base import output
    from sfepy.discrete import FieldVariable, Integral, Material
    from sfepy.discrete.fem import FEDomain, Field, Mesh
    from sfepy.mechanics.matcoefs import stiffness_from_lame
    from sfepy.terms import Term

    output.set_output(quiet=True)
    cells = [np.asarray(tets, np.int32)]
    mesh = Mesh.from_data("body", points, None, cells, [np.zeros(len(tets), np.int32)], ["3_4"])
    domain = FEDomain("domain", mesh)
    omega = domain.create_region("Omega", "all")
    started = time.perf_counter()
    space = Field.from_args("u", np.float64, "vector", omega, approx_order=2)
    u = FieldVariable("u", "unknown", space)
    v = FieldVariable("v", "test", space, primary_var_name="u")
    m = Material("m", D=stiffness_from_lame(3, LAM, MU), rho=RHO)
    elastic = Term.new("dw_lin_elastic(m.D, v, u)", Integral("i", 2), omega, m=m, v=v, u=u)
    inertia = Term.new("dw_dot(m.rho, v, u)", Integral("j", 4), omega, m=m, v=v, u=u)
    matrices = []
    for term in (elastic, inertia):
        term.setup()
        matrices.append(_sfepy_matrix(term, u))
    seconds = time.perf_counter() - started
    K, M = matrices
    x = space.get_coor()
    values = stretched(x).ravel()
    return seconds, (float(values @ K @ values / 2), float(M.sum() / 3))


def _sfepy_matrix(term: Any, u: Any) -> Any:
    from scipy import sparse

    blocks, _ = term.evaluate(mode="weak", diff_var="u", standalone=True, asm_obj=None)
    econn = u.field.econn
    n, a = len(econn), econn.shape[1]
    # Element matrices are ordered component by component.
    dofs = (3 * econn[:, None, :] + np.arange(3)[None, :, None]).reshape(n, 3 * a)
    rows = np.repeat(dofs, 3 * a, axis=1).ravel()
    columns = np.tile(dofs, (1, 3 * a)).ravel()
    size = 3 * u.field.n_nod
    return sparse.coo_array((np.ravel(blocks), (rows, columns)), shape=(size, size)).tocsr()


CODES: dict[str, Callable[[np.ndarray, np.ndarray], Timed]] = {
    "skinwave": skinwave,
    "scikit-fem": scikit_fem,
    "ngsolve": ngsolve,
    "felupe": felupe,
    "sfepy": sfepy,
}
