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
              of a generalised Maxwell branch, see `maxwell`; a loss factor is such terms, see
              `constant_loss`
    and likewise of thin layers at a surface, see `coat`; K of a sheet that is orthotropic or in
    tension has further parts, see `plane_stiffness`

Where nu > 0.45 most of lam acts on a projection of the dilatation, see `pressure_projection`;
without that volumetric locking makes displacements some wavelengths away several per cent too
small.
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
from fem.combination import Laws, proportional
from fem.elements import shape_functions, tetrahedron_rule
from fem.geometry import gradient_integrals, jacobians, shape_nodes
from fem.maxwell import (
    Branch,
    on_free,
    property_of,
    together,
    viscoelastic,
)  # fmt: skip
from fem.memory import check_memory
from fem.plane_stiffness import (
    SIDES,
    Tension,
    directional_parts,
    orthotropic_stiffness,
    tension_stiffness,
)
from fem.pressure_projection import projected_divergence
from fem.sparsity import (
    UPPER,
    SparsityPattern,
    in_each_direction,
    restricted,
    selected,
    slabs,
)
from fem.typing import Bools, Floats, Ints
from meshes import TetMesh, facet_set
from simple_model.layers.material import Material

LOCKING_FREE = 9.001  # lam / mu just beyond nu = 0.45: 10-node tetrahedra do not lock up to it
UNPROJECTED = (
    2.0  # lam / mu of the unprojected part beyond it; a slab's error was least with 1 to 3
)


Materials = Material | Mapping[int, Material]
Fixed = str | Mapping[str, str] | ArrayLike
# K of shares (r,) of each material's moduli, and M of their densities (r,), on the free dofs.
Volume = tuple[Callable[[Floats], sparse.csr_array], Callable[[Floats], sparse.csr_array]]


@dataclass(frozen=True, kw_only=True, eq=False)
class Operators:
    """M u'' + C u' + K u = f on the free degrees of freedom.

    `K`, `C`, `M` are sparse (n_free, n_free), and so is `R`, the part of C in absorbing boundaries
    and layers; `free` (n_free,) numbers their rows among the 3 n displacement components of the
    mesh, component fastest. `branches` are generalised Maxwell branches in parallel with K, the
    equilibrium (fully relaxed) stiffness. `laws` are C and these as combinations of K and M; None
    where there are none, and where one of the matrices is replaced.
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
        """Values (n_free, ...) on all dofs (n_dofs, ...), 0 where the body is fixed."""
        full = np.zeros((self.n_dofs, *values.shape[1:]), values.dtype)
        full[self.free] = values
        return full


@dataclass(frozen=True, kw_only=True, eq=False)
class MovingNodes:
    """Nodes (n,) that have a free component, their sparsity pattern, and the free ones (f,) among
    their components.
    """

    nodes: Ints
    pattern: SparsityPattern
    free: Ints

    @staticmethod
    def of(mesh: TetMesh, free: Ints) -> MovingNodes:
        """Those of a mesh with free degrees of freedom (f,)."""
        nodes = np.unique(free // 3)
        number = np.full(len(mesh.points), len(nodes))
        number[nodes] = np.arange(len(nodes))
        return MovingNodes(
            nodes=nodes,
            pattern=SparsityPattern.of(number[mesh.tets], len(nodes)),
            free=3 * number[free // 3] + free % 3,
        )

    def on_free(self, A: Any) -> sparse.csr_array:
        """A matrix on these nodes on the free degrees of freedom."""
        return restricted(A, self.free)

    def of_elements(self, own: Bools | Ints) -> SparsityPattern:
        """The pattern with the slots of some of the elements."""
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
    mesh : TetMesh
    material : one Material, or region number -> Material
    fixed : the name of a facet set that does not move; or facet set -> the components that do
        not, such as {"bottom": "xyz", "left": "x"}; or an (n, 3) bool array, True where fixed.
    absorbing : absorbing facets (dashpots), by the name of their set or as nodes, or None.
    drag : (m,) float, 1/s, mass-proportional damping of each element in an absorbing layer
    support : springs and dashpots of a surface as functions of position, or None
    coat : thin layers at a surface, in place of the material that is meshed there, or None
    tension : in-plane tension of a sheet along its sides, or None
    axes : (2, 3) float, unit vectors along x and y of a sheet that is orthotropic or stretched,
        those of the coordinates if not given
    stiffener : (3 n, 3 n) N/m, elastic stiffness beside that of the elements, such as that of a
        `shell_stiffness`, which scales with the modulus of the first material; or None

    Returns
    -------
    Operators
        K in N/m, C in N s/m and M in kg of the free degrees of freedom.

    Raises
    ------
    ValueError
        If a region has no material, or no degree of freedom is left.
    MeshError
        If a facet set is unknown or an element is inverted.
    MemoryError
        If there is no memory for the matrices.
    """
    given, region = by_region(mesh, material)
    materials = [m.without_loss_factor() for m in given]
    free = np.flatnonzero(~fixed_dofs(mesh, fixed))
    if not len(free):
        raise ValueError("every node is fixed; leave some of the body free to move")
    check_memory(len(free))
    nodes = MovingNodes.of(mesh, free)

    axes = SIDES if axes is None else axes
    volume = _volume(mesh, nodes, materials, region, axes, stiffener)
    beside = R = sparse.csr_array((len(free), len(free)))  # of K, and of C
    if support is not None and support.stiffness.any():
        beside = beside + restricted(springs(mesh, support), free)
    if tension is not None:
        beside = beside + nodes.on_free(tension_stiffness(mesh, nodes.pattern, tension, axes))
    if absorbing is not None:
        leaky = dashpots(mesh, facet_set(mesh, absorbing), given, region)
        R = R + restricted(leaky, free)
    if support is not None and support.absorbed.any():
        leaky = dashpots(mesh, support.facets, given, region, support.absorbed)
        R = R + restricted(leaky, free)
    if drag is not None:
        R = R + _drag(mesh, nodes, property_of(materials, "density")[region] * drag)
    if len(materials) == 1 and materials[0].law is None:
        K, M = volume[0](np.ones(1)), volume[1](np.array([materials[0].density]))
        del volume  # whose parts free their memory
        K = K + beside if beside.nnz else K
        C, branches, laws = proportional(materials[0], K, beside, R)
    else:
        K, C, M, branches = viscoelastic(materials, *volume)
        del volume
        K, C = (A + B if B.nnz else A for A, B in ((K, beside), (C, R)))
        laws = None
    if coat is not None:
        of_coat = coat_operators(mesh, coat, materials, region, fixed_dofs(mesh, fixed))
        thin = *(restricted(A, free) for A in of_coat[:3]), on_free(of_coat[3], free)
        (K, C, M, branches), laws = together((K, C, M, branches), thin), None
    return Operators(
        K=K, C=C, M=M, R=R, free=free, n_dofs=mesh.n_dofs, branches=branches, laws=laws
    )


def _volume(
    mesh: TetMesh,
    nodes: MovingNodes,
    materials: list[Material],
    region: Ints,
    axes: Floats,
    stiffener: sparse.sparray | None,
) -> Volume:
    """K of a share (r,) of each material's moduli, and M of densities (r,), on the free dofs."""
    mu, lam = (property_of(materials, name) for name in ("shear_modulus", "first_lame"))
    direct = direct_part(lam, mu) if mesh.order == 2 else lam
    beside: dict[int, Any] = {}
    for m in np.flatnonzero(lam > direct).tolist():
        D = (lam - direct)[m] ** 0.5 * projected_divergence(elements_of(mesh, region == m))
        D = selected(D, np.arange(D.shape[0] // 4), nodes.nodes)
        beside[m] = (D.T @ D).T  # symmetric, but now it is sorted, which sums need
    for m, added in directional_parts(materials).items():
        own = region == m
        part = orthotropic_stiffness(elements_of(mesh, own), nodes.of_elements(own), added, axes)
        beside[m] = beside.get(m, 0) + part
    if stiffener is not None:
        blocks = sparse.bsr_array(stiffener, blocksize=(3, 3))
        beside[0] = beside.get(0, 0) + selected(blocks, nodes.nodes, nodes.nodes)

    def stiffness(share: Floats) -> sparse.csr_array:
        blocks = element_stiffness(mesh, (share * mu)[region], (share * direct)[region])
        parts = (part if share[m] == 1 else share[m] * part for m, part in beside.items())
        return nodes.on_free(sum(parts, start=nodes.pattern.blocks(blocks)))

    def mass(rho: Floats) -> sparse.csr_array:
        return nodes.on_free(_mass(mesh, nodes.pattern, rho[region]))

    return stiffness, mass


def direct_part(lam: Floats, mu: Floats) -> Floats:
    """Unprojected part (r,) of lam in Pa; the rest acts on the projection of the dilatation."""
    return np.where(lam > LOCKING_FREE * mu, UNPROJECTED * mu, lam)


def elements_of(mesh: TetMesh, chosen: Bools | Ints) -> TetMesh:
    """Some of the elements (m,) of a mesh, among all its nodes."""
    return replace(mesh, tets=mesh.tets[chosen], region=mesh.region[chosen], facets={})


def element_stiffness(mesh: TetMesh, mu: Floats, lam: Floats) -> Iterator[tuple[slice, Floats]]:
    """Element stiffness blocks (6, e, a, b) in N/m for the components (i, j) in UPPER, of Lame's
    parameters mu and lam (e,) in Pa, some elements at a time, with their slice. Those below the
    diagonal are these, transposed.
    """

    def elastic(slab: slice, G: Floats) -> Floats:
        l2, m2 = lam[slab, None], mu[slab, None]
        shear = m2 * (G[0, 0] + G[1, 1] + G[2, 2])
        return np.array([l2 * G[i, j] + m2 * G[j, i] + (i == j) * shear for i, j in UPPER])

    return gradient_integrals(mesh, elastic)


def element_masses(mesh: TetMesh, rho: Floats) -> Iterator[tuple[slice, Floats]]:
    """Element mass matrices (e, a, b) in kg, some elements at a time, with their slice."""
    n_nodes, shapes = mesh.tets.shape[1], shape_nodes(mesh)
    N = shape_functions(tetrahedron_rule(5)[0], n_nodes)
    NN = np.einsum("qa,qb->qab", N, N).reshape(len(N), -1)
    for slab in slabs(len(mesh.tets)):
        weights = rho[slab, None] * jacobians(shapes[slab], 5, slab.start)[2]
        yield slab, (weights @ NN).reshape(-1, n_nodes, n_nodes)


def _mass(mesh: TetMesh, pattern: SparsityPattern, rho: Floats) -> sparse.csr_array:
    """Consistent mass matrix int rho N_a N_b dV on the nodes of a pattern."""
    return in_each_direction(pattern.nodal(element_masses(mesh, rho)))


def _drag(mesh: TetMesh, nodes: MovingNodes, rate: Floats) -> sparse.csr_array:
    """Mass-proportional damping matrix of a rate (m,) in kg/m3/s that is 0 in most elements."""
    layer = np.flatnonzero(rate)
    R = _mass(elements_of(mesh, layer), nodes.of_elements(layer), rate[layer])
    R.eliminate_zeros()
    return nodes.on_free(R)


def by_region(mesh: TetMesh, material: Materials) -> tuple[list[Material], Ints]:
    """The materials of a mesh, and the index (e,) of each element's."""
    if isinstance(material, Material):
        return [material], np.zeros(len(mesh.tets), np.int64)
    if not isinstance(material, Mapping):
        raise ValueError(f"material {material!r} is none; give a Material, or one for each region")
    numbers, index = np.unique(mesh.region, return_inverse=True)
    if missing := sorted(set(numbers.tolist()) - set(material)):
        raise ValueError(f"regions {missing} have no material; give one for each region")
    return [material[r] for r in numbers.tolist()], index
