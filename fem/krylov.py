"""Krylov moment matching: the basis of a reduced-order model of probes under any surface load.

With A(s) = K + s C + s^2 M (and s tau_j / (1 + s tau_j) K_j for each generalised Maxwell branch),
symmetric, the transfer function from a load f to a probe s_p is, by reciprocity,

    H(s) = s_p^T A(s)^-1 f = f^T y(s),   A(s) y(s) = s_p

V holds the first n moments of y, its Taylor coefficients about one real expansion point s_0. Then
Galerkin projection onto V has the same moments of H (Bai and Su, SIAM J Sci Comput 26:1692, 2005),
at the cost of one real factorisation. V is built by the two-level orthogonal Arnoldi procedure
(TOAR: Lu, Su and Bai, SIAM J Matrix Anal Appl 37:195, 2016): with proportional damping the plain
recurrence loses all accuracy after a few dozen moments. The dashpot stretches of Maxwell branches,
y / (1 + s tau_j), are further parts of the linearised vectors; their moments lie in the same space.
The basis is mass-orthonormal. Added mass of a fluid is dense and can only be applied: with it the
expansion point is 0, where no mass is factorised.

The error estimate is the difference from the response of the model with some more moments, which by
Galerkin orthogonality solves the residual equation in the larger space. Those moments are then
dropped: convergence may become steep or stall at any moment.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, aslinearoperator

from fem.assembly import Operators
from fem.combination import Laws, factors_at, laws_of
from fem.harmonic import dynamic_stiffness
from fem.linear_solver import Factor, factorise
from fem.maxwell import Branch, MaxwellBranch, with_internal
from fem.reduced import ReducedModel
from fem.typing import Complex, Floats

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
ALIKE = 1e-6  # squared sine below which directions are orthonormalised once more
AT_ONCE = 32  # vectors that are multiplied together
# Rows of tall matrices whose inner products are taken at a time, which stay in the processor's
# cache: 100 by 5 inner products of 128,000 rows take 5.5 ms so, and 18 by one multiplication.
ROWS = 512


class NotReduced(ValueError):
    """A body whose response takes more moments than a reduced-order model is made of."""


def reduce(
    operators: Operators,
    probes: sparse.csr_array,
    band: float = 1000.0,
    tolerance: float = 1e-3,
    *,
    loads: Floats | None = None,
    added: LinearOperator | None = None,
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
    laws = laws_of(operators.K, operators.C, operators.branches, operators.laws)
    factors = factors_at(operators.branches, point)
    factor = factorise(laws.dynamic_stiffness(factors, operators.K, operators.M), backend=solver)
    report(0.0)

    independent = _independent(start_vectors)
    space = KrylovBasis(operators, laws, independent.shape[1] * (MOST_MOMENTS + 1))
    seen = start_vectors if loads is None else np.hstack([start_vectors, loads[free]])
    growing = _moments(space, operators, laws, point, factor, independent)
    moments, size, estimate = _converged(
        space, seen, start_vectors.shape[1], band, tolerance, growing, report
    )

    backend = factor.backend
    del factor  # whose memory the basis takes
    K, C, M, branches = space.model(size)
    small = Operators(
        K=K.copy(), C=C.copy(), M=M, R=space.radiation(operators.R, size), branches=branches,
        free=np.arange(size), n_dofs=size,
    )  # fmt: skip
    outputs = space.seen(size)[:, : start_vectors.shape[1]].T.copy()
    return ReducedModel(
        operators=small, basis=space.expanded(size), outputs=outputs, moments=moments,
        estimate=estimate, solver=backend,
    )  # fmt: skip


def load_subspace(loads: Floats, tolerance: float = 1e-3) -> Floats:
    """Proper orthogonal basis (3 n, s) of loads (3 n, k), to a relative error in the 2-norm. A
    circling focus needs about twenty at 1e-3.
    """
    squares, vectors = np.linalg.eigh(loads.T @ loads)
    left_out = np.sqrt(np.cumsum(np.maximum(squares, 0)) / squares.sum())
    kept = left_out > tolerance
    return loads @ (vectors[:, kept] / np.sqrt(squares[kept]))


class KrylovBasis:
    """Mass-orthonormal basis that grows, and what is projected onto it.

    Products with sparse matrices are formed where they are needed, in less time than it takes to
    read them from memory. Memory is touched only as far as used, and new vectors are
    orthonormalised in place.
    """

    def __init__(self, operators: Operators, laws: Laws, most: int) -> None:
        self._branches, self._laws = operators.branches, laws
        self._M, self._K = operators.M, operators.K
        self._rests = [part.rest for part in laws.parts]
        self._free, n_dofs = operators.free, operators.n_dofs
        self._all_dofs = np.empty((n_dofs, most), order="F")  # for `expanded`
        self._columns = self._all_dofs[: len(operators.free)]
        # Projected K and rests (size, size), and what is seen of a response (size, k).
        self._small_K = np.empty((0, 0))
        self._small_rests: list[Any] = [None if r is None else self._small_K for r in self._rests]
        self._seen = np.empty((0, 0))
        self.size = 0

    @property
    def basis(self) -> Floats:
        """Vectors (n, size)."""
        return self._columns[:, : self.size]

    def expanded(self, size: int) -> Floats:
        """The first vectors on all dofs (n_dofs, size), 0 where the body is fixed. Reuses the basis
        buffer; the basis is invalid afterwards.
        """
        for column in self._all_dofs[:, :size].T:
            values = column[: len(self._free)].copy()
            column[:] = 0
            column[self._free] = values
        return self._all_dofs[:, :size]

    def model(self, size: int) -> tuple[Floats, Floats, Floats, tuple[MaxwellBranch, ...]]:
        """Projected K, C, M and Maxwell branches, in the first vectors, as far as projected."""
        K, M = self._small_K[:size, :size], np.eye(size)
        rests = (None if rest is None else rest[:size, :size] for rest in self._small_rests)
        each = (replace(part, rest=r) for part, r in zip(self._laws.parts, rests, strict=True))
        C, *relaxing = (part.of(K) for part in each)
        return K, C, M, _branches(relaxing, self._branches)

    def seen(self, size: int) -> Floats:
        """Components (size, k) of the vectors that `project` was given."""
        return self._seen[:size]

    def radiation(self, R: sparse.csr_array, size: int) -> Floats:
        """Projected damping (size, size) of absorbing boundaries, which may be the rest of C."""
        if R is self._laws.damping.rest:
            return np.array(self._small_rests[0])[:size, :size]
        basis = self.basis[:, :size]
        return _products(R, basis, basis)

    def forces(self, of_mass: Floats, of_rests: Sequence[Floats]) -> Floats:
        """Nodal forces M z + sum_j rest_j r_j (n, k) of coordinates z and r_j (size, k)."""
        acting = [(self._M, of_mass)]
        acting += [(A, r) for A, r in zip(self._rests, of_rests, strict=True) if A is not None]
        fields = _combined(self.basis, np.hstack([r for _, r in acting]))  # reads the basis once
        each = np.split(fields, len(acting), axis=1)
        return sum(A @ field for (A, _), field in zip(acting, each, strict=True))

    def extend(self, block: Floats) -> Floats:
        """Add the linearly independent directions of a block (n, k), by block Gram-Schmidt and a
        decomposition of its Gram matrix; its coordinates (size, k).
        """
        M, Q = self._M, self.basis
        moved = M @ block
        scale = _norms(block, moved)
        first = _inner(Q, moved)
        block = block - _combined(Q, first)
        # Twice is enough, and once is not: after 90 moments vectors were orthogonal to 1e-3.
        moved = M @ block
        second = _inner(Q, moved)
        gram = block.T @ moved - second.T @ second
        block -= _combined(Q, second)
        size = np.sqrt(np.maximum(np.diag(gram), 0.0))
        # A space of all of a body's dofs has no new direction.
        inverse = np.divide(1, size, out=np.zeros_like(size), where=size > ROUND_OFF * scale)
        squares, directions = np.linalg.eigh(gram * np.outer(inverse, inverse))
        distinct = squares > max(DEPENDENT * squares.max(), SMALLEST)
        squares, directions = squares[distinct], directions[:, distinct]
        upright = inverse[:, None] * directions / np.sqrt(squares)
        if len(squares) and squares.min() < ALIKE * squares.max():
            upright = self._again(block, upright)
        start, self.size = self.size, self.size + upright.shape[1]
        np.matmul(block, upright, out=self._columns[:, start : self.size])
        return np.vstack([first + second, upright.T @ gram])

    def _again(self, block: Floats, upright: Floats) -> Floats:
        """Orthonormalise directions of a block that are much alike once more: scaled, their
        round-off is no longer small, also that of what is in the basis.
        """
        new = block @ upright
        block -= _combined(self.basis, self.basis.T @ (self._M @ new)) @ np.linalg.pinv(upright)
        new = block @ upright
        return upright @ np.linalg.inv(np.linalg.cholesky(new.T @ (self._M @ new))).T

    def project(self, seen: Floats, size: int) -> None:
        """Project the matrices, and what is seen (n, k), onto those of the first vectors that are
        new since.
        """
        Q, new = self._columns[:, :size], self._columns[:, len(self._small_K) : size]
        self._seen = np.vstack([self._seen.reshape(-1, seen.shape[1]), new.T @ seen])
        self._small_K = _bordered(self._small_K, _products(self._K, Q, new))
        self._small_rests = [
            None if rest is None else _bordered(small, _products(rest, Q, new))
            for rest, small in zip(self._rests, self._small_rests, strict=True)
        ]


def _converged(
    space: KrylovBasis,
    seen: Floats,
    probes: int,
    band: float,
    tolerance: float,
    growing: Iterable[tuple[int, int]],
    report: Callable[[float], None],
) -> tuple[int, int, float]:
    """Moments and vectors of the first model within the tolerance, and its error, as both grow, by
    what is seen (n, probes + loads) of a response.
    """
    # Nearly from 0 Hz: at 0 Hz itself an unconstrained body has no finite response.
    fine = np.asarray(2j * np.pi * np.linspace(1e-3 * band, band, LOOKED_AT), np.complex128)
    coarse = fine[::AT_FIRST]  # until the error is below the tolerance there
    at, before, response, first, error = 0, (0, 0), None, np.inf, np.inf
    for moments, size in growing:
        if moments < at + max(FEWEST_BETWEEN, SHARE_BETWEEN * moments):
            continue
        at = moments
        space.project(seen, size)
        now = _band_response(space, probes, coarse, size)
        if response is not None:
            error = _largest_change(response, now)
            if error <= tolerance:
                both = (_band_response(space, probes, fine, each) for each in (before[1], size))
                error = _largest_change(*both)
            first = error if first == np.inf else first
            report(max(0.0, np.log(error / first) / np.log(tolerance / first)))
            if error <= tolerance:
                return *before, error
        before, response = (moments, size), now
    raise NotReduced(
        f"{MOST_MOMENTS} moments leave an error of {error:.2g}, above the tolerance {tolerance:g}; "
        "raise the tolerance, narrow the band or add damping"
    )


def _expansion(
    operators: Operators, added: LinearOperator | None, band: float
) -> tuple[float, Operators]:
    """Expansion point in rad/s, and the operators with an added mass, of which M can only be
    applied.
    """
    if added is None:
        relaxing = 2 * np.pi * RELAXING_POINT * band
        return relaxing if operators.branches else EXPANSION_POINT, operators
    return 0.0, replace(operators, M=aslinearoperator(operators.M) + added)


def _independent(start_vectors: Floats) -> Floats:
    """Independent directions of vectors (n, p), of length 1: probes on a clamped edge do not move,
    and those in one element may be linearly dependent. Opposite vectors have opposite directions.
    """
    squares, directions = np.linalg.eigh(start_vectors.T @ start_vectors)
    kept = squares > DISTINCT**2 * squares[-1]
    return start_vectors @ (directions[:, kept] / np.sqrt(squares[kept]))[:, ::-1]


def _moments(
    space: KrylovBasis,
    operators: Operators,
    laws: Laws,
    point: float,
    factor: Factor,
    start_vectors: Floats,
) -> Iterator[tuple[int, int]]:
    """Numbers of the moments of start vectors (n, p), from 1, by each of which the space has been
    extended, and of its vectors.
    """
    branches = with_internal(operators.branches)
    lags = [branch.time / (1 + point * branch.time) for branch in branches]
    factors = factors_at(branches, point)
    scale = point or EXPANSION_POINT
    # Coordinates in the basis of the linearised Krylov vectors (y, y' / scale, dashpot stretches):
    # those of all moments are orthonormalised, so that nothing grows however many there are.
    earlier = np.zeros((2 + len(lags), 0, 0))
    upper = space.extend(factor.solve(start_vectors))
    relaxed = [(1 - point * lag) * upper for lag in lags]
    latest = np.stack([upper, np.zeros_like(upper), *relaxed])
    for moment in range(1, MOST_MOMENTS + 1):
        yield moment, space.size
        earlier, latest = _orthonormalised(earlier, latest)
        y, y_before, *y_relaxed = latest
        stretches = [lag * part for lag, part in zip(lags, y_relaxed, strict=True)]
        known, of_mass, of_rests = laws.without_stiffness(
            factors, [y, *stretches], 2 * point * y + scale * y_before
        )
        upper = -space.extend(factor.solve(space.forces(of_mass, of_rests)))
        upper -= _padded(known, len(upper))
        lower, _, *before = (_padded(part, len(upper)) for part in latest)
        relaxed = [
            (1 - point * lag) * upper - lag * part for lag, part in zip(lags, before, strict=True)
        ]
        latest = np.stack([upper, lower / scale, *relaxed])


def _combined(basis: Floats, coordinates: Floats) -> Floats:
    """Vectors (n, k) of coordinates (size, k), column by column as the basis, which is faster."""
    found = np.empty((len(basis), coordinates.shape[1]), order="F")
    return np.matmul(basis, coordinates, out=found)


def _inner(basis: Floats, block: Floats) -> Floats:
    """Inner products basis^T block (size, k) of tall matrices."""
    found = np.zeros((block.shape[1], basis.shape[1]))
    for start in range(0, len(basis), ROWS):
        found += block[start : start + ROWS].T @ basis[start : start + ROWS]
    return found.T


def _norms(block: Floats, product: Floats) -> Floats:
    """Mass norms (m,) of columns with their product with M: 0 at rest for every second moment of a
    body without loss.
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


def _products(A: Any, basis: Floats, vectors: Floats) -> Floats:
    """Matrix basis^T A vectors (size, k) of a symmetric A, some vectors at a time."""
    starts = range(0, vectors.shape[1], AT_ONCE)
    columns = [_inner(basis, A @ vectors[:, k : k + AT_ONCE]) for k in starts]
    return np.hstack(columns) if columns else np.empty((basis.shape[1], 0))


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


def _band_response(space: KrylovBasis, probes: int, s: Complex, size: int) -> Complex:
    """Responses (f, k, p) of the probes to the loads that the space has seen beside them, or their
    fields (f, size, p), at complex frequencies s (f,) in rad/s, by the first vectors of the basis.
    """
    K, C, M, branches = space.model(size)
    start_vectors, loads = np.split(space.seen(size), [probes], axis=1)
    # One by one: all at once would be as large as the body's own factors.
    fields: Iterator[Any] = (
        np.linalg.solve(dynamic_stiffness(K, C, M, branches, at), start_vectors) for at in s
    )
    return np.array([loads.T @ x if loads.shape[1] else x for x in fields])


def _largest_change(before: Complex, now: Complex) -> float:
    """Largest relative change at any frequency."""
    change = now.copy()
    change[:, : before.shape[1]] -= before
    return float((np.linalg.norm(change, axis=(1, 2)) / np.linalg.norm(now, axis=(1, 2))).max())
