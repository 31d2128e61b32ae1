"""Free vibration of a plate's modes with Maxwell branches in bending.

Bending makes the share e of the squared frequency w^2 of a mode; air and edges damp it by c. Its
dynamic stiffness is D(s) = s^2 + c s + w^2 [1 - e + e h(s)] with

    h(s) = h_0 + lag s + sum_j h_j s tau_j / (1 + s tau_j),

and, by its poles p, the compliance 1 / D(s) = sum_p 1 / (D'(p) (s - p)): a vibration, and the creep
of each branch. Poles are eigenvalues of the equations with the stretches d_j of the branches,

    u'' = -c u' - w^2 [(1 - e + e h_0) u + e lag u' + e sum_j h_j d_j],   d_j' = u' - d_j / tau_j.
"""

from dataclasses import dataclass

import numpy as np

from simple_model.layers.material import Material
from simple_model.plates.modes import PlateModes
from simple_model.typing import Complex, Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class FreeModes:
    """Poles (m, j) in 1/s of m modes, and `residues` (m, j) in s of their compliances. Only one of
    two conjugate poles has a residue, that of both; real poles have half of theirs.
    """

    poles: Complex
    residues: Complex

    def start(self, frequencies: Floats, forces: Complex) -> Complex:
        """Amplitudes (m, j) of exp(pole t) that start all modes from rest at t = 0.

        Modal forces are Re sum F exp(2 pi i f t), with F (f, m) at frequencies (f,) in Hz. A line
        makes F residue [exp(2 pi i f t) - exp(pole t)] / (2 pi i f - pole).
        """
        amplitudes = np.zeros(self.poles.shape, np.complex128)
        for s, force in zip(2j * np.pi * frequencies, forces, strict=True):
            amplitudes -= force[:, None] / (s - self.poles) + force.conj()[:, None] / (
                -s - self.poles
            )
        return amplitudes * self.residues

    def impulse(self, coordinates: Floats, rates: Floats) -> Complex:
        """Amplitudes (m, j) of exp(pole t) for coordinates (m,) in m kg^1/2 and their rates."""
        return 2 * self.residues * (self.poles * coordinates[:, None] + rates[:, None])


@dataclass(frozen=True, kw_only=True, eq=False)
class Loss:
    """Modulus of a material relative to that of the modes: at `rest`, viscous `lag` in s, and
    `shares` (j,) of Maxwell branches with relaxation `times` (j,) in s.
    """

    rest: float
    lag: float
    shares: Floats
    times: Floats

    @staticmethod
    def of(material: Material) -> "Loss":
        """Relative modulus of a material."""
        solid, mu = material.relaxing(), material.shear_modulus
        terms = [term for term in solid.prony if term.modulus]
        return Loss(
            rest=solid.shear_modulus / mu, lag=solid.viscosity / mu,
            shares=np.array([term.modulus / mu for term in terms]),
            times=np.array([term.time for term in terms]),
        )  # fmt: skip

    def storage(self, omega: Floats) -> Floats:
        """Relative storage modulus (...) at angular frequencies (...) in rad/s."""
        squared = np.multiply.outer(omega, self.times) ** 2
        return np.asarray(self.rest + (self.shares * squared / (1 + squared)).sum(axis=-1))


def free_modes(modes: PlateModes, material: Material) -> FreeModes:
    """Poles and residues of the modes of a plate whose material has no modulus law."""
    squared = np.maximum(modes.squared, np.finfo(float).tiny)
    bent = squared * modes.elastic
    stiffness, times = relaxing_stiffness(squared - bent, bent, material)
    stiffness[:, 1] += modes.damping
    return free_vibration(stiffness, times)


def relaxing_stiffness(lossless: Floats, bent: Floats, material: Material) -> tuple[Floats, Floats]:
    """Stiffness (m, 2 + n) of modes and times (n,) in s, for `free_vibration`, from a material with
    Maxwell branches.

    `lossless` (m,) and `bent` (m,) in 1/s2 are the parts of the squared frequencies without loss
    and in proportion to the modulus of the material.
    """
    loss = Loss.of(material)
    parts = lossless + bent * loss.rest, bent * loss.lag, bent[:, None] * loss.shares
    return np.column_stack(parts), loss.times


def free_vibration(stiffness: Floats, times: Floats) -> FreeModes:
    """Poles and residues of modes of stiffness (m, 2 + n): at rest in 1/s2, viscous in 1/s, and of
    each Maxwell branch in 1/s2, with times (n,) in s.
    """
    poles = _poles(stiffness, times)
    apart = np.abs(poles[:, :, None] - poles[:, None]) / np.abs(poles).max(axis=1)[:, None, None]
    apart[:, range(poles.shape[1]), range(poles.shape[1])] = np.inf
    stiffer = 1.0001
    closest = 1e-6  # relative distance of two poles, below which a mode is made stiffer
    if (critical := apart.min(axis=(1, 2)) < closest).any():
        stiffness = stiffness * np.where(critical, stiffer, 1.0)[:, None]
        poles[critical] = _poles(stiffness[critical], times)
    residues = 1 / _slope(stiffness, times, poles)
    return FreeModes(poles=poles, residues=residues * (1 + np.sign(poles.imag)) / 2)


def _poles(stiffness: Floats, times: Floats) -> Complex:
    n = 2 + len(times)
    speed = np.sqrt(stiffness[:, 0])  # so that u' / speed is as large as u
    companion = np.zeros((len(stiffness), n, n))
    companion[:, 0, 1] = speed
    companion[:, 1, 0] = -speed
    companion[:, 1, 1] = -stiffness[:, 1]
    companion[:, 1, 2:] = -stiffness[:, 2:] / speed[:, None]
    companion[:, 2:, 1] = speed[:, None]
    companion[:, range(2, n), range(2, n)] = -1 / times
    poles = np.linalg.eigvals(companion).astype(np.complex128)
    for _ in range(3):
        poles -= _stiffness(stiffness, times, poles) / _slope(stiffness, times, poles)
    return poles


def _stiffness(stiffness: Floats, times: Floats, s: Complex) -> Complex:
    """Dynamic stiffness D (m, j) at s (m, j) in rad/s."""
    phase = s[..., None] * times
    rest, viscous, relaxing = stiffness[:, :1], stiffness[:, 1:2], stiffness[:, None, 2:]
    return s**2 + rest + viscous * s + (relaxing * phase / (1 + phase)).sum(axis=-1)


def _slope(stiffness: Floats, times: Floats, s: Complex) -> Complex:
    """Derivative D' (m, j) at s (m, j) in rad/s."""
    relaxing = stiffness[:, None, 2:] * times / (1 + s[..., None] * times) ** 2
    return 2 * s + stiffness[:, 1:2] + relaxing.sum(axis=-1)
