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
from simple_model.plates.path_forces import MIDDLE, modal_path_forces
from simple_model.plates.von_karman import KarmanPlate
from simple_model.typing import Complex, Floats, Ints


def linear_motion(
    modes: PlateModes,
    pressure: MovingPressure,
    material: Material,
    times: Floats,
    *,
    middle: Sequence[float] = MIDDLE,
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


def stretched_motion(
    plate: KarmanPlate, linear: Floats, dt: float, material: Material | None = None
) -> Floats:
    """Coordinates (n, r) in kg^1/2 m from rest, at 0, dt, ..., (n - 1) dt in s. Without stretching,
    the load would move the plate by `linear` (n, r) in kg^1/2 m, the `linear_motion` of the chosen
    modes.
    """
    rest = np.zeros((2, linear.shape[1]))
    return _motion(plate, np.zeros_like(linear[1:]), linear, dt, material, rest)


def forced_motion(
    plate: KarmanPlate,
    forces: Floats,
    dt: float,
    material: Material | None = None,
    *,
    start: Floats | None = None,
) -> Floats:
    """Coordinates (n + 1, r) in kg^1/2 m at the times 0, dt, ..., n dt under forces (n, r) in N
    kg^-1/2 on the chosen modes.

    The motion starts from `start` (2, r), coordinates in kg^1/2 m and their rates, or from rest.
    Without a material it has no loss. Raises an ArithmeticError if a step is not finite.
    """
    r = forces.shape[1]
    start = np.zeros((2, r)) if start is None else start
    return _motion(plate, forces, np.zeros((len(forces) + 1, r)), dt, material, start)


def _motion(
    plate: KarmanPlate, forces: Floats, linear: Floats, dt: float, material: Material | None,
    start: Floats,
) -> Floats:  # fmt: skip
    """Motion (n + 1, r) that differs from a linear one by the effect of stretching and of forces.

    The linear plate moves exactly: only the difference from it takes the stiffness at rest and the
    inertia of the steps.
    """
    scheme = _Scheme.of(plate, dt, material)
    M, K, B, rest, pull = scheme.mass, scheme.K, scheme.bending, scheme.rest, scheme.pull
    keep, follow = scheme.keep[:, None], scheme.follow[:, None]
    damping, hardening = plate.damping, (rest / 2 + scheme.stiff) / 2
    system = np.diag(M / dt**2 + damping / dt / 2) + scheme.stiff / 2 * B
    inertia = 2 / dt**2 * M
    after, shift = (
        np.diag(inertia) - K,
        np.vstack([linear[1:2] - linear[:1], linear[2:] - linear[:-2]]),
    )
    loads = forces + shift @ system
    z = np.empty_like(linear)
    z[0], rate = start
    G, before = plate.gradients(z[0]), z[0] - linear[0]
    y = G @ z[0] / 2
    unbalanced = forces[0] - K @ before - rest * (y @ G) - scheme.lag * (B @ rate) - damping * rate
    z[1] = z[0] + shift[0] + dt * rate + dt**2 / 2 * unbalanced / M
    apart = z[1] - linear[1]
    bent, stretched = follow * (apart - before) / 2, follow * (G @ z[1] / 2 - y)  # of the branches
    y = G @ z[1] / 2
    for n in range(1, len(forces)):
        G = plate.gradients(z[n])
        rhs = loads[n] + after @ apart - inertia * before
        rhs -= (rest * y + pull @ stretched) @ G + B @ (pull @ bent)
        stiffness = dsyrk(hardening, G.T, beta=1.0, c=system, lower=1)
        _, change, failed = dposv(stiffness, rhs, lower=1, overwrite_a=1)
        if failed:
            raise ArithmeticError(f"step {n} of dt = {dt:g} s is not finite; lower the load")
        z[n + 1] = z[n - 1] + change
        before, apart = apart, z[n + 1] - linear[n + 1]
        following = G @ z[n + 1] / 2
        bent = keep * bent + follow * ((change - shift[n]) / 2)
        stretched = keep * stretched + follow * (following - y)
        y = following
    return z


def energy_between_steps(
    plate: KarmanPlate, coordinates: Floats, dt: float, material: Material | None = None
) -> Floats:
    """Energy (n,) in J between the steps of a motion (n + 1, r) in kg^1/2 m by `forced_motion`."""
    scheme = _Scheme.of(plate, dt, material)
    M, K, B, z = scheme.mass, scheme.K, scheme.bending, coordinates
    keep, follow = scheme.keep[:, None], scheme.follow[:, None]
    energy, bent, stretched = np.empty(len(z) - 1), np.zeros(1), np.zeros(1)
    for n in range(len(energy)):
        G = plate.gradients(z[n])
        y, before = G @ z[n + 1] / 2, G @ z[max(n - 1, 0)] / 2
        bent = keep * bent + follow * (z[n + 1] - z[max(n - 1, 0)]) / 2
        stretched = keep * stretched + follow * (y - before)
        v = (z[n + 1] - z[n]) / dt
        springs = scheme.shares @ ((bent @ B * bent).sum(axis=1) + (stretched**2).sum(axis=1))
        energy[n] = (v @ (M * v) + z[n + 1] @ K @ z[n] + scheme.rest * (y @ y) + springs) / 2
    return energy


@dataclass(frozen=True, kw_only=True, eq=False)
class _Scheme:
    """Coefficients of steps of dt in s: `mass` (r,) of modes, stiffness `K` (r, r) at rest,
    `bending` (r, r), and the modulus: at `rest`, viscous `lag` in s, and `shares` (j,) of Maxwell
    branches, whose stretch d becomes `keep` (j,) d + `follow` (j,) times the change of the strain.
    """

    dt: float
    mass: Floats
    K: Floats
    bending: Floats
    rest: float
    lag: float
    shares: Floats
    keep: Floats
    follow: Floats

    @staticmethod
    def of(plate: KarmanPlate, dt: float, material: Material | None) -> _Scheme:
        without_loss = Loss(rest=1.0, lag=0.0, shares=np.zeros(0), times=np.ones(0))
        loss = Loss.of(material) if material else without_loss
        squared = np.maximum(plate.squared, 0.0)
        bending = np.diagonal(plate.bending) * (loss.storage(np.sqrt(squared)) - 1)
        half = np.sqrt(np.maximum(squared + bending, 0.0)) * dt / 2
        highest_phase = 1.2  # rad per half step; faster modes are slowed down to it
        mass = 1 / np.sinc(np.minimum(half, highest_phase) / np.pi) ** 2
        mass *= np.maximum(half / highest_phase, 1) ** 2
        share = dt / 2 / loss.times
        return _Scheme(
            dt=dt, mass=mass, bending=plate.bending,
            K=np.diag(plate.squared) + (loss.rest - 1) * plate.bending,
            rest=loss.rest, lag=loss.lag, shares=loss.shares,
            keep=(1 - share) / (1 + share), follow=1 / (1 + share),
        )  # fmt: skip

    @property
    def pull(self) -> Floats:
        """Stress (j,) per stretch of branches at the beginning of a step."""
        return self.shares * self.follow

    @property
    def stiff(self) -> float:
        """Stress of viscosity and branches per change of strain over a step."""
        return self.lag / self.dt + float(self.pull.sum()) / 2
