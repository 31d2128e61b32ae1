"""Krylov moment matching: the basis of a reduced-order model of probes under any surface load.

With A(s) = K + s C + s^2 M (plus s tau_j / (1 + s tau_j) K_j for each generalised Maxwell branch),
symmetric, the transfer function from a load f to a probe s_p is, by reciprocity,

    H(s) = s_p^T A(s)^-1 f = f^T y(s),   A(s) y(s) = s_p

V spans the first n moments of y, its Taylor coefficients about one real expansion point s_0.
Galerkin projection onto V preserves these moments of H (Bai and Su, SIAM J Sci Comput 26:1692,
2005) at the cost of one real factorisation. V is built by the two-level orthogonal Arnoldi
procedure (TOAR: Lu, Su and Bai, SIAM J Matrix Anal Appl 37:195, 2016), because the plain recurrence
loses all accuracy after a few dozen moments with proportional damping. The dashpot stretches of
Maxwell branches, y / (1 + s tau_j), are further parts of the linearised vectors; their moments lie
in the same space. The basis is mass-orthonormal. The added mass of a fluid is dense and can only be
applied; the expansion point is then 0, where no mass is factorised.

The error estimate is the difference from a model with a few more moments, which by Galerkin
orthogonality solves the residual equation in the larger space. These moments are then dropped:
convergence may become steep or stall at any moment.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import aslinearoperator

from fem.air import Air, damping
from fem.assembly import Operators
from fem.combination import Laws, factors_at
from fem.harmonic import dynamic_stiffness
from fem.linear_solver import Factor, factorise
from fem.maxwell import MaxwellBranch, maxwell_only
from fem.reduced import ReducedModel
from simple_model.typing import Complex, Floats

EXPANSION_POINT = 2 * np.pi * 200.0  # rad/s: about 4.5 times the lowest natural frequency is best


class NotReduced(ValueError):
    """The response of a body needs more moments than a reduced-order model may have."""


def reduce(
    operators: Operators,
    probes: sparse.csr_array,
    band: float = 1000.0,
    tolerance: float = 1e-3,
    *,
    loads: Floats | None = None,
    air: Air | None = None,
    weighted: bool = False,
    rate: int = 0,
    point: float = EXPANSION_POINT,
    most_moments: int = 200,
    solver: str = "auto",
    progress: Callable[[float], None] | None = None,
) -> ReducedModel:
    """Return a reduced-order model of the motion of a body's probes.

    Parameters
    ----------
    operators : Operators of the full body
    probes : (p, 3 n) sparse, from `probe_operator`; for whole fields also the rows of a
        `load_subspace`, without `loads`
    band : highest frequency at which the tolerance must be met, Hz
    tolerance : relative error of the probes' displacement at any frequency of the band
    loads : (3 n, k) float, typical nodal forces for the error estimate. Without them, the error is
        that of the probes' adjoint fields in the whole body, which needs far more moments.
    air : around a sheet, from `air_around`; the body must then be constrained
    weighted : whether errors are relative to the strongest response at any frequency, not at each,
        as for a `load_subspace`. Weak probes then get fewer moments.
    rate : order of the time derivative whose error counts, 1 for velocity
    point : expansion point, rad/s. Ignored with `air`, and with Maxwell branches, where the band
        sets it
    most_moments : largest number of moments
    solver : backend of `factorise`
    progress : called with the fraction done as the error estimate approaches the tolerance

    Returns
    -------
    ReducedModel
        Its `estimate` is at most the tolerance.

    Raises
    ------
    NotReduced
        If the tolerance is not reached.
    ValueError
        If no probe can move.

    Examples
    --------
    >>> import fem, meshes
    >>> mesh = meshes.block((0.02, 0.02, 0.01), 0.005)
    >>> ops = fem.assemble(mesh, fem.PRESETS["palm"], fixed="bottom")
    >>> S, force = fem.probe_operator(mesh, [[0.0, 0.0]]), fem.pressure_operator(mesh).sum(axis=1)
    >>> model = fem.reduce(ops, S, 500.0, 1e-3, loads=force[:, None])
    >>> len(ops.free), len(model.operators.K)
    (972, 12)
    """
    free, report = operators.free, progress or (lambda fraction: None)
    start_vectors = probes[:, free].toarray().T
    if not start_vectors.any():
        raise ValueError("all probes lie where the body is fixed; move one to a free point")
    point, operators = _expansion(operators, air, band, point)
    laws = operators.combinations()
    factors = factors_at(operators.branches, point)
    factor = factorise(laws.dynamic_stiffness(factors, operators.K, operators.M), backend=solver)
    report(0.0)

    independent, directions = _independent(start_vectors)
    space = KrylovBasis(operators, laws, independent.shape[1] * (most_moments + 1))
    rows = start_vectors if loads is None else np.hstack([start_vectors, loads[free]])
    growing = _moments(space, operators, laws, point, factor, independent, most_moments)
    moments, size, estimate = _iterate(
        space, rows, directions, band, tolerance, growing, report, weighted, rate
    )

    backend = factor.backend
    del factor  # the basis needs its memory
    K, C, M, branches = space.model(size)
    basis = space.on_all_dofs(size)
    if air is not None:
        V = basis[free]
        C = C + damping(K, M, {name: V.T @ (R @ V) for name, R in air.resistances.items()})
    small = Operators(
        K=K.copy(), C=C.copy(), M=M, R=space.radiation(operators.R, size), branches=branches,
        free=np.arange(size), n_dofs=size,
    )  # fmt: skip
    outputs = space.rows(size)[:, : start_vectors.shape[1]].T.copy()
    return ReducedModel(
        operators=small, basis=basis, outputs=outputs, moments=moments,
        estimate=estimate, solver=backend,
    )  # fmt: skip


def load_subspace(loads: Floats, tolerance: float = 1e-3) -> Floats:
    """Return a proper orthogonal basis (3 n, s) of loads (3 n, k) to a relative error in the
    2-norm, each vector as large as its part of the loads. A circling focus needs about twenty
    vectors at 1e-3.
    """
    squares, vectors = np.linalg.eigh(loads.T @ loads)
    truncated = np.sqrt(np.cumsum(np.maximum(squares, 0)) / squares.sum())
    needed = truncated > tolerance
    return loads @ vectors[:, needed]


class KrylovBasis:
    """Growing mass-orthonormal basis, with the matrices and vectors projected onto it.

    Products with sparse matrices are recomputed where needed, which takes less time than reading
    them from memory. New vectors are orthonormalised in place.
    """

    def __init__(self, operators: Operators, laws: Laws, most: int) -> None:
        self._branches, self._laws = operators.branches, laws
        self._M, self._K = operators.M, operators.K
        self._rests = [part.rest for part in laws.parts]
        self._free, n_dofs = operators.free, operators.n_dofs
        self._all_dofs = np.empty((n_dofs, most), order="F")  # for `expanded`
        self._columns = self._all_dofs[: len(operators.free)]
        # Projected K and rests (size, size), and projected probes and loads (size, k).
        self._small_K = np.empty((0, 0))
        self._small_rests: list[Any] = [None if r is None else self._small_K for r in self._rests]
        self._rows = np.empty((0, 0))
        self.size = 0
        self.followed: int | None = None  # vectors of a moment that get a next one, None for all

    @property
    def basis(self) -> Floats:
        """Vectors (n, size)."""
        return self._columns[:, : self.size]

    def on_all_dofs(self, size: int) -> Floats:
        """Return the first vectors on all dofs (n_dofs, size), 0 where the body is fixed. Reuses
        the basis buffer; the basis is invalid afterwards.
        """
        for column in self._all_dofs[:, :size].T:
            values = column[: len(self._free)].copy()
            column[:] = 0
            column[self._free] = values
        return self._all_dofs[:, :size]

    def model(self, size: int) -> tuple[Floats, Floats, Floats, tuple[MaxwellBranch, ...]]:
        """Return K, C, M and Maxwell branches projected onto the first vectors."""
        K, M = self._small_K[:size, :size], np.eye(size)
        rests = (None if rest is None else rest[:size, :size] for rest in self._small_rests)
        each = (replace(part, rest=r) for part, r in zip(self._laws.parts, rests, strict=True))
        C, *relaxing = (part.of(K) for part in each)
        branches = zip(relaxing, maxwell_only(self._branches), strict=True)
        return K, C, M, tuple(MaxwellBranch(K=A, time=b.time) for A, b in branches)

    def rows(self, size: int) -> Floats:
        """Return the components (size, k) of the vectors that `project` received last."""
        return self._rows[:size]

    def radiation(self, R: sparse.csr_array, size: int) -> Floats:
        """Return the projected damping (size, size) of absorbing boundaries."""
        if R is self._laws.damping.rest:
            return np.array(self._small_rests[0])[:size, :size]
        basis = self.basis[:, :size]
        return _products(R, basis, basis)

    def forces(self, of_mass: Floats, of_rests: Sequence[Floats]) -> Floats:
        """Return nodal forces M z + sum_j rest_j r_j (n, k) for coordinates z, r_j (size, k)."""
        acting = [(self._M, of_mass)]
        acting += [(A, r) for A, r in zip(self._rests, of_rests, strict=True) if A is not None]
        fields = _combine(self.basis, np.hstack([r for _, r in acting]))  # reads the basis once
        each = np.split(fields, len(acting), axis=1)
        return sum(A @ field for (A, _), field in zip(acting, each, strict=True))

    def extend(self, block: Floats) -> Floats:
        """Add the independent directions of a block (n, k), by block Gram-Schmidt and a
        decomposition of its Gram matrix. Return the coordinates (size, k) of the block.
        """
        M, Q = self._M, self.basis
        product = M @ block
        tiny = np.finfo(np.float64).tiny
        scale = np.maximum(np.sqrt(np.einsum("nm,nm->m", block, product)), tiny)  # mass norms
        first = _inner(Q, product)
        block = block - _combine(Q, first)
        # Once is not enough: after 90 moments vectors would be orthogonal to 1e-3 only.
        product = M @ block
        second = _inner(Q, product)
        gram = block.T @ product - second.T @ second
        block -= _combine(Q, second)
        size = np.sqrt(np.maximum(np.diag(gram), 0.0))
        round_off = 1e-12  # of a direction: smaller remainders are round-off
        # A space that spans all dofs of a body has no new direction.
        inverse = np.divide(1, size, out=np.zeros_like(size), where=size > round_off * scale)
        squares, directions = np.linalg.eigh(gram * np.outer(inverse, inverse))
        dependent = 1e-10  # squared sine below which a direction is not new
        distinct = squares > max(dependent * squares.max(), tiny)
        squares, directions = squares[distinct], directions[:, distinct]
        upright = inverse[:, None] * directions / np.sqrt(squares)
        alike = 1e-6  # squared sine below which directions are orthonormalised once more
        if len(squares) and squares.min() < alike * squares.max():
            upright = self._reorthonormalise(block, upright)
        start, self.size = self.size, self.size + upright.shape[1]
        np.matmul(block, upright, out=self._columns[:, start : self.size])
        return np.vstack([first + second, upright.T @ gram])

    def _reorthonormalise(self, block: Floats, upright: Floats) -> Floats:
        """Orthonormalise similar directions again, because scaling amplifies round-off."""
        new = block @ upright
        block -= _combine(self.basis, self.basis.T @ (self._M @ new)) @ np.linalg.pinv(upright)
        new = block @ upright
        return upright @ np.linalg.inv(np.linalg.cholesky(new.T @ (self._M @ new))).T

    def project(self, rows: Floats, size: int) -> None:
        """Project the matrices, probes and loads (n, k) onto the vectors added since."""
        Q, new = self._columns[:, :size], self._columns[:, len(self._small_K) : size]
        self._rows = np.vstack([self._rows.reshape(-1, rows.shape[1]), new.T @ rows])
        self._small_K = _border(self._small_K, _products(self._K, Q, new))
        self._small_rests = [
            None if rest is None else _border(small, _products(rest, Q, new))
            for rest, small in zip(self._rests, self._small_rests, strict=True)
        ]


def _iterate(
    space: KrylovBasis,
    rows: Floats,
    directions: Floats,
    band: float,
    tolerance: float,
    growing: Iterable[tuple[int, int]],
    report: Callable[[float], None],
    weighted: bool,
    rate: int,
) -> tuple[int, int, float]:
    """Return moments, vectors and error of the first model within the tolerance.

    The rows begin with those of the probes; `directions` (p, k) combine these to the vectors of a
    moment.
    """
    probes, dropped = len(directions), 0.0  # error of vectors that get no further moments
    frequencies, coarse_step = 41, 5  # where the error is computed; at first only every fifth
    # Not 0 Hz itself, where an unconstrained body has no finite response.
    fine = np.asarray(2j * np.pi * np.linspace(1e-3 * band, band, frequencies), np.complex128)
    coarse = fine[::coarse_step]  # until the error is below the tolerance there
    at, before, response, first, error = 0, (0, 0), None, np.inf, np.inf
    weak_share = 0.3  # of the tolerance: error of weak start vectors that have no more moments
    for moments, size in growing:
        # At least three moments give the error to a factor of 4. A sixteenth of all, because
        # estimating the error of a large model costs more than its moments.
        if moments < at + max(3, moments / 16):
            continue
        at = moments
        space.project(rows, size)
        now = _band_response(space, probes, coarse, size, rate)
        if response is not None:
            error = np.hypot(_largest_change(response, now, weighted), dropped)
            if error <= tolerance:
                earlier, latest = (
                    _band_response(space, probes, fine, each, rate) for each in (before[1], size)
                )
                error = np.hypot(_largest_change(earlier, latest, weighted), dropped)
            if weighted:
                each = _changes(response, now, weighted, directions)[:, : space.followed]
                ends = np.sqrt(np.cumsum(each[:, ::-1] ** 2, axis=1)).max(axis=0)[::-1]
                weak = np.hypot(ends, dropped) <= weak_share * tolerance
                space.followed = max(1, int(np.count_nonzero(~weak)))
                dropped = float(np.hypot(dropped, ends[space.followed :].max(initial=0.0)))
            first = error if first == np.inf else first
            report(max(0.0, np.log(error / first) / np.log(tolerance / first)))
            if error <= tolerance:
                return *before, error
        before, response = (moments, size), now
    raise NotReduced(
        f"the reduced-order model of {moments} moments has a relative error of {error:.2g}, "
        f"above the tolerance {tolerance:g}; raise the tolerance, narrow the band or add damping"
    )


def _expansion(
    operators: Operators, air: Air | None, band: float, point: float
) -> tuple[float, Operators]:
    """Return the expansion point in rad/s, and the operators with the added mass."""
    if air is None:
        # With Maxwell branches, waves of high frequency lose little, and many of them matter: the
        # best point is 0.8 to 1.6 times the band. The point given needs nearly twice the moments.
        return 2 * np.pi * band if operators.branches else point, operators
    return 0.0, replace(operators, M=aslinearoperator(operators.M) + air.mass)


def _independent(start_vectors: Floats) -> tuple[Floats, Floats]:
    """Return independent unit directions (n, d) in the span of vectors (n, p), the strongest first,
    and the unit combinations (p, d) of the vectors along them.

    Probes on a clamped edge do not move, and probes in one element may be linearly dependent.
    """
    squares, directions = np.linalg.eigh(start_vectors.T @ start_vectors)
    distinct = squares > 1e-12 * squares[-1]  # squared singular values; the others are dependent
    directions = directions[:, distinct][:, ::-1]
    return start_vectors @ (directions / np.sqrt(squares[distinct])[::-1]), directions


def _moments(
    space: KrylovBasis,
    operators: Operators,
    laws: Laws,
    point: float,
    factor: Factor,
    start_vectors: Floats,
    most: int,
) -> Iterator[tuple[int, int]]:
    """Extend the space by up to `most` moments; yield the numbers of moments and of vectors."""
    branches = maxwell_only(operators.branches)
    lags = [branch.time / (1 + point * branch.time) for branch in branches]
    factors = factors_at(branches, point)
    scale = point or EXPANSION_POINT
    # Coordinates of the linearised Krylov vectors (y, y' / scale, dashpot stretches) in the basis.
    # They are orthonormalised over all moments, so that none grows.
    earlier = np.zeros((2 + len(lags), 0, 0))
    upper = space.extend(factor.solve(start_vectors))
    relaxed = [(1 - point * lag) * upper for lag in lags]
    latest = np.stack([upper, np.zeros_like(upper), *relaxed])
    for moment in range(1, most + 1):
        yield moment, space.size
        earlier, latest = _orthonormalise(earlier, latest)
        latest = latest[:, :, : space.followed]
        y, y_before, *y_relaxed = latest
        stretches = [lag * part for lag, part in zip(lags, y_relaxed, strict=True)]
        direct, of_mass, of_rests = laws.without_stiffness(
            factors, [y, *stretches], 2 * point * y + scale * y_before
        )
        upper = -space.extend(factor.solve(space.forces(of_mass, of_rests)))
        upper -= _pad(direct, len(upper))
        lower, _, *before = (_pad(part, len(upper)) for part in latest)
        relaxed = [
            (1 - point * lag) * upper - lag * part for lag, part in zip(lags, before, strict=True)
        ]
        latest = np.stack([upper, lower / scale, *relaxed])


def _combine(basis: Floats, coordinates: Floats) -> Floats:
    """Return vectors (n, k) of coordinates (size, k), column by column like the basis for speed."""
    return np.matmul(
        basis, coordinates, out=np.empty((len(basis), coordinates.shape[1]), order="F")
    )


def _inner(basis: Floats, block: Floats) -> Floats:
    """Return the inner products basis^T block (size, k) of tall matrices."""
    products = np.zeros((block.shape[1], basis.shape[1]))
    rows = 512  # that stay in the processor's cache: a third of the time of one multiplication
    for start in range(0, len(basis), rows):
        products += block[start : start + rows].T @ basis[start : start + rows]
    return products.T


def _pad(coordinates: Floats, size: int) -> Floats:
    return np.vstack([coordinates, np.zeros((size - len(coordinates), coordinates.shape[1]))])


def _orthonormalise(earlier: Floats, latest: Floats) -> tuple[Floats, Floats]:
    """Orthonormalise the latest vectors to earlier ones (parts, size, k). Return all, and them."""
    parts, size, width = latest.shape
    padded = np.pad(earlier, ((0, 0), (0, size - earlier.shape[1]), (0, 0)))
    W, X = padded.reshape(parts * size, -1), latest.reshape(parts * size, width)
    X = X / np.linalg.norm(X, axis=0)
    for _ in range(2):
        X = X - W @ (W.T @ X)
    X = np.linalg.qr(X)[0]
    return np.hstack([W, X]).reshape(parts, size, -1), X.reshape(parts, size, width)


def _products(A: Any, basis: Floats, vectors: Floats) -> Floats:
    """Return basis^T A vectors (size, k), some vectors at a time."""
    at_once = 32  # vectors multiplied together
    starts = range(0, vectors.shape[1], at_once)
    columns = [_inner(basis, A @ vectors[:, k : k + at_once]) for k in starts]
    return np.hstack(columns) if columns else np.empty((basis.shape[1], 0))


def _border(small: Floats, columns: Floats) -> Floats:
    """Border a symmetric matrix by its last columns (r, k) and rows."""
    return np.vstack([np.hstack([small, columns[: len(small)]]), columns.T])


def _band_response(space: KrylovBasis, probes: int, s: Complex, size: int, rate: int) -> Complex:
    """Return derivatives of order `rate` of the responses (f, k, p) of the probes to the loads, or
    without loads of their fields (f, size, p), at complex frequencies s (f,) in rad/s, in the first
    vectors of the basis.
    """
    K, C, M, branches = space.model(size)
    start_vectors, loads = np.split(space.rows(size), [probes], axis=1)
    # One by one: all at once would need as much memory as the body's own factors.
    fields: Iterator[Any] = (
        np.linalg.solve(dynamic_stiffness(K, C, M, branches, at), start_vectors) for at in s
    )
    response = np.array([loads.T @ x if loads.shape[1] else x for x in fields])
    return response * np.abs(s[:, None, None]) ** rate


def _largest_change(before: Complex, now: Complex, of_all: bool) -> float:
    """Return the largest relative change at any frequency; `of_all` is as in `_changes`."""
    return float(np.linalg.norm(_changes(before, now, of_all), axis=1).max())


def _changes(
    before: Complex, now: Complex, of_all: bool, directions: Floats | None = None
) -> Floats:
    """Return the change (f, d) at each frequency by probe, or by combinations (p, d) of probes,
    over the response at that frequency or, with `of_all`, the strongest at any.
    """
    change = now.copy()
    change[:, : before.shape[1]] -= before
    change = change if directions is None else change @ directions
    size = np.linalg.norm(now, axis=(1, 2))
    return np.linalg.norm(change, axis=1) / (size.max() if of_all else size[:, None])
