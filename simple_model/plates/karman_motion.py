"""Motion of von Karman's plate in its modes.

    z'' + K z + sum_k s_k H_k z = f,  y_k = z^T H_k z / 2

s_k is the stress of the state y_k; without loss it is y_k itself. Bending and stretching both have
the loss of the material: a viscosity and Maxwell branches. Air and edges damp each mode as at its
own frequency.

Time steps of dt are linearly implicit, with y between steps:

    y^(n+1/2) = z^(n+1) H z^n / 2,  force at n: (y^(n+1/2) + y^(n-1/2)) / 2 . H z^n

As y^(n+1/2) - y^(n-1/2) = z^n H (z^(n+1) - z^(n-1)) / 2, the work of this force is exactly the
change of y^2 / 2. Without load and loss the energy at half steps,

    v M v / 2 + z^(n+1) K z^n / 2 + y^(n+1/2)^2 / 2,  v = (z^(n+1) - z^n) / dt,

is constant to round-off. It is never negative, so the motion is bounded for any dt. Each step
solves one positive definite linear system (Bilbao, Numer Methods Partial Differ Equ 24:193 (2008);
Bilbao, Thomas, Touze and Ducceschi, ibid. 31:1948 (2015), doi 10.1002/num.21974).

M is a little above 1, so that a mode without stretching has its exact frequency. The steps of
`stretched_motion` take the difference from the exact linear motion, so their error is in proportion
to the effect of stretching.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg.blas import dsyrk
from scipy.linalg.lapack import dposv

from simple_model.layers.material import Material
from simple_model.load.pressure import MovingPressure
from simple_model.load.spectrum import lines_from_rest, synthesise
from simple_model.plates.free_modes import Loss, free_modes
from simple_model.plates.modes import PlateModes, modal_motion, modal_motion_apart
from simple_model.plates.path_forces import modal_path_forces
from simple_model.plates.von_karman import KarmanPlate
from simple_model.typing import Complex, Floats, Ints


def linear_motion(
    modes: PlateModes,
    pressure: MovingPressure,
    material: Material,
    times: Floats,
    *,
    middle: Sequence[float] = (0.0, 0.0),
    chosen: Ints | None = None,
    driving: float = np.inf,
    highest: float = np.inf,
) -> Floats:
    """Modal coordinates (t, r) in kg^1/2 m from rest of a plate that does not stretch, without time
    steps.

    The material has the `shear_modulus` of the modes and no modulus law of its own; times (t,) in s
    are 0 or above; `middle` (2,) in m is that of the plate in the scene. Returns the modes of
    indices `chosen` (r,), by default all. Lines of the load are computed below `driving` Hz; the
    steady vibration of those at or above `highest` Hz is left out.
    """
    x, y = middle
    driven = modes_from_rest(modes, pressure, material, (x, y), driving)
    chosen = np.arange(len(modes.squared)) if chosen is None else chosen
    few = driven.frequencies < highest
    coordinates = synthesise(driven.frequencies[few], driven.motion[few][:, chosen], times)
    for poles, amplitudes in zip(driven.poles[chosen].T, driven.start[chosen].T, strict=True):
        moving = amplitudes != 0
        decay = np.exp(np.multiply.outer(times, poles[moving]))
        coordinates[:, moving] += (decay * amplitudes[moving]).real
    return coordinates


@dataclass(frozen=True, kw_only=True, eq=False)
class ModesFromRest:
    """Motion of modes from rest without stretching: the steady vibration `motion` (f, m) in kg^1/2
    m under modal `forces` (f, m) in N kg^-1/2 at `frequencies` (f,) in Hz, and the free vibration
    after its `start`, amplitudes (m, j) of exp(t `poles` (m, j)).
    """

    frequencies: Floats
    forces: Complex
    motion: Complex
    poles: Complex
    start: Complex


@lru_cache(maxsize=3)
def modes_from_rest(
    modes: PlateModes, pressure: MovingPressure, material: Material, middle: tuple[float, float],
    highest: float = np.inf,
) -> ModesFromRest:  # fmt: skip
    """Return the motion from rest under the lines of a load below `highest` Hz; kept, because
    several runs need it.
    """

    def modulus(omega: Floats) -> Floats:
        return np.asarray(material.complex_modulus(omega) / material.shear_modulus)

    f, forces = lines_from_rest(pressure).gather(modal_path_forces(modes, pressure, middle))
    f, forces = f[f < highest], forces[f < highest]
    motion, free = modal_motion(modes, f, forces, modulus), free_modes(modes, material)
    coupling = motion - modal_motion_apart(modes, f, forces, modulus)
    start = free.start(f, forces)
    start -= free.impulse(coupling.real.sum(axis=0), (2j * np.pi * f @ coupling).real)
    return ModesFromRest(frequencies=f, forces=forces, motion=motion, poles=free.poles, start=start)


def stretched_motion(plate: KarmanPlate, linear: Floats, dt: float, material: Material) -> Floats:
    """Coordinates (n, r) in kg^1/2 m at 0, dt, ..., (n - 1) dt in s of a plate that starts flat.

    Without stretching they would be `linear` (n, r), such as the `linear_motion` of the chosen
    modes. Raises an ArithmeticError if a step is not finite.
    """
    loss, B = Loss.of(material), plate.bending
    M, K = _mass_of_steps(plate, loss, dt), np.diag(plate.squared) + (loss.rest - 1) * B
    # Over a step the stretch of a branch becomes `keep` times itself plus `follow` times the change
    # of strain.
    share = (dt / 2 / loss.times)[:, None]
    keep, follow = (1 - share) / (1 + share), 1 / (1 + share)
    pull = loss.shares * follow[:, 0]  # stress per stretch at the beginning of a step
    stiff = loss.lag / dt + pull.sum() / 2  # stress per change of strain over a step
    system = np.diag(M / dt**2 + plate.damping / dt / 2) + stiff / 2 * B
    inertia = 2 / dt**2 * M
    after = np.diag(inertia) - K
    shift = linear[2:] - linear[:-2]
    loads = shift @ system
    before = -linear[0]  # not zero: air damps free motion as at each mode's own frequency
    apart = before - dt**2 / 2 * (K @ before) / M
    z = np.empty_like(linear)
    z[0], z[1] = 0.0, linear[1] + apart
    y, bent = np.zeros(len(plate.H)), follow * (apart - before) / 2
    stretched = np.zeros((len(share), len(y)))
    for n in range(1, len(z) - 1):
        G = plate.gradients(z[n])
        rhs = loads[n - 1] + after @ apart - inertia * before
        rhs -= (loss.rest * y + pull @ stretched) @ G + B @ (pull @ bent)
        stiffness = dsyrk((loss.rest / 2 + stiff) / 2, G.T, beta=1.0, c=system, lower=1)
        _, change, failed = dposv(stiffness, rhs, lower=1, overwrite_a=1)
        if failed:
            raise ArithmeticError(f"step {n} of dt = {dt:g} s is not finite; lower the load")
        z[n + 1] = z[n - 1] + change
        before, apart = apart, z[n + 1] - linear[n + 1]
        following = G @ z[n + 1] / 2
        bent = keep * bent + follow * ((change - shift[n - 1]) / 2)
        stretched = keep * stretched + follow * (following - y)
        y = following
    return z


def _mass_of_steps(plate: KarmanPlate, loss: Loss, dt: float, highest_phase: float = 1.2) -> Floats:
    """Modal masses (r,) that give steps of dt in s the exact frequencies without stretching. Modes
    of a phase above `highest_phase`, in rad per half step, are slowed down to it.
    """
    squared = np.maximum(plate.squared, 0.0)
    bending = np.diagonal(plate.bending) * (loss.storage(np.sqrt(squared)) - 1)
    half = np.sqrt(np.maximum(squared + bending, 0.0)) * dt / 2
    mass = 1 / np.sinc(np.minimum(half, highest_phase) / np.pi) ** 2
    return np.asarray(mass * np.maximum(half / highest_phase, 1) ** 2)
