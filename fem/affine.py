"""Operators of a body as sums over its materials, of matrices that no modulus or density changes.

    K = sum_r mu_r K_r + held S,   M = sum_r rho_r M_r
    C = sum_r viscosity_r K_r + sqrt(mu_r rho_r) R_r + drag rho_r D_r

with springs S and dashpots R at surfaces, and the absorbing layer D. The added mass F of a fluid,
which can only be applied, joins M (`added_mass`). Poisson's ratios are fixed, so that the dynamic
stiffness

    A(s) = sum_q w_q(s) A_q

is an affine sum with scalar weights, and its projection onto one basis serves every material
(Prud'homme et al., J Fluids Eng 124:70 (2002)). In the steady state mu_r(s) may be the complex
modulus of any law. On a mesh whose nodes move smoothly with a thickness the projected matrices A_q
are smooth in it, and interpolated between those of a few geometries (`interpolated`).
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from fem.added_mass import AddedMass
from fem.assembly import Operators, assemble
from fem.boundary import Support, springs
from fem.coat import Coat
from fem.materials import Material
from fem.maxwell import MaxwellBranch
from fem.products import product
from meshes import TetMesh
from meshes.tetmesh import Floats, Ints

ABSENT = 1e-30  # of a modulus and a density beside 1: below all round-off
KINDS = ("stiffness", "mass", "dashpots", "layer", "springs", "fluid")  # of matrices


@dataclass(frozen=True, kw_only=True)
class Solids:
    """Materials (r,) of a body, of its coat first and then of its regions; factors of its `springs`
    and of the `drag` of its absorbing layer, over those that it was assembled with.
    """

    materials: tuple[Material, ...]
    springs: float = 1.0
    drag: float = 1.0


@dataclass(frozen=True, kw_only=True, eq=False)
class AffineOperators:
    """Matrices (n, n), sparse or projected, of each material (r,) or none of a kind that is not
    there: `stiffness` per shear modulus, `mass` per density, `dashpots` per impedance
    sqrt(mu rho), absorbing `layer` per density; and one matrix or none of `springs`, and of the
    added mass of a `fluid` in kg, a LinearOperator until it is projected.

    `free` (n_free,) and `n_dofs` as of `Operators`.
    """

    stiffness: tuple[Any, ...]
    mass: tuple[Any, ...]
    dashpots: tuple[Any, ...]
    layer: tuple[Any, ...]
    springs: tuple[Any, ...]
    free: Ints
    n_dofs: int
    fluid: tuple[Any, ...] = ()

    @property
    def parts(self) -> tuple[Any, ...]:
        """All matrices A_q, in the order of `weights`."""
        return tuple(part for kind in KINDS for part in getattr(self, kind))


def assemble_affine(
    mesh: TetMesh,
    materials: Sequence[Material],
    *,
    fixed: Any,
    absorbing: Any = None,
    drag: Floats | None = None,
    support: Support | None = None,
    coat: Coat | None = None,
) -> AffineOperators:
    """Assemble the matrices of a body's operators, once for all its materials.

    Parameters
    ----------
    mesh : TetMesh
    materials : (r,), of the coat's layers and then of the regions 0, 1, ...: their Poisson's ratios
    fixed, absorbing, drag, support : as for `assemble`
    coat : thin layers at a surface, whose materials are the first of those given

    Returns
    -------
    AffineOperators
    """
    dashpots_only = support and replace(support, stiffness=np.zeros_like(support.stiffness))
    alone = [_alone(materials, r) for r in range(len(materials))]

    def assembled(each: Sequence[Material], **conditions: Any) -> Operators:
        layers = len(coat.materials) if coat else 0
        return assemble(
            mesh, dict(enumerate(each[layers:])), fixed=fixed,
            coat=coat and replace(coat, materials=tuple(each[:layers])), **conditions,
        )  # fmt: skip

    found = [assembled(each, absorbing=absorbing, support=dashpots_only) for each in alone]
    layer = [] if drag is None else [assembled(each, drag=drag).R for each in alone]
    free = found[0].free
    is_sprung = support and support.stiffness.any()
    held = (springs(mesh, support)[free][:, free],) if support and is_sprung else ()
    return AffineOperators(
        stiffness=tuple(o.K for o in found), mass=tuple(o.M for o in found),
        dashpots=_present([o.R for o in found]), layer=_present(layer), springs=_present(held),
        free=free, n_dofs=mesh.n_dofs,
    )  # fmt: skip


def operators_of(affine: AffineOperators, solids: Solids) -> Operators:
    """Operators of materials without modulus laws of their own; with a fluid, projected ones.

    Impedances of dashpots are those of the moduli that materials are given by.
    """
    materials = [m.without_loss_factor() for m in solids.materials]
    terms = [[term for term in m.prony if term.modulus] for m in materials]
    mu, rho, eta = (
        np.array([getattr(m, name) for m in materials])
        for name in ("shear_modulus", "density", "viscosity")
    )
    impedance = [m.density * m.shear_speed for m in solids.materials]
    R = _sum(affine.dashpots, impedance) + _sum(affine.layer, solids.drag * rho)
    K = _sum(affine.stiffness, mu) + _sum(affine.springs, [solids.springs])
    M = _sum(affine.mass, rho) + _sum(affine.fluid, [1.0])
    C = _sum(affine.stiffness, eta) + R
    branches = [
        MaxwellBranch(K=_sum(affine.stiffness, shares), time=time)
        for time in sorted({term.time for each in terms for term in each})
        if any(shares := [sum(t.modulus for t in each if t.time == time) for each in terms])
    ]
    K, C, M, R = (_like(affine.stiffness[0], part) for part in (K, C, M, R))
    return Operators(
        K=K, C=C, M=M, R=R, free=affine.free, n_dofs=affine.n_dofs, branches=tuple(branches)
    )


def in_vacuum(affine: AffineOperators) -> AffineOperators:
    """The same without a fluid, whose added mass leaves no matrix sparse."""
    return replace(affine, fluid=())


def fluid_of(affine: AffineOperators) -> AddedMass | None:
    """Added mass of a fluid apart from `operators_of` the body in vacuum; None without any."""
    return next((AddedMass(M=F) for F in affine.fluid), None)


def weights(affine: AffineOperators, solids: Solids, frequencies: ArrayLike) -> NDArray[Any]:
    """Weights (f, q) of the matrices in the dynamic stiffness.

    Parameters
    ----------
    affine : AffineOperators, of q matrices
    solids : of any modulus laws
    frequencies : (f,) float, Hz

    Returns
    -------
    (f, q) complex
    """
    s = 2j * np.pi * np.asarray(frequencies, np.float64)
    each = solids.materials
    columns = [
        *(m.complex_modulus(s.imag) for m, _ in zip(each, affine.stiffness, strict=True)),
        *(m.density * s**2 for m, _ in zip(each, affine.mass, strict=True)),
        *(s * m.density * m.shear_speed for m, _ in zip(each, affine.dashpots)),  # noqa: B905
        *(s * solids.drag * m.density for m, _ in zip(each, affine.layer)),  # noqa: B905
        *(np.full_like(s, solids.springs) for _ in affine.springs),
        *(s**2 for _ in affine.fluid),
    ]
    return np.stack(columns, axis=-1)


def project(affine: AffineOperators, basis: Floats, before: Floats) -> Floats:
    """Matrices (q, m, m) of Galerkin's method in a basis.

    Parameters
    ----------
    affine : AffineOperators, of q matrices
    basis : (n_free, m) float
    before : (q, k, k) float, those of its first k vectors

    Returns
    -------
    (q, m, m) float
    """
    k, m = before.shape[1], basis.shape[1]
    found = np.empty((len(affine.parts), m, m))
    found[:, :k, :k] = before
    for matrix, small in zip(affine.parts, found, strict=True):
        columns = basis.T @ product(matrix)(basis[:, k:])
        small[:, k:], small[k:, :k] = columns, columns[:k].T
        small[k:, k:] = (columns[k:] + columns[k:].T) / 2
    return found


def with_parts(affine: AffineOperators, parts: Iterable[Any]) -> AffineOperators:
    """The same with other matrices (q,), in the order of `weights`."""
    left = iter(parts)
    found: dict[str, Any] = {
        kind: tuple(next(left) for _ in getattr(affine, kind)) for kind in KINDS
    }
    return replace(affine, **found)


def interpolated(affine: AffineOperators, parts: Floats, shares: Floats) -> AffineOperators:
    """Projected operators of a geometry between others.

    Parameters
    ----------
    affine : AffineOperators, of any matrices of the same kinds
    parts : (g, q, m, m) float, matrices of each geometry
    shares : (g,) float, of each, with sum 1

    Returns
    -------
    AffineOperators
    """
    return with_parts(affine, np.tensordot(shares, parts, 1))


def _alone(materials: Sequence[Material], r: int) -> tuple[Material, ...]:
    """Elastic materials of which one has modulus and density 1, and the others next to nothing."""
    size = [1.0 if k == r else ABSENT for k in range(len(materials))]
    return tuple(
        Material(density=x, shear_modulus=x, poisson=m.poisson)
        for m, x in zip(materials, size, strict=True)
    )


def _present(matrices: Sequence[Any]) -> tuple[Any, ...]:
    """The matrices, or none if all are 0."""
    return tuple(matrices) if any(abs(A).sum() > 0 for A in matrices) else ()


def _sum(matrices: Sequence[Any], factors: Sequence[float] | Floats) -> Any:
    """Sum of matrices with factors that are not 0; 0 if there is none."""
    return sum(w * A for A, w in zip(matrices, factors) if w)  # noqa: B905


def _like(one: Any, found: Any) -> Any:
    """A sum of matrices, as sparse or as dense as one of them if it has no terms."""
    if not isinstance(found, int):
        return found.tocsr() if sparse.issparse(found) else found
    return sparse.csr_array(one.shape) if sparse.issparse(one) else np.zeros(one.shape)
