"""Energy balance: the work of a load and where it has gone.

    work = kinetic + elastic + dissipated + radiated
    dissipated + radiated = int v^T C v dt + sum_j int d_j^T K_j d_j dt / tau_j

C contains the loss in the material and R, the damping of absorbing boundaries. Average acceleration
satisfies this balance to round-off, whatever the time step (Hughes, The Finite Element Method,
1987, chapter 9), so that an imbalance is an error of the solution and not of the step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from fem.assembly import Operators
from fem.maxwell import Branch, with_internal
from fem.transient import State
from fem.typing import Complex, Floats, Ints

ROUND_OFF = 1e-6  # of the reactive power
TINY = np.finfo(np.float64).tiny / np.finfo(np.float64).eps  # numbers below it lose digits


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
    operators: Operators, states: Iterator[State], force: Callable[[float], Floats]
) -> Iterator[tuple[State, EnergyBalance]]:
    """Add the energy balance to the states of a transient solution.

    Parameters
    ----------
    operators : Operators
    states : of `transient`, from rest
    force : nodal forces (3 n,) in N by time in s, which drive them

    Yields
    ------
    State, and its energy balance so far in J
    """
    C, R, free = operators.C, operators.R, operators.free

    def lost(before: State, state: State) -> EnergyBalance:
        velocity = (state.velocity + before.velocity)[free] / 2
        dt = state.time - before.time
        out = dt * float(velocity @ (R @ velocity))
        viscous = dt * float(velocity @ (C @ velocity)) - out
        relaxed = 0.0
        both = zip(before.stretch, state.stretch, strict=True)
        for branch, (old, new) in zip(with_internal(operators.branches), both, strict=True):
            mean = (old + new)[free] / 2
            relaxed += dt / branch.time * float(mean @ (branch.K @ mean))
        return EnergyBalance(dissipated=viscous + relaxed, radiated=out)

    return with_losses(states, force, free, lost)


def with_losses(
    states: Iterator[State],
    force: Callable[[float], Floats],
    free: Ints,
    lost: Callable[[State, State], EnergyBalance],
) -> Iterator[tuple[State, EnergyBalance]]:
    """States of any body, each with the energy balance in J since the first, under nodal forces (3
    n,) of a time; `lost` are the losses between two successive states.
    """
    before, spent = next(states), EnergyBalance()
    f = force(before.time)[free]
    yield before, spent
    for state in states:
        f_next = force(state.time)[free]
        moved = (state.displacement - before.displacement)[free]
        spent += EnergyBalance(work=float(moved @ (f + f_next)) / 2) + lost(before, state)
        yield state, spent
        before, f = state, f_next


def stored(operators: Operators, state: State) -> float:
    """Elastic and kinetic energy of a state in J."""
    u, v = state.displacement[operators.free], state.velocity[operators.free]
    stretched = zip(operators.branches, state.stretch, strict=bool(state.stretch))
    springs = sum(d[operators.free] @ (b.K @ d[operators.free]) for b, d in stretched)
    return float(u @ (operators.K @ u) + v @ (operators.M @ v) + springs) / 2


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
    """Mean power balance of a load's spectral lines.

    Parameters
    ----------
    C, R : (n, n) damping, and the part of it in absorbing boundaries, dense or sparse
    forces, motion : (f, n) complex amplitudes of the load in N and of the displacement in metre
    frequencies : (f,) float, Hz
    branches : generalised Maxwell branches, of (n, n) each

    Returns
    -------
    EnergyBalance
        Of all lines together, W.
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
