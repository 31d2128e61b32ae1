"""Nonlinear statics and dynamics at large displacement: M u'' + f_int(u, u', d) = f(t, u).

Statics by Newton's method with a line search, in load steps if need be. Dynamics by the average
acceleration of `transient`, with forces balanced in the mean of the ends of a step,

    M (a' + a) + f_int(u', v') - f' + f_int(u, v) - f = 0

and the stretches d of Maxwell branches at these ends, by the trapezoidal rule (Belytschko, Liu and
Moran, Nonlinear Finite Elements for Continua and Structures (2000), chapter 6). One factorisation
serves as many steps as Newton's method converges with it (modified Newton). Energy is conserved to
second order in the step.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import count

import numpy as np

from fem.energy import Elastic
from fem.linear_solver import Factor, factorise
from fem.transient import Diverged, State, acceleration, at_rest, check_step
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
    """Static displacement (3 n,) in metre under a force (3 n,) in N, applied in as few load steps
    as converge, from an initial guess or undeformed.

    The `tolerance` is of the residual relative to the force or, below `ROUND_OFF`, of the
    correction that it calls for, relative to the displacement. If Newton's method does not converge
    even in steps of 1/64 of the load, it raises Diverged.
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
    initial: State | None = None,
    tolerance: float = 1e-3,
    solver: str = "auto",
) -> Iterator[State]:
    """Time integration by average acceleration and Newton's method, without end: states at 0, dt, 2
    dt, ..., from rest or an initial displacement and velocity, under nodal forces (3 n,) in N of a
    time in s.

    Arguments are those of `transient`; the `tolerance` is of the last correction of a step's
    displacement, relative to it. A step for which Newton's method does not converge is made of two
    halves, and so on; if even 64 parts do not, it raises Diverged.
    """
    check_step(dt)
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
    march = _March(body=body, force=force, tolerance=tolerance, solver=solver)
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
    """Body, load, tolerance and solver of a time integration, the same in every step."""

    body: Elastic
    force: Callable[[float], Floats]
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
    body = march.body
    C, M, free = body.operators.C, body.operators.M, body.operators.free
    dt, a, before, residual = until - now.t, now.a, np.inf, np.inf
    shares = [2 * part.times / (dt + 2 * part.times) for part in body.relaxing]
    predicted = now.u + dt * now.v + dt**2 / 4 * now.a
    f = march.force(until)[free]
    load = f + now.force
    for _ in range(MOST_ITERATIONS):
        u = predicted + dt**2 / 4 * a
        v = now.v + dt / 2 * (now.a + a)
        _, stretch = _relaxed(body, now, u, shares)
        internal = body.internal(u) + body.viscous(u, v) + _relaxing_force(body, u, stretch)
        r = load - M @ (a + now.a) - internal - now.internal
        residual = float(np.linalg.norm(r) / (np.linalg.norm(load) or 1.0))
        if not np.isfinite(residual):
            break
        if halvings not in factors:
            K = body.tangent(u)
            for part, share in zip(body.relaxing, shares, strict=True):
                K = K + part.tangent(u, share)
            system = M + dt * (C / 2 + dt / 4 * K)
            try:
                factors[halvings] = factorise(system, backend=march.solver)
            except ValueError:
                break
        change = factors[halvings].solve(r)
        a = a + change
        sizes = (u - now.u, dt**2 / 4 * a, STANDSTILL * u)
        step = max(float(np.linalg.norm(size)) for size in sizes)
        left = dt**2 / 4 * float(np.linalg.norm(change)) / (step or 1.0)
        shrinks = left <= max(SLOW * before, march.tolerance / 100)
        if left <= march.tolerance and (shrinks or before <= march.tolerance):
            # One more residual would only confirm what this correction leaves: its square or, with
            # an old tangent, a small part of it. The balance of forces stands for it.
            u, v = u + dt**2 / 4 * change, v + dt / 2 * change
            internal = load - M @ (a + now.a) - now.internal
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
