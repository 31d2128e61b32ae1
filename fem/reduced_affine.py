"""Reduced-order model of a body for every material and geometry of a range.

One basis of Krylov moments serves all materials if it holds those of the least loss, whose motion
has most detail. It begins with the reduced-order model of that material (`reduced`), and is
assessed over a training set: by how much its last quarter changes the response of each material and
line and, at the largest such changes, by solutions of the full body. Where one of these is off by
more than the tolerance, the moments of that material are added (weak greedy algorithm: Rozza, Huynh
and Patera, Arch Comput Methods Eng 15:229 (2008)).

The nodes of all geometries are those of one mesh, moved. The same basis serves them all; matrices,
forces and outputs are projected at some of them and interpolated. Variants between these are solved
on the full body each time.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, aslinearoperator

from fem.affine import (
    AffineOperators,
    Solids,
    fluid_of,
    in_vacuum,
    interpolated,
    operators_of,
    project,
    weights,
    with_parts,
)
from fem.affine_solution import line_solution
from fem.line_basis import FAINT, Complex, line_errors
from fem.reduced import reduce
from meshes.tetmesh import Floats

LOSS_AT = 2 * np.pi * 200.0  # rad/s, where losses are compared
NESTED = 3 / 4  # of the moments: a smaller basis, from which the change is taken
CHECKED = 2  # materials of which the full body is solved, one line each
MOST_BASES = 6
WATCHED = 16  # strongest lines, at which changes are looked at
BETWEEN = 1e-9  # of a share: less is round-off
DEPENDENT = 1e-10  # squared sine below which a direction counts as not new


@dataclass(frozen=True, kw_only=True, eq=False)
class Geometry:
    """Full body of one geometry: its `affine` operators, `probes` (p, 3 n) sparse, nodal `forces`
    (f, n_free) of lines in N, and `loads` as for `reduce`.
    """

    affine: AffineOperators
    probes: sparse.csr_array
    forces: Complex
    loads: Floats | None


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


@dataclass(frozen=True, kw_only=True, eq=False)
class AffineModel:
    """Reduced-order model of any variant: matrices `parts` (g, q, m, m) of each geometry, whose
    kinds are those of `affine`; the `basis` (n_free, m), `outputs` (g, p, m) and `forces` (g, f, m)
    of lines; the largest relative `error` found at a line of the full body, and the number of
    `factorisations` that it took.
    """

    affine: AffineOperators
    parts: Floats
    basis: Floats
    outputs: Floats
    forces: Complex
    error: float
    factorisations: int


def reduce_affine(
    geometries: Sequence[Callable[[], Geometry]],
    training: Sequence[Variant],
    frequencies: Floats,
    *,
    band: float,
    tolerance: float,
    solver: str,
    progress: Callable[[float], None],
) -> AffineModel:
    """Reduced-order model for all variants of a range.

    Parameters
    ----------
    geometries : (g,) between which others are interpolated
    training : variants without modulus laws of their own, over the range
    frequencies : (f,) float, Hz, of the lines that errors are assessed at
    band, solver : as for `reduce`
    tolerance : float, relative error of a line
    progress : called with the fraction done

    Returns
    -------
    AffineModel

    Raises
    ------
    ValueError
        If `MOST_BASES` variants are not enough, or as `reduce` does.
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
        model = reduce(
            operators_of(in_vacuum(full.affine), training[t].solids), full.probes, band,
            tolerance / 2, loads=full.loads, added=fluid_of(full.affine),
            solver=solver,
            progress=lambda x: progress((step + x) / (step + 2)),  # noqa: B023
        )  # fmt: skip
        smaller = basis.shape[1] or int(NESTED * len(model.K))
        basis = _joined(basis, model.basis[full.affine.free], M)
        found = _projected(geometries, basis, parts)
        parts = found.parts
        others = [t for t, each in enumerate(training) if t not in visited or each.is_between]
        errors = {}
        for t, k, near, least in _suspects(found, training, others, frequencies, smaller):
            exact = _outputs(found, training[t], frequencies, k, solver)
            errors[t] = _norm(near - exact) / max(_norm(exact), least)
        checked += len(errors)
        t = max(errors, key=lambda each: errors[each], default=t)
        done = replace(found, factorisations=step + 1 + checked)
        if not errors or errors[t] <= tolerance:
            return replace(done, error=errors.get(t, model.estimate))
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


def steady(
    model: AffineModel, variant: Variant, frequencies: Floats, chosen: Iterable[int], size: int = 0
) -> Complex:
    """Steady state (k, p) of the outputs at chosen lines (k,).

    Parameters
    ----------
    model : AffineModel
    variant : Variant
    frequencies : (f,) float, Hz, of all lines
    chosen : (k,) int, of these
    size : of its first vectors alone, all if 0

    Returns
    -------
    (k, p) complex, metre
    """
    states = _states(model, variant, frequencies, list(chosen), size or model.basis.shape[1])
    outputs = np.tensordot(variant.shares, model.outputs[..., : states.shape[1]], 1)
    return np.asarray(states @ outputs.T, np.complex128)


def _states(
    model: AffineModel, variant: Variant, frequencies: Floats, chosen: list[int], n: int
) -> Complex:
    """Steady state (k, n) at chosen lines (k,) in the first n vectors."""
    parts = np.tensordot(variant.shares, model.parts[..., :n, :n], 1)
    forces = np.tensordot(variant.shares, model.forces[:, chosen, :n], 1)
    each = weights(model.affine, variant.solids, frequencies[chosen])
    return np.stack([
        np.linalg.solve(np.tensordot(w, parts, 1), force)
        for w, force in zip(each, forces, strict=True)
    ])  # fmt: skip


def _projected(
    geometries: Sequence[Callable[[], Geometry]], basis: Floats, before: Floats
) -> AffineModel:
    """Model of a basis (n_free, m), with the matrices (g, q, k, k) of its first vectors."""
    parts, outputs, forces = [], [], []
    for each, known in zip(geometries, before, strict=True):
        full = each()
        parts.append(project(full.affine, basis, known))
        outputs.append(sparse.csr_array(full.probes[:, full.affine.free]) @ basis)
        forces.append(full.forces.real @ basis + 1j * (full.forces.imag @ basis))
    return AffineModel(
        affine=with_parts(full.affine, parts[-1]), parts=np.stack(parts), basis=basis,
        outputs=np.stack(outputs), forces=np.stack(forces), error=0.0, factorisations=0,
    )  # fmt: skip


def _suspects(
    model: AffineModel,
    training: Sequence[Variant],
    others: Sequence[int],
    frequencies: Floats,
    smaller: int,
) -> Iterator[tuple[int, int, Complex, float]]:
    """Variants that the last vectors changed most, all between the geometries, and of each other
    geometry one, each with the line where they changed it most, the response (p,) there, and what
    its error is relative to at least.
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
    full = variant.geometry()
    (of_line,) = weights(full.affine, variant.solids, frequencies[[line]])
    u = line_solution(
        full.affine, of_line, full.forces[line], solver=solver,
        fluid_share=_fluid_share(model, variant, frequencies, line) if full.affine.fluid else 0.0,
    )  # fmt: skip
    return np.asarray(sparse.csr_array(full.probes[:, full.affine.free]) @ u)


def _fluid_share(model: AffineModel, variant: Variant, frequencies: Floats, line: int) -> float:
    """Added mass of a fluid over the body's own, of the motion at one line by the model."""
    (x,) = _states(model, variant, frequencies, [line], model.basis.shape[1])
    small = interpolated(model.affine, model.parts, variant.shares)
    own = sum(m.density * A for m, A in zip(variant.solids.materials, small.mass, strict=True))
    (F,) = small.fluid
    return float(np.vdot(x, F @ x).real / np.vdot(x, own @ x).real)


def _mass(affine: AffineOperators, solids: Solids) -> LinearOperator:
    """Mass (n, n) of the full body, with that of a fluid."""
    own, fluid = operators_of(in_vacuum(affine), solids).M, fluid_of(affine)
    return aslinearoperator(own) + fluid.M if fluid else aslinearoperator(own)


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
