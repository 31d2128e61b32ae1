"""Weak greedy searches for the bases of an `AffineModel`.

Rozza, Huynh and Patera, Arch Comput Methods Eng 15:229 (2008).

`reduce_affine`: one basis of Krylov moments serves all materials and geometries if it holds those
of the least loss, whose motion has most detail. It begins with the reduced-order model of that
material (`krylov`). Over a training set it is assessed by how much its last quarter changes the
response of each material and line and, at the largest such changes, by solutions of the full body.
Where one of these is off by more than the tolerance, the moments of that material are added.
Geometries are those of one mesh whose nodes are moved; variants between them are solved on the
full body each time.

`line_bases`: at one line the states of such a model are on a smooth manifold, which a few of them
span. The next state is that of the material at which the last one changed the response most. The
search ends when several predictions of it in a row are within the tolerance.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, aslinearoperator

from fem.affine import AffineOperators, Solids, line_solution, operators_of, project, weights
from fem.affine_model import FAINT, AffineModel, interpolated, line_errors, states, steady
from fem.krylov import reduce
from fem.typing import Array, Complex, Floats, Ints

LOSS_AT = 2 * np.pi * 200.0  # rad/s, where losses are compared
NESTED = 3 / 4  # of the moments: a smaller basis, from which the change is taken
CHECKED = 2  # materials of which the full body is solved, one line each
MOST_BASES = 6
WATCHED = 16  # strongest lines, at which changes are looked at
BETWEEN = 1e-9  # of a share: less is round-off
DEPENDENT = 1e-10  # of a direction: what is left of it, or its square, outside a basis is round-off
IN_A_ROW = 3  # predictions within the tolerance that end the search
MOST_STATES = 80  # of one line
EXPECTED = 25  # of one line: for the progress
SETTLED = 0.1  # of the tolerance: lines with less error take no further state


@dataclass(frozen=True, kw_only=True, eq=False)
class Geometry:
    """Full body of one geometry: its `affine` operators, `probes` (p, 3 n) sparse, nodal `forces`
    (f, n_free) of lines in N, and `loads` as for `reduce`.
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
    """A body of a range: its `solids`, the full body of its `geometry`, and the `shares` (g,) of
    the geometries that it is interpolated between, of which it may be one.
    """

    solids: Solids
    geometry: Callable[[], Geometry]
    shares: Floats

    @property
    def is_between(self) -> bool:
        """Whether its geometry is none of those that others are interpolated between."""
        return float(self.shares.max()) < 1 - BETWEEN


def reduce_affine(
    geometries: Sequence[Callable[[], Geometry]],
    training: Sequence[Variant],
    frequencies: Floats,
    *,
    band: float,
    tolerance: float,
    solver: str,
    progress: Callable[[float], None],
) -> tuple[AffineModel, float, int]:
    """Model for all variants of a range, the largest relative error found at a line of the full
    body, and the number of factorisations: of geometries (g,) between which others are
    interpolated, and a training set without modulus laws of its own; by errors at lines of
    frequencies (f,) in Hz. `band` and `solver` are as for `reduce`. If `MOST_BASES` variants are
    not enough it raises a ValueError.
    """
    t = min(range(len(training)), key=lambda each: _loss(training[each].solids))
    first = training[t].geometry()
    M = _mass(first.affine, training[t].solids)
    basis, visited, checked = np.zeros((len(first.affine.free), 0)), set[int](), 0
    parts = np.zeros((len(geometries), len(first.affine.parts), 0, 0))
    errors: dict[int, float] = {}
    for step in range(min(MOST_BASES, len(training))):
        visited.add(t)
        full = training[t].geometry()
        reduced = reduce(
            operators_of(full.affine.in_vacuum(), training[t].solids), full.probes, band,
            tolerance / 2, loads=full.loads, added=full.affine.fluid, solver=solver,
            progress=lambda x: progress((step + x) / (step + 2)),  # noqa: B023
        )  # fmt: skip
        smaller = basis.shape[1] or int(NESTED * reduced.basis.shape[1])
        basis = _joined(basis, reduced.basis[full.affine.free], M)
        model = _projected(geometries, basis, parts)
        parts = model.parts
        others = [t for t, each in enumerate(training) if t not in visited or each.is_between]
        errors = {}
        for t, k, near, least in _suspects(model, training, others, frequencies, smaller):
            exact = _outputs(model, training[t], frequencies, k, solver)
            errors[t] = _norm(near - exact) / max(_norm(exact), least)
        checked += len(errors)
        t = max(errors, key=lambda each: errors[each], default=t)
        if not errors or errors[t] <= tolerance:
            return model, errors.get(t, reduced.estimate), step + 1 + checked
        if t in visited:
            raise ValueError(
                f"matrices interpolated between thicknesses leave an error of {errors[t]:.2g}, "
                f"the limit is {tolerance:.2g}; narrow the range of the thickness, or raise the "
                "tolerance"
            )
    raise ValueError(
        f"reduced bases of {step + 1} variants leave an error of {errors[t]:.2g} at another, "
        f"the limit is {tolerance:.2g}; narrow the ranges, or raise the tolerance"
    )


def _projected(
    geometries: Sequence[Callable[[], Geometry]], basis: Floats, before: Floats
) -> AffineModel:
    """Model of a basis (n_free, m), with the matrices (g, q, k, k) of its first vectors."""
    parts, outputs, forces = [], [], []
    for each, known in zip(geometries, before, strict=True):
        full = each()
        parts.append(project(full.affine, basis, known))
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
    """Variants that the last vectors changed most, all between the geometries, and one of each
    other geometry, each with the line where they changed it most, the response (p,) there, and what
    its error is relative to at least.
    """
    if not others:
        return

    def lines(t: int, chosen: Ints, size: int = 0) -> Complex:
        at = weights(model.terms, training[t].solids, frequencies[chosen])
        return steady(model, at, training[t].shares, chosen.tolist(), size)

    everywhere = np.flatnonzero(frequencies > 0)
    strength = np.linalg.norm(lines(others[0], everywhere), axis=1)
    watched = everywhere[np.argsort(-strength)[:WATCHED]]
    found = []
    for t in others:
        now = lines(t, watched)
        change = line_errors(lines(t, watched, smaller), now)
        k = int(np.argmax(change))
        least = FAINT * float(np.linalg.norm(now, axis=1).max())
        found.append((float(change[k]), (t, int(watched[k]), now[k], least)))
    found.sort(key=lambda each: -each[0])
    seen = set[tuple[float, ...]]()
    for rank, (_, suspect) in enumerate(found):
        at = training[suspect[0]]
        geometry = tuple(at.shares.round(6).tolist())
        if rank < CHECKED or at.is_between or geometry not in seen:
            yield suspect
        seen.add(geometry)


def _outputs(
    model: AffineModel, variant: Variant, frequencies: Floats, line: int, solver: str
) -> Complex:
    """Steady state (p,) of the full body's outputs at one line."""
    full, share = variant.geometry(), 0.0
    at = weights(model.terms, variant.solids, frequencies[[line]])
    if full.affine.fluid is not None:
        share = _fluid_share(model, variant, states(model, at, variant.shares, [line])[0])
    u = line_solution(full.affine, at[0], full.forces[line], solver=solver, fluid_share=share)
    return np.asarray(full.outputs @ u)


def _fluid_share(model: AffineModel, variant: Variant, x: Complex) -> float:
    """Added mass of a fluid over the body's own, of a state (m,) of the model."""
    small = interpolated(model, variant.shares)
    own = operators_of(small.in_vacuum(), variant.solids).M
    return float(np.vdot(x, small.fluid @ x).real / np.vdot(x, own @ x).real)


def _mass(affine: AffineOperators, solids: Solids) -> LinearOperator:
    """Mass (n, n) of the full body, with that of a fluid."""
    own = aslinearoperator(operators_of(affine.in_vacuum(), solids).M)
    return own if affine.fluid is None else own + affine.fluid


def _joined(basis: Floats, more: Floats, M: LinearOperator) -> Floats:
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
    moduli = np.array([m.complex_modulus(LOSS_AT) for m in solids.materials])
    return float((moduli.imag / moduli.real).sum())


def _norm(vector: Complex) -> float:
    return float(np.linalg.norm(vector))


def line_bases(
    model: AffineModel,
    weights: Complex,
    shares: Floats,
    tolerance: float,
    progress: Callable[[float], None],
) -> tuple[tuple[AffineModel, ...], float]:
    """Bases (f,) of the lines of a model for every material like those of a training set, each a
    model of one line in coordinates of the given one, and the largest error of the last
    comparisons. `weights` (t, f, q) are of the terms for each material at each line, `shares` (t,
    g) of its geometries. If `MOST_STATES` are not enough it raises a ValueError.
    """
    lines = range(model.forces.shape[1])
    nothing = np.zeros((model.parts.shape[-1], 0))
    bases, errors = [_of_line(model, k, nothing) for k in lines], []
    before = np.zeros((len(weights), len(bases), model.outputs.shape[1]), complex)
    changes, left = np.zeros(len(weights)), np.ones(len(weights), bool)
    for _ in range(min(MOST_STATES, len(weights))):
        t = int(np.argmax(np.where(left, changes, -1)))
        left[t] = False
        exact = states(model, weights[t], shares[t], lines)
        by_line = line_errors(before[t], exact @ np.tensordot(shares[t], model.outputs, 1).T)
        errors.append(float(by_line.max()))
        if len(errors) > IN_A_ROW and max(errors[-IN_A_ROW:]) <= tolerance:
            return tuple(bases), max(errors[-IN_A_ROW:])
        progress(min(0.9, len(errors) / EXPECTED))
        for k in np.flatnonzero(by_line > SETTLED * tolerance).tolist():
            bases[k] = _extended(bases[k], exact[k], model, k)
        now = np.stack([_of_all(b, weights[:, k], shares) for k, b in enumerate(bases)], axis=1)
        changes = np.array([line_errors(a, b).max() for a, b in zip(before, now, strict=True)])
        before = now
    raise ValueError(
        f"{len(errors)} materials of the ranges leave an error of {errors[-1]:.2g} in between, "
        f"above the tolerance {tolerance:g}; narrow the ranges, free fewer keys, or raise it"
    )


def _of_all(line: AffineModel, weights: Complex, shares: Floats) -> Complex:
    """Outputs (t, p) of one line for all weights (t, q) and shares (t, g) at once."""
    m = line.basis.shape[1]
    both = (shares[:, :, None] * weights[:, None]).reshape(len(weights), -1)  # (t, g q)
    A = (both @ line.parts.reshape(both.shape[1], -1)).reshape(-1, m, m)
    found = np.linalg.solve(A, (shares @ line.forces[:, 0])[..., None])[..., 0]
    each = np.einsum("gpm,tm->tgp", line.outputs, found)
    return np.asarray(np.einsum("tg,tgp->tp", shares, each))


def _extended(basis: AffineModel, state: Complex, model: AffineModel, line: int) -> AffineModel:
    """The basis of a line with one more state (r,) of the model, unless it is in it."""
    W, new = basis.basis, state / np.linalg.norm(state)
    for _ in range(2):
        new = new - W @ (W.conj().T @ new)
    if (size := np.linalg.norm(new)) < DEPENDENT:
        return basis
    new = new / size
    W = np.column_stack([W, new])
    moved = model.parts @ np.stack([new.real, new.imag], axis=1)  # of real matrices
    column = W.conj().T @ (moved[..., 0] + 1j * moved[..., 1])[..., None]
    row = (new.conj() @ model.parts) @ W
    m = W.shape[1]
    grown = np.empty((*model.parts.shape[:2], m, m), complex)
    grown[..., : m - 1, : m - 1] = basis.parts
    grown[..., -1:], grown[..., -1, :] = column, row
    return replace(_of_line(model, line, W), parts=grown)


def _of_line(model: AffineModel, line: int, W: Array) -> AffineModel:
    """Model of one line in states W (r, m), without its matrices."""
    return AffineModel(
        terms=model.terms, parts=np.zeros((*model.parts.shape[:2], 0, 0)),
        forces=model.forces[:, [line]] @ W.conj(), outputs=model.outputs @ W, basis=W,
    )  # fmt: skip
