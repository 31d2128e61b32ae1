"""Operators of a body as affine sums, of matrices that no modulus or density changes.

    A(s) = sum_q w_q(s) A_q

Each term q is of a kind, and of one of the body's materials r:

    stiffness  mu_r(s) K_r, of the complex modulus of any law
    mass       rho_r s^2 M_r
    dashpots   sqrt(mu_r rho_r) s R_r
    layer      drag rho_r s D_r, of an absorbing layer
    springs    held S, of a support
    fluid      s^2 F, an added mass, which can only be applied (`added_mass`)

Poisson's ratios are fixed, so that the projections of the A_q onto one basis serve every material
(Prud'homme et al., J Fluids Eng 124:70 (2002)). Operators of given materials are the same sum with
constant weights (`operators_of`).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, gmres

from fem.assembly import Operators, assemble
from fem.boundary import Support, springs
from fem.coat import Coat
from fem.linear_solver import SumFactoriser
from fem.maxwell import MaxwellBranch
from fem.transient import Diverged
from fem.typing import Complex, Floats, Ints
from meshes import TetMesh
from simple_model.layers.material import Material

KINDS = ("stiffness", "mass", "dashpots", "layer", "springs", "fluid")  # of terms
ABSENT = 1e-30  # of a modulus and a density beside 1: below all round-off
RESIDUAL = 1e-8  # relative, of GMRES: a resonance makes some hundred times as much of it
RESTART, CYCLES = 60, 5  # of GMRES

Terms = tuple[tuple[str, int], ...]


@dataclass(frozen=True, kw_only=True)
class Solids:
    """Materials (r,) of a body, of its coat first and then of its regions; factors of its `springs`
    and of the `drag` of its absorbing layer.
    """

    materials: tuple[Material, ...]
    springs: float = 1.0
    drag: float = 1.0


@dataclass(frozen=True, kw_only=True, eq=False)
class AffineOperators:
    """Matrices `parts` (q,), sparse or dense (n, n), each of a term: its kind, and the index of its
    material. `free` (n,) and `n_dofs` as of `Operators`.
    """

    terms: Terms
    parts: Any
    free: Ints
    n_dofs: int

    def of(self, *kinds: str) -> list[Any]:
        """Matrices of some kinds."""
        each = zip(self.terms, self.parts, strict=True)
        return [part for (kind, _), part in each if kind in kinds]

    @property
    def fluid(self) -> Any:
        """Added mass in kg of a fluid; None without one."""
        return next(iter(self.of("fluid")), None)

    def with_fluid(self, added: LinearOperator) -> "AffineOperators":
        """The same with the added mass of a fluid."""
        return replace(self, terms=(*self.terms, ("fluid", 0)), parts=(*self.parts, added))

    def in_vacuum(self) -> "AffineOperators":
        """The same without a fluid, whose added mass leaves no matrix sparse."""
        kept = [q for q, (kind, _) in enumerate(self.terms) if kind != "fluid"]
        terms, parts = (tuple(each[q] for q in kept) for each in (self.terms, self.parts))
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
    """Matrices of a body's operators, once for all materials (r,) of the given Poisson's ratios: of
    the layers of its coat and then of the regions 0, 1, ... Conditions as for `assemble`.
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
    free = found[0].free
    by_kind = {
        "stiffness": [each.K for each in found],
        "mass": [each.M for each in found],
        "dashpots": [each.R for each in found],
        "layer": [] if drag is None else [assembled(each, drag=drag).R for each in alone],
        "springs": [springs(mesh, support)[free][:, free]] if support else [],
    }
    parts = {(kind, r): A for kind, each in by_kind.items() for r, A in enumerate(each)
             if abs(A).sum() > 0}  # fmt: skip
    return AffineOperators(
        terms=tuple(parts), parts=tuple(parts.values()), free=free, n_dofs=mesh.n_dofs
    )


def operators_of(affine: AffineOperators, solids: Solids) -> Operators:
    """Operators of materials without modulus laws of their own; with a fluid, projected ones.

    Impedances of dashpots are those of the moduli that materials are given by.
    """
    materials = [m.without_loss_factor() for m in solids.materials]
    prony = [[term for term in m.prony if term.modulus] for m in materials]
    first = affine.parts[0]
    nothing = sparse.csr_array(first.shape) if sparse.issparse(first) else np.zeros(first.shape)

    def summed(**factors: Sequence[float]) -> Any:
        """Sum of the terms of some kinds with a factor for each material."""
        each = zip(affine.terms, affine.parts, strict=True)
        return sum(
            (w * A for (kind, r), A in each if kind in factors and (w := factors[kind][r])),
            start=nothing,
        )

    rho = [m.density for m in materials]
    R = summed(
        dashpots=[m.density * m.shear_speed for m in solids.materials],
        layer=[solids.drag * x for x in rho],
    )
    branches = [
        MaxwellBranch(K=summed(stiffness=shares), time=time)
        for time in sorted({term.time for each in prony for term in each})
        if any(shares := [sum(t.modulus for t in each if t.time == time) for each in prony])
    ]
    return Operators(
        K=summed(stiffness=[m.shear_modulus for m in materials], springs=[solids.springs]),
        C=summed(stiffness=[m.viscosity for m in materials]) + R,
        M=summed(mass=rho, fluid=[1.0]),
        R=R, free=affine.free, n_dofs=affine.n_dofs, branches=tuple(branches),
    )  # fmt: skip


def weights(terms: Terms, solids: Solids, frequencies: ArrayLike) -> Complex:
    """Weights (f, q) of terms (q,) in the dynamic stiffness of materials of any modulus laws, at
    frequencies (f,) in Hz.
    """
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
        return s**2

    return np.stack([of_kind(kind, solids.materials[r]) for kind, r in terms], axis=-1)


def project(affine: AffineOperators, basis: Floats, before: Floats) -> Floats:
    """Matrices (q, m, m) of Galerkin's method in a basis (n_free, m), of which those (q, k, k) of
    the first k vectors are known.
    """
    k, m = before.shape[1], basis.shape[1]
    found = np.empty((len(affine.parts), m, m))
    found[:, :k, :k] = before
    for matrix, small in zip(affine.parts, found, strict=True):
        columns = basis.T @ (matrix @ basis[:, k:])
        small[:, k:], small[k:, :k] = columns, columns[:k].T
        small[k:, k:] = (columns[k:] + columns[k:].T) / 2
    return found


def line_solution(
    affine: AffineOperators,
    weights: Complex,
    force: Complex,
    *,
    solver: str = "auto",
    fluid_share: float = 0.0,
) -> Complex:
    """Steady state (n_free,) in metre of a full body at one line, by the `weights` (q,) of its
    matrices there and the force (n_free,) in N.

    The added mass F of a fluid can only be applied: P = A - w F + E is factorised, with the
    equivalent added mass E of the line's bending waves, `fluid_share` of the body's own mass. Waves
    of other wavenumbers do not resonate at the line: P^-1 (P + w F - E) is near the identity, and
    GMRES takes some iterations with it, or raises Diverged.
    """
    dry = affine.in_vacuum()
    is_mass = np.array([kind == "mass" for kind, _ in dry.terms])
    own = weights[: len(is_mass)]
    factorise = SumFactoriser([sparse.csr_array(part) for part in dry.parts], backend=solver)
    factor = factorise(own * (1 + fluid_share * is_mass))
    force = force.astype(np.complex128)
    if affine.fluid is None:
        return factor.solve(force)
    E = fluid_share * sum(w * M for w, M in zip(own[is_mass], dry.of("mass"), strict=True))
    return _with_fluid(factor.solve, weights[-1], affine.fluid, E, force)


def _with_fluid(
    solve: Callable[[Complex], Complex], w: complex, F: LinearOperator, E: Any, force: Complex
) -> Complex:
    """Solution of P u + w F u - E u = force, with that of P."""

    def preconditioned(u: Complex) -> Complex:
        fluid = F @ np.column_stack([u.real, u.imag])  # of real fields
        return u + solve(w * (fluid @ [1, 1j]) - E @ u)

    n = len(force)
    system = LinearOperator((n, n), matvec=preconditioned, dtype=np.complex128)
    u, failed = gmres(system, solve(force), rtol=RESIDUAL, restart=RESTART, maxiter=CYCLES)
    if failed:
        raise Diverged(
            f"a line in air is not solved to a residual of {RESIDUAL:g} by {RESTART * CYCLES} "
            "iterations; take a smaller sheet or larger elements, or leave air out"
        )
    return np.asarray(u, np.complex128)


def _alone(materials: Sequence[Material], r: int) -> tuple[Material, ...]:
    """Elastic materials of which one has modulus and density 1, and the others next to nothing."""
    size = [1.0 if k == r else ABSENT for k in range(len(materials))]
    return tuple(
        Material(density=x, shear_modulus=x, poisson=m.poisson)
        for m, x in zip(materials, size, strict=True)
    )
