"""The fingertip of the verification by scikit-fem on the same mesh: `python -m bench.fingertip`.

Prints the largest difference of any node's motion over the largest motion, and the values that
`skinwave/verify/statics.py` compares with.
"""

from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

import fem
from meshes import TetMesh
from skinwave.verify import statics as ours


def scikit_fem(mesh: TetMesh, materials: dict[int, fem.Material]) -> tuple[np.ndarray, np.ndarray]:
    """Motion (3 n,) at rest and at the frequency, of a fingertip held at its cut."""
    from skfem import Basis, BilinearForm, ElementTetP2, ElementVector, MeshTet
    from skfem.helpers import ddot, dot, eye, sym_grad, trace

    corners, tets = np.unique(mesh.tets[:, :4], return_inverse=True)
    peer = MeshTet(mesh.points[corners].T.copy(), tets.reshape(-1, 4).T.copy(), sort_t=False)
    basis = Basis(peer, ElementVector(ElementTetP2()), intorder=2)
    fine = Basis(peer, basis.elem, intorder=4)

    def by_element(name: str, of: Any) -> np.ndarray:
        values = np.array([getattr(materials[r], name) for r in mesh.region.tolist()])
        return np.repeat(values[:, None], of.X.shape[-1], axis=1)

    @BilinearForm
    def stiffness(u: Any, v: Any, w: Any) -> Any:
        e = sym_grad(u)
        return ddot(2 * w.mu * e + w.lam * eye(trace(e), 3), sym_grad(v))

    @BilinearForm
    def mass(u: Any, v: Any, w: Any) -> Any:
        return w.rho * dot(u, v)

    mu, lam = by_element("shear_modulus", basis), by_element("first_lame", basis)
    lag = by_element("viscosity", basis) / mu
    K = stiffness.assemble(basis, mu=mu, lam=lam)
    C = stiffness.assemble(basis, mu=lag * mu, lam=lag * lam)
    M = mass.assemble(fine, rho=by_element("density", fine))
    component = np.empty(K.shape[0], int)
    for i in range(3):
        component[basis.nodal_dofs[i]] = component[basis.edge_dofs[i]] = i
    away, node = cKDTree(mesh.points).query(basis.doflocs.T)
    assert away.max() < 1e-12
    dof, free = 3 * node + component, np.flatnonzero(~np.isin(node, mesh.facets["sides"]))
    force, w = ours.fingertip_push(mesh)[dof], 2 * np.pi * ours.FREQUENCY

    def solved(A: Any) -> np.ndarray:
        found = np.zeros(len(dof), A.dtype)
        factor = splu(sparse.csc_matrix(A)[free][:, free])
        found[dof[free]] = factor.solve(force[free].astype(A.dtype))
        return found

    return solved(K), solved(K + 1j * w * C - w**2 * M)


def main() -> None:
    """Compare, and print the values."""
    mesh = ours.fingertip()
    for name, materials in ours.FINGERTIPS.items():
        motions = ours.fingertip_motion(mesh, materials), scikit_fem(mesh, materials)
        for own, other in zip(*motions, strict=True):
            error = np.abs(own - other).max() / np.abs(other).max()
            print(f"{name}: largest difference {error:.1e}")
            print(ours.fingertip_summary(mesh, other).tolist())


if __name__ == "__main__":
    main()
