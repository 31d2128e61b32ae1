"""Reduced-order model of a body for every material of a range.

One basis of Krylov moments serves all materials if it holds those of the least loss, whose motion
has most detail. It begins with the reduced-order model of that material (`reduced`), and is
assessed over a training set: by how much its last quarter changes the response of each material and
line and, at the largest such changes, by solutions of the full body. Where one of these is off by
more than the tolerance, the moments of that material are added (weak greedy algorithm: Rozza, Huynh
and Patera, Arch Comput Methods Eng 15:229 (2008)).
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from fem.affine import AffineOperators, Solids, modulus, operators_of, project, weights
from fem.line_basis import FAINT, Complex, line_errors
from fem.linear_solver import available, factorise
from fem.reduced import reduce
from meshes.tetmesh import Floats

LOSS_AT = 2j * np.pi * 200.0  # rad/s, where losses are compared
NESTED = 3 / 4  # of the moments: a smaller basis, from which the change is taken
CHECKED = 2  # materials of which the full body is solved, one line each
MOST_BASES = 6
WATCHED = 16  # strongest lines, at which changes are looked at
DEPENDENT = 1e-10  # squared sine below which a direction counts as not new


@dataclass(frozen=True, kw_only=True, eq=False)
class AffineModel:
    """Reduced-order model of any material: projected matrices, the `basis` (n_free, m), `outputs`
    (p, m) and `forces` (f, m) of lines; the largest relative `error` found at a line of the full
    body, and the number of `factorisations` that it took.
    """

    affine: AffineOperators
    basis: Floats
    outputs: Floats
    forces: Complex
    error: float
    factorisations: int


def reduce_affine(
    affine: AffineOperators,
    training: Sequence[Solids],
    probes: sparse.csr_array,
    lines: tuple[Floats, Complex],
    *,
    band: float,
    tolerance: float,
    loads: Floats,
    solver: str,
    progress: Callable[[float], None],
) -> AffineModel:
    """Reduced-order model for all materials of a range.

    Parameters
    ----------
    affine : AffineOperators, of the full body
    training : materials without modulus laws of their own, over the range
    probes : (p, 3 n) sparse
    lines : frequencies (f,) in Hz and nodal forces (f, n_free) in N that errors are assessed at
    band, loads, solver : as for `reduce`
    tolerance : float, relative error of a line
    progress : called with the fraction done

    Returns
    -------
    AffineModel

    Raises
    ------
    ValueError
        If `MOST_BASES` materials are not enough, or as `reduce` does.
    """
    frequencies, nodal = lines
    read = sparse.csr_array(probes[:, affine.free])
    t = min(range(len(training)), key=lambda each: _loss(training[each]))
    M = operators_of(affine, training[t]).M
    basis, visited, checked = np.zeros((len(affine.free), 0)), set[int](), 0
    for step in range(min(MOST_BASES, len(training))):
        visited.add(t)
        model = reduce(
            operators_of(affine, training[t]), probes, band, tolerance / 2, loads=loads,
            solver=solver, progress=lambda x: progress((step + x) / (step + 2)),  # noqa: B023
        )  # fmt: skip
        smaller = basis.shape[1] or int(NESTED * len(model.K))
        basis = _joined(basis, model.basis[affine.free], M)
        found = AffineModel(
            affine=project(affine, basis), basis=basis, outputs=read @ basis,
            forces=nodal @ basis, error=0.0, factorisations=step + 1 + checked,
        )  # fmt: skip
        others = [each for each in range(len(training)) if each not in visited]
        errors = {}
        for t, k, near, least in _suspects(found, training, others, frequencies, smaller):
            of_line = weights(affine, training[t], frequencies[[k]])[0]
            exact = read @ _solution(affine, of_line, nodal[k], solver)
            errors[t] = _norm(near - exact) / max(_norm(exact), least)
        checked += len(errors)
        t = max(errors, key=lambda each: errors[each], default=t)
        if not errors or errors[t] <= tolerance:
            return replace(
                found, error=errors.get(t, model.estimate), factorisations=step + 1 + checked
            )
    raise ValueError(
        f"reduced bases of {step + 1} materials leave an error of {errors[t]:.2g} at another, "
        f"above the tolerance {tolerance:g}; narrow the ranges or raise it"
    )


def steady(
    model: AffineModel, solids: Solids, frequencies: Floats, chosen: Iterable[int], size: int = 0
) -> Complex:
    """Steady state (k, p) of the outputs at chosen lines (k,).

    Parameters
    ----------
    model : AffineModel
    solids : Solids
    frequencies : (f,) float, Hz, of all lines
    chosen : (k,) int, of these
    size : of its first vectors alone, all if 0

    Returns
    -------
    (k, p) complex, metre
    """
    n = size or model.basis.shape[1]
    parts = np.stack(model.affine.parts)[:, :n, :n]
    chosen = list(chosen)
    each = weights(model.affine, solids, frequencies[chosen])
    states = [
        np.linalg.solve(np.tensordot(w, parts, 1), model.forces[k, :n])
        for w, k in zip(each, chosen, strict=True)
    ]
    return np.asarray(np.stack(states) @ model.outputs[:, :n].T, np.complex128)


def _suspects(
    model: AffineModel,
    training: Sequence[Solids],
    others: Sequence[int],
    frequencies: Floats,
    smaller: int,
) -> Iterator[tuple[int, int, Complex, float]]:
    """Materials that the last vectors changed most, each with the line where they did, the response
    (p,) there, and what its error is relative to at least.
    """
    if not others:
        return
    everywhere = np.flatnonzero(frequencies > 0)
    strength = np.linalg.norm(steady(model, training[others[0]], frequencies, everywhere), axis=1)
    watched = everywhere[np.argsort(-strength)[:WATCHED]]
    found = []
    for t in others:
        now = steady(model, training[t], frequencies, watched)
        before = steady(model, training[t], frequencies, watched, smaller)
        change = line_errors(before, now)
        k = int(np.argmax(change))
        least = FAINT * float(np.linalg.norm(now, axis=1).max())
        found.append((float(change[k]), (t, int(watched[k]), now[k], least)))
    found.sort(key=lambda each: -each[0])
    for _, suspect in found[:CHECKED]:
        yield suspect


def _solution(affine: AffineOperators, of_line: Complex, force: Complex, solver: str) -> Complex:
    """Displacement (n_free,) of the full body at one line."""
    A = sum(w * part for w, part in zip(of_line, affine.parts, strict=True))
    backend = solver if solver in available(complex_valued=True) else "auto"
    return factorise(sparse.csr_array(A), backend=backend).solve(force.astype(np.complex128))


def _joined(basis: Floats, more: Floats, M: sparse.csr_array) -> Floats:
    """Mass-orthonormal basis (n, m) with the directions of more vectors (n, k) that are new; the
    first are orthonormal as they come.
    """
    if not basis.shape[1]:
        return more
    new = more
    for _ in range(2):
        new = new - basis @ (basis.T @ (M @ new))
        squares, directions = np.linalg.eigh(new.T @ (M @ new))
        kept = squares > DEPENDENT * squares.max(initial=0.0)
        new = new @ (directions[:, kept] / np.sqrt(squares[kept]))
    return np.hstack([basis, new])


def _loss(solids: Solids) -> float:
    """Sum of the loss tangents of all materials."""
    moduli = np.array([modulus(m, np.array(LOSS_AT)) for m in solids.materials])
    return float((moduli.imag / moduli.real).sum())


def _norm(vector: Complex) -> float:
    return float(np.linalg.norm(vector))
