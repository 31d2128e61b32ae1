"""Where the work of a load has gone.

    work = kinetic + elastic + dissipated,  dissipated = int v^T C v dt

C holds the loss in the material as well as what absorbing facets let out. Average acceleration
keeps this balance to round-off (Hughes, The Finite Element Method, 1987, section 9.1), whatever
the time step, so that an imbalance is a mistake in the solution and not in the step.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fem.assembly import Operators
from fem.transient import State
from meshes.tetmesh import Floats


@dataclass(frozen=True, kw_only=True)
class Spent:
    """Work of the load since the start and what of it was dissipated, in J."""

    work: float = 0.0
    dissipated: float = 0.0


def audited(
    operators: Operators, states: Iterator[State], force: Callable[[float], Floats]
) -> Iterator[tuple[State, Spent]]:
    """States from rest, each with what was spent so far, for one product with C a step.

    Parameters
    ----------
    force : time in s -> nodal forces (3 n,) in N, the ones that drive the states
    """
    C, free = operators.C, operators.free
    before, spent = next(states), Spent()
    f = force(before.time)[free]
    yield before, spent
    for state in states:
        f_next = force(state.time)[free]
        moved = (state.displacement - before.displacement)[free]
        velocity = (state.velocity + before.velocity)[free] / 2
        dt = state.time - before.time
        spent = Spent(
            work=spent.work + float(moved @ (f + f_next)) / 2,
            dissipated=spent.dissipated + dt * float(velocity @ (C @ velocity)),
        )
        yield state, spent
        before, f = state, f_next


def imbalance(operators: Operators, state: State, spent: Spent) -> float:
    """Energy that is missing or too much in a state, relative to all that went round."""
    u, v = state.displacement[operators.free], state.velocity[operators.free]
    stored = float(u @ (operators.K @ u) + v @ (operators.M @ v)) / 2
    size = max(abs(spent.work), stored + spent.dissipated)
    return abs(spent.work - stored - spent.dissipated) / size if size > 0 else 0.0


def power_imbalance(
    C: Floats, forces: NDArray[np.complex128], motion: NDArray[np.complex128], frequencies: Floats
) -> float:
    """Mean power of lines that is neither put in by the load nor dissipated, relative to either.

    Parameters
    ----------
    C : (n, n) damping, dense or sparse
    forces, motion : (f, n) complex amplitudes of the load in N and of the displacement in metre
    frequencies : (f,) float, Hz
    """
    w = 2 * np.pi * frequencies
    supplied = (w[:, None] * np.imag(forces * motion.conj())).sum(axis=1) / 2
    # For the real matrix C, u^H C u is the sum over the real and the imaginary part.
    lost = np.array([u.real @ (C @ u.real) + u.imag @ (C @ u.imag) for u in motion]) * w**2 / 2
    size = max(float(np.abs(supplied).sum()), float(lost.sum()))
    return float(abs(supplied.sum() - lost.sum())) / size if size > 0 else 0.0
