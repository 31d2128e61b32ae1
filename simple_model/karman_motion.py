"""Static deflection and motion of von Karman's plate in its modes.

    z'' + K z + sum_k s_k H_k z = f,  y_k = z^T H_k z / 2

where s_k is the stress of the state y_k: y_k itself without loss. Bending and stretching have the
same loss, that of the material: a viscosity, and Maxwell branches.

In time the nonlinear force is taken linearly implicit, with y between steps of dt:

    y^(n+1/2) = z^(n+1) H z^n / 2,  force at n = (y^(n+1/2) + y^(n-1/2)) / 2 . H z^n

As y^(n+1/2) - y^(n-1/2) = z^n H (z^(n+1) - z^(n-1)) / 2, the work of this force is exactly the
change of y^2 / 2: without load and loss the energy at half steps,

    v M v / 2 + z^(n+1) K z^n / 2 + y^(n+1/2)^2 / 2,  v = (z^(n+1) - z^n) / dt,

is constant to round-off and 0 or above, so that no step is too long for stability, and each step is
one positive definite linear system in z^(n+1). (Bilbao, Numer Methods Partial Differ Equ 24:193
(2008); Bilbao, Thomas, Touze and Ducceschi, ibid. 31:1948 (2015), doi 10.1002/num.21974.) It is an
energy quadratisation whose auxiliary variables, being quadratic in z, do not drift from what they
stand for. A single scalar auxiliary variable (Bilbao, Ducceschi and Zama, J Comput Phys 472:111697
(2023)) saves the linear system, which is small here, and drifts.

M is a little above 1, such that a mode without stretching has its exact frequency in steps.
`stretched_motion` goes further: its forces make the steps of the plate without stretching exactly
those of a given linear motion, so that steps affect only what stretching changes.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg, signal
from scipy.linalg.lapack import dposv

from simple_model.free_modes import free_modes
from simple_model.load_spectrum import lines_from_rest, synthesise
from simple_model.material import Floats, Material
from simple_model.plate_modes import PlateModes, modal_motion, modal_motion_apart
from simple_model.plate_response import MIDDLE, modal_path_forces
from simple_model.pressure import MovingPressure
from simple_model.von_karman import KarmanPlate

TOLERANCE = 1e-10  # of the load: unbalanced force of a static deflection
MOST_ITERATIONS = 30
SHORTEST_LOAD_STEP = 1 / 256
HIGHEST_PHASE = 1.2  # rad per half step: modes that are faster than this are slowed to it


@dataclass(frozen=True, kw_only=True, eq=False)
class Motion:
    """Modal coordinates (n, r) in kg^1/2 m at steps, and `energy` (n - 1,) in J between them."""

    coordinates: Floats
    energy: Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class _Loss:
    """Modulus of a material over that of the modes: at `rest`, viscous `lag` in s, and `shares`
    (j,) of Maxwell branches with `times` (j,) in s.
    """

    rest: float
    lag: float
    shares: Floats
    times: Floats

    @staticmethod
    def of(material: Material | None) -> "_Loss":
        if material is None:
            return _Loss(rest=1.0, lag=0.0, shares=np.zeros(0), times=np.ones(0))
        solid, mu = material.relaxing(), material.shear_modulus
        terms = [term for term in solid.prony if term.modulus]
        return _Loss(
            rest=solid.shear_modulus / mu, lag=solid.viscosity / mu,
            shares=np.array([term.modulus / mu for term in terms]),
            times=np.array([term.time for term in terms]),
        )  # fmt: skip

    def storage(self, omega: Floats) -> Floats:
        """Relative storage modulus (...) at angular frequencies (...) in rad/s."""
        turned = np.multiply.outer(omega, self.times) ** 2
        return np.asarray(self.rest + (self.shares * turned / (1 + turned)).sum(axis=-1))


def static_deflection(
    plate: KarmanPlate, forces: Floats, material: Material | None = None
) -> Floats:
    """Modal coordinates at rest under a constant load.

    Parameters
    ----------
    plate : KarmanPlate
    forces : (m,) N kg^-1/2, modal forces of all modes of the plate, as of `area_forces`
    material : Material, the modulus of which at rest resists; that of the modes if not given

    Returns
    -------
    (m,) kg^1/2 m, of all modes; those that are not `plate.chosen` are as stiff as without
    deflection

    Raises
    ------
    ArithmeticError
        If Newton's method does not converge even in small load steps.
    """
    rest, modes = _Loss.of(material).rest, plate.modes
    found = forces / (modes.squared * (1 + (rest - 1) * modes.elastic))
    found[plate.chosen] = _equilibrium(plate, forces[plate.chosen], rest)
    return np.asarray(found)


def _equilibrium(plate: KarmanPlate, forces: Floats, rest: float) -> Floats:
    K, z = _stiffness_at_rest(plate, rest), np.zeros(len(forces))
    reached, step = 0.0, 1.0
    while reached < 1:
        target = min(1.0, reached + step)
        found = _newton(plate, K, target * forces, rest, z)
        if found is not None:
            z, reached, step = found, target, 2 * step
        elif (step := step / 2) < SHORTEST_LOAD_STEP:
            raise ArithmeticError(
                f"no equilibrium was found at {100 * target:.3g} % of the load; lower the load, or "
                "take more modes"
            )
    return z


def _newton(plate: KarmanPlate, K: Floats, forces: Floats, rest: float, z: Floats) -> Floats | None:
    """Equilibrium from a first guess, or None if Newton's method does not find it."""
    size = float(np.linalg.norm(forces)) or 1.0
    for _ in range(MOST_ITERATIONS):
        G = _gradients(plate, z)
        y = G @ z / 2
        unbalanced = forces - K @ z - rest * (y @ G)
        left = float(np.linalg.norm(unbalanced)) / size
        if left <= TOLERANCE:
            return z
        tangent = K + rest * (np.tensordot(y, plate.H, axes=1) + G.T @ G)
        try:
            z = z + linalg.cho_solve(linalg.cho_factor(tangent), unbalanced)
        except linalg.LinAlgError:
            return None
        if not np.isfinite(z).all():
            return None
    return None


def linear_motion(
    modes: PlateModes,
    pressure: MovingPressure,
    material: Material,
    times: Floats,
    *,
    middle: Sequence[float] = MIDDLE,
) -> Floats:
    """Modal coordinates of a plate that does not stretch, from rest, without steps.

    Parameters
    ----------
    modes : PlateModes
    pressure : MovingPressure
    material : Material, with the `shear_modulus` of the modes and no modulus law of its own
    times : (t,) s, of which the first is 0 or above
    middle : (2,) metre, of the plate in the scene

    Returns
    -------
    (t, m) kg^1/2 m
    """

    def modulus(omega: Floats) -> Floats:
        return np.asarray(material.complex_modulus(omega) / material.shear_modulus)

    path = modal_path_forces(modes, pressure, middle)
    f, forces = lines_from_rest(pressure).gather(path)
    motion = modal_motion(modes, f, forces, modulus)
    free = free_modes(modes, material)
    beside = motion - modal_motion_apart(modes, f, forces, modulus)
    start = free.start(f, forces)
    start -= free.impulse(beside.real.sum(axis=0), (2j * np.pi * f @ beside).real)
    found = synthesise(f, motion, times)
    for poles, amplitudes in zip(free.poles.T, start.T, strict=True):
        moving = amplitudes != 0
        decay = np.exp(np.multiply.outer(times, poles[moving]))
        found[:, moving] += (decay * amplitudes[moving]).real
    return found


def stretched_motion(
    plate: KarmanPlate, linear: Floats, dt: float, material: Material | None = None
) -> Motion:
    """Motion of a plate from rest under the load that gives it, without stretching, a linear
    motion.

    Parameters
    ----------
    plate : KarmanPlate
    linear : (n, r) kg^1/2 m, at 0, dt, 2 dt, ..., of the chosen modes, as of `linear_motion`
    dt : s
    material : Material, as of the linear motion; no loss if not given

    Returns
    -------
    Motion
        Of n steps.
    """
    scheme = _Scheme.of(plate, dt, material)
    return _march(plate, scheme, scheme.forces(linear), np.zeros((2, len(plate.squared))))


def forced_motion(
    plate: KarmanPlate,
    forces: Floats,
    dt: float,
    material: Material | None = None,
    *,
    start: Floats | None = None,
) -> Motion:
    """Motion of a plate under forces that are known at steps.

    Parameters
    ----------
    plate : KarmanPlate
    forces : (n, r) N kg^-1/2, on the chosen modes at 0, dt, ..., (n - 1) dt
    dt : s
    material : Material; no loss if not given
    start : (2, r), coordinates in kg^1/2 m and their rates in kg^1/2 m/s at time 0, of relaxed
        branches; at rest if not given

    Returns
    -------
    Motion
        Of n + 1 steps.
    """
    start = np.zeros((2, len(plate.squared))) if start is None else start
    return _march(plate, _Scheme.of(plate, dt, material), forces, start)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Scheme:
    """Steps of dt: `mass` (r,) of modes in steps, stiffness at rest `K` (r, r), `bending` (r, r)
    and its `loss`; `slower` (j,) dt / 2 over the times of Maxwell branches.
    """

    dt: float
    mass: Floats
    K: Floats
    bending: Floats
    loss: _Loss
    slower: Floats

    @staticmethod
    def of(plate: KarmanPlate, dt: float, material: Material | None) -> "_Scheme":
        loss, squared = _Loss.of(material), np.maximum(plate.squared, 0.0)
        elastic = np.diagonal(plate.bending)
        own = squared + (loss.storage(np.sqrt(squared)) - 1) * elastic
        half = np.sqrt(np.maximum(own, 0.0)) * dt / 2
        mass = 1 / np.sinc(np.minimum(half, HIGHEST_PHASE) / np.pi) ** 2
        mass *= np.maximum(half / HIGHEST_PHASE, 1) ** 2
        return _Scheme(
            dt=dt, mass=mass, K=_stiffness_at_rest(plate, loss.rest), bending=plate.bending,
            loss=loss, slower=dt / 2 / loss.times,
        )  # fmt: skip

    @property
    def relaxing(self) -> float:
        """Force of viscosity and branches per change of their strain within a step."""
        return self.loss.lag / self.dt + float((self.loss.shares / (2 * (1 + self.slower))).sum())

    def forces(self, motion: Floats) -> Floats:
        """Forces (n - 1, r) under which steps without stretching are a motion (n, r) from rest."""
        z, dt = motion, self.dt
        moved = np.vstack([z[1:2] - z[:1], z[2:] - z[:-2]]) / 2
        strained = self.relaxing * moved
        for share, a in zip(self.loss.shares, self.slower, strict=True):
            d = signal.lfilter([1 / (1 + a)], [1, (a - 1) / (1 + a)], moved, axis=0)
            strained[1:] += share * d[:-1] / (1 + a)
        strained[0] = 0.0
        inertia = np.vstack([2 * (z[1:2] - z[:1]), z[2:] - 2 * z[1:-1] + z[:-2]]) / dt**2
        return np.asarray(self.mass * inertia + z[:-1] @ self.K + strained @ self.bending)


def _march(plate: KarmanPlate, scheme: _Scheme, forces: Floats, start: Floats) -> Motion:
    """Motion (n + 1, r) under forces (n, r) from coordinates and rates (2, r)."""
    dt, M, K, B, loss = scheme.dt, scheme.mass, scheme.K, scheme.bending, scheme.loss
    slower, damped = 1 + scheme.slower[:, None], bool(scheme.relaxing)
    remembered = (2 - slower) / slower
    pull = loss.shares / slower[:, 0]
    base = np.diag(M / dt**2) + scheme.relaxing / 2 * B
    hardening = (loss.rest / 2 + scheme.relaxing) / 2
    z = np.empty((len(forces) + 1, len(M)))
    energy = np.empty(len(forces))
    z[0], speed = start
    G = _gradients(plate, z[0])
    now = G @ z[0] / 2
    unbalanced = forces[0] - K @ z[0] - loss.rest * (now @ G) - scheme.loss.lag * (B @ speed)
    z[1] = z[0] + dt * speed + dt**2 / 2 * unbalanced / M
    y = G @ z[1] / 2
    d, e = (np.outer(pull * 0 + 1, x) / slower for x in ((z[1] - z[0]) / 2, y - now))
    for n in range(len(forces)):
        if n:
            G = _gradients(plate, z[n])
            back = z[n] - z[n - 1]
            rhs = forces[n] - K @ z[n] + 2 / dt**2 * M * back
            rhs -= (loss.rest * y + pull @ e) @ G
            if damped:
                rhs -= B @ (pull @ d)
            _, change, failed = dposv(base + hardening * (G.T @ G), rhs)
            if failed:
                raise ArithmeticError(f"step {n} of dt = {dt:g} s is not finite; lower the load")
            z[n + 1] = z[n - 1] + change
            stretched = G @ z[n + 1] / 2
            if damped:
                d = remembered * d + change / 2 / slower
                e = remembered * e + (stretched - y) / slower
            y = stretched
        v = (z[n + 1] - z[n]) / dt
        energy[n] = (v @ (M * v) + z[n + 1] @ K @ z[n] + loss.rest * (y @ y)) / 2
        if damped:
            energy[n] += loss.shares @ (((d @ B) * d).sum(axis=1) + (e * e).sum(axis=1)) / 2
    return Motion(coordinates=z, energy=energy)


def _gradients(plate: KarmanPlate, z: Floats) -> Floats:
    """Derivatives (k, r) of the states of stress y by the coordinates z (r,): H z."""
    return (plate.stacked @ z).reshape(-1, len(z))


def _stiffness_at_rest(plate: KarmanPlate, rest: float) -> Floats:
    """Stiffness (r, r) in rad2/s2 of slow motion."""
    return np.asarray(np.diag(plate.squared) + (rest - 1) * plate.bending)
