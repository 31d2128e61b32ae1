"""Operators of a body as affine sums of matrices that are independent of moduli and densities.

    A(s) = sum_q w_q(s) A_q

Each term q has a kind and belongs to one material r of the body:

    stiffness  mu_r(s) K_r, with the complex modulus of any law
    mass       rho_r s^2 M_r
    dashpots   sqrt(mu_r rho_r) s R_r
    layer      drag rho_r s D_r, of an absorbing layer
    springs    factor S, of a support
    fluid      s^2 F, the added mass of `air`, which can only be applied
    friction, monopole, dipole
               s |s|^p F, the resistances of `air`

Poisson's ratios are fixed, so the projections of the A_q onto one basis serve every material
(Prud'homme et al., J Fluids Eng 124:70 (2002)). `operators_of` sums them for given materials.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, gmres

from fem.air import RESISTANCES, Air, damping, growth
from fem.assembly import Operators, assemble
from fem.boundary import Support, springs
from fem.coat import Coat
from fem.linear_solver import SumFactoriser
from fem.maxwell import MaxwellBranch, property_of, relaxation_of
from fem.transient import Diverged
from meshes import TetMesh
from simple_model.layers.material import Material
from simple_model.typing import Complex, Floats, Ints

Terms = tuple[tuple[str, int], ...]


@dataclass(frozen=True, kw_only=True)
class Solids:
    """Materials (r,) of a body, first of its coat, then of its regions, with factors of its
    `springs` and of the `drag` of its absorbing layer.
    """

    materials: tuple[Material, ...]
    springs: float = 1.0
    drag: float = 1.0


@dataclass(frozen=True, kw_only=True, eq=False)
class AffineOperators:
    """Matrices `parts` (q,), each sparse or dense (n, n), of the `terms` (q,): the kind of each and
    the index of its material. `free` (n,) and `n_dofs` are those of `Operators`.
    """

    terms: Terms
    parts: Any
    free: Ints
    n_dofs: int

    @property
    def air(self) -> Air | None:
        """Air around a sheet, or None."""
        each = {kind: part for (kind, _), part in zip(self.terms, self.parts, strict=True)}
        if "fluid" not in each:
            return None
        losses = {kind: part for kind, part in each.items() if kind in RESISTANCES}
        return Air(mass=each["fluid"], resistances=losses)

    def with_air(self, air: Air) -> "AffineOperators":
        """Return these operators with those of the air around a sheet."""
        more = {"fluid": air.mass, **air.resistances}
        terms = (*self.terms, *((kind, 0) for kind in more))
        return replace(self, terms=terms, parts=(*self.parts, *more.values()))

    def in_vacuum(self) -> "AffineOperators":
        """Return the sparse operators, without air."""
        of_air = ("fluid", *RESISTANCES)
        dry = [q for q, (kind, _) in enumerate(self.terms) if kind not in of_air]
        terms, parts = (tuple(each[q] for q in dry) for each in (self.terms, self.parts))
        return replace(self, terms=terms, parts=parts)


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
    """Return the operators of a body for all materials with the same Poisson's ratios as the given
    ones (r,): those of the layers of its coat, then of the regions 0, 1, ... See `assemble` for the
    other arguments.
    """
    dashpots_only = support and replace(support, stiffness=np.zeros_like(support.stiffness))
    alone = [_only(materials, r) for r in range(len(materials))]

    def assembled(each: Sequence[Material], **conditions: Any) -> Operators:
        layers = len(coat.materials) if coat else 0
        return assemble(
            mesh, dict(enumerate(each[layers:])), fixed=fixed,
            coat=coat and replace(coat, materials=tuple(each[:layers])), **conditions,
        )  # fmt: skip

    operators = [assembled(each, absorbing=absorbing, support=dashpots_only) for each in alone]
    free = operators[0].free
    by_kind = {
        "stiffness": [each.K for each in operators],
        "mass": [each.M for each in operators],
        "dashpots": [each.R for each in operators],
        "layer": [] if drag is None else [assembled(each, drag=drag).R for each in alone],
        "springs": [springs(mesh, support)[free][:, free]] if support else [],
    }
    parts = {(kind, r): A for kind, each in by_kind.items() for r, A in enumerate(each)
             if abs(A).sum() > 0}  # fmt: skip
    return AffineOperators(
        terms=tuple(parts), parts=tuple(parts.values()), free=free, n_dofs=mesh.n_dofs
    )


def operators_of(affine: AffineOperators, solids: Solids) -> Operators:
    """Return the operators for materials without modulus laws. With a fluid, `affine` must be
    projected. The impedances of dashpots are those of the moduli at rest.
    """
    materials = [m.without_loss_factor() for m in solids.materials]
    lags, times, shares = relaxation_of(materials)
    first = affine.parts[0]
    nothing = sparse.csr_array(first.shape) if sparse.issparse(first) else np.zeros(first.shape)

    def summed(**factors: Sequence[float] | Floats) -> Any:
        """Return the sum of the terms of some kinds, with a factor for each material."""
        each = zip(affine.terms, affine.parts, strict=True)
        return sum(
            (w * A for (kind, r), A in each if kind in factors and (w := factors[kind][r])),
            start=nothing,
        )

    rho, mu = (property_of(materials, name) for name in ("density", "shear_modulus"))
    R = summed(
        dashpots=[m.density * m.shear_speed for m in solids.materials], layer=solids.drag * rho
    )
    branches = (
        MaxwellBranch(K=summed(stiffness=share * mu), time=time)
        for time, share in zip(times.tolist(), shares, strict=True)
    )
    K, M = summed(stiffness=mu, springs=[solids.springs]), summed(mass=rho, fluid=[1.0])
    C = summed(stiffness=lags * mu) + R
    if affine.air:
        C = C + damping(K, M, affine.air.resistances)
    return Operators(
        K=K, C=C, M=M, R=R, free=affine.free, n_dofs=affine.n_dofs, branches=tuple(branches)
    )


def weights(terms: Terms, solids: Solids, frequencies: ArrayLike) -> Complex:
    """Return the weights (f, q) of terms in the dynamic stiffness at frequencies (f,) in Hz."""
    s = 2j * np.pi * np.asarray(frequencies, np.float64)

    def of_kind(kind: str, m: Material) -> Any:
        match kind:
            case "stiffness":
                return m.complex_modulus(s.imag)
            case "mass":
                return m.density * s**2
            case "dashpots":
                return s * m.density * m.shear_speed
            case "layer":
                return s * solids.drag * m.density
            case "springs":
                return np.full_like(s, solids.springs)
            case "fluid":
                return s**2
        return s * growth(kind, np.asarray(s.imag, np.float64))

    return np.stack([of_kind(kind, solids.materials[r]) for kind, r in terms], axis=-1)


def project(affine: AffineOperators, basis: Floats, before: Floats) -> Floats:
    """Project the matrices onto a basis (n_free, m); `before` (q, k, k) are the known projections
    onto its first k vectors.
    """
    k, m = before.shape[1], basis.shape[1]
    projected = np.empty((len(affine.parts), m, m))
    projected[:, :k, :k] = before
    for matrix, small in zip(affine.parts, projected, strict=True):
        columns = basis.T @ (matrix @ basis[:, k:])
        small[:, k:], small[k:, :k] = columns, columns[:k].T
        small[k:, k:] = (columns[k:] + columns[k:].T) / 2
    return projected


def line_solution(
    affine: AffineOperators,
    weights: Complex,
    force: Complex,
    *,
    solver: str = "auto",
    fluid_share: float = 0.0,
    restart: int = 60,
    cycles: int = 5,
) -> Complex:
    """Return the steady state (n_free,) of a full body at one line, in m, for `weights` (q,) of its
    matrices and a force (n_free,) in N.

    The operators F of air can only be applied. P = A - sum w F + E is factorised, where E is the
    equivalent added mass of the bending waves of this line, `fluid_share` of the body's own mass.
    Waves with other wavenumbers do not resonate, so P^-1 (P + sum w F - E) is near the identity and
    GMRES needs few iterations. Raises Diverged if it does not converge in a number of `cycles` with
    `restart` iterations each.
    """
    dry = affine.in_vacuum()
    is_mass = np.array([kind == "mass" for kind, _ in dry.terms])
    own, around = np.split(weights, [len(is_mass)])
    factorise = SumFactoriser([sparse.csr_array(part) for part in dry.parts], backend=solver)
    factor = factorise(own * (1 + fluid_share * is_mass))
    force = force.astype(np.complex128)
    if not len(around):
        return factor.solve(force)
    E = fluid_share * sum(w * dry.parts[q] for q, w in enumerate(own) if is_mass[q])
    solve, air = factor.solve, list(zip(around, affine.parts[len(is_mass) :], strict=True))

    def preconditioned(u: Complex) -> Complex:
        parts = np.column_stack([u.real, u.imag])  # F takes real fields
        return u + solve(sum(w * ((F @ parts) @ [1, 1j]) for w, F in air) - E @ u)

    n = len(force)
    system = LinearOperator((n, n), matvec=preconditioned, dtype=np.complex128)
    residual = 1e-8  # relative, of GMRES; a resonance amplifies it about a hundred times
    u, failed = gmres(system, solve(force), rtol=residual, restart=restart, maxiter=cycles)
    if failed:
        raise Diverged(
            f"GMRES did not reach a residual of {residual:g} in {restart * cycles} iterations for "
            "a sheet in air; use a smaller sheet or larger elements, or air = false"
        )
    return np.asarray(u, np.complex128)


def _only(materials: Sequence[Material], r: int) -> tuple[Material, ...]:
    """Return elastic materials: modulus and density are 1 for material r, negligible for others."""
    negligible = 1e-30  # modulus and density of a material that is left out, relative to the others
    size = [1.0 if k == r else negligible for k in range(len(materials))]
    return tuple(
        Material(density=x, shear_modulus=x, poisson=m.poisson)
        for m, x in zip(materials, size, strict=True)
    )
