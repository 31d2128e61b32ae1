"""Reduced-order model of the probes' response to any surface load, by Krylov moment matching.

By reciprocity the response of probe p to a load f is f^T y_p with (K + s C + s^2 M) y_p = s_p,
where K stands for K + sum_j s tau_j / (1 + s tau_j) K_j if there are generalised Maxwell branches.
Those y_p(s) are approximated by Galerkin projection onto the second-order Krylov space of the
probe vectors about one real expansion point, which costs one real factorisation. The space is built
by the two-level orthogonal Arnoldi procedure (TOAR: Lu, Su and Bai, SIAM J Matrix Anal Appl 37:195,
2016): with proportional damping the plain recurrence loses all accuracy after a few dozen moments.
The dashpot stretches of Maxwell branches, y / (1 + s tau_j), are further parts of the linearised
vectors: their moments lie in the same space, so that the moments matched are those of the exact
constitutive law.
The basis is mass-orthonormal: the reduced mass is the identity, and field norms are vector norms.
Added mass of a fluid is dense and can only be applied: with it the expansion point is 0, where no
mass is factorised.

The error estimate needs no solution of the full system: it is the difference from the response of
the model with some more moments, which by Galerkin orthogonality solves the residual equation in
the larger space. Those further moments are then dropped: the error of the larger model would be
unknown, because convergence may become steep or stall at any moment.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse
from scipy.sparse.linalg import aslinearoperator

from fem.added_mass import AddedMass
from fem.assembly import Operators
from fem.linear_solver import Factor, factorise
from fem.maxwell import MaxwellBranch, relaxing_stiffness, with_internal
from meshes.tetmesh import Floats

Complex = NDArray[np.complex128]

SHIFT = 2 * np.pi * 200.0  # expansion point, rad/s: best at 200 to 400 Hz for a band of 1 to 2 kHz
# Expansion point over the band with Maxwell branches: waves of high frequency lose little then, and
# many of them count. Best between 0.8 and 1.6; the one above takes nearly twice as many moments.
RELAXING_SHIFT = 1.0
# Moments between two error estimates: at least so many, which give it to a factor of 4, and this
# share of all, because estimating the error of a large model costs more than its moments.
AHEAD = 3
SHARE_AHEAD = 1 / 16
MOST_MOMENTS = 200
SMALLEST = np.finfo(np.float64).tiny
DISTINCT = 1e-6  # of the largest singular value: probes that differ by less count as dependent
ROUND_OFF = 1e-12  # of a direction: what orthogonalisation leaves of it is round-off
DEPENDENT = 1e-10  # squared sine below which a direction counts as not new


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
    operators : Operators
    probes : (p, 3 n) sparse, from `probe_operator`; for whole fields the rows of a
        `load_subspace` as well, without `loads`
    band : float, Hz, highest frequency at which the tolerance must be met
    tolerance : float, relative error of the probes' displacement at any frequency of the band
    loads : (3 n, k), typical nodal forces that the error is estimated for; without any it is
        that of the probes' adjoint fields in the whole body, which takes far more moments
    added : added mass of a fluid, as `added_mass` gives it; the body must be constrained then
    progress : called with the fraction done, as the error estimate approaches the tolerance

    Raises
    ------
    ValueError
        If the tolerance is out of reach, or no probe can move.
    """
    free, branches = operators.free, with_internal(operators.branches)
    seeds = probes[:, free].toarray().T
    if not seeds.any():
        raise ValueError("no probe can move, all lie where the body is fixed; move one inwards")
    # Probes on a clamped edge do not move; those in one element may be linearly dependent.
    directions, strengths, _ = np.linalg.svd(seeds, full_matrices=False)
    moving = directions[:, strengths > DISTINCT * strengths[0]]
    shift = 2 * np.pi * RELAXING_SHIFT * band if branches else SHIFT
    if added is not None:
        shift, operators = 0.0, _with_added(operators, added)
    K, C, M = operators.K, operators.C, operators.M
    shifted = K + shift * C + shift**2 * M + relaxing_stiffness(branches, shift) if shift else K
    factor = factorise(shifted, backend=solver)
    if progress:
        progress(0.0)
    others = [C, *(branch.K for branch in branches)]
    space = _Space([M, *others], moving.shape[1] * (MOST_MOMENTS + 1))
    small = [np.empty((0, 0)) for _ in [K, *others]]
    grown = _moments(space, operators, shift, factor, moving)
    looked, size, before = 0, 0, None
    errors: list[float] = []
    for moment in range(1, MOST_MOMENTS + 1):
        next(grown)
        basis, images = space.basis, space.images
        new = slice(len(small[0]), None)
        moved = [K @ basis[:, new], *(image[:, new] for image in images[1:])]
        small = [_bordered(part, basis.T @ f) for part, f in zip(small, moved, strict=True)]
        if moment < looked + max(AHEAD, SHARE_AHEAD * moment):
            continue
        weights = None if loads is None else basis.T @ loads[free]
        model = (small[0], small[1], _branches(small[2:], branches))
        now = _probe_response(*model, basis.T @ seeds, weights, band)
        errors += [] if before is None else [_change(before, now)]
        if errors and errors[-1] <= tolerance:
            break
        if errors and progress:
            progress(max(0.0, np.log(errors[-1] / errors[0]) / np.log(tolerance / errors[0])))
        looked, size, before = moment, space.size, now
    else:
        raise ValueError(
            f"{MOST_MOMENTS} moments leave an error of {errors[-1]:.2g}, above the tolerance "
            f"{tolerance:g}; raise the tolerance, narrow the band or add damping"
        )
    basis = space.basis[:, :size]
    K, C, *relaxing = (part[:size, :size].copy() for part in small)
    return ReducedModel(
        basis=operators.expand(basis),
        K=K,
        C=C,
        R=basis.T @ (operators.R @ basis),
        outputs=seeds.T @ basis,
        moments=looked,
        estimate=errors[-1],
        solver=factor.backend,
        branches=_branches(relaxing, branches),
    )


def _with_added(operators: Operators, added: AddedMass) -> Operators:
    """Operators of a body with an added mass, of which C and M can only be applied."""
    C, M = aslinearoperator(operators.C), aslinearoperator(operators.M)
    return replace(operators, C=C + added.rate * added.M, M=M + added.M)


def _moments(
    space: "_Space", operators: Operators, shift: float, factor: Factor, seeds: Floats
) -> Iterator[None]:
    """Extend the Krylov space by the next moment of start vectors (n, p) at each turn."""
    branches = operators.branches
    lags = [branch.time / (1 + shift * branch.time) for branch in branches]
    scale = shift or SHIFT
    # Coordinates in the basis of the linearised Krylov vectors (y, y' / scale, dashpot stretches):
    # rows of `taken` are orthonormal, so that nothing grows however many moments are taken.
    taken = np.zeros((2 + len(lags), 0, 0))
    upper = space.extend(factor.solve(seeds))
    relaxed = [(1 - shift * lag) * upper for lag in lags]
    newest = np.stack([upper, np.zeros_like(upper), *relaxed])
    while True:
        yield
        taken, newest = _append(taken, newest)
        y, y_before, *y_relaxed = newest
        M, C, *K_relaxing = space.images  # times the basis, whose coordinates these are
        rest = C @ y + M @ (2 * shift * y + scale * y_before)
        for K, lag, part in zip(K_relaxing, lags, y_relaxed, strict=True):
            rest += K @ (lag * part)
        upper = space.extend(-factor.solve(rest))
        lower, _, *before = (_padded(part, len(upper)) for part in newest)
        relaxed = [
            (1 - shift * lag) * upper - lag * part for lag, part in zip(lags, before, strict=True)
        ]
        newest = np.stack([upper, lower / scale, *relaxed])


def load_subspace(loads: Floats, tolerance: float = 1e-3) -> Floats:
    """Proper orthogonal basis (3 n, s) of loads (3 n, k), to a relative error in the 2-norm.

    A circling focus needs about twenty at 1e-3, however many positions it is given at.
    """
    squares, vectors = np.linalg.eigh(loads.T @ loads)
    left_out = np.sqrt(np.cumsum(np.maximum(squares, 0)) / squares.sum())
    kept = left_out > tolerance
    return loads @ (vectors[:, kept] / np.sqrt(squares[kept]))


def transfer(model: ReducedModel, forces: Floats, frequencies: ArrayLike) -> Complex:
    """Transfer function: probe displacement (f, p, k) in metre per unit of the reduced forces
    (r, k), at frequencies (f,) in Hz.
    """
    w = 2 * np.pi * np.atleast_1d(np.asarray(frequencies, np.float64))
    Z = _impedance(model.K, model.C, model.branches, w)
    return model.outputs @ np.linalg.solve(Z, np.broadcast_to(forces, (len(w), *forces.shape)))


class _Space:
    """Mass-orthonormal Krylov basis (n, size) that grows, and its `images`, the products of M and
    other matrices with it, each formed once; memory is touched only as far as it is used.
    """

    def __init__(self, matrices: list[sparse.csr_array], most: int) -> None:
        self._matrices = matrices
        shape = (matrices[0].shape[0], most)
        self._columns = [np.empty(shape, order="F") for _ in [None, *matrices]]
        self.size = 0

    @property
    def basis(self) -> Floats:
        return self._columns[0][:, : self.size]

    @property
    def images(self) -> list[Floats]:
        return [columns[:, : self.size] for columns in self._columns[1:]]

    def extend(self, block: Floats) -> Floats:
        """Add the linearly independent directions of a block (n, k); its coordinates (size, k)."""
        M, *others = self._matrices
        Q, MQ = self.basis, self.images[0]
        scale = _norms(block, M @ block)
        block, overlap = block / scale, np.zeros((self.size, len(scale)))
        for _ in range(2):  # twice is enough
            coordinates = MQ.T @ block
            block = block - Q @ coordinates
            overlap = overlap + coordinates
        image = M @ block
        left = _norms(block, image)
        fresh = left > ROUND_OFF  # of 1: a space of all of a body's dofs has no new direction
        block, image = (np.where(fresh, x / left, 0.0) for x in (block, image))
        squares, directions = np.linalg.eigh(block.T @ image)
        new = block @ (directions[:, squares > max(DEPENDENT * squares.max(), SMALLEST)])
        for _ in range(2):
            new = new - Q @ (MQ.T @ new)
            image = M @ new
            upright = np.linalg.inv(np.linalg.cholesky(new.T @ image)).T
            new, image = new @ upright, image @ upright
        grown = slice(self.size, self.size + new.shape[1])
        parts = [new, image, *(other @ new for other in others)]
        for columns, part in zip(self._columns, parts, strict=True):
            columns[:, grown] = part
        self.size = grown.stop
        return np.vstack([overlap, (image.T @ block) * left]) * scale


def _norms(block: Floats, image: Floats) -> Floats:
    """Mass norms (k,) of columns with their image under M.

    At rest every second moment of a body without loss is 0, which is no direction.
    """
    return np.maximum(np.sqrt(np.einsum("nk,nk->k", block, image)), SMALLEST)


def _padded(coordinates: Floats, size: int) -> Floats:
    return np.vstack([coordinates, np.zeros((size - len(coordinates), coordinates.shape[1]))])


def _append(taken: Floats, newest: Floats) -> tuple[Floats, Floats]:
    """The previous vectors (l, size, k) with the newest orthonormalised to them; and the newest."""
    parts, size, width = newest.shape
    grown = np.zeros((parts, size, taken.shape[2]))
    grown[:, : taken.shape[1]] = taken
    W, X = grown.reshape(parts * size, -1), newest.reshape(parts * size, width)
    X = X / np.linalg.norm(X, axis=0)
    for _ in range(2):
        X = X - W @ (W.T @ X)
    X = np.linalg.qr(X)[0]
    return np.hstack([W, X]).reshape(parts, size, -1), X.reshape(parts, size, width)


def _bordered(small: Floats, columns: Floats) -> Floats:
    """Symmetric matrix bordered by its last columns (r, k) and rows."""
    r, k = columns.shape
    grown = np.empty((r, r))
    grown[: r - k, : r - k] = small
    grown[:, r - k :] = columns
    grown[r - k :] = columns.T
    return grown


def _branches(small: list[Floats], large: tuple[MaxwellBranch, ...]) -> tuple[MaxwellBranch, ...]:
    """The full model's Maxwell branches with the reduced stiffness."""
    return tuple(MaxwellBranch(K=K, time=b.time) for K, b in zip(small, large, strict=True))


def _impedance(K: Floats, C: Floats, branches: tuple[MaxwellBranch, ...], w: Floats) -> Complex:
    s = 1j * w[:, None, None]
    return np.asarray(K + s * C + s**2 * np.eye(len(K)) + relaxing_stiffness(branches, s))


def _probe_response(
    K: Floats,
    C: Floats,
    branches: tuple[MaxwellBranch, ...],
    seeds: Floats,
    loads: Floats | None,
    band: float,
) -> Complex:
    """Responses (f, k, p) of the probes to the loads (r, k), or their fields (f, r, p)."""
    # Nearly from 0 Hz: at 0 Hz itself an unconstrained body has no finite response.
    w = 2 * np.pi * np.linspace(1e-3 * band, band, 41)
    # One by one: all at once would be as large as the body's own factors.
    fields = (np.linalg.solve(_impedance(K, C, branches, at)[0], seeds) for at in w[:, None])
    return np.array([x if loads is None else loads.T @ x for x in fields])


def _change(before: Complex, now: Complex) -> float:
    """Largest relative change at any frequency."""
    change = now.copy()
    change[:, : before.shape[1]] -= before
    return float((np.linalg.norm(change, axis=(1, 2)) / np.linalg.norm(now, axis=(1, 2))).max())
