"""Reduced-order model for all materials and geometries of a range.

    sum_g share_g sum_q w_q A_gq c = sum_g share_g f_g,   outputs = sum_g share_g S_g c

Matrices, forces and outputs are projected onto one basis at a few geometries g and interpolated
between them. `greedy` computes the basis, for a whole band or for each line.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from fem.affine import AffineOperators, Solids, Terms, operators_of
from fem.assembly import Operators
from simple_model.typing import Array, Complex, Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class AffineModel:
    """Equations in m basis vectors at each geometry g: matrices `parts` (g, q, m, m) of the `terms`
    (q,), `forces` (g, f, m) of lines, and `outputs` (g, p, m). The `basis` (n, m) is on the free
    dofs of a body or in the coordinates of another model.
    """

    terms: Terms
    parts: Array
    forces: Complex
    outputs: Array
    basis: Array


def steady_states(
    model: AffineModel, weights: Complex, shares: Floats, lines: Iterable[int], size: int = 0
) -> Complex:
    """Return the steady state (k, m) of some `lines` (k,) in the basis, or in its first `size`
    vectors.

    `weights` (k, q) are those of the terms at each line; `shares` (g,) of the geometries add to 1.
    """
    n = size or model.basis.shape[1]
    parts = np.tensordot(shares, model.parts[..., :n, :n], 1)
    forces = np.tensordot(shares, model.forces[:, list(lines), :n], 1)
    return np.stack([
        np.linalg.solve(np.tensordot(w, parts, 1), force)
        for w, force in zip(weights, forces, strict=True)
    ])  # fmt: skip


def steady_outputs(
    model: AffineModel, weights: Complex, shares: Floats, lines: Iterable[int], size: int = 0
) -> Complex:
    """Return the steady outputs (k, p) in m; see `steady_states` for the arguments."""
    states = steady_states(model, weights, shares, lines, size)
    outputs = np.tensordot(shares, model.outputs[..., : states.shape[1]], 1)
    return np.asarray(states @ outputs.T, np.complex128)


def steady_lines(bases: Sequence[AffineModel], weights: Complex, shares: Floats) -> Complex:
    """Return the steady outputs (f, p) for weights (f, q), with one model for each line."""
    each = zip(bases, weights, strict=True)
    return np.concatenate([steady_outputs(model, w[None], shares, [0]) for model, w in each])


def operators_at(model: AffineModel, solids: Solids, shares: Floats) -> Operators:
    """Return the operators in the coordinates of a model, for materials without modulus laws."""
    return operators_of(interpolate(model, shares), solids)


def interpolate(model: AffineModel, shares: Floats) -> AffineOperators:
    """Return affine operators in the coordinates of a model, for shares (g,) of the geometries."""
    r = model.parts.shape[-1]
    parts = np.tensordot(shares, model.parts, 1)
    return AffineOperators(terms=model.terms, parts=parts, free=np.arange(r), n_dofs=r)


def least_scale(strengths: Floats, weak: float = 1e-2) -> float:
    """Return the smallest scale of errors of lines with some strengths (f,): the share `weak` of
    the strongest.
    """
    return float(max(weak * strengths.max(), np.finfo(np.float64).tiny))


def line_errors(candidate: Complex, reference: Complex) -> Floats:
    """Return relative errors (f,) of lines (f, p): norms over the outputs, relative to each line or
    to the `least_scale`, whichever is larger.
    """
    strengths = np.linalg.norm(reference, axis=1)
    scales = np.maximum(strengths, least_scale(strengths))
    return np.asarray(np.linalg.norm(candidate - reference, axis=1) / scales)
