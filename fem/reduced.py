"""Reduced-order model of the probes' response to any surface load, by Krylov moment matching.

With A(s) = K + s C + s^2 M (and s tau_j / (1 + s tau_j) K_j for each generalised Maxwell branch),
symmetric, the transfer function from a load f to a probe s_p is, by reciprocity,

    H(s) = s_p^T A(s)^-1 f = f^T y(s),   A(s) y(s) = s_p

and Galerkin projection onto a basis V gives H_r(s) = f^T V (V^T A V)^-1 V^T s_p = f^T V c. As the
residual A (y - V c) is orthogonal to V, the error is, for any coefficients g,

    H(s) - H_r(s) = (A(s)^-1 f - V g)^T A(s) (y(s) - V c)

V holds the first n moments of y, its Taylor coefficients about one real expansion point s_0: then
those of H and of H_r are the same (Bai and Su, SIAM J Sci Comput 26:1692, 2005), which costs one
real factorisation. V is built by the two-level orthogonal Arnoldi procedure (TOAR: Lu, Su and Bai,
SIAM J Matrix Anal Appl 37:195, 2016): with proportional damping the plain recurrence loses all
accuracy after a few dozen moments. The dashpot stretches of Maxwell branches, y / (1 + s tau_j),
are further parts of the linearised vectors: their moments lie in the same space, so that the
moments matched are those of the exact constitutive law.
The basis is mass-orthonormal: the reduced mass is the identity, and field norms are vector norms.
Added mass of a fluid is dense and can only be applied: with it the expansion point is 0, where no
mass is factorised.

The error estimate needs no solution of the full system: it is the difference from the response of
the model with some more moments, which by Galerkin orthogonality solves the residual equation in
the larger space. Those further moments are then dropped: the error of the larger model would be
unknown, because convergence may become steep or stall at any moment.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse
from scipy.sparse.linalg import aslinearoperator

from fem.added_mass import AddedMass
from fem.assembly import Operators
from fem.harmonic import dynamic_stiffness
from fem.linear_solver import Factor, factorise
from fem.maxwell import Branch, MaxwellBranch, with_internal
from fem.products import product
from meshes.tetmesh import Floats

Complex = NDArray[np.complex128]

EXPANSION_POINT = 2 * np.pi * 200.0  # rad/s: best at 200 to 400 Hz for a band of 1 to 2 kHz
# Expansion point over the band with Maxwell branches: waves of high frequency lose little then, and
# many of them count. Best between 0.8 and 1.6; the one above takes nearly twice as many moments.
RELAXING_POINT = 1.0
# Moments between two error estimates: at least so many, which give it to a factor of 4, and this
# share of all, because estimating the error of a large model costs more than its moments.
FEWEST_BETWEEN = 3
SHARE_BETWEEN = 1 / 16
MOST_MOMENTS = 200
LOOKED_AT, AT_FIRST = 41, 5  # frequencies that the error is looked at, and every which at first
SMALLEST = np.finfo(np.float64).tiny
DISTINCT = 1e-6  # of the largest singular value: probes that differ by less count as dependent
ROUND_OFF = 1e-12  # of a direction: what orthogonalisation leaves of it is round-off
DEPENDENT = 1e-10  # squared sine below which a direction counts as not new


class NotReduced(ValueError):
    """A body whose response takes more moments than a reduced-order model is made of."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ReducedModel:
    """Reduced-order model u'' + C u' + K u = basis^T f, displacement at the probes = outputs u.

    `basis` (3 n, r) in kg^-1/2, `K`, `C` and `R` (r, r), `outputs` (p, r), Maxwell `branches` in
    parallel with K of (r, r) each; `estimate` is the relative change of the probes' response by
    some more moments, `moments` how many there are.
    """

    basis: Floats
    K: Floats
    C: Floats
    R: Floats
    outputs: Floats
    moments: int
    estimate: float
    solver: str
    branches: tuple[MaxwellBranch, ...] = ()


def reduce(
    operators: Operators,
    probes: sparse.csr_array,
    band: float = 1000.0,
    tolerance: float = 1e-3,
    *,
    loads: Floats | None = None,
    added: AddedMass | None = None,
    solver: str = "auto",
    progress: Callable[[float], None] | None = None,
) -> ReducedModel:
    """Reduced-order model of the motion of a body's probes.

    Parameters
    ----------
    operators : Operators, of the full body
    probes : (p, 3 n) sparse, from `probe_operator`; for whole fields the rows of a
        `load_subspace` as well, without `loads`
    band : float, Hz, highest frequency at which the tolerance must be met
    tolerance : float, relative error of the probes' displacement at any frequency of the band
    loads : (3 n, k), typical nodal forces that the error is estimated for; without any it is
        that of the probes' adjoint fields in the whole body, which takes far more moments
    added : added mass of a fluid, as `added_mass` gives it; the body must be constrained then
    solver : of `linear_solver.factorise`
    progress : called with the fraction done, as the error estimate approaches the tolerance

    Returns
    -------
    ReducedModel
        With an `estimate` of at most the tolerance.

    Raises
    ------
    NotReduced
        If the tolerance is out of reach.
    ValueError
        If no probe can move.
    """
    free, report = operators.free, progress or (lambda fraction: None)
    start_vectors = probes[:, free].toarray().T
    if not start_vectors.any():
        raise ValueError("no probe can move, all lie where the body is fixed; move one inwards")
    point, operators = _expansion(operators, added, band)
    factor = factorise(_stiffness_at(operators, point), backend=solver)
    report(0.0)

    independent = _independent(start_vectors)
    space = KrylovBasis(operators, independent.shape[1] * (MOST_MOMENTS + 1))
    # Nearly from 0 Hz: at 0 Hz itself an unconstrained body has no finite response.
    fine = np.asarray(2j * np.pi * np.linspace(1e-3 * band, band, LOOKED_AT), np.complex128)
    coarse = fine[::AT_FIRST]  # until the error is below the tolerance there
    moments, size, before = 0, 0, None
    errors: list[float] = []
    for moment in _moments(space, operators, point, factor, independent):
        if moment < moments + max(FEWEST_BETWEEN, SHARE_BETWEEN * moment):
            continue
        weights = None if loads is None else space.basis.T @ loads[free]
        respond = partial(_band_response, space, space.basis.T @ start_vectors, weights)
        now = respond(coarse, space.size)
        if before is not None:
            errors.append(_largest_change(before, now))
            if errors[-1] <= tolerance:
                errors[-1] = _largest_change(respond(fine, size), respond(fine, space.size))
            if errors[-1] <= tolerance:
                break
            report(max(0.0, np.log(errors[-1] / errors[0]) / np.log(tolerance / errors[0])))
        moments, size, before = moment, space.size, now
    else:
        raise NotReduced(
            f"{MOST_MOMENTS} moments leave an error of {errors[-1]:.2g}, above the tolerance "
            f"{tolerance:g}; raise the tolerance, narrow the band or add damping"
        )

    basis = space.basis[:, :size]
    K, C, *relaxing = (part[:size, :size].copy() for part in space.projected)
    return ReducedModel(
        basis=operators.expand(basis),
        K=K,
        C=C,
        R=basis.T @ (operators.R @ basis),
        outputs=start_vectors.T @ basis,
        moments=moments,
        estimate=errors[-1],
        solver=factor.backend,
        branches=_branches(relaxing, operators.branches),
    )


def load_subspace(loads: Floats, tolerance: float = 1e-3) -> Floats:
    """Proper orthogonal basis (3 n, s) of loads (3 n, k), to a relative error in the 2-norm.

    A circling focus needs about twenty at 1e-3, however many positions it is given at.
    """
    squares, vectors = np.linalg.eigh(loads.T @ loads)
    left_out = np.sqrt(np.cumsum(np.maximum(squares, 0)) / squares.sum())
    kept = left_out > tolerance
    return loads @ (vectors[:, kept] / np.sqrt(squares[kept]))


def transfer(model: ReducedModel, forces: Floats, frequencies: ArrayLike) -> Complex:
    """Transfer function of a reduced-order model.

    Parameters
    ----------
    model : ReducedModel
    forces : (r, k) float, N kg^-1/2, reduced forces
    frequencies : (f,) float, Hz

    Returns
    -------
    (f, p, k) complex, metre, displacement of the probes under each of the forces

    Raises
    ------
    LinAlgError
        If the model has no loss and a natural frequency among the frequencies.
    """
    s = 2j * np.pi * np.atleast_1d(np.asarray(frequencies, np.float64))[:, None, None]
    A = dynamic_stiffness(model.K, model.C, np.eye(len(model.K)), model.branches, s)
    fields: Complex = np.linalg.solve(A, np.broadcast_to(forces, (len(s), *forces.shape)))
    return model.outputs @ fields


class KrylovBasis:
    """Mass-orthonormal basis that grows, and the `projected` K, C and K_j (size, size) of the
    Maxwell branches.

    Only the vectors are kept: their products with sparse matrices are formed where they are needed,
    in less time than it takes to read them from memory. Memory is touched only as far as used.
    """

    def __init__(self, operators: Operators, most: int) -> None:
        self._branches = operators.branches
        self._M = product(operators.M)
        stiffnesses = [branch.K for branch in operators.branches]
        self._K, self._C, *self._relaxing = map(product, (operators.K, operators.C, *stiffnesses))
        self._columns = np.empty((len(operators.free), most), order="F")
        self.projected = [np.empty((0, 0)) for _ in (None, None, *stiffnesses)]
        self.size = 0

    @property
    def basis(self) -> Floats:
        """Vectors (n, size)."""
        return self._columns[:, : self.size]

    def model(self, size: int) -> tuple[Floats, Floats, Floats, tuple[MaxwellBranch, ...]]:
        """Projected K, C, M and Maxwell branches, in the first vectors."""
        K, C, *relaxing = (part[:size, :size] for part in self.projected)
        return K, C, np.eye(size), _branches(relaxing, self._branches)

    def forces(self, y: Floats, z: Floats, stretches: Sequence[Floats]) -> Floats:
        """Nodal forces C y + M z + sum_j K_j s_j (n, k) of coordinates (size, k) in the basis."""
        width = y.shape[1]
        fields = self.basis @ np.hstack([y, z, *stretches])  # reads the basis once
        applied = (self._C, self._M, *self._relaxing)
        parts = (times(fields[:, j * width :][:, :width]) for j, times in enumerate(applied))
        return sum(parts, np.zeros((len(fields), width)))

    def extend(self, block: Floats) -> Floats:
        """Add the linearly independent directions of a block (n, k); its coordinates (size, k)."""
        M, Q = self._M, self.basis
        moved = M(block)
        scale = _norms(block, moved)
        block, moved, overlap = block / scale, moved / scale, np.zeros((self.size, len(scale)))
        for _ in range(2):  # twice is enough
            coordinates = Q.T @ moved
            block = block - Q @ coordinates
            overlap, moved = overlap + coordinates, M(block)
        left = _norms(block, moved)
        fresh = left > ROUND_OFF  # of 1: a space of all of a body's dofs has no new direction
        block, moved = (np.where(fresh, x / left, 0.0) for x in (block, moved))
        squares, directions = np.linalg.eigh(block.T @ moved)
        distinct = squares > max(DEPENDENT * squares.max(), SMALLEST)
        apart = directions[:, distinct] / np.sqrt(squares[distinct])
        # Orthonormal but for round-off that the scaling has raised, also of what is in the basis.
        new = block @ apart
        new = new - Q @ (Q.T @ (moved @ apart))
        moved_new = M(new)
        upright = np.linalg.inv(np.linalg.cholesky(new.T @ moved_new)).T
        self._append(new @ upright)
        return np.vstack([overlap, (upright.T @ (moved_new.T @ block)) * left]) * scale

    def _append(self, new: Floats) -> None:
        """Append vectors (n, k), and project the matrices onto them."""
        width, start = new.shape[1], self.size
        self.size = start + width
        self._columns[:, start : self.size] = new
        forces = np.hstack([times(new) for times in (self._K, self._C, *self._relaxing)])
        columns = self.basis.T @ forces
        self.projected = [
            _bordered(small, columns[:, j * width :][:, :width])
            for j, small in enumerate(self.projected)
        ]


def _expansion(
    operators: Operators, added: AddedMass | None, band: float
) -> tuple[float, Operators]:
    """Expansion point in rad/s, and the operators with an added mass, of which C and M can only be
    applied.
    """
    if added is None:
        relaxing = 2 * np.pi * RELAXING_POINT * band
        return relaxing if operators.branches else EXPANSION_POINT, operators
    C, M = aslinearoperator(operators.C), aslinearoperator(operators.M)
    return 0.0, replace(operators, C=C + added.rate * added.M, M=M + added.M)


def _stiffness_at(operators: Operators, point: float) -> sparse.csr_array:
    K, C, M = operators.K, operators.C, operators.M
    return dynamic_stiffness(K, C, M, operators.branches, point) if point else K


def _independent(start_vectors: Floats) -> Floats:
    """Orthonormal basis of vectors (n, p): probes on a clamped edge do not move, and those in one
    element may be linearly dependent.
    """
    directions, strengths, _ = np.linalg.svd(start_vectors, full_matrices=False)
    return directions[:, strengths > DISTINCT * strengths[0]]


def _moments(
    space: KrylovBasis, operators: Operators, point: float, factor: Factor, start_vectors: Floats
) -> Iterator[int]:
    """Numbers, from 1, of the moments of start vectors (n, p), by each of which the space has
    been extended.
    """
    branches = with_internal(operators.branches)
    lags = [branch.time / (1 + point * branch.time) for branch in branches]
    scale = point or EXPANSION_POINT
    # Coordinates in the basis of the linearised Krylov vectors (y, y' / scale, dashpot stretches):
    # those of all moments are orthonormalised, so that nothing grows however many there are.
    earlier = np.zeros((2 + len(lags), 0, 0))
    upper = space.extend(factor.solve(start_vectors))
    relaxed = [(1 - point * lag) * upper for lag in lags]
    latest = np.stack([upper, np.zeros_like(upper), *relaxed])
    for moment in range(1, MOST_MOMENTS + 1):
        yield moment
        earlier, latest = _orthonormalised(earlier, latest)
        y, y_before, *y_relaxed = latest
        stretches = [lag * part for lag, part in zip(lags, y_relaxed, strict=True)]
        rest = space.forces(y, 2 * point * y + scale * y_before, stretches)
        upper = space.extend(-factor.solve(rest))
        lower, _, *before = (_padded(part, len(upper)) for part in latest)
        relaxed = [
            (1 - point * lag) * upper - lag * part for lag, part in zip(lags, before, strict=True)
        ]
        latest = np.stack([upper, lower / scale, *relaxed])


def _norms(block: Floats, product: Floats) -> Floats:
    """Mass norms (m,) of columns with their product with M.

    At rest every second moment of a body without loss is 0, which is no direction.
    """
    return np.maximum(np.sqrt(np.einsum("nm,nm->m", block, product)), SMALLEST)


def _padded(coordinates: Floats, size: int) -> Floats:
    return np.vstack([coordinates, np.zeros((size - len(coordinates), coordinates.shape[1]))])


def _orthonormalised(earlier: Floats, latest: Floats) -> tuple[Floats, Floats]:
    """Earlier vectors (parts, size, k) with the latest, orthonormalised to them; and the latest."""
    parts, size, width = latest.shape
    padded = np.zeros((parts, size, earlier.shape[2]))
    padded[:, : earlier.shape[1]] = earlier
    W, X = padded.reshape(parts * size, -1), latest.reshape(parts * size, width)
    X = X / np.linalg.norm(X, axis=0)
    for _ in range(2):
        X = X - W @ (W.T @ X)
    X = np.linalg.qr(X)[0]
    return np.hstack([W, X]).reshape(parts, size, -1), X.reshape(parts, size, width)


def _bordered(small: Floats, columns: Floats) -> Floats:
    """Symmetric matrix bordered by its last columns (r, k) and rows."""
    r, k = columns.shape
    whole = np.empty((r, r))
    whole[: r - k, : r - k] = small
    whole[:, r - k :] = columns
    whole[r - k :] = columns.T
    return whole


def _branches(small: list[Floats], large: tuple[Branch, ...]) -> tuple[MaxwellBranch, ...]:
    """The full model's Maxwell branches with the reduced stiffness."""
    return tuple(
        MaxwellBranch(K=K, time=b.time) for K, b in zip(small, with_internal(large), strict=True)
    )


def _band_response(
    space: KrylovBasis, start_vectors: Floats, loads: Floats | None, s: Complex, size: int
) -> Complex:
    """Responses (f, k, p) of the probes to the loads (r, k), or their fields (f, size, p), at
    complex frequencies s (f,) in rad/s, by the first vectors of the basis.
    """
    K, C, M, branches = space.model(size)
    loads = loads if loads is None else loads[:size]
    # One by one: all at once would be as large as the body's own factors.
    fields: Iterator[Any] = (
        np.linalg.solve(dynamic_stiffness(K, C, M, branches, at), start_vectors[:size]) for at in s
    )
    return np.array([x if loads is None else loads.T @ x for x in fields])


def _largest_change(before: Complex, now: Complex) -> float:
    """Largest relative change at any frequency."""
    change = now.copy()
    change[:, : before.shape[1]] -= before
    return float((np.linalg.norm(change, axis=(1, 2)) / np.linalg.norm(now, axis=(1, 2))).max())
