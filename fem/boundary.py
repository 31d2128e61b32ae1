"""Boundary conditions: fixed degrees of freedom, elastic supports and absorbing dashpots."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from fem.load_and_probe import facet_geometry, facet_normals
from fem.typing import Bools, Floats, Ints
from meshes import MeshError, TetMesh, facet_set
from meshes.tetmesh import FACES, facet_keys
from simple_model.layers.material import Material

ABSORBED_RATIO = 11.0  # (c_p / c_s)**2 at nu = 0.45; a stiffer dashpot would pin the normal motion


@dataclass(frozen=True, kw_only=True, eq=False)
class Support:
    """Elastic and absorbing support of boundary facets (k, a): springs of a `stiffness` (k q,) in
    N/m3 and the share `absorbed` (k q,) of the surface with dashpots, at the points of
    `facet_points`. Where whole facets are fixed the edge of the constrained area follows the mesh;
    that of a smooth stiffness does not.
    """

    facets: Ints
    stiffness: Floats
    absorbed: Floats


def fixed_dofs(mesh: TetMesh, fixed: str | Mapping[str, str] | ArrayLike) -> Bools:
    """Mask (3 n,) bool of the fixed degrees of freedom, whose displacement is 0."""
    if isinstance(fixed, str):
        fixed = {fixed: "xyz"}
    if not isinstance(fixed, Mapping):
        mask = np.asarray(fixed, bool)
        if mask.shape != mesh.points.shape:
            raise ValueError(f"fixed has shape {mask.shape}; give {mesh.points.shape}, node by xyz")
        return mask.ravel()
    mask = np.zeros(mesh.points.shape, bool)
    for name, components in fixed.items():
        if not components or set(components) - set("xyz"):
            raise ValueError(f"fixed components '{components}' of '{name}': use letters of 'xyz'")
        for component in components:
            mask[np.unique(facet_set(mesh, name)), "xyz".index(component)] = True
    return mask.ravel()


def springs(mesh: TetMesh, support: Support) -> sparse.csr_array:
    """Winkler foundation (3 n, 3 n) of a support: int k N_a N_b dA in every direction."""
    held, k = _where(support.facets, support.stiffness)
    return _over_facets(mesh, held, k[:, :, None, None] * np.eye(3))


def dashpots(
    mesh: TetMesh,
    nodes: Ints,
    materials: list[Material],
    region: Ints,
    share: Floats | None = None,
) -> sparse.csr_array:
    """Lysmer-Kuhlemeyer damping (3 n, 3 n) in N s/m of absorbing facets (e, a), by the materials
    and the index of each element's; `share` (e q,) is the fraction of it at each quadrature point.
    """
    if share is not None:
        nodes, share = _where(nodes, share)
    m = [materials[r] for r in region[owners(mesh, nodes)]]
    shear = np.array([x.density * x.shear_speed for x in m])
    squared_ratio = np.array(
        [min((x.pressure_speed / x.shear_speed) ** 2, ABSORBED_RATIO) for x in m]
    )
    pressure = shear * np.sqrt(squared_ratio)
    unit = facet_normals(mesh, nodes).reshape(len(nodes), -1, 3)
    along = unit[..., :, None] * unit[..., None, :]
    impedance = pressure[:, None, None, None] * along
    impedance += shear[:, None, None, None] * (np.eye(3) - along)
    if share is not None:
        impedance *= share[:, :, None, None]
    return _over_facets(mesh, nodes, impedance)


def _where(nodes: Ints, values: Floats) -> tuple[Ints, Floats]:
    """The facets (k, a) on which values (k q,) are not all 0, and these by facet (k, q)."""
    by_facet = values.reshape(len(nodes), -1)
    some = by_facet.any(axis=1)
    return nodes[some], by_facet[some]


def _over_facets(mesh: TetMesh, nodes: Ints, traction: Floats) -> sparse.csr_array:
    """int N_a t_ij N_b dA (3 n, 3 n) of a matrix t (k, q, i, j) at the points of facets (k, a)."""
    N, normals = facet_geometry(mesh, nodes)
    area = np.linalg.norm(normals, axis=2)
    local = np.einsum("eq,eqij,qa,qb->eaibj", area, traction, N, N, optimize=True)
    dofs = (3 * nodes[:, :, None] + np.arange(3)).reshape(len(nodes), 3 * nodes.shape[1])
    rows = np.broadcast_to(dofs[:, :, None].astype(np.int32), (*dofs.shape, dofs.shape[1]))
    columns = rows.transpose(0, 2, 1)
    shape = (mesh.n_dofs, mesh.n_dofs)
    return sparse.csr_array((local.ravel(), (rows.ravel(), columns.ravel())), shape=shape)


def owners(mesh: TetMesh, nodes: Ints) -> Ints:
    """The tetrahedron behind each facet: the one that has all its corners."""
    n = len(mesh.points)
    corner_sets = mesh.tets[:, FACES[:, :3]].reshape(-1, 3)
    keys = facet_keys(corner_sets, n)
    order = np.argsort(keys)
    wanted = facet_keys(nodes, n)
    found = order[np.minimum(np.searchsorted(keys, wanted, sorter=order), len(order) - 1)]
    if not (keys[found] == wanted).all():
        raise MeshError("a facet belongs to no tetrahedron; take facets from the same mesh")
    return found // 4
