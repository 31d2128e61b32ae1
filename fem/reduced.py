"""Reduced-order model of a body: transfer function, poles, and motion under loads.

    M u'' + C u' + K u = basis^T f,  probes = outputs u

In modal (pole-residue) form

    z' = pole z + inputs f(t),  probes = 2 Re(outputs z)

For a load of lines F exp(i w t) from rest, the exact solution is the lines plus a free vibration:

    z(t) = inputs F [exp(i w t) - exp(pole t)] / (i w - pole)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg

from fem.assembly import Operators
from fem.harmonic import dynamic_stiffness
from fem.maxwell import maxwell_only
from simple_model.typing import Complex, Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class ReducedModel:
    """Reduced-order model in r basis vectors, from `reduce`.

    Parameters
    ----------
    operators : Operators (r, r), projected
    basis : (3 n, r) float, kg^-1/2
    outputs : (p, r) float, of the probes
    moments : number of Krylov moments
    estimate : relative change of the probes' response by a few more moments
    solver : backend that factorised the body
    """

    operators: Operators
    basis: Floats
    outputs: Floats
    moments: int
    estimate: float
    solver: str


def transfer(model: ReducedModel, forces: Floats, frequencies: ArrayLike) -> Complex:
    """Return the transfer function of a reduced-order model.

    Parameters
    ----------
    forces : (r, k) float, N kg^-1/2, reduced forces
    frequencies : (f,) float, Hz

    Returns
    -------
    (f, p, k) complex
        Displacement of the probes under each of the forces, m.

    Raises
    ------
    LinAlgError
        If the model has no loss and a frequency is a natural frequency.
    """
    s = 2j * np.pi * np.atleast_1d(np.asarray(frequencies, np.float64))[:, None, None]
    ops = model.operators
    A = dynamic_stiffness(ops.K, ops.C, ops.M, ops.branches, s)
    fields: Complex = np.linalg.solve(A, np.broadcast_to(forces, (len(s), *forces.shape)))
    return model.outputs @ fields


@dataclass(frozen=True, kw_only=True, eq=False)
class Poles:
    """Pole-residue form of a model: z' = pole z + inputs f, probes = 2 Re(outputs z).

    Parameters
    ----------
    values : (m,) complex, poles with imaginary part >= 0, 1/s
    inputs : (m, r) complex
    outputs : (p, m) complex
    """

    values: Complex
    inputs: Complex
    outputs: Complex


def poles(operators: Operators, outputs: Floats | None = None) -> Poles:
    """Diagonalise projected operators in first-order form.

    Internal variables of Maxwell branches are part of that form:
    z_j' = (L_j^T u - z_j) / tau_j with K_j = L_j L_j^T.

    Parameters
    ----------
    operators : Operators with dense matrices (r, r)
    outputs : (p, r) float; all coordinates by default

    Returns
    -------
    Poles
        One of each conjugate pair.
    """
    r, branches = len(operators.K), maxwell_only(operators.branches)
    upright = np.linalg.inv(np.linalg.cholesky(operators.M)).T  # coordinates of unit mass
    K, C, *relaxing = (
        upright.T @ A @ upright for A in (operators.K, operators.C, *(b.K for b in branches))
    )
    companion = np.block([[np.zeros((r, r)), np.eye(r)], [-(K + sum(relaxing)), -C]])
    for L, time in zip(map(low_rank_factor, relaxing), (b.time for b in branches), strict=True):
        size, k = len(companion), L.shape[1]
        pulled, followed = np.zeros((size, k)), np.zeros((k, size))
        pulled[r : 2 * r], followed[:, :r] = L, L.T / time
        companion = np.block([[companion, pulled], [followed, -np.eye(k) / time]])
    values, vectors = linalg.eig(companion)
    kept = values.imag >= 0
    inverse = np.linalg.solve(vectors, np.eye(len(values))[:, r : 2 * r])[kept]
    # A real pole has no conjugate, and twice the real part would count it double.
    weight = np.where(values[kept].imag > 0, 1.0, 0.5)
    read = upright if outputs is None else outputs @ upright
    return Poles(
        values=values[kept], inputs=inverse @ upright.T,
        outputs=(read @ vectors[:r, kept]) * weight,
    )  # fmt: skip


def low_rank_factor(K: Floats) -> Floats:
    """Return L (n, k) of full rank with L L^T = K, positive semidefinite, so that a branch has
    internal variables only where it has springs.
    """
    squares, vectors = np.linalg.eigh(K)
    nonzero = squares > 1e-12 * squares.max()
    return np.asarray(vectors[:, nonzero] * np.sqrt(squares[nonzero]))


def line_response(poles: Poles, forces: Complex, frequencies: Floats) -> tuple[Complex, Complex]:
    """Return the steady state (f, p) and the free vibration (m, p) from rest at t = 0: complex
    amplitudes in m of exp(2 pi i f t) and exp(pole t).

    The load is Re sum_f forces exp(2 pi i f t) with reduced forces (f, r) in N kg^-1/2 and
    frequencies (f,) in Hz.
    """
    iw, values = 2j * np.pi * frequencies[:, None], poles.values
    forwards = (forces @ poles.inputs.T) / (iw - values)  # (f, m)
    backwards = (forces.conj() @ poles.inputs.T) / (-iw - values)
    lines = forwards @ poles.outputs.T + (backwards @ poles.outputs.T).conj()
    return lines, -(forwards + backwards).sum(axis=0)[:, None] * poles.outputs.T


def impulse_response(poles: Poles, impulse: Floats) -> Complex:
    """Return amplitudes (m, p) of exp(pole t) after an impulse (r,) in N s kg^-1/2 at t = 0."""
    return 2 * (poles.inputs @ impulse)[:, None] * poles.outputs.T


def exponential_sum(rates: Complex, amplitudes: Complex, times: Floats) -> Floats:
    """Return Re sum_j amplitudes exp(rates t) (t, p) for complex rates (j,) in 1/s and amplitudes
    (j, p), at equally spaced times from 0.

    Exponentials are products of those within the first chunk of times and at the start of each.
    """
    j, p = amplitudes.shape
    most_rates = 8192  # rates summed at a time, to bound memory
    if j > most_rates:
        parts = [slice(k, k + most_rates) for k in range(0, j, most_rates)]
        return np.sum([exponential_sum(rates[k], amplitudes[k], times) for k in parts], axis=0)
    chunk = 256  # times that share their exponentials
    within = np.exp(rates * times[:chunk, None])
    starts = np.exp(rates * times[::chunk, None])
    driven = (starts[:, :, None] * amplitudes).transpose(1, 0, 2).reshape(j, len(starts) * p)
    summed = within.real @ driven.real - within.imag @ driven.imag
    return summed.reshape(len(within), len(starts), p).swapaxes(0, 1).reshape(-1, p)[: len(times)]
