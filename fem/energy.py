"""Energy balance: the work of a load and where it has gone.

    work = kinetic + elastic + dissipated + radiated
    dissipated + radiated = int v^T C v dt + sum_j int d_j^T K_j d_j dt / tau_j

for a linear body, where C contains R, the damping of absorbing boundaries. Average acceleration
satisfies this balance to round-off, whatever the time step (Hughes, The Finite Element Method,
1987, chapter 9), so that an imbalance is an error of the solution and not of the step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse

from fem.assembly import Operators
from fem.maxwell import Branch, MaxwellBranch, with_internal
from fem.transient import State
from fem.typing import Complex, Floats

ROUND_OFF = 1e-6  # of the reactive power
TINY = np.finfo(np.float64).tiny / np.finfo(np.float64).eps  # numbers below it lose digits


@dataclass(frozen=True, kw_only=True, eq=False)
class Relaxing:
    """Maxwell branches of j relaxation `times` in s, whose springs are stretched by d (j, ...),
    d' = e' - d / times, of a strain e (...) = `strain(u)`. `force(u, d)` (n_free,) in N is theirs
    together, `tangent(u, shares)` in N/m its derivative about d = shares (j,) of e, and
    `energy(d)` (j,) in J what each stores.
    """

    times: Floats
    strain: Callable[[Floats], Floats]
    force: Callable[[Floats, Floats], Floats]
    tangent: Callable[[Floats, Floats], Any]
    energy: Callable[[Floats], Floats]

    @staticmethod
    def linear(branches: Sequence[MaxwellBranch]) -> Relaxing:
        """Branches whose strain is the displacement."""
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
    """Elastic body: its forces at a displacement u (n_free,) in metre of its free dofs.

    `internal(u)` (n_free,) in N at equilibrium, its `tangent(u)` (n_free, n_free) in N/m,
    `viscous(u, v)` (n_free,) in N at a velocity v (n_free,) in m/s, and the stored `energy(u)` in
    J; `relaxing` branches beside it; `operators` is the linearisation at rest.
    """

    operators: Operators
    internal: Callable[[Floats], Floats]
    tangent: Callable[[Floats], sparse.csr_array]
    viscous: Callable[[Floats, Floats], Floats]
    energy: Callable[[Floats], float]
    relaxing: tuple[Relaxing, ...] = ()

    @staticmethod
    def linear(operators: Operators) -> Elastic:
        """A body at small displacement."""
        K, C = operators.K, operators.C
        branches = with_internal(operators.branches)
        return Elastic(
            operators=operators, internal=lambda u: K @ u, tangent=lambda u: K,
            viscous=lambda u, v: C @ v, energy=lambda u: float(u @ (K @ u)) / 2,
            relaxing=(Relaxing.linear(branches),) if branches else (),
        )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class EnergyBalance:
    """Energy balance of a load in J (or its mean power in W): its work, what the material
    dissipated, what absorbing boundaries took; and for mean powers the apparent power exchanged.
    """

    work: float = 0.0
    dissipated: float = 0.0
    radiated: float = 0.0
    exchanged: float = 0.0

    def __add__(self, other: EnergyBalance) -> EnergyBalance:
        return EnergyBalance(
            work=self.work + other.work,
            dissipated=self.dissipated + other.dissipated,
            radiated=self.radiated + other.radiated,
            exchanged=self.exchanged + other.exchanged,
        )

    @property
    def lost(self) -> float:
        """Energy that has left the body, as heat or through absorbing boundaries."""
        return self.dissipated + self.radiated


def with_energy_balance(
    body: Elastic | Operators, states: Iterator[State], force: Callable[[float], Floats]
) -> Iterator[tuple[State, EnergyBalance]]:
    """Add the energy balance to the states of a time integration by average acceleration.

    Parameters
    ----------
    body : Elastic, or Operators of a linear body
    states : of `transient` or `nonlinear.dynamic`
    force : nodal forces (3 n,) in N by time in s, which drive them

    Yields
    ------
    State, and its energy balance since the first in J
    """
    body = body if isinstance(body, Elastic) else Elastic.linear(body)
    R, free = body.operators.R, body.operators.free
    before, spent = next(states), EnergyBalance()
    f = force(before.time)[free]
    yield before, spent
    for state in states:
        f_next, dt = force(state.time)[free], state.time - before.time
        moved = (state.displacement - before.displacement)[free]
        middle = (state.displacement + before.displacement)[free] / 2
        radiated = float(moved @ (R @ moved)) / dt
        dissipated = float(moved @ body.viscous(middle, moved)) / dt - radiated
        for part, old, new in zip(body.relaxing, before.stretch, state.stretch, strict=True):
            dissipated += dt * float((2 / part.times) @ part.energy((old + new) / 2))
        work = float(moved @ (f + f_next)) / 2
        spent += EnergyBalance(work=work, dissipated=dissipated, radiated=radiated)
        yield state, spent
        before, f = state, f_next


def stored(body: Elastic | Operators, state: State) -> float:
    """Elastic and kinetic energy of a state in J."""
    body = body if isinstance(body, Elastic) else Elastic.linear(body)
    ops = body.operators
    u, v = state.displacement[ops.free], state.velocity[ops.free]
    stretched = zip(body.relaxing, state.stretch, strict=bool(state.stretch))
    springs = sum(float(part.energy(d).sum()) for part, d in stretched)
    return float(v @ (ops.M @ v)) / 2 + body.energy(u) + springs


def imbalance(spent: EnergyBalance, stored: float = 0.0) -> float:
    """Relative error of the energy balance, of which `stored` in J since its start. Round-off of
    the reactive power is no imbalance, nor is that of numbers too small for their digits.
    """
    size = max(abs(spent.work), abs(stored) + spent.lost, ROUND_OFF * spent.exchanged)
    return abs(spent.work - stored - spent.lost) / size if size > TINY else 0.0


def mean_power(
    C: Floats,
    R: Floats,
    forces: Complex,
    motion: Complex,
    frequencies: Floats,
    branches: Sequence[Branch] = (),
) -> EnergyBalance:
    """Mean power balance in W of all spectral lines of a load together, by the damping C and R (n,
    n) and Maxwell branches, and complex amplitudes (f, n) of forces in N and motion in metre at
    frequencies (f,) in Hz.
    """
    w = 2 * np.pi * frequencies
    apparent = w * (forces * motion.conj()).sum(axis=1) / 2
    supplied = float(apparent.imag.sum())
    velocity = w[:, None] * motion

    def taken(D: Floats, lag: Floats) -> float:
        """Mean power of the forces lag (f,) D v."""
        # For a real matrix u^H D u is the sum over the real and the imaginary part.
        parts = zip(lag, velocity, strict=True)
        return sum(t * float(x @ (D @ x)) for t, v in parts for x in (v.real, v.imag)) / 2

    always = np.ones(len(w))
    radiated = taken(R, always)
    relaxed = sum(taken(b.K, b.lag(w)) for b in branches)
    dissipated = taken(C, always) - radiated + relaxed
    exchanged = float(np.abs(apparent).sum())
    return EnergyBalance(
        work=supplied, dissipated=dissipated, radiated=radiated, exchanged=exchanged
    )
