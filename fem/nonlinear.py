"""Nonlinear statics and dynamics at large displacement: M u'' + f_int(u, u', d) = f(t, u).

Statics by Newton's method with a line search, in load steps if need be. Dynamics by the
generalized-alpha method of `transient` with the internal force weighted between the ends of a step,

    M [(1 - a_m) a' + a_m a] + (1 - a_f) [f_int(u', v') - f'] + a_f [f_int(u, v) - f] = 0

with the stretches d of Maxwell branches at their ends, by the trapezoidal rule (Belytschko, Liu and
Moran, Nonlinear Finite Elements for Continua and Structures (2000), chapter 6). One factorisation
serves as many steps as Newton's method converges with it (modified Newton). Average acceleration
conserves energy to second order in the step.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import count

import numpy as np

from fem.energy import EnergyBalance, with_losses
from fem.finite_strain import Elastic
from fem.linear_solver import Factor, factorise
from fem.transient import Diverged, State, acceleration, at_rest, weights
from fem.typing import Floats

MOST_ITERATIONS = 25
MOST_HALVINGS = 6  # of a load or time step
SLOW = 0.3  # of a correction, beyond which the next one calls for another tangent
ROUND_OFF = 1e-5  # of the load: a residual below it is assessed by the correction it calls for
STANDSTILL = 1e-6  # of the displacement: a step below it counts as none


class _Stuck(ArithmeticError):
    """Newton's method did not converge; its argument is the relative residual."""


def static(
    body: Elastic,
    force: Floats,
    *,
    start: Floats | None = None,
    tolerance: float = 1e-8,
    solver: str = "auto",
) -> Floats:
    """Static displacement under a force applied in as few load steps as converge.

    Parameters
    ----------
    body : Elastic
    force : (3 n,) in N
    start : (3 n,) in metre, initial guess; undeformed if not given
    tolerance : residual relative to the force; or, of a residual below `ROUND_OFF`, the
        correction that it calls for, relative to the displacement
    solver : of `linear_solver.factorise`

    Returns
    -------
    (3 n,) float, metre

    Raises
    ------
    Diverged
        If Newton's method does not converge even in steps of 1/64 of the load.
    """
    operators = body.operators
    free = operators.free
    u = np.zeros(len(free)) if start is None else start[free]
    reached, part = 0.0, 1.0
    while reached < 1:
        target = min(1.0, reached + part)

        def unbalanced(u: Floats, share: float = target) -> tuple[Floats, float]:
            f = share * force[free]
            return f - body.internal(u), float(np.linalg.norm(f))

        try:
            u = _newton(body, unbalanced, u, tolerance, solver)
        except _Stuck as stuck:
            part /= 2
            if part < 0.5**MOST_HALVINGS:
                raise Diverged(
                    f"no equilibrium was found at {100 * target:.3g} % of the load: a residual of "
                    f"{stuck.args[0]:.2g} of it is left, above {tolerance:g}, after load steps of "
                    f"1/{2**MOST_HALVINGS}; lower the load, or refine the mesh where it bends most"
                ) from None
        else:
            reached, part = target, 2 * part
    return operators.expand(u)


def _newton(
    body: Elastic,
    unbalanced: Callable[[Floats], tuple[Floats, float]],
    u: Floats,
    tolerance: float,
    solver: str,
) -> Floats:
    left = np.inf
    for _ in range(MOST_ITERATIONS):
        r, size = unbalanced(u)
        left = float(np.linalg.norm(r)) / (size or 1.0)
        if not np.isfinite(left):
            break
        if left <= tolerance:
            return u
        try:
            step = factorise(body.tangent(u), backend=solver).solve(r)
        except ValueError:  # no longer positive definite: too far from the solution
            break
        # The residual of thin bodies ends as round-off of forces that cancel: it moves nothing.
        size = float(np.linalg.norm(u))
        if left <= ROUND_OFF and float(np.linalg.norm(step)) <= tolerance * size:
            return u + step
        if float(step @ r) <= 0.0:  # nor is it for solvers that do not tell
            break
        u = u + _line_search(unbalanced, u, step) * step
    raise _Stuck(left)


def _line_search(
    unbalanced: Callable[[Floats], tuple[Floats, float]], u: Floats, step: Floats
) -> float:
    """Line search: the fraction of a step at which the residual does no more work along it."""
    from scipy.optimize import brentq  # which takes long to import

    def work(part: float) -> float:
        return float(step @ unbalanced(u + part * step)[0])

    start, end = work(0.0), work(1.0)
    if end >= -0.5 * start or not np.isfinite(end):
        return 1.0
    return float(brentq(work, 0.0, 1.0, xtol=0.02, rtol=0.02))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Now:
    """Free components of a state, with the load and the internal force; the strain and stretch of
    each kind of Maxwell branches.
    """

    t: float
    u: Floats
    v: Floats
    a: Floats
    force: Floats
    internal: Floats
    strain: tuple[Floats, ...]
    stretch: tuple[Floats, ...]


def dynamic(
    body: Elastic,
    force: Callable[[float], Floats],
    dt: float,
    *,
    spectral_radius: float = 1.0,
    initial: State | None = None,
    tolerance: float = 1e-3,
    solver: str = "auto",
) -> Iterator[State]:
    """Time integration by generalized-alpha and Newton's method, without end.

    A step for which Newton's method does not converge is made of two halves, and so on.

    Parameters
    ----------
    body : Elastic
    force : time in s -> nodal forces (3 n,) in N
    dt : float, s
    spectral_radius : 0 to 1, factor per step on the amplitude of motion far above 1/dt
    initial : displacement and velocity to start from; at rest at time 0 if not given
    tolerance : the last correction of a step's displacement, relative to that displacement
    solver : of `linear_solver.factorise`

    Yields
    ------
    State
        At 0, dt, 2 dt, ..., with the stretches (j, ...) of each of `body.relaxing`.

    Raises
    ------
    ValueError
        If dt or the spectral radius is out of range.
    Diverged
        If Newton's method does not converge even in 64 parts of a step.
    """
    scheme = weights(dt, spectral_radius)
    free, start = body.operators.free, initial or at_rest(body.operators.n_dofs)
    u, v = start.displacement[free], start.velocity[free]
    f, internal = force(start.time)[free], body.internal(u)
    strain = tuple(part.strain(u) for part in body.relaxing)
    stretch = start.stretch or tuple(
        np.zeros((len(part.times), *e.shape)) for part, e in zip(body.relaxing, strain, strict=True)
    )
    internal = internal + body.viscous(u, v) + _relaxing_force(body, u, stretch)
    a = acceleration(body.operators, f - internal)
    now = _Now(t=start.time, u=u, v=v, a=a, force=f, internal=internal,
               strain=strain, stretch=stretch)  # fmt: skip
    march = _March(body=body, force=force, scheme=scheme, tolerance=tolerance, solver=solver)
    factors: dict[float, Factor] = {}
    for step in count(1):
        yield _state(body, now)
        try:
            now = _advance(march, now, start.time + step * dt, factors, 0)
        except _Stuck as stuck:
            raise Diverged(
                f"step {step} of dt = {dt:g} s, to t = {start.time + step * dt:g} s, did not "
                f"converge even in {2**MOST_HALVINGS} parts: a residual of {stuck.args[0]:.2g} of "
                f"the load is left, with corrections above {tolerance:g} of a part; shorten dt or "
                "lower the load"
            ) from None


@dataclass(frozen=True, kw_only=True, eq=False)
class _March:
    """Body, load, scheme, tolerance and solver of a time integration, the same in every step."""

    body: Elastic
    force: Callable[[float], Floats]
    scheme: tuple[float, float, float, float]
    tolerance: float
    solver: str


def _advance(
    march: _March, now: _Now, until: float, factors: dict[float, Factor], halvings: int
) -> _Now:
    try:
        return _step(march, now, until, factors, halvings)
    except _Stuck:
        factors.pop(halvings, None)
        if halvings == MOST_HALVINGS:
            raise
    middle = _advance(march, now, (now.t + until) / 2, factors, halvings + 1)
    return _advance(march, middle, until, factors, halvings + 1)


def _step(
    march: _March, now: _Now, until: float, factors: dict[float, Factor], halvings: int
) -> _Now:
    """One step by Newton's method, with the factorisation cached by `halvings` while it
    converges.
    """
    body, (a_m, a_f, beta, gamma) = march.body, march.scheme
    C, M, free = body.operators.C, body.operators.M, body.operators.free
    dt, a, before, residual = until - now.t, now.a, np.inf, np.inf
    shares = [2 * part.times / (dt + 2 * part.times) for part in body.relaxing]
    predicted = now.u + dt * now.v + dt**2 * (0.5 - beta) * now.a
    f = march.force(until)[free]
    load = (1 - a_f) * f + a_f * now.force
    for _ in range(MOST_ITERATIONS):
        u = predicted + dt**2 * beta * a
        v = now.v + dt * ((1 - gamma) * now.a + gamma * a)
        _, stretch = _relaxed(body, now, u, shares)
        internal = body.internal(u) + body.viscous(u, v) + _relaxing_force(body, u, stretch)
        r = load - M @ ((1 - a_m) * a + a_m * now.a) - (1 - a_f) * internal - a_f * now.internal
        residual = float(np.linalg.norm(r) / (np.linalg.norm(load) or 1.0))
        if not np.isfinite(residual):
            break
        if halvings not in factors:
            K = body.tangent(u)
            for part, share in zip(body.relaxing, shares, strict=True):
                K = K + part.tangent(u, share)
            system = (1 - a_m) * M + (1 - a_f) * dt * (gamma * C + beta * dt * K)
            try:
                factors[halvings] = factorise(system, backend=march.solver)
            except ValueError:
                break
        change = factors[halvings].solve(r)
        a = a + change
        sizes = (u - now.u, dt**2 * beta * a, STANDSTILL * u)
        step = max(float(np.linalg.norm(size)) for size in sizes)
        left = dt**2 * beta * float(np.linalg.norm(change)) / (step or 1.0)
        shrinks = left <= max(SLOW * before, march.tolerance / 100)
        if left <= march.tolerance and (shrinks or before <= march.tolerance):
            # One more residual would only confirm what this correction leaves: its square or, with
            # an old tangent, a small part of it. The balance of forces stands for it.
            u, v = u + dt**2 * beta * change, v + dt * gamma * change
            internal = (load - M @ ((1 - a_m) * a + a_m * now.a) - a_f * now.internal) / (1 - a_f)
            strain, stretch = _relaxed(body, now, u, shares)
            return _Now(t=until, u=u, v=v, a=a, force=f, internal=internal,
                        strain=strain, stretch=stretch)  # fmt: skip
        if left > SLOW * before:
            factors.pop(halvings)
        before = left
    raise _Stuck(residual)


def _relaxed(
    body: Elastic, now: _Now, u: Floats, shares: list[Floats]
) -> tuple[tuple[Floats, ...], tuple[Floats, ...]]:
    """Strains and stretches of the branches at the end of a step, at a displacement u."""
    strain = tuple(part.strain(u) for part in body.relaxing)
    each = zip(shares, now.stretch, now.strain, strain, strict=True)
    return strain, tuple(
        np.multiply.outer(2 * x - 1, np.ones_like(new)) * d + np.multiply.outer(x, new - old)
        for x, d, old, new in each
    )


def _relaxing_force(body: Elastic, u: Floats, stretch: tuple[Floats, ...]) -> Floats:
    each = zip(body.relaxing, stretch, strict=True)
    return sum((part.force(u, d) for part, d in each), np.zeros_like(u))


def _state(body: Elastic, now: _Now) -> State:
    expand = body.operators.expand
    return State(
        time=now.t, displacement=expand(now.u), velocity=expand(now.v), acceleration=expand(now.a),
        stretch=now.stretch,
    )  # fmt: skip


def total_energy(body: Elastic, state: State) -> float:
    """Kinetic and stored energy of a state in J."""
    free = body.operators.free
    v = state.velocity[free]
    stretched = zip(body.relaxing, state.stretch, strict=bool(state.stretch))
    springs = sum(float(part.energy(d).sum()) for part, d in stretched)
    moving = float(v @ (body.operators.M @ v)) / 2
    return moving + body.energy(state.displacement[free]) + springs


def with_energy_balance(
    body: Elastic, states: Iterator[State], force: Callable[[float], Floats]
) -> Iterator[tuple[State, EnergyBalance]]:
    """States of `dynamic`, each with the energy balance in J since the first, under the nodal
    forces (3 n,) in N of a time that drive them.
    """
    free = body.operators.free

    def lost(before: State, state: State) -> EnergyBalance:
        moved = (state.displacement - before.displacement)[free]
        middle = (state.displacement + before.displacement)[free] / 2
        dt = state.time - before.time
        dissipated = float(moved @ body.viscous(middle, moved)) / dt
        both = zip(body.relaxing, before.stretch, state.stretch, strict=True)
        for part, old, new in both:
            dissipated += dt * float((2 / part.times) @ part.energy((old + new) / 2))
        return EnergyBalance(dissipated=dissipated)

    return with_losses(states, force, free, lost)
