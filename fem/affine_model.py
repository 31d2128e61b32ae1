"""Reduced-order model for every material and geometry of a range: its equations and solution.

    sum_g share_g sum_q w_q A_gq c = sum_g share_g f_g,   outputs = sum_g share_g S_g c

Matrices, forces and outputs are projected onto one basis at a few geometries g, and interpolated
between them. `greedy` finds the basis: of a whole band, or of each line in such a model.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from fem.affine import AffineOperators, Solids, Terms, operators_of
from fem.assembly import Operators
from fem.typing import Array, Complex, Floats

FAINT = 1e-2  # of the strongest line that moves: an error is relative to no less than this


@dataclass(frozen=True, kw_only=True, eq=False)
class AffineModel:
    """Equations in m basis vectors: matrices `parts` (g, q, m, m) of the `terms` (q,) of affine
    operators at each geometry, `forces` (g, f, m) of lines, `outputs` (g, p, m), and the `basis`
    (n, m), of the free dofs of a body or of the coordinates of another model.
    """

    terms: Terms
    parts: Array
    forces: Complex
    outputs: Array
    basis: Array


def states(
    model: AffineModel, weights: Complex, shares: Floats, lines: Iterable[int], size: int = 0
) -> Complex:
    """Steady state (k, m) in the basis, or in its first vectors, `size`: by the weights (k, q) of
    the terms at each of the `lines` (k,) that the model has forces of, and the shares (g,) of the
    geometries, with sum 1.
    """
    n = size or model.basis.shape[1]
    parts = np.tensordot(shares, model.parts[..., :n, :n], 1)
    forces = np.tensordot(shares, model.forces[:, list(lines), :n], 1)
    return np.stack([
        np.linalg.solve(np.tensordot(w, parts, 1), force)
        for w, force in zip(weights, forces, strict=True)
    ])  # fmt: skip


def steady(
    model: AffineModel, weights: Complex, shares: Floats, lines: Iterable[int], size: int = 0
) -> Complex:
    """Steady state (k, p) of the outputs in metre; parameters as of `states`."""
    found = states(model, weights, shares, lines, size)
    outputs = np.tensordot(shares, model.outputs[..., : found.shape[1]], 1)
    return np.asarray(found @ outputs.T, np.complex128)


def steady_lines(bases: Sequence[AffineModel], weights: Complex, shares: Floats) -> Complex:
    """Steady state (f, p) of the outputs, by a model of one line for each of the weights (f, q)."""
    each = zip(bases, weights, strict=True)
    return np.concatenate([steady(model, w[None], shares, [0]) for model, w in each])


def operators_at(model: AffineModel, solids: Solids, shares: Floats) -> Operators:
    """Operators in the coordinates of a model, of materials without modulus laws of their own."""
    return operators_of(interpolated(model, shares), solids)


def interpolated(model: AffineModel, shares: Floats) -> AffineOperators:
    """Affine operators in the coordinates of a model, of a geometry by its shares (g,)."""
    r = model.parts.shape[-1]
    parts = np.tensordot(shares, model.parts, 1)
    return AffineOperators(terms=model.terms, parts=parts, free=np.arange(r), n_dofs=r)


def line_errors(candidate: Complex, reference: Complex) -> Floats:
    """Relative errors (f,) of lines (f, p): norms over the outputs, over that of each line or of
    `FAINT` of the strongest, if this is more.
    """
    strength = np.linalg.norm(reference, axis=1)
    least = max(FAINT * strength.max(), np.finfo(np.float64).tiny)
    return np.asarray(np.linalg.norm(candidate - reference, axis=1) / np.maximum(strength, least))
