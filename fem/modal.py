"""Modal (pole-residue) form of a reduced-order model, and its motion under moving loads.

    z' = pole z + inputs f(t),  probes = 2 Re(outputs z)

In time, exact for a load of lines F exp(i w t): the lines themselves and the free vibration that
the start leaves,

    z(t) = inputs F [exp(i w t) - exp(pole t)] / (i w - pole)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from fem.maxwell import factors
from fem.reduced import ReducedModel
from meshes.tetmesh import Floats

Complex = NDArray[np.complex128]
CHUNK = 256  # times that share their exponentials
MOST_RATES = 8192  # summed at a time, to bound memory


@dataclass(frozen=True, kw_only=True, eq=False)
class Poles:
    """Pole-residue form of a model: z' = pole z + inputs f, probes = 2 Re(outputs z).

    `values` (m,) in 1/s with imaginary part >= 0, `inputs` (m, r), `outputs` (p, m).
    """

    values: Complex
    inputs: Complex
    outputs: Complex


def poles(model: ReducedModel, outputs: Floats | None = None) -> Poles:
    """Diagonalise the model in first-order form, once; one of each conjugate pair is returned.

    Internal variables of Maxwell branches are part of that form:
    z_j' = (L_j^T u - z_j) / tau_j, K_j = L_j L_j^T.

    Parameters
    ----------
    outputs : (p, r), output matrix of the reduced coordinates: that of the probes if not given
    """
    r = len(model.K)
    fast = model.K + sum(branch.K for branch in model.branches)
    companion = np.block([[np.zeros((r, r)), np.eye(r)], [-fast, -model.C]])
    for L, time in map(factors, model.branches):
        size, k = len(companion), L.shape[1]
        pulled, followed = np.zeros((size, k)), np.zeros((k, size))
        pulled[r : 2 * r], followed[:, :r] = L, L.T / time
        companion = np.block([[companion, pulled], [followed, -np.eye(k) / time]])
    values, vectors = linalg.eig(companion)
    kept = values.imag >= 0
    inverse = np.linalg.solve(vectors, np.eye(len(values))[:, r : 2 * r])[kept]
    # A real pole stands alone, so that twice the real part counts it double.
    weight = np.where(values[kept].imag > 0, 1.0, 0.5)
    read = model.outputs if outputs is None else outputs
    return Poles(values=values[kept], inputs=inverse, outputs=(read @ vectors[:r, kept]) * weight)


def line_response(poles: Poles, forces: Complex, frequencies: Floats) -> tuple[Complex, Complex]:
    """Steady state and free vibration under a load Re sum_f forces exp(2 pi i f t) from t = 0 on.

    Parameters
    ----------
    poles : Poles, of p outputs
    forces : (f, r) reduced forces of the lines, N kg^-1/2
    frequencies : (f,) float, Hz

    Returns
    -------
    lines : (f, p) complex amplitudes in metre of the steady state
    start : (m, p) complex amplitudes of exp(pole t), the free vibration from rest at t = 0
    """
    iw, values = 2j * np.pi * frequencies[:, None], poles.values
    forwards = (forces @ poles.inputs.T) / (iw - values)  # (f, m)
    backwards = (forces.conj() @ poles.inputs.T) / (-iw - values)
    lines = forwards @ poles.outputs.T + (backwards @ poles.outputs.T).conj()
    return lines, -(forwards + backwards).sum(axis=0)[:, None] * poles.outputs.T


def impulse_response(poles: Poles, impulse: Floats) -> Complex:
    """Free vibration (m, p), complex amplitudes of exp(pole t), after an impulse (r,) in
    N s kg^-1/2 at t = 0.
    """
    return 2 * (poles.inputs @ impulse)[:, None] * poles.outputs.T


def exponential_sum(rates: Complex, amplitudes: Complex, times: Floats) -> Floats:
    """Exponential sum Re sum_j amplitudes exp(rates t).

    Exponentials are computed within one chunk of times and at the start of each, and multiplied.

    Parameters
    ----------
    rates : (j,) complex, 1/s
    amplitudes : (j, p) complex
    times : (t,) float, s, equally spaced from 0

    Returns
    -------
    (t, p) float, in the unit of the amplitudes
    """
    j, p = amplitudes.shape
    if j > MOST_RATES:
        parts = range(0, j, MOST_RATES)
        return np.sum(
            [
                exponential_sum(rates[k : k + MOST_RATES], amplitudes[k : k + MOST_RATES], times)
                for k in parts
            ],
            axis=0,
        )
    within = np.exp(rates * times[:CHUNK, None])
    starts = np.exp(rates * times[::CHUNK, None])
    driven = (starts[:, :, None] * amplitudes).transpose(1, 0, 2).reshape(j, -1)
    summed = within.real @ driven.real - within.imag @ driven.imag
    return summed.reshape(len(within), -1, p).swapaxes(0, 1).reshape(-1, p)[: len(times)]
