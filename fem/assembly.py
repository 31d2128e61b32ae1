"""Stiffness, damping and mass of a body.

    K_ab,ij = int lam N_a,i N_b,j + mu (N_a,j N_b,i + delta_ij N_a,k N_b,k) dV
    M_ab,ij = delta_ij int rho N_a N_b dV
    C       = (viscosity/mu) K + Rayleigh damping for the loss factor
              + R, what takes waves out of the body:
    R       = int rho (c_p n n + c_s (1 - n n)) N_a N_b dA on absorbing facets
                (Lysmer and Kuhlemeyer, ASCE EM4, 1969)
              + int drag rho N_a N_b dV in a layer before them
    K_j     = (relaxing modulus/mu) K of the elements that relax in the same time, see `relaxation`

Near incompressibility the part of lam beyond nu = 0.45 acts on the element mean of the
dilatation (Nagtegaal, Parks and Rice 1974; Hughes 1980), without which displacements some
wavelengths away come out several per cent too small.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from fem.boundary import dashpots, fixed_dofs
from fem.elements import shape_derivatives, shape_functions, tetrahedron_rule
from fem.materials import Material, rayleigh_damping
from fem.pattern import UPPER, Pattern, from_blocks, from_masses
from fem.relaxation import Branch, on_free
from meshes import MeshError, TetMesh, facet_set
from meshes.tetmesh import EDGES, Floats, Ints

SLAB = 8192  # elements at a time: keeps the temporaries in tens of megabytes
LOCKING_FREE = 9.0  # lam / mu at nu = 0.45, below which 10-node tetrahedra need no remedy
LOSS_BAND = (50.0, 600.0)  # Hz, the lines that a Tacton makes


@dataclass(frozen=True, kw_only=True, eq=False)
class Operators:
    """M u'' + C u' + K u = f on the free degrees of freedom.

    `K`, `C`, `M` are sparse (n_free, n_free), and so is `R`, the part of C that takes waves out
    of the body; `free` (n_free,) numbers their rows among the 3 n displacement components of the
    mesh, component fastest. `branches` pull beside K, which is the stiffness after they relaxed.
    """

    K: sparse.csr_array
    C: sparse.csr_array
    M: sparse.csr_array
    R: sparse.csr_array
    free: Ints
    n_dofs: int
    branches: tuple[Branch, ...] = ()

    def expand(self, values: Floats) -> Floats:
        """Values (n_free, ...) as (n_dofs, ...), 0 where the body is fixed."""
        full = np.zeros((self.n_dofs, *values.shape[1:]), values.dtype)
        full[self.free] = values
        return full


def assemble(
    mesh: TetMesh,
    material: Material | Mapping[int, Material],
    *,
    fixed: str | Mapping[str, str] | ArrayLike = "clamped",
    absorbing: str | Ints | None = None,
    drag: Floats | None = None,
) -> Operators:
    """Operators of a body.

    Parameters
    ----------
    mesh : TetMesh
    material : one Material, or region number -> Material
    fixed : the name of a facet set that does not move; or facet set -> the components that do
        not, such as {"bottom": "xyz", "left": "x"}; or an (n, 3) bool array, True where fixed.
    absorbing : facets that let waves out, by the name of their set or as nodes, or None.
    drag : (m,) float, 1/s, force per momentum in each element that damps waves on their way out

    Raises
    ------
    ValueError
        If a region has no material, or no degree of freedom is left.
    MeshError
        If a facet set is unknown or an element is inverted.
    """
    materials, region = by_region(mesh, material)
    rho, mu, lam, lag = (
        np.array([value(m) for m in materials])[region]
        for value in (
            lambda m: m.density,
            lambda m: m.shear_modulus,
            lambda m: m.first_lame,
            lambda m: m.viscosity / m.shear_modulus,
        )
    )
    a, b = np.array([rayleigh_damping(m.loss_factor, LOSS_BAND) for m in materials]).T
    pattern = Pattern.of(mesh.tets, len(mesh.points))
    free = np.flatnonzero(~fixed_dofs(mesh, fixed))
    if not len(free):
        raise ValueError("every node is fixed; leave some of the body free to move")

    shares = {time: share[region] for time, share in _relaxing_shares(materials).items()}
    K, C, M, branches = _volume_operators(
        mesh, pattern, rho, mu, lam, a[region], b[region] + lag, shares
    )
    R = sparse.csr_array(K.shape)
    if absorbing is not None:
        R = R + dashpots(mesh, facet_set(mesh, absorbing), materials, region)
    if drag is not None:
        R = R + _drag(mesh, pattern, rho * drag)
    C = C + R
    if len(free) < mesh.n_dofs:
        K, C, M, R = (operator[free][:, free] for operator in (K, C, M, R))
        branches = on_free(branches, free)
    return Operators(K=K, C=C, M=M, R=R, free=free, n_dofs=mesh.n_dofs, branches=branches)


def _relaxing_shares(materials: list[Material]) -> dict[float, Floats]:
    """By relaxation time in s: relaxing over lasting modulus (r,) of the materials that have it."""
    times = sorted({m.relaxation_time for m in materials if m.relaxing_modulus > 0})
    return {
        time: np.array(
            [(m.relaxation_time == time) * m.relaxing_modulus / m.shear_modulus for m in materials]
        )
        for time in times
    }


def _volume_operators(
    mesh: TetMesh,
    pattern: Pattern,
    rho: Floats,
    mu: Floats,
    lam: Floats,
    mass_rate: Floats,
    stiffness_lag: Floats,
    relaxing_shares: Mapping[float, Floats],
) -> tuple[sparse.csr_array, sparse.csr_array, sparse.csr_array, tuple[Branch, ...]]:
    """K, C, M and what relaxes in each time, on all degrees of freedom.

    By element C is mass_rate M + stiffness_lag K, and what relaxes its share of K.
    """
    blocks, masses = element_matrices(mesh, rho, mu, lam)
    K, M = from_blocks(pattern, blocks), from_masses(pattern, masses)
    branches = tuple(
        Branch(K=_scaled(pattern, K, blocks, share), time=time)
        for time, share in relaxing_shares.items()
    )
    if np.ptp(mass_rate) == 0 and np.ptp(stiffness_lag) == 0:
        C = stiffness_lag[0] * K if stiffness_lag[0] else sparse.csr_array(K.shape)
        return K, C + mass_rate[0] * M if mass_rate[0] else C, M, branches
    blocks *= stiffness_lag[:, None, None]
    masses *= mass_rate[:, None, None]
    return K, from_blocks(pattern, blocks) + from_masses(pattern, masses), M, branches


def _scaled(
    pattern: Pattern, K: sparse.csr_array, blocks: Floats, share: Floats
) -> sparse.csr_array:
    """K, which the blocks sum to, of a share (e,) of each element's stiffness."""
    if np.ptp(share) == 0:
        return share[0] * K
    part = from_blocks(pattern, blocks * share[:, None, None])
    part.eliminate_zeros()
    return part


def element_matrices(mesh: TetMesh, rho: Floats, mu: Floats, lam: Floats) -> tuple[Floats, Floats]:
    """Element stiffness blocks (k, e, a, b) in N/m for the components (i, j) = UPPER[k], and
    masses (e, a, b) in kg. The blocks below the diagonal are these, transposed.
    """
    m, n_nodes = mesh.tets.shape
    blocks, masses = np.empty((6, m, n_nodes, n_nodes)), np.empty((m, n_nodes, n_nodes))
    projected = np.maximum(lam - LOCKING_FREE * mu, 0.0) if mesh.order == 2 else np.zeros(m)
    direct = lam - projected
    N = shape_functions(tetrahedron_rule(5)[0], n_nodes)
    NN = np.einsum("qa,qb->qab", N, N).reshape(len(N), -1)
    shape_of = mesh.tets[:, :4] if is_straight(mesh) else mesh.tets
    for start in range(0, m, SLAB):
        slab = slice(start, start + SLAB)
        corners = mesh.points[shape_of[slab]]
        slopes, volumes = gradients(corners, n_nodes, 2, start)
        e, q = volumes.shape
        G = (np.sqrt(volumes)[:, :, None, None] * slopes).reshape(e, q, 3 * n_nodes)
        H = np.matmul(G.transpose(0, 2, 1), G).reshape(e, 3, n_nodes, 3, n_nodes)
        l2, m2 = direct[slab, None, None], mu[slab, None, None]
        shear = m2 * np.einsum("eiaib->eab", H)
        mean = np.einsum("eq,eqia->eia", volumes, slopes)
        mean *= np.sqrt(projected[slab] / volumes.sum(axis=1))[:, None, None]
        for k, (i, j) in enumerate(UPPER):
            block = blocks[k, slab]
            np.multiply(l2, H[:, i, :, j], out=block)
            block += m2 * H[:, j, :, i]
            if i == j:
                block += shear
            if projected[slab].any():
                block += mean[:, i, :, None] * mean[:, j, None, :]
        weights = rho[slab, None] * _jacobians(corners, 5, start)[2]
        masses[slab] = (weights @ NN).reshape(e, n_nodes, n_nodes)
    return blocks, masses


def _drag(mesh: TetMesh, pattern: Pattern, rate: Floats) -> sparse.csr_array:
    """int rate N_a N_b dV (3 n, 3 n), of a rate (m,) in kg/m3/s that is 0 in most elements."""
    masses = np.zeros((len(mesh.tets), *2 * mesh.tets.shape[1:]))
    layer = np.flatnonzero(rate)
    none = np.zeros(len(layer))
    part = replace(mesh, tets=mesh.tets[layer], region=mesh.region[layer], facets={})
    masses[layer] = element_matrices(part, rate[layer], none, none)[1]
    R = from_masses(pattern, masses)
    R.eliminate_zeros()
    return R


def is_straight(mesh: TetMesh) -> bool:
    """Whether every mid-side node lies in the middle of its edge."""
    if mesh.order == 1:
        return True
    ends = mesh.points[mesh.tets[:, EDGES]]
    middles = mesh.points[mesh.tets[:, 4:]]
    bow = np.abs(2 * middles - ends[:, :, 0] - ends[:, :, 1]).max()
    return bool(bow < 1e-10 * np.abs(ends[:, :, 0] - ends[:, :, 1]).max())


def gradients(nodes: Floats, n_nodes: int, degree: int, first: int) -> tuple[Floats, Floats]:
    """Shape gradients (e, q, i, a) and quadrature volumes (e, q); `nodes` (e, a, i) give shape."""
    derivatives = shape_derivatives(tetrahedron_rule(degree)[0], n_nodes)
    cofactors, determinants, volumes = _jacobians(nodes, degree, first)
    inverse = cofactors / determinants[..., None, None]
    return np.matmul(inverse.swapaxes(2, 3), derivatives.transpose(0, 2, 1)), volumes


def _jacobians(nodes: Floats, degree: int, first: int) -> tuple[Floats, Floats, Floats]:
    """Cofactors (e, q, l, i) and determinants (e, q) of the map from the reference element, and
    quadrature volumes (e, q). Four nodes span a straight element, where q is 1 for the first two.
    """
    barycentric, weights = tetrahedron_rule(degree)
    at = barycentric[:1] if nodes.shape[1] == 4 else barycentric
    jacobian = np.einsum(
        "qal,eai->eqli", shape_derivatives(at, nodes.shape[1]), nodes, optimize=True
    )
    x, y, z = (jacobian[..., i] for i in range(3))
    cofactors = np.empty_like(jacobian)
    for l in range(3):  # noqa: E741 - the letter of the derivatives
        m, n = (l + 1) % 3, (l + 2) % 3
        cofactors[..., l, 0] = y[..., m] * z[..., n] - z[..., m] * y[..., n]
        cofactors[..., l, 1] = z[..., m] * x[..., n] - x[..., m] * z[..., n]
        cofactors[..., l, 2] = x[..., m] * y[..., n] - y[..., m] * x[..., n]
    determinants = (jacobian[..., 0, :] * cofactors[..., 0, :]).sum(axis=-1)
    inverted = np.flatnonzero((determinants <= 0).any(axis=1))
    if len(inverted):
        raise MeshError(
            f"element {first + inverted[0]} is inverted (and {len(inverted) - 1} more near it); "
            "straighten its mid-side nodes or remesh"
        )
    return cofactors, determinants, determinants * weights / 6


def by_region(
    mesh: TetMesh, material: Material | Mapping[int, Material]
) -> tuple[list[Material], Ints]:
    """The materials that there are, and which of them each element (e,) is made of."""
    if isinstance(material, Material):
        return [material], np.zeros(len(mesh.tets), np.int64)
    if not isinstance(material, Mapping):
        raise ValueError(f"material {material!r} is none; give a Material, or one for each region")
    numbers, index = np.unique(mesh.region, return_inverse=True)
    if missing := sorted(set(numbers.tolist()) - set(material)):
        raise ValueError(f"regions {missing} have no material; give one for each region")
    return [material[r] for r in numbers.tolist()], index
