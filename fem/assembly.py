"""Assembly of the stiffness, damping and mass matrices of a body.

    K_ab,ij = int lam N_a,i N_b,j + mu (N_a,j N_b,i + delta_ij N_a,k N_b,k) dV
    M_ab,ij = delta_ij int rho N_a N_b dV
    C       = (viscosity/mu) K
              + R, the damping of the absorbing boundaries and layers:
    R       = int rho (c_p n n + c_s (1 - n n)) N_a N_b dA on absorbing facets
                (Lysmer and Kuhlemeyer, ASCE EM4, 1969)
              + int drag rho N_a N_b dV in an absorbing (sponge) layer before them
    K      += int k delta_ij N_a N_b dA where a surface rests on springs of k per area
    K_j     = (mu_j/mu) K of the elements with a Prony term of one relaxation time: the stiffness
              of a generalised Maxwell branch, see `maxwell`

A loss factor is replaced by Prony terms. Thin layers at a surface are added by `coat`, orthotropy
and tension of a sheet by `plane_stiffness`. Where nu > 0.45, most of lam acts on a projection of
the dilatation (`pressure_projection`). Without it, volumetric locking makes displacements a few
wavelengths away several per cent too small.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from fem.boundary import Support, dashpots, fixed_dofs, springs
from fem.coat import Coat, coat_operators
from fem.combination import Combination, Laws, viscoelastic
from fem.geometry import gradient_integrals, jacobians, shape_nodes
from fem.maxwell import Branch, add_matrices, property_of
from fem.memory import check_memory
from fem.plane_stiffness import (
    SIDES,
    Tension,
    directional_parts,
    orthotropic_stiffness,
    tension_stiffness,
)
from fem.pressure_projection import projected_divergence
from fem.sparsity import UPPER, SparsityPattern, in_each_direction, restrict, select, slabs
from meshes import TetMesh, facet_set
from meshes.elements import shape_functions, tetrahedron_rule
from simple_model.layers.material import Material
from simple_model.typing import Bools, Floats, Ints

Materials = Material | Mapping[int, Material]
Fixed = str | Mapping[str, str] | ArrayLike
# K as a function of shares (r,) of the materials' moduli, and M of their densities (r,).
Volume = tuple[Callable[[Floats], sparse.csr_array], Callable[[Floats], sparse.csr_array]]


@dataclass(frozen=True, kw_only=True, eq=False)
class Operators:
    """Operators of M u'' + C u' + K u = f on the free degrees of freedom.

    Parameters
    ----------
    K, C, M : (n_free, n_free) sparse, equilibrium (fully relaxed) stiffness in N/m, damping in
        N s/m and mass in kg
    R : (n_free, n_free) sparse, the part of C in absorbing boundaries and layers
    free : (n_free,) int, free degrees of freedom among the 3 n displacement components of the mesh,
        component fastest
    n_dofs : number of all degrees of freedom, 3 n
    branches : generalised Maxwell branches in parallel with K
    laws : C and the branches as combinations of K, or None
    """

    K: sparse.csr_array
    C: sparse.csr_array
    M: sparse.csr_array
    R: sparse.csr_array
    free: Ints
    n_dofs: int
    branches: tuple[Branch, ...] = ()
    laws: Laws | None = None

    def expand(self, values: Floats) -> Floats:
        """Return values (n_free, ...) on all dofs (n_dofs, ...), 0 where the body is fixed."""
        full = np.zeros((self.n_dofs, *values.shape[1:]), values.dtype)
        full[self.free] = values
        return full

    def combinations(self) -> Laws:
        """Return `laws` if they hold for these matrices, otherwise the matrices themselves."""
        matrices = self.K, self.C, *(branch.K for branch in self.branches)
        if self.laws and [*map(id, self.laws.matrices)] == [*map(id, matrices)]:
            return self.laws
        damping, *relaxing = (Combination(rest=A) for A in matrices[1:])
        return Laws(damping=damping, branches=tuple(relaxing), matrices=matrices)


@dataclass(frozen=True, kw_only=True, eq=False)
class MovingNodes:
    """Nodes (n,) with a free component, their pattern, and their free components (f,)."""

    nodes: Ints
    pattern: SparsityPattern
    free: Ints

    @staticmethod
    def of(mesh: TetMesh, free: Ints) -> MovingNodes:
        """Return the moving nodes of a mesh with free degrees of freedom (f,)."""
        nodes = np.unique(free // 3)
        number = np.full(len(mesh.points), len(nodes))
        number[nodes] = np.arange(len(nodes))
        pattern = SparsityPattern.of(number[mesh.tets], len(nodes))
        return MovingNodes(nodes=nodes, pattern=pattern, free=3 * number[free // 3] + free % 3)

    def on_free(self, A: Any) -> sparse.csr_array:
        """Restrict a matrix on these nodes to the free degrees of freedom."""
        return restrict(A, self.free)

    def of_elements(self, own: Bools | Ints) -> SparsityPattern:
        """Return the pattern with the slots of some elements only."""
        return replace(self.pattern, slot=self.pattern.slot[own])


def assemble(
    mesh: TetMesh,
    material: Materials,
    *,
    fixed: Fixed = "clamped",
    absorbing: str | Ints | None = None,
    drag: Floats | None = None,
    support: Support | None = None,
    coat: Coat | None = None,
    tension: Tension | None = None,
    axes: Floats | None = None,
    stiffener: sparse.csr_array | None = None,
) -> Operators:
    """Assemble the operators of a body.

    Parameters
    ----------
    material : Material, or mapping of region numbers to Materials
    fixed : name of a facet set that does not move; or mapping of facet sets to fixed components,
        such as {"bottom": "xyz", "left": "x"}; or (n, 3) bool, True where fixed
    absorbing : absorbing facets (dashpots): name of a facet set, or nodes; or None
    drag : (m,) float, 1/s, mass-proportional damping of each element of an absorbing layer
    support : springs and dashpots on a surface, or None
    coat : thin layers at a surface that replace the material meshed there, or None
    tension : in-plane tension of a sheet along its sides, or None
    axes : (2, 3) float, unit vectors along the sides of an orthotropic or stretched sheet; the
        coordinate axes by default
    stiffener : (3 n, 3 n) N/m, further elastic stiffness, such as a `shell_stiffness`, that scales
        with the modulus of the first material; or None

    Raises
    ------
    ValueError
        If a region has no material, or every node is fixed.
    MeshError
        If a facet set is unknown or an element is inverted.
    MemoryError
        If the matrices need more memory than is free.

    Examples
    --------
    >>> import fem, meshes
    >>> mesh = meshes.block((0.02, 0.02, 0.01), 0.005)
    >>> ops = fem.assemble(mesh, fem.PRESETS["palm"], fixed="bottom", absorbing="sides")
    >>> ops.K.shape, mesh.n_dofs
    ((972, 972), 1215)
    """
    given, region = by_region(mesh, material)
    materials = [m.without_loss_factor() for m in given]
    free = np.flatnonzero(~fixed_dofs(mesh, fixed))
    if not len(free):
        raise ValueError("every node is fixed; leave part of the body free to move")
    check_memory(len(free))
    nodes = MovingNodes.of(mesh, free)

    axes = SIDES if axes is None else axes
    stiffness, mass = _volume(mesh, nodes, materials, region, axes, stiffener)
    extra = R = sparse.csr_array((len(free), len(free)))  # added to K, and to C
    if support is not None and support.stiffness.any():
        extra = extra + restrict(springs(mesh, support), free)
    if tension is not None:
        extra = extra + nodes.on_free(tension_stiffness(mesh, nodes.pattern, tension, axes))
    if absorbing is not None:
        R = R + restrict(dashpots(mesh, facet_set(mesh, absorbing), given, region), free)
    if support is not None and support.absorbed.any():
        of_support = dashpots(mesh, support.facets, given, region, support.absorbed)
        R = R + restrict(of_support, free)
    if drag is not None:
        R = R + _drag(mesh, nodes, property_of(materials, "density")[region] * drag)
    K, C, M, branches, combined = viscoelastic(
        materials, stiffness, mass,
        springs=extra if extra.nnz else None, absorbing=R if R.nnz else None,
    )  # fmt: skip
    if coat is not None:
        of_coat = coat_operators(mesh, coat, materials, region, fixed_dofs(mesh, fixed))
        thin = [restrict(A, free) for A in of_coat[:3]]
        relaxing = tuple(replace(b, K=restrict(b.K, free)) for b in of_coat[3])
        K, C, M, branches = add_matrices((K, C, M, branches), (*thin, relaxing))
    return Operators(
        K=K, C=C, M=M, R=R, free=free, n_dofs=mesh.n_dofs, branches=branches,
        laws=combined if coat is None else None,
    )  # fmt: skip


def _volume(
    mesh: TetMesh,
    nodes: MovingNodes,
    materials: list[Material],
    region: Ints,
    axes: Floats,
    stiffener: sparse.sparray | None,
) -> Volume:
    """Return K as a function of shares (r,) of the moduli, and M of densities (r,)."""
    mu, lam = (property_of(materials, name) for name in ("shear_modulus", "first_lame"))
    direct = direct_part(lam, mu) if mesh.order == 2 else lam
    extra: dict[int, Any] = {}
    for m in np.flatnonzero(lam > direct).tolist():
        D = (lam - direct)[m] ** 0.5 * projected_divergence(elements_of(mesh, region == m))
        D = select(D, np.arange(D.shape[0] // 4), nodes.nodes)
        extra[m] = (D.T @ D).T  # symmetric; the transpose is sorted, as sums need
    for m, added in directional_parts(materials).items():
        own = region == m
        part = orthotropic_stiffness(elements_of(mesh, own), nodes.of_elements(own), added, axes)
        extra[m] = extra.get(m, 0) + part
    if stiffener is not None:
        blocks = sparse.bsr_array(stiffener, blocksize=(3, 3))
        extra[0] = extra.get(0, 0) + select(blocks, nodes.nodes, nodes.nodes)

    def stiffness(share: Floats) -> sparse.csr_array:
        blocks = element_stiffness(mesh, (share * mu)[region], (share * direct)[region])
        parts = (part if share[m] == 1 else share[m] * part for m, part in extra.items())
        return nodes.on_free(sum(parts, start=nodes.pattern.blocks(blocks)))

    def mass(rho: Floats) -> sparse.csr_array:
        return nodes.on_free(_mass(mesh, nodes.pattern, rho[region]))

    return stiffness, mass


def direct_part(lam: Floats, mu: Floats) -> Floats:
    """Return the part (r,) of lam in Pa that acts on the dilatation itself, not its projection."""
    locking_free = 9.001  # lam / mu just beyond nu = 0.45: 10-node tetrahedra do not lock up to it
    unprojected = 2.0  # lam / mu of the unprojected part beyond it: 1 to 3 give the least error
    return np.where(lam > locking_free * mu, unprojected * mu, lam)


def elements_of(mesh: TetMesh, chosen: Bools | Ints) -> TetMesh:
    """Return a mesh of some elements (m,) and all nodes."""
    return replace(mesh, tets=mesh.tets[chosen], region=mesh.region[chosen], facets={})


def element_stiffness(mesh: TetMesh, mu: Floats, lam: Floats) -> Iterator[tuple[slice, Floats]]:
    """Yield slabs of elements and their stiffness blocks (6, e, a, b) in N/m for the components
    `UPPER`, for Lame's parameters mu and lam (e,) in Pa.
    """

    def coefficients(slab: slice, G: Floats) -> Floats:
        l2, m2 = lam[slab, None], mu[slab, None]
        shear = m2 * (G[0, 0] + G[1, 1] + G[2, 2])
        return np.array([l2 * G[i, j] + m2 * G[j, i] + (i == j) * shear for i, j in UPPER])

    return gradient_integrals(mesh, coefficients)


def element_masses(mesh: TetMesh, rho: Floats) -> Iterator[tuple[slice, Floats]]:
    """Yield slabs of elements and their mass matrices (e, a, b) in kg."""
    n_nodes, shapes = mesh.tets.shape[1], shape_nodes(mesh)
    N = shape_functions(tetrahedron_rule(5)[0], n_nodes)
    NN = np.einsum("qa,qb->qab", N, N).reshape(len(N), -1)
    for slab in slabs(len(mesh.tets)):
        weights = rho[slab, None] * jacobians(shapes[slab], 5, slab.start)[2]
        yield slab, (weights @ NN).reshape(-1, n_nodes, n_nodes)


def _mass(mesh: TetMesh, pattern: SparsityPattern, rho: Floats) -> sparse.csr_array:
    """Return the consistent mass matrix int rho N_a N_b dV on the nodes of a pattern."""
    return in_each_direction(pattern.nodal(element_masses(mesh, rho)))


def _drag(mesh: TetMesh, nodes: MovingNodes, rate: Floats) -> sparse.csr_array:
    """Return the damping matrix of a drag (m,) in kg/m3/s that is 0 in most elements."""
    layer = np.flatnonzero(rate)
    R = _mass(elements_of(mesh, layer), nodes.of_elements(layer), rate[layer])
    R.eliminate_zeros()
    return nodes.on_free(R)


def by_region(mesh: TetMesh, material: Materials) -> tuple[list[Material], Ints]:
    """Return the materials of a mesh, and the index (e,) of the material of each element."""
    if isinstance(material, Material):
        return [material], np.zeros(len(mesh.tets), np.int64)
    if not isinstance(material, Mapping):
        raise ValueError(f"material is {material!r}; give a Material, or one for each region")
    numbers, index = np.unique(mesh.region, return_inverse=True)
    if missing := sorted(set(numbers.tolist()) - set(material)):
        raise ValueError(f"regions {missing} have no material; give each region a material")
    return [material[r] for r in numbers.tolist()], index
