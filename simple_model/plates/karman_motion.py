"""Motion of von Karman's plate in its modes.

    z'' + K z + sum_k s_k H_k z = f,  y_k = z^T H_k z / 2

s_k is the stress of the state y_k; without loss it is y_k itself. Bending and stretching both have
the loss of the material: a viscosity and Maxwell branches.

Time steps of dt are linearly implicit, with y between steps:

    y^(n+1/2) = z^(n+1) H z^n / 2,  force at n: (y^(n+1/2) + y^(n-1/2)) / 2 . H z^n

As y^(n+1/2) - y^(n-1/2) = z^n H (z^(n+1) - z^(n-1)) / 2, the work of this force is exactly the
change of y^2 / 2. Without load and loss the energy at half steps,

    v M v / 2 + z^(n+1) K z^n / 2 + y^(n+1/2)^2 / 2,  v = (z^(n+1) - z^n) / dt,

is constant to round-off. It is never negative, so the motion is bounded for any dt. Each step
solves one positive definite linear system (Bilbao, Numer Methods Partial Differ Equ 24:193 (2008);
Bilbao, Thomas, Touze and Ducceschi, ibid. 31:1948 (2015), doi 10.1002/num.21974).

M is a little above 1, so that a mode without stretching has its exact frequency. The forces of
`stretched_motion` are those under which the steps of the linear plate are an exact linear motion,
so the error of the steps is in proportion to the effect of stretching.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg.lapack import dposv

from simple_model.layers.material import Material
from simple_model.load.pressure import MovingPressure
from simple_model.load.spectrum import lines_from_rest, synthesise
from simple_model.plates.free_modes import WITHOUT_LOSS, FreeModes, Loss, free_modes
from simple_model.plates.modes import PlateModes, modal_motion, modal_motion_apart
from simple_model.plates.path_forces import MIDDLE, modal_path_forces
from simple_model.plates.von_karman import KarmanPlate
from simple_model.typing import Complex, Floats, Ints

HIGHEST_PHASE = 1.2  # rad per half step; faster modes are slowed down to it


@dataclass(frozen=True, kw_only=True, eq=False)
class Motion:
    """Modal coordinates (n, r) in kg^1/2 m at steps, and `energy` (n - 1,) in J between them."""

    coordinates: Floats
    energy: Floats


def linear_motion(
    modes: PlateModes,
    pressure: MovingPressure,
    material: Material,
    times: Floats,
    *,
    middle: Sequence[float] = MIDDLE,
    chosen: Ints | None = None,
    highest: float = np.inf,
) -> Floats:
    """Modal coordinates (t, r) in kg^1/2 m from rest of a plate that does not stretch, without time
    steps.

    The material has the `shear_modulus` of the modes and no modulus law of its own; times (t,) in s
    are 0 or above; `middle` (2,) in m is that of the plate in the scene. Returns the modes of
    indices `chosen` (r,), by default all. Lines of the load at or above `highest` Hz are left out.
    """
    x, y = middle
    f, motion, free, start = _linear_parts(modes, pressure, material, (x, y), highest)
    chosen = np.arange(len(modes.squared)) if chosen is None else chosen
    coordinates = synthesise(f, motion[:, chosen], times)
    for poles, amplitudes in zip(free.poles[chosen].T, start[chosen].T, strict=True):
        moving = amplitudes != 0
        decay = np.exp(np.multiply.outer(times, poles[moving]))
        coordinates[:, moving] += (decay * amplitudes[moving]).real
    return coordinates


@lru_cache(maxsize=4)
def _linear_parts(
    modes: PlateModes, pressure: MovingPressure, material: Material, middle: tuple[float, float],
    highest: float,
) -> tuple[Floats, Complex, FreeModes, Complex]:  # fmt: skip
    """Return frequencies (f,) in Hz and steady coordinates (f, m) of the lines below `highest`, the
    free modes, and the amplitudes (m, j) of their vibration; kept, because several runs need them.
    """

    def modulus(omega: Floats) -> Floats:
        return np.asarray(material.complex_modulus(omega) / material.shear_modulus)

    f, forces = lines_from_rest(pressure).gather(modal_path_forces(modes, pressure, middle))
    f, forces = f[f < highest], forces[f < highest]
    motion = modal_motion(modes, f, forces, modulus)
    coupling = motion - modal_motion_apart(modes, f, forces, modulus)
    free = free_modes(modes, material)
    start = free.start(f, forces)
    start -= free.impulse(coupling.real.sum(axis=0), (2j * np.pi * f @ coupling).real)
    return f, motion, free, start


def stretched_motion(
    plate: KarmanPlate, linear: Floats, dt: float, material: Material | None = None
) -> Motion:
    """Motion from rest, at 0, dt, ..., (n - 1) dt in s. Without stretching, the load would move the
    plate by `linear` (n, r) in kg^1/2 m, the `linear_motion` of the chosen modes.
    """
    forces = _Scheme.of(plate, dt, material).forces(linear)
    return forced_motion(plate, forces, dt, material)


def forced_motion(
    plate: KarmanPlate,
    forces: Floats,
    dt: float,
    material: Material | None = None,
    *,
    start: Floats | None = None,
) -> Motion:
    """Motion at the n + 1 times 0, dt, ..., n dt under forces (n, r) in N kg^-1/2 on the chosen
    modes.

    It starts from `start` (2, r), coordinates in kg^1/2 m and their rates, or from rest. Without a
    material it has no loss. Raises an ArithmeticError if a step is not finite.
    """
    scheme = _Scheme.of(plate, dt, material)
    M, K, B, rest = scheme.mass, scheme.K, scheme.bending, scheme.rest
    shares, pull, stiff = scheme.shares, scheme.pull, scheme.stiff
    keep, follow = scheme.keep[:, None], scheme.follow[:, None]
    z, energy = np.empty((len(forces) + 1, len(M))), np.empty(len(forces))
    z[0], rate = np.zeros((2, len(M))) if start is None else start
    G = plate.gradients(z[0])
    y = G @ z[0] / 2
    unbalanced = forces[0] - K @ z[0] - rest * (y @ G) - scheme.lag * (B @ rate)
    z[1] = z[0] + dt * rate + dt**2 / 2 * unbalanced / M
    bent, stretched = follow * (z[1] - z[0]) / 2, follow * (G @ z[1] / 2 - y)  # of the branches
    y = G @ z[1] / 2
    linear, hardening = np.diag(M / dt**2) + stiff / 2 * B, (rest / 2 + stiff) / 2
    for n in range(len(forces)):
        if n:
            G = plate.gradients(z[n])
            rhs = forces[n] - K @ z[n] + 2 / dt**2 * M * (z[n] - z[n - 1])
            rhs -= (rest * y + pull @ stretched) @ G + B @ (pull @ bent)
            _, change, failed = dposv(linear + hardening * (G.T @ G), rhs)
            if failed:
                raise ArithmeticError(f"step {n} of dt = {dt:g} s is not finite; lower the load")
            z[n + 1] = z[n - 1] + change
            following = G @ z[n + 1] / 2
            bent = keep * bent + follow * (change / 2)
            stretched = keep * stretched + follow * (following - y)
            y = following
        v = (z[n + 1] - z[n]) / dt
        springs = shares @ ((bent @ B * bent).sum(axis=1) + (stretched**2).sum(axis=1))
        energy[n] = (v @ (M * v) + z[n + 1] @ K @ z[n] + rest * (y @ y) + springs) / 2
    return Motion(coordinates=z, energy=energy)


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
        loss = Loss.of(material) if material else WITHOUT_LOSS
        squared = np.maximum(plate.squared, 0.0)
        bending = np.diagonal(plate.bending) * (loss.storage(np.sqrt(squared)) - 1)
        half = np.sqrt(np.maximum(squared + bending, 0.0)) * dt / 2
        mass = 1 / np.sinc(np.minimum(half, HIGHEST_PHASE) / np.pi) ** 2
        mass *= np.maximum(half / HIGHEST_PHASE, 1) ** 2
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

    def forces(self, motion: Floats) -> Floats:
        """Forces (n - 1, r) under which the steps without stretching are a motion (n, r)."""
        from scipy.signal import lfilter  # slow to import

        z, dt = motion, self.dt
        change = np.vstack([z[1:2] - z[:1], z[2:] - z[:-2]]) / 2
        stress = self.stiff * change
        for pull, keep, follow in zip(self.pull, self.keep, self.follow, strict=True):
            stretch = lfilter([follow], [1, -keep], change, axis=0)
            stress[1:] += pull * stretch[:-1]
        stress[0] = 0.0
        inertia = np.vstack([2 * (z[1:2] - z[:1]), z[2:] - 2 * z[1:-1] + z[:-2]]) / dt**2
        return np.asarray(self.mass * inertia + z[:-1] @ self.K + stress @ self.bending)
