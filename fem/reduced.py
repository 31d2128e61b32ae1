"""A small model that answers like the large one at the probes, for any load on the surface.

By reciprocity the response of probe p to a load f is f^T y_p with (K + s C + s^2 M) y_p = s_p,
where K stands for K + sum_j s tau_j / (1 + s tau_j) K_j if some of the stiffness relaxes.
Those y_p(s) are approximated by Galerkin projection onto the second-order Krylov space of the
probe vectors at one real shift, which costs one real factorisation. The space is built by the
two-level orthogonal Arnoldi procedure (TOAR: Lu, Su and Bai, SIAM J Matrix Anal Appl 37:195, 2016):
with proportional damping the plain recurrence loses all accuracy after a few dozen moments.
What has relaxed of y, y / (1 + s tau_j), is a further part of the linearised vectors: its moments
lie in the same space, so that these are the moments of the exact law.
The basis is mass-orthonormal: the reduced mass is the identity, and field norms are vector norms.
Mass that moves along with a body, as air does, is dense and can only be applied: with it the shift
is 0, where no mass is factorised.

The error estimate needs no solution of the full system: it is the residual of the model answered
in the space of some more moments, where Galerkin's method makes the two answers' difference solve
the residual equation. Those moments are then dropped: a model of theirs would have an error that
nobody knows, because convergence may at any moment become steep or stall.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse
from scipy.sparse.linalg import aslinearoperator

from fem.air import Added
from fem.assembly import Operators
from fem.linear_solver import Factor, factorise
from fem.relaxation import Branch, relaxing_stiffness
from meshes.tetmesh import Floats

Complex = NDArray[np.complex128]

SHIFT = 2 * np.pi * 200.0  # rad/s: best between 200 and 400 Hz for a band of 1 to 2 kHz
# Of the band, if stiffness relaxes: fast waves lose little then, and many of them count. Best
# between 0.8 and 1.6; the shift above takes nearly twice as many moments.
RELAXING_SHIFT = 1.0
# Moments between two looks at the error: at least so many, which tell it to a factor of 4, and
# this share of all, because a look at a large model costs more than its moments.
AHEAD = 3
SHARE_AHEAD = 1 / 16
MOST_MOMENTS = 200
SMALLEST = np.finfo(np.float64).tiny
DISTINCT = 1e-6  # of the strongest: what less of probes is not told apart
ROUND_OFF = 1e-12  # of a direction, of which what is left after orthogonalisation says nothing
DEPENDENT = 1e-10  # squared sine below which a direction counts as not new


@dataclass(frozen=True, kw_only=True, eq=False)
class ReducedModel:
    """u'' + C u' + K u = basis^T f, displacement at the probes = outputs u.

    `basis` (3 n, r) in kg^-1/2, `K`, `C` and `R` (r, r), `outputs` (p, r), `branches` beside K of
    (r, r) each; `estimate` is the relative change of the probes' response by some more moments,
    `moments` how many there are.
    """

    basis: Floats
    K: Floats
    C: Floats
    R: Floats
    outputs: Floats
    moments: int
    estimate: float
    solver: str
    branches: tuple[Branch, ...] = ()


def reduce(
    operators: Operators,
    probes: sparse.csr_array,
    band: float = 1000.0,
    tolerance: float = 1e-3,
    *,
    loads: Floats | None = None,
    added: Added | None = None,
    solver: str = "auto",
    progress: Callable[[float], None] | None = None,
) -> ReducedModel:
    """Reduce a body to the motion of its probes.

    Parameters
    ----------
    operators : Operators
    probes : (p, 3 n) sparse, from `probe_operator`; for whole fields the rows of a
        `load_subspace` as well, without `loads`
    band : float, Hz, highest frequency that must be right
    tolerance : float, relative error of the probes' displacement at any frequency of the band
    loads : (3 n, k), typical nodal forces by which the error is judged; without any it is judged
        by the probes' adjoint fields in the whole body, which asks for far more moments
    added : what moves with the body, as `added_mass` gives it; something must hold the body then
    progress : called with the fraction done, as the error estimate approaches the tolerance

    Raises
    ------
    ValueError
        If the tolerance is out of reach, or no probe can move.
    """
    free, branches = operators.free, operators.branches
    seeds = probes[:, free].toarray().T
    if not seeds.any():
        raise ValueError("no probe can move, all lie where the body is held; move one inwards")
    # Probes on a clamped edge stay where they are, those in one element know of each other.
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


def _with_added(operators: Operators, added: Added) -> Operators:
    """The operators of a body with what moves along, of which C and M can only be applied."""
    C, M = aslinearoperator(operators.C), aslinearoperator(operators.M)
    return replace(operators, C=C + added.rate * added.M, M=M + added.M)


def _moments(
    space: "_Space", operators: Operators, shift: float, factor: Factor, seeds: Floats
) -> Iterator[None]:
    """Adds the next moment of seeds (n, p) to the space at each turn."""
    branches = operators.branches
    lags = [branch.time / (1 + shift * branch.time) for branch in branches]
    scale = shift or SHIFT
    # Coordinates in the basis of the linearised Krylov vectors (y, y' / scale, what has relaxed):
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
    """Orthonormal columns (3 n, s) that span loads (3 n, k) to a relative error in the 2-norm.

    A circling focus needs about twenty at 1e-3, however many positions it is given at.
    """
    squares, vectors = np.linalg.eigh(loads.T @ loads)
    left_out = np.sqrt(np.cumsum(np.maximum(squares, 0)) / squares.sum())
    kept = left_out > tolerance
    return loads @ (vectors[:, kept] / np.sqrt(squares[kept]))


def transfer(model: ReducedModel, forces: Floats, frequencies: ArrayLike) -> Complex:
    """Probe displacement (f, p, k) in metre per unit of the reduced forces (r, k) at each Hz."""
    w = 2 * np.pi * np.atleast_1d(np.asarray(frequencies, np.float64))
    Z = _impedance(model.K, model.C, model.branches, w)
    return model.outputs @ np.linalg.solve(Z, np.broadcast_to(forces, (len(w), *forces.shape)))


class _Space:
    """A growing mass-orthonormal basis (n, size), and its `images` under M and other matrices,
    which all later products with them come from; memory is touched only as far as it is used.
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
        """Add the directions of a block (n, k) that are new; its coordinates (size, k)."""
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
        fresh = left > ROUND_OFF  # of 1: in a space that holds all of a body there is nothing new
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
    """Those taken (l, size, k) with the newest made orthonormal to them; and those alone."""
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
    """A symmetric matrix grown by its last columns (r, k)."""
    r, k = columns.shape
    grown = np.empty((r, r))
    grown[: r - k, : r - k] = small
    grown[:, r - k :] = columns
    grown[r - k :] = columns.T
    return grown


def _branches(small: list[Floats], large: tuple[Branch, ...]) -> tuple[Branch, ...]:
    """The large model's branches with the small model's stiffness."""
    return tuple(Branch(K=K, time=b.time) for K, b in zip(small, large, strict=True))


def _impedance(K: Floats, C: Floats, branches: tuple[Branch, ...], w: Floats) -> Complex:
    s = 1j * w[:, None, None]
    return np.asarray(K + s * C + s**2 * np.eye(len(K)) + relaxing_stiffness(branches, s))


def _probe_response(
    K: Floats,
    C: Floats,
    branches: tuple[Branch, ...],
    seeds: Floats,
    loads: Floats | None,
    band: float,
) -> Complex:
    """Responses (f, k, p) of the probes to the loads (r, k), or their fields (f, r, p)."""
    # Nearly from rest: at rest itself a body that nothing holds has no answer.
    w = 2 * np.pi * np.linspace(1e-3 * band, band, 41)
    # One by one: all at once would be as large as the body's own factors.
    fields = (np.linalg.solve(_impedance(K, C, branches, at)[0], seeds) for at in w[:, None])
    return np.array([x if loads is None else loads.T @ x for x in fields])


def _change(before: Complex, now: Complex) -> float:
    """Largest relative change at any frequency."""
    change = now.copy()
    change[:, : before.shape[1]] -= before
    return float((np.linalg.norm(change, axis=(1, 2)) / np.linalg.norm(now, axis=(1, 2))).max())
