"""Reduced basis of each spectral line of a load, over a range of materials.

At one frequency the steady state of a body is on a smooth manifold, with as many dimensions as its
materials have free parameters. A few states span it to any accuracy: Galerkin's method in a basis
of these leaves some tens of equations a line, in place of the hundreds of a reduced-order model
that holds in a whole band.

States are chosen by a greedy search (Rozza, Huynh and Patera, Arch Comput Methods Eng 15:229
(2008)): the next is that of the material at which the last one changed the response most. There
the prediction is compared with the state before it is extended by it; the search ends when several
such comparisons in a row are within the tolerance.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from meshes.tetmesh import Floats

Complex = NDArray[np.complex128]

IN_A_ROW = 3  # predictions within the tolerance that end the search
MOST_STATES = 80  # of one line
EXPECTED = 25  # of one line: for the progress
SETTLED = 0.1  # of the tolerance: lines with less error take no further state
FAINT = 1e-2  # of the strongest line that moves: an error is relative to no less than this
DEPENDENT = 1e-10  # of a state: what is left of it outside a basis is round-off


@dataclass(frozen=True, kw_only=True, eq=False)
class LineBasis:
    """Galerkin equations of one line in m states, of g geometries: matrices `parts` (g q, m, m),
    `force` (g, m) and `outputs` (g, p, m); `states` (r, m) are orthonormal.
    """

    parts: Complex
    force: Complex
    outputs: Complex
    states: Complex


def steady_lines(bases: tuple[LineBasis, ...], weights: Complex, shares: Floats) -> Complex:
    """Steady state at the outputs of each line's basis.

    Parameters
    ----------
    bases : (f,) LineBasis
    weights : (f, q) complex, of the matrices of one geometry
    shares : (g,) float, of the geometries of the bases

    Returns
    -------
    (f, p) complex
    """
    both = _of_parts(weights[None], shares[None])[0]
    each = zip(bases, both, strict=True)
    return np.stack([_outputs(b, w[None], shares[None])[0] for b, w in each])


def line_bases(
    parts: Floats,
    forces: Complex,
    outputs: Floats,
    weights: Complex,
    shares: Floats,
    tolerance: float,
    progress: Callable[[float], None],
) -> tuple[tuple[LineBasis, ...], float]:
    """Bases of lines for every material that is like those of a training set.

    Parameters
    ----------
    parts : (g, q, r, r) float, matrices of a reduced-order model, of each geometry
    forces : (g, f, r) complex, of each line
    outputs : (g, p, r) float
    weights : (t, f, q) complex, of the parts for each material of the training set, at each line
    shares : (t, g) float, of the geometries for each of them
    tolerance : float, relative error of each line that is not faint
    progress : called with the fraction done

    Returns
    -------
    bases : (f,) LineBasis
    error : float, the largest of the last comparisons

    Raises
    ------
    ValueError
        If `MOST_STATES` are not enough.
    """
    (g, count, r), p = forces.shape, outputs.shape[1]
    parts, weights = parts.reshape(-1, r, r), _of_parts(weights, shares)
    empty = LineBasis(
        parts=np.zeros((len(parts), 0, 0), complex), force=np.zeros((g, 0), complex),
        outputs=np.zeros((g, p, 0), complex), states=np.zeros((r, 0), complex),
    )  # fmt: skip
    bases, errors = [empty] * count, []
    before = np.zeros((len(weights), count, p), complex)
    changes, left = np.zeros(len(weights)), np.ones(len(weights), bool)
    for _ in range(min(MOST_STATES, len(weights))):
        t = int(np.argmax(np.where(left, changes, -1)))
        left[t] = False
        driven = zip(weights[t], np.tensordot(shares[t], forces, 1), strict=True)
        states = np.stack([_solved(parts, w, f) for w, f in driven])
        found = states @ np.tensordot(shares[t], outputs, 1).T
        by_line = line_errors(before[t], found)
        errors.append(float(by_line.max()))
        if len(errors) > IN_A_ROW and max(errors[-IN_A_ROW:]) <= tolerance:
            return tuple(bases), max(errors[-IN_A_ROW:])
        progress(min(0.9, len(errors) / EXPECTED))
        for k in np.flatnonzero(by_line > SETTLED * tolerance):
            bases[k] = _extended(bases[k], states[k], parts, forces[:, k], outputs)
        now = np.stack([_outputs(b, weights[:, k], shares) for k, b in enumerate(bases)], axis=1)
        changes = np.array([line_errors(a, b).max() for a, b in zip(before, now, strict=True)])
        before = now
    raise ValueError(
        f"{len(errors)} materials of the ranges leave an error of {errors[-1]:.2g} in between, "
        f"above the tolerance {tolerance:g}; narrow the ranges, free fewer keys, or raise it"
    )


def line_errors(candidate: Complex, reference: Complex) -> Floats:
    """Relative errors (f,) of lines (f, p): norms over the outputs, over that of each line or of
    `FAINT` of the strongest, if this is more.
    """
    strength = np.linalg.norm(reference, axis=1)
    least = max(FAINT * strength.max(), np.finfo(np.float64).tiny)
    return np.asarray(np.linalg.norm(candidate - reference, axis=1) / np.maximum(strength, least))


def _solved(parts: Floats, weights: Complex, force: Complex) -> Complex:
    """State (r,) of one line."""
    A = np.tensordot(weights, parts, 1)
    return np.asarray(np.linalg.solve(A, force), np.complex128)


def _of_parts(weights: Complex, shares: Floats) -> Complex:
    """Weights (t, f, g q) of the matrices of all geometries."""
    both = shares[:, None, :, None] * weights[:, :, None, :]
    return both.reshape(*weights.shape[:2], -1)


def _outputs(basis: LineBasis, weights: Complex, shares: Floats) -> Complex:
    """Outputs (t, p) of one line with weights (t, g q) and shares (t, g) of the geometries."""
    m = basis.states.shape[1]
    A = (weights @ basis.parts.reshape(len(basis.parts), -1)).reshape(-1, m, m)
    states = np.linalg.solve(A, (shares @ basis.force)[..., None])[..., 0]
    each = np.einsum("gpm,tm->tgp", basis.outputs, states)
    return np.asarray(np.einsum("tg,tgp->tp", shares, each))


def _extended(
    basis: LineBasis, state: Complex, parts: Floats, force: Complex, outputs: Floats
) -> LineBasis:
    """The basis with one more state (r,), unless it is in it."""
    W, new = basis.states, state / np.linalg.norm(state)
    for _ in range(2):
        new = new - W @ (W.conj().T @ new)
    if (size := np.linalg.norm(new)) < DEPENDENT:
        return basis
    new = new / size
    W = np.column_stack([W, new])
    moved = parts @ np.stack([new.real, new.imag], axis=1)  # of real matrices
    column = W.conj().T @ (moved[..., 0] + 1j * moved[..., 1])[..., None]
    row = (new.conj() @ parts) @ W
    m = W.shape[1]
    grown = np.empty((len(parts), m, m), complex)
    grown[:, : m - 1, : m - 1] = basis.parts
    grown[:, :, -1:], grown[:, -1] = column, row
    return LineBasis(parts=grown, force=force @ W.conj(), outputs=outputs @ W, states=W)
