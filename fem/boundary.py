"""Boundary conditions: fixed degrees of freedom, elastic supports and absorbing dashpots."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from fem.load_and_probe import facet_geometry, facet_normals
from fem.sparsity import dofs_of, from_entries
from meshes import MeshError, TetMesh, facet_set
from meshes.tetmesh import FACES, facet_keys
from simple_model.layers.material import Material
from simple_model.typing import Bools, Floats, Ints


@dataclass(frozen=True, kw_only=True, eq=False)
class Support:
    """Elastic and absorbing support of a surface.

    A smooth stiffness has an edge that does not depend on the mesh, unlike fixed facets.

    Parameters
    ----------
    facets : (k, a) int, nodes of the facets
    stiffness : (k q,) float, N/m3, of the springs at the points of `facet_points`
    absorbed : (k q,) float, share of the surface with dashpots there
    """

    facets: Ints
    stiffness: Floats
    absorbed: Floats


def fixed_dofs(mesh: TetMesh, fixed: str | Mapping[str, str] | ArrayLike) -> Bools:
    """Return a mask (3 n,) of the fixed degrees of freedom."""
    if isinstance(fixed, str):
        fixed = {fixed: "xyz"}
    if not isinstance(fixed, Mapping):
        mask = np.asarray(fixed, bool)
        if mask.shape != mesh.points.shape:
            raise ValueError(f"fixed has shape {mask.shape}; give shape {mesh.points.shape}")
        return mask.ravel()
    mask = np.zeros(mesh.points.shape, bool)
    for name, components in fixed.items():
        if not components or set(components) - set("xyz"):
            raise ValueError(f"fixed components of '{name}' are '{components}'; use 'x', 'y', 'z'")
        for component in components:
            mask[np.unique(facet_set(mesh, name)), "xyz".index(component)] = True
    return mask.ravel()


def springs(mesh: TetMesh, support: Support) -> sparse.csr_array:
    """Return the Winkler foundation (3 n, 3 n) of a support: int k delta_ij N_a N_b dA."""
    facets, k = _nonzero_facets(support.facets, support.stiffness)
    return _over_facets(mesh, facets, k[:, :, None, None] * np.eye(3))


def dashpots(
    mesh: TetMesh, nodes: Ints, materials: list[Material], region: Ints, share: Floats | None = None
) -> sparse.csr_array:
    """Return the Lysmer-Kuhlemeyer damping (3 n, 3 n) in N s/m of absorbing facets (e, a).

    `region` has the index of each element's material, and `share` (e q,) the fraction of the
    damping at each quadrature point.
    """
    if share is not None:
        nodes, share = _nonzero_facets(nodes, share)
    m = [materials[r] for r in region[owners(mesh, nodes)]]
    shear = np.array([x.density * x.shear_speed for x in m])
    absorbed_ratio = 11.0  # (c_p / c_s)**2 at nu = 0.45; stiffer dashpots would pin normal motion
    squared_ratio = np.array(
        [min((x.pressure_speed / x.shear_speed) ** 2, absorbed_ratio) for x in m]
    )
    pressure = shear * np.sqrt(squared_ratio)
    unit = facet_normals(mesh, nodes).reshape(len(nodes), -1, 3)
    normal = unit[..., :, None] * unit[..., None, :]
    impedance = pressure[:, None, None, None] * normal
    impedance += shear[:, None, None, None] * (np.eye(3) - normal)
    if share is not None:
        impedance *= share[:, :, None, None]
    return _over_facets(mesh, nodes, impedance)


def _nonzero_facets(nodes: Ints, values: Floats) -> tuple[Ints, Floats]:
    """Return the facets (k, a) whose values are not all 0, and these values (k, q)."""
    by_facet = values.reshape(len(nodes), -1)
    nonzero = by_facet.any(axis=1)
    return nodes[nonzero], by_facet[nonzero]


def _over_facets(mesh: TetMesh, nodes: Ints, traction: Floats) -> sparse.csr_array:
    """Return int N_a t_ij N_b dA (3 n, 3 n) of t (k, q, i, j) at the points of facets (k, a)."""
    N, normals = facet_geometry(mesh.points[nodes])
    area = np.linalg.norm(normals, axis=2)
    local = np.einsum("eq,eqij,qa,qb->eaibj", area, traction, N, N, optimize=True)
    dofs = dofs_of(nodes)
    shape = mesh.n_dofs, mesh.n_dofs
    return from_entries(local, dofs[..., None, None], dofs[:, None, None], shape)


def owners(mesh: TetMesh, nodes: Ints) -> Ints:
    """Return the tetrahedron behind each facet: the one with all its corners."""
    n = len(mesh.points)
    corner_sets = mesh.tets[:, FACES[:, :3]].reshape(-1, 3)
    keys = facet_keys(corner_sets, n)
    order = np.argsort(keys)
    wanted = facet_keys(nodes, n)
    nearest = order[np.minimum(np.searchsorted(keys, wanted, sorter=order), len(order) - 1)]
    if not (keys[nearest] == wanted).all():
        raise MeshError("a facet belongs to no tetrahedron; use facets of the same mesh")
    return nearest // 4
