"""Time integration by average acceleration.

    M u'' + C u' + K u + sum_j K_j d_j = f(t),   d_j' = u' - d_j / tau_j

Newmark, J Eng Mech Div ASCE 85:67 (1959), with beta = 1/4 and gamma = 1/2: second order, stable for
any step, without numerical damping. Forces are balanced in the mean of the ends of a step. The
trapezoidal rule integrates the internal variables d_j of Maxwell branches.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.sparse.linalg import cg

from fem.assembly import Operators
from fem.linear_solver import factorise
from fem.maxwell import branch_force, maxwell_only, relaxing_stiffness
from simple_model.typing import Floats


class Diverged(ArithmeticError):
    """A computation diverged or did not converge."""


@dataclass(frozen=True, kw_only=True, eq=False)
class State:
    """State of a body at one time.

    Parameters
    ----------
    time : s
    displacement, velocity, acceleration : (3 n,) float, m, m/s and m/s2
    stretch : internal variables (j, ...) of each kind of Maxwell branches; in `transient`,
        displacements (j, n_free) in m. Empty if all branches are relaxed.
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
    initial: State | None = None,
    solver: str = "auto",
) -> Iterator[State]:
    """Integrate in time by average acceleration, without end.

    Parameters
    ----------
    force : function of the time in s that returns nodal forces (3 n,) in N
    dt : time step, s
    initial : state to start from; at rest at time 0 by default
    solver : backend of `factorise`

    Yields
    ------
    State
        At 0, dt, 2 dt, ...

    Raises
    ------
    ValueError
        If dt is not a finite number above 0.
    Diverged
        If the displacement is not finite.

    Examples
    --------
    >>> from itertools import islice
    >>> import fem, meshes
    >>> mesh = meshes.block((0.02, 0.02, 0.01), 0.005)
    >>> ops = fem.assemble(mesh, fem.PRESETS["palm"], fixed="bottom")
    >>> step = fem.pressure_operator(mesh).sum(axis=1)  # 1 Pa on the whole top from t = 0
    >>> *_, last = islice(fem.transient(ops, lambda t: step, 2e-4), 51)  # to t = 10 ms
    >>> (1e9 * (fem.probe_operator(mesh, [[0.0, 0.0]]) @ last.displacement)).round(1)  # nm
    array([82.4])
    """
    check_step(dt)
    K, C, M, free = operators.K, operators.C, operators.M, operators.free
    branches = maxwell_only(operators.branches)
    stiff = K + relaxing_stiffness(branches, 2 / dt)  # s of the trapezoidal rule
    factor = factorise(M + dt / 2 * C + dt**2 / 4 * stiff, backend=solver)
    shares = np.array([[branch.share(2 / dt)] for branch in branches]).reshape(-1, 1)

    start = initial or at_rest(operators.n_dofs)
    u, v = start.displacement[free], start.velocity[free]
    d = start.stretch[0] if start.stretch else 0 * shares * u
    f = force(start.time)[free]
    a = acceleration(operators, f - C @ v - K @ u - branch_force(branches, d))
    step = 0
    while True:
        time = start.time + step * dt
        if not np.isfinite(u).all():
            raise Diverged(
                f"the displacement is not finite at t = {time:g} s, step {step} of dt = {dt:g} s; "
                "check the load and the material"
            )
        yield State(
            time=time, displacement=operators.expand(u), velocity=operators.expand(v),
            acceleration=operators.expand(a), stretch=(d,) if branches else (),
        )  # fmt: skip
        step += 1
        f_next = force(start.time + step * dt)[free]
        u_next, v_next = u + dt * v + dt**2 / 4 * a, v + dt / 2 * a
        d_next = (2 * shares - 1) * d + shares * (u_next - u)
        inner = f_next + f - M @ a - K @ (u_next + u) - C @ (v_next + v)
        a = factor.solve(inner - branch_force(branches, d_next + d))
        u, v, f = u_next + dt**2 / 4 * a, v_next + dt / 2 * a, f_next
        d = d_next + shares * (dt**2 / 4 * a)


def check_step(dt: float) -> None:
    """Raise a ValueError unless a time step is a finite number above 0."""
    if not (np.isfinite(dt) and dt > 0):
        raise ValueError(f"dt is {dt} s; give a finite number above 0")


def at_rest(n_dofs: int) -> State:
    """Return the state of rest at time 0."""
    zero = np.zeros(n_dofs)
    return State(time=0.0, displacement=zero, velocity=zero, acceleration=zero)


def acceleration(operators: Operators, unbalanced: Floats) -> Floats:
    """Return M^-1 r by conjugate gradients with a diagonal preconditioner."""
    if not unbalanced.any():
        return np.zeros_like(unbalanced)
    scale = 1 / np.sqrt(operators.M.diagonal())
    scaled = operators.M.multiply(scale).T.multiply(scale).tocsr()
    size = 2.0 ** np.frexp(np.abs(unbalanced).max())[1]  # squares of tiny loads would underflow
    a, failed = cg(scaled, scale * (unbalanced / size), rtol=1e-13, atol=0.0, maxiter=500)
    if failed:
        raise Diverged("the mass matrix could not be inverted; check that densities are above 0")
    return scale * a * size
