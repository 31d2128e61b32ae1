"""Energy balance: the work of a load, and the energy that it becomes.

    work = kinetic + elastic + dissipated + radiated
    dissipated + radiated = int v^T C v dt + sum_j int d_j^T K_j d_j dt / tau_j

for a linear body, where C contains R, the damping of absorbing boundaries. Average acceleration
satisfies this balance to round-off for any time step (Hughes, The Finite Element Method, 1987,
chapter 9), so an imbalance is an error of the solution, not of the step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from scipy import sparse

from fem.assembly import Operators
from fem.maxwell import Branch, MaxwellBranch, maxwell_only
from fem.transient import State
from simple_model.typing import Complex, Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class Relaxing:
    """Maxwell branches with j relaxation `times` in s and stretches d (j, ...), d' = e' - d /
    times, of a strain e (...) = `strain(u)`. `force(u, d)` (n_free,) in N is their total force,
    `tangent(u, shares)` in N/m its derivative for d = shares (j,) times e, and `energy(d)` (j,) in
    J their stored energy.
    """

    times: Floats
    strain: Callable[[Floats], Floats]
    force: Callable[[Floats, Floats], Floats]
    tangent: Callable[[Floats, Floats], Any]
    energy: Callable[[Floats], Floats]

    @staticmethod
    def linear(branches: Sequence[MaxwellBranch]) -> Relaxing:
        """Return branches whose strain is the displacement."""
        each = [branch.K for branch in branches]

        def force(u: Floats, d: Floats) -> Floats:
            return np.asarray(sum(K @ x for K, x in zip(each, d, strict=True)))

        return Relaxing(
            times=np.array([branch.time for branch in branches]), strain=lambda u: u, force=force,
            tangent=lambda u, shares: sum(x * K for x, K in zip(shares, each, strict=True)),
            energy=lambda d: np.array([x @ (K @ x) / 2 for x, K in zip(d, each, strict=True)]),
        )  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class Elastic:
    """Forces of a body as functions of the displacement u (n_free,) in m of its free dofs.

    Parameters
    ----------
    operators : linearisation at rest
    internal : u -> (n_free,) equilibrium force, N
    tangent : u -> (n_free, n_free) sparse, its derivative, N/m
    viscous : u, velocity (n_free,) in m/s -> (n_free,) force, N
    energy : u -> stored energy, J
    relaxing : further Maxwell branches
    """

    operators: Operators
    internal: Callable[[Floats], Floats]
    tangent: Callable[[Floats], sparse.csr_array]
    viscous: Callable[[Floats, Floats], Floats]
    energy: Callable[[Floats], float]
    relaxing: tuple[Relaxing, ...] = ()

    @staticmethod
    def linear(operators: Operators) -> Elastic:
        """Return a body at small displacement."""
        K, C = operators.K, operators.C
        branches = maxwell_only(operators.branches)
        return Elastic(
            operators=operators, internal=lambda u: K @ u, tangent=lambda u: K,
            viscous=lambda u, v: C @ v, energy=lambda u: float(u @ (K @ u)) / 2,
            relaxing=(Relaxing.linear(branches),) if branches else (),
        )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class EnergyBalance:
    """Energies of a load in J, or mean powers in W: its work, the energy dissipated in the material
    and radiated through absorbing boundaries; for mean powers also the apparent power `exchanged`.
    """

    work: float = 0.0
    dissipated: float = 0.0
    radiated: float = 0.0
    exchanged: float = 0.0

    def __add__(self, other: EnergyBalance) -> EnergyBalance:
        names = [field.name for field in fields(self)]
        return EnergyBalance(**{x: getattr(self, x) + getattr(other, x) for x in names})

    @property
    def lost(self) -> float:
        """Energy lost as heat or through absorbing boundaries."""
        return self.dissipated + self.radiated


def with_energy_balance(
    body: Elastic | Operators, states: Iterator[State], force: Callable[[float], Floats]
) -> Iterator[tuple[State, EnergyBalance]]:
    """Add the energy balance to the states of a time integration by average acceleration.

    Parameters
    ----------
    body : Elastic, or Operators of a linear body
    states : states of `transient` or `nonlinear.dynamic`
    force : the function of time that drives them and returns nodal forces (3 n,) in N

    Yields
    ------
    State, EnergyBalance
        The balance in J since the first state.
    """
    body = body if isinstance(body, Elastic) else Elastic.linear(body)
    R, free = body.operators.R, body.operators.free
    before, spent = next(states), EnergyBalance()
    f = force(before.time)[free]
    yield before, spent
    for state in states:
        f_next, dt = force(state.time)[free], state.time - before.time
        change = (state.displacement - before.displacement)[free]
        middle = (state.displacement + before.displacement)[free] / 2
        radiated = float(change @ (R @ change)) / dt
        dissipated = float(change @ body.viscous(middle, change)) / dt - radiated
        for part, old, new in zip(body.relaxing, before.stretch, state.stretch, strict=True):
            dissipated += dt * float((2 / part.times) @ part.energy((old + new) / 2))
        work = float(change @ (f + f_next)) / 2
        spent += EnergyBalance(work=work, dissipated=dissipated, radiated=radiated)
        yield state, spent
        before, f = state, f_next


def mechanical_energy(body: Elastic | Operators, state: State) -> float:
    """Return the elastic and kinetic energy in J of a state; the body may be linear `Operators`."""
    body = body if isinstance(body, Elastic) else Elastic.linear(body)
    ops = body.operators
    u, v = state.displacement[ops.free], state.velocity[ops.free]
    branches = zip(body.relaxing, state.stretch, strict=bool(state.stretch))
    springs = sum(float(part.energy(d).sum()) for part, d in branches)
    return float(v @ (ops.M @ v)) / 2 + body.energy(u) + springs


def imbalance(spent: EnergyBalance, stored: float = 0.0) -> float:
    """Return the error of an energy balance relative to its largest part.

    `stored` is the energy in J that the body has gained. Round-off, of tiny numbers or of the
    reactive power, is ignored.
    """
    round_off = 1e-6  # of the reactive power
    size = max(abs(spent.work), abs(stored) + spent.lost, round_off * spent.exchanged)
    tiny = np.finfo(np.float64).tiny / np.finfo(np.float64).eps  # smaller numbers lose digits
    return abs(spent.work - stored - spent.lost) / size if size > tiny else 0.0


def mean_power(
    C: Floats,
    R: Floats,
    forces: Complex,
    motion: Complex,
    frequencies: Floats,
    branches: Sequence[Branch] = (),
) -> EnergyBalance:
    """Return the mean power balance in W of all spectral lines of a load.

    `C`, `R` (n, n) and branches are those of `Operators`; `forces` in N and `motion` in m are
    complex amplitudes (f, n) at frequencies (f,) in Hz.
    """
    w = 2 * np.pi * frequencies
    apparent = w * (forces * motion.conj()).sum(axis=1) / 2
    supplied = float(apparent.imag.sum())
    velocity = w[:, None] * motion

    def power(D: Floats, lag: Floats) -> float:
        """Return the mean power of the forces lag (f,) D v."""
        # For a real matrix u^H D u is the sum over the real and the imaginary part.
        parts = zip(lag, velocity, strict=True)
        return sum(t * float(x @ (D @ x)) for t, v in parts for x in (v.real, v.imag)) / 2

    always = np.ones(len(w))
    radiated = power(R, always)
    dissipated = power(C, always) - radiated + sum(power(b.K, b.lag(w)) for b in branches)
    exchanged = float(np.abs(apparent).sum())
    return EnergyBalance(
        work=supplied, dissipated=dissipated, radiated=radiated, exchanged=exchanged
    )
