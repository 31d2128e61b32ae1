"""Weak greedy searches for the bases of an `AffineModel`.

Rozza, Huynh and Patera, Arch Comput Methods Eng 15:229 (2008).

`reduce_affine`: one basis of Krylov moments serves all materials and geometries if it includes the
moments of the material with the lowest loss, whose motion has the most detail. The search begins
with the reduced-order model of that material (`krylov`). Over a training set, the change of the
response by the last quarter of the basis selects materials and lines, which are solved on the full
body. If the error exceeds the tolerance, the moments of that material are added. Geometries share
one mesh, whose nodes move; variants between the geometries are solved on the full body each time.

`line_bases`: the states of such a model at one line form a smooth manifold, which a few states
span. The next state is that of the material whose response the last state changed most. The search
ends after several predictions in a row within the tolerance.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, aslinearoperator

from fem.affine import AffineOperators, Solids, line_solution, operators_of, project, weights
from fem.affine_model import (
    AffineModel,
    interpolate,
    least_scale,
    line_errors,
    steady_outputs,
    steady_states,
)
from fem.krylov import reduce
from simple_model.typing import Array, Complex, Floats, Ints


@dataclass(frozen=True, kw_only=True, eq=False)
class Geometry:
    """Full body of one geometry: `affine` operators, `probes` (p, 3 n) sparse, nodal `forces`
    (f, n_free) of lines in N, and the `loads` of `reduce`.
    """

    affine: AffineOperators
    probes: sparse.csr_array
    forces: Complex
    loads: Floats | None

    @property
    def outputs(self) -> sparse.csr_array:
        """Probes (p, n_free) on the free degrees of freedom."""
        return sparse.csr_array(self.probes[:, self.affine.free])


@dataclass(frozen=True, kw_only=True, eq=False)
class Variant:
    """One body of a range: `solids`, `geometry`, and the `shares` (g,) of the geometries."""

    solids: Solids
    geometry: Callable[[], Geometry]
    shares: Floats

    @property
    def is_between(self) -> bool:
        """Whether its geometry is interpolated, not one of the g geometries."""
        share_tolerance = 1e-9  # of a share of a geometry
        return float(self.shares.max()) < 1 - share_tolerance


def reduce_affine(
    geometries: Sequence[Callable[[], Geometry]],
    training: Sequence[Variant],
    frequencies: Floats,
    *,
    band: float,
    tolerance: float,
    solver: str,
    progress: Callable[[float], None],
    most_bases: int = 6,
    nested: float = 3 / 4,
) -> tuple[AffineModel, float, int]:
    """Return a model for all variants of a range, the largest relative error at a line of the full
    body, and the number of factorisations.

    Other variants are interpolated between the geometries (g,). Materials of the training set have
    no modulus laws. Errors are checked at lines with frequencies (f,) in Hz. `band` and `solver`
    are those of `reduce`; `nested` is the share of vectors in the smaller basis, from which the
    change is computed. Raises a ValueError if `most_bases` variants are not enough.
    """
    t = min(range(len(training)), key=lambda each: _loss(training[each].solids))
    first = training[t].geometry()
    M, air = operators_of(first.affine.in_vacuum(), training[t].solids).M, first.affine.air
    M = aslinearoperator(M) + air.mass if air else M
    basis, visited, checked = np.zeros((len(first.affine.free), 0)), set[int](), 0
    parts = np.zeros((len(geometries), len(first.affine.parts), 0, 0))
    errors: dict[int, float] = {}
    for step in range(min(most_bases, len(training))):
        visited.add(t)
        full = training[t].geometry()
        reduced = reduce(
            operators_of(full.affine.in_vacuum(), training[t].solids), full.probes, band,
            tolerance / 2, loads=full.loads, air=full.affine.air, solver=solver,
            progress=lambda x: progress((step + x) / (step + 2)),  # noqa: B023
        )  # fmt: skip
        smaller = basis.shape[1] or int(nested * reduced.basis.shape[1])
        basis = _join(basis, reduced.basis[full.affine.free], M)
        model = _project(geometries, basis, parts)
        parts = model.parts
        others = [t for t, each in enumerate(training) if t not in visited or each.is_between]
        errors = {}
        for t, k, near, least in _suspects(model, training, others, frequencies, smaller):
            exact = _outputs(model, training[t], frequencies, k, solver)
            error, size = (float(np.linalg.norm(x)) for x in (near - exact, exact))
            errors[t] = error / max(size, least)
        checked += len(errors)
        t = max(errors, key=lambda each: errors[each], default=t)
        if not errors or errors[t] <= tolerance:
            return model, errors.get(t, reduced.estimate), step + 1 + checked
        if t in visited:
            raise ValueError(
                f"interpolation between thicknesses has a relative error of {errors[t]:.2g}, above "
                f"the limit {tolerance:.2g}; narrow the range of the thickness or raise the "
                "tolerance"
            )
    raise ValueError(
        f"reduced bases of {step + 1} variants have a relative error of {errors[t]:.2g} at another "
        f"variant, above the limit {tolerance:.2g}; narrow the ranges or raise the tolerance"
    )


def _project(
    geometries: Sequence[Callable[[], Geometry]], basis: Floats, before: Floats
) -> AffineModel:
    """Return the model of a basis (n_free, m), given the matrices of its first vectors."""
    parts, outputs, forces = [], [], []
    for geometry, projected in zip(geometries, before, strict=True):
        full = geometry()
        parts.append(project(full.affine, basis, projected))
        outputs.append(full.outputs @ basis)
        forces.append(full.forces.real @ basis + 1j * (full.forces.imag @ basis))
    return AffineModel(
        terms=full.affine.terms, parts=np.stack(parts), basis=basis,
        outputs=np.stack(outputs), forces=np.stack(forces),
    )  # fmt: skip


def _suspects(
    model: AffineModel,
    training: Sequence[Variant],
    others: Sequence[int],
    frequencies: Floats,
    smaller: int,
) -> Iterator[tuple[int, int, Complex, float]]:
    """Yield variants to check: those that the last vectors changed most, all between the
    geometries, and one of each geometry. Each comes with the line that changed most, the response
    (p,) there, and the smallest scale of its error.
    """
    if not others:
        return

    def lines(t: int, chosen: Ints, size: int = 0) -> Complex:
        at = weights(model.terms, training[t].solids, frequencies[chosen])
        return steady_outputs(model, at, training[t].shares, chosen.tolist(), size)

    everywhere = np.flatnonzero(frequencies > 0)
    strength = np.linalg.norm(lines(others[0], everywhere), axis=1)
    watched_lines = 16  # strongest lines, whose changes are compared
    watched = everywhere[np.argsort(-strength)[:watched_lines]]
    changes = []
    for t in others:
        now = lines(t, watched)
        change = line_errors(lines(t, watched, smaller), now)
        k = int(np.argmax(change))
        least = least_scale(np.linalg.norm(now, axis=1))
        changes.append((float(change[k]), (t, int(watched[k]), now[k], least)))
    changes.sort(key=lambda each: -each[0])
    visited = set[tuple[float, ...]]()
    checked = 2  # materials solved on the full body, at one line each
    for rank, (_, suspect) in enumerate(changes):
        variant = training[suspect[0]]
        geometry = tuple(variant.shares.round(6).tolist())
        if rank < checked or variant.is_between or geometry not in visited:
            yield suspect
        visited.add(geometry)


def _outputs(
    model: AffineModel, variant: Variant, frequencies: Floats, line: int, solver: str
) -> Complex:
    """Return the steady outputs (p,) of the full body at one line."""
    full, small, share = variant.geometry(), interpolate(model, variant.shares), 0.0
    at = weights(model.terms, variant.solids, frequencies[[line]])
    if small.air is not None:
        x = steady_states(model, at, variant.shares, [line])[0]
        own = operators_of(small.in_vacuum(), variant.solids).M
        share = float(np.vdot(x, small.air.mass @ x).real / np.vdot(x, own @ x).real)
    u = line_solution(full.affine, at[0], full.forces[line], solver=solver, fluid_share=share)
    return np.asarray(full.outputs @ u)


def _join(basis: Floats, more: Floats, M: LinearOperator) -> Floats:
    """Extend a mass-orthonormal basis (n, m) by the new directions of vectors (n, k)."""
    if not basis.shape[1]:
        return more
    new = more
    for _ in range(2):
        new = new - basis @ (basis.T @ (M @ new))
        squares, directions = np.linalg.eigh(new.T @ (M @ new))
        is_new = squares > 1e-10 * squares.max(initial=0.0)  # the others are round-off
        new = new @ (directions[:, is_new] / np.sqrt(squares[is_new]))
    return np.hstack([basis, new])


def _loss(solids: Solids) -> float:
    """Return the sum of the loss tangents of all materials."""
    loss_frequency = 2 * np.pi * 200.0  # rad/s, where losses are compared
    moduli = np.array([m.complex_modulus(loss_frequency) for m in solids.materials])
    return float((moduli.imag / moduli.real).sum())


def line_bases(
    model: AffineModel,
    weights: Complex,
    shares: Floats,
    tolerance: float,
    progress: Callable[[float], None],
    *,
    most_states: int = 80,
    in_a_row: int = 3,
    settled: float = 0.1,
) -> tuple[tuple[AffineModel, ...], float]:
    """Return a model of each line (f,), in the coordinates of the given model, for materials like
    those of a training set, and the largest error of the last comparisons.

    `weights` (t, f, q) are those of the terms for each material and line, `shares` (t, g) those of
    its geometries. The search ends after `in_a_row` predictions within the tolerance. Lines with
    less than the share `settled` of it need no further state. Raises a ValueError if `most_states`
    of a line are not enough.
    """
    lines = range(model.forces.shape[1])
    nothing = np.zeros((model.parts.shape[-1], 0))
    bases, errors = [_of_line(model, k, nothing) for k in lines], []
    before = np.zeros((len(weights), len(bases), model.outputs.shape[1]), complex)
    changes, left = np.zeros(len(weights)), np.ones(len(weights), bool)
    expected_states = 25  # of one line, for the progress
    for _ in range(min(most_states, len(weights))):
        t = int(np.argmax(np.where(left, changes, -1)))
        left[t] = False
        exact = steady_states(model, weights[t], shares[t], lines)
        by_line = line_errors(before[t], exact @ np.tensordot(shares[t], model.outputs, 1).T)
        errors.append(float(by_line.max()))
        if len(errors) > in_a_row and max(errors[-in_a_row:]) <= tolerance:
            return tuple(bases), max(errors[-in_a_row:])
        progress(min(0.9, len(errors) / expected_states))
        for k in np.flatnonzero(by_line > settled * tolerance).tolist():
            bases[k] = _extend(bases[k], exact[k], model, k)
        now = np.stack(
            [_outputs_of_all(b, weights[:, k], shares) for k, b in enumerate(bases)], axis=1
        )
        changes = np.array([line_errors(a, b).max() for a, b in zip(before, now, strict=True)])
        before = now
    raise ValueError(
        f"bases of {len(errors)} materials have a relative error of {errors[-1]:.2g} at another "
        f"material, above the tolerance {tolerance:g}; narrow the ranges, free fewer keys, or "
        "raise the tolerance"
    )


def _outputs_of_all(line: AffineModel, weights: Complex, shares: Floats) -> Complex:
    """Return the outputs (t, p) of one line for weights (t, q) and shares (t, g)."""
    m = line.basis.shape[1]
    both = (shares[:, :, None] * weights[:, None]).reshape(len(weights), -1)  # (t, g q)
    A = (both @ line.parts.reshape(both.shape[1], -1)).reshape(-1, m, m)
    states = np.linalg.solve(A, (shares @ line.forces[:, 0])[..., None])[..., 0]
    each = np.einsum("gpm,tm->tgp", line.outputs, states)
    return np.asarray(np.einsum("tg,tgp->tp", shares, each))


def _extend(basis: AffineModel, state: Complex, model: AffineModel, line: int) -> AffineModel:
    """Return the basis of a line with a further state (r,) of the model, if it is independent."""
    W, new = basis.basis, state / np.linalg.norm(state)
    for _ in range(2):
        new = new - W @ (W.conj().T @ new)
    if (size := np.linalg.norm(new)) < 1e-10:  # round-off
        return basis
    new = new / size
    W = np.column_stack([W, new])
    product = model.parts @ np.stack([new.real, new.imag], axis=1)  # the matrices are real
    column = W.conj().T @ (product[..., 0] + 1j * product[..., 1])[..., None]
    row = (new.conj() @ model.parts) @ W
    m = W.shape[1]
    grown = np.empty((*model.parts.shape[:2], m, m), complex)
    grown[..., : m - 1, : m - 1] = basis.parts
    grown[..., -1:], grown[..., -1, :] = column, row
    return replace(_of_line(model, line, W), parts=grown)


def _of_line(model: AffineModel, line: int, W: Array) -> AffineModel:
    """Return the model of one line in states W (r, m), without matrices."""
    return AffineModel(
        terms=model.terms, parts=np.zeros((*model.parts.shape[:2], 0, 0)),
        forces=model.forces[:, [line]] @ W.conj(), outputs=model.outputs @ W, basis=W,
    )  # fmt: skip
