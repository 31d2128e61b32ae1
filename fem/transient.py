"""Generalized-alpha time integration from rest of M u'' + C u' + K u + sum_j K_j d_j = f(t), d_j' =
u' - d_j / tau_j.

Chung and Hulbert, J Appl Mech 60:371 (1993), doi 10.1115/1.2900803. Spectral radius 1 is average
acceleration (Newmark 1/4, 1/2), which conserves energy; 0 annihilates what the time step cannot
resolve. The internal variables d_j of Maxwell branches are integrated by the trapezoidal rule.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.sparse.linalg import cg

from fem.assembly import Operators
from fem.linear_solver import factorise
from fem.maxwell import branch_force, relaxing_stiffness, with_internal
from fem.typing import Floats


class Diverged(ArithmeticError):
    """A computation that diverged or did not converge."""


@dataclass(frozen=True, kw_only=True, eq=False)
class State:
    """State at a time in s: displacement, velocity and acceleration (3 n,) in m, m/s and m/s2, and
    the internal variables `stretch` (3 n,) in m of the Maxwell branches, none if all are relaxed.
    """

    time: float
    displacement: Floats
    velocity: Floats
    acceleration: Floats
    stretch: tuple[Floats, ...] = ()


def transient(
    operators: Operators,
    force: Callable[[float], Floats],
    dt: float,
    *,
    spectral_radius: float = 1.0,
    initial: State | None = None,
    solver: str = "auto",
) -> Iterator[State]:
    """Time integration by the generalized-alpha method, without end.

    Parameters
    ----------
    operators : Operators
    force : time in s -> nodal forces (3 n,) in N
    dt : float, s
    spectral_radius : 0 to 1, factor per step on the amplitude of motion far above 1/dt
    initial : state to start from; at rest at time 0 if not given
    solver : of `linear_solver.factorise`

    Yields
    ------
    State
        At 0, dt, 2 dt, ...

    Raises
    ------
    ValueError
        If dt or the spectral radius is out of range.
    Diverged
        If the displacement is not finite.
    """
    a_m, a_f, beta, gamma = weights(dt, spectral_radius)
    K, C, M, free = operators.K, operators.C, operators.M, operators.free
    branches = with_internal(operators.branches)
    stiff = K + relaxing_stiffness(branches, 2 / dt)  # s of the trapezoidal rule
    system = (1 - a_m) * M + (1 - a_f) * (gamma * dt * C + beta * dt**2 * stiff)
    factor = factorise(system, backend=solver)
    shares = np.array([[branch.share(2 / dt)] for branch in branches]).reshape(-1, 1)

    start = initial or at_rest(operators.n_dofs)
    u, v = start.displacement[free], start.velocity[free]
    d = np.array([part[free] for part in start.stretch]) if start.stretch else 0 * shares * u
    f = force(start.time)[free]
    a = acceleration(operators, f - C @ v - K @ u - branch_force(branches, d))
    step = 0
    while True:
        time = start.time + step * dt
        if not np.isfinite(u).all():
            raise Diverged(
                f"displacement is not finite at t = {time:g} s, step {step} of dt = {dt:g} s; "
                "check the load and the material"
            )
        yield State(
            time=time,
            displacement=operators.expand(u),
            velocity=operators.expand(v),
            acceleration=operators.expand(a),
            stretch=tuple(map(operators.expand, d)),
        )
        step += 1
        f_next = force(start.time + step * dt)[free]
        u_next = u + dt * v + dt**2 * (0.5 - beta) * a
        v_next = v + dt * (1 - gamma) * a
        d_next = (2 * shares - 1) * d + shares * (u_next - u)
        inner = (1 - a_f) * f_next + a_f * f - a_m * (M @ a)
        inner -= K @ ((1 - a_f) * u_next + a_f * u) + C @ ((1 - a_f) * v_next + a_f * v)
        inner -= branch_force(branches, (1 - a_f) * d_next + a_f * d)
        a = factor.solve(inner)
        u, v, f = u_next + dt**2 * beta * a, v_next + dt * gamma * a, f_next
        d = d_next + shares * (dt**2 * beta * a)


def weights(dt: float, spectral_radius: float) -> tuple[float, float, float, float]:
    """Generalized-alpha parameters a_m, a_f, beta and gamma (Chung and Hulbert 1993).

    Raises
    ------
    ValueError
        If dt or the spectral radius is out of range.
    """
    if not (np.isfinite(dt) and dt > 0):
        raise ValueError(f"dt = {dt} s must be a finite number above 0")
    if not 0 <= spectral_radius <= 1:
        raise ValueError(f"spectral_radius = {spectral_radius} is outside 0..1; 1 conserves energy")
    a_m = (2 * spectral_radius - 1) / (spectral_radius + 1)
    a_f = spectral_radius / (spectral_radius + 1)
    return a_m, a_f, (1 - a_m + a_f) ** 2 / 4, 0.5 - a_m + a_f


def at_rest(n_dofs: int) -> State:
    """State of rest at time 0: no displacement, velocity or acceleration."""
    zero = np.zeros(n_dofs)
    return State(time=0.0, displacement=zero, velocity=zero, acceleration=zero)


def acceleration(operators: Operators, unbalanced: Floats) -> Floats:
    """Acceleration M^-1 r by conjugate gradients: a consistent mass matrix scaled by its diagonal
    is well-conditioned.
    """
    if not unbalanced.any():
        return np.zeros_like(unbalanced)
    scale = 1 / np.sqrt(operators.M.diagonal())
    scaled = operators.M.multiply(scale).T.multiply(scale).tocsr()
    size = 2.0 ** np.frexp(np.abs(unbalanced).max())[1]  # squares of tiny loads would be 0
    a, failed = cg(scaled, scale * (unbalanced / size), rtol=1e-13, atol=0.0, maxiter=500)
    if failed:
        raise Diverged("the mass matrix could not be inverted; are all densities above 0?")
    return scale * a * size
