"""Nonlinear statics and dynamics at large displacement: M u'' + f_int(u, u', d) = f(t, u).

Statics uses Newton's method with a line search, in load steps if needed. Dynamics uses the average
acceleration of `transient`, with forces balanced in the mean of the ends of a step,

    M (a' + a) + f_int(u', v') - f' + f_int(u, v) - f = 0

and the trapezoidal rule for the stretches d of Maxwell branches (Belytschko, Liu and Moran,
Nonlinear Finite Elements for Continua and Structures (2000), chapter 6). A factorisation is reused
as long as Newton's method converges with it (modified Newton). Energy is conserved to second order
in the step.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import count

import numpy as np

from fem.energy import Elastic
from fem.linear_solver import Factor, factorise
from fem.transient import Diverged, State, acceleration, at_rest, check_step
from simple_model.typing import Floats


class _Stuck(ArithmeticError):
    """Newton's method did not converge; the argument is the relative residual."""


def static(
    body: Elastic,
    force: Floats,
    *,
    start: Floats | None = None,
    tolerance: float = 1e-8,
    most_iterations: int = 25,
    most_halvings: int = 6,
    solver: str = "auto",
) -> Floats:
    """Return the static displacement under a force, applied in as few load steps as converge.

    Parameters
    ----------
    force : (3 n,) float, N
    start : (3 n,) float, m, initial guess; undeformed by default
    tolerance : largest residual relative to the force; or, for residuals below 1e-5, largest
        correction relative to the displacement
    most_iterations : largest number of Newton iterations in a load step
    most_halvings : how often a load step is halved if it does not converge
    solver : backend of `factorise`

    Returns
    -------
    (3 n,) float
        Displacement, m.

    Raises
    ------
    Diverged
        If Newton's method does not converge in the smallest load steps.
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
            u = _newton(body, unbalanced, u, tolerance, most_iterations, solver)
        except _Stuck as stuck:
            part /= 2
            if part < 0.5**most_halvings:
                raise Diverged(
                    f"no equilibrium was found at {100 * target:.3g} % of the load in load steps "
                    f"of 1/{2**most_halvings}: the relative residual is {stuck.args[0]:.2g}, above "
                    f"{tolerance:g}; lower the load, or refine the mesh where it bends most"
                ) from None
        else:
            reached, part = target, 2 * part
    return operators.expand(u)


def _newton(
    body: Elastic,
    unbalanced: Callable[[Floats], tuple[Floats, float]],
    u: Floats,
    tolerance: float,
    most_iterations: int,
    solver: str,
) -> Floats:
    residual = np.inf
    round_off = 1e-5  # of the load: a smaller residual is judged by the correction it causes
    for _ in range(most_iterations):
        r, size = unbalanced(u)
        residual = float(np.linalg.norm(r)) / (size or 1.0)
        if not np.isfinite(residual):
            break
        if residual <= tolerance:
            return u
        try:
            step = factorise(body.tangent(u), backend=solver).solve(r)
        except ValueError:  # no longer positive definite: too far from the solution
            break
        # The residual of thin bodies may be round-off of cancelling forces, which moves nothing.
        size = float(np.linalg.norm(u))
        if residual <= round_off and float(np.linalg.norm(step)) <= tolerance * size:
            return u + step
        if float(step @ r) <= 0.0:  # likewise, for solvers that raise no error
            break
        u = u + _line_search(unbalanced, u, step) * step
    raise _Stuck(residual)


def _line_search(
    unbalanced: Callable[[Floats], tuple[Floats, float]], u: Floats, step: Floats
) -> float:
    """Return the fraction of a step at which the residual does no work along it."""
    from scipy.optimize import brentq  # slow to import

    def work(part: float) -> float:
        return float(step @ unbalanced(u + part * step)[0])

    start, end = work(0.0), work(1.0)
    if end >= -0.5 * start or not np.isfinite(end):
        return 1.0
    return float(brentq(work, 0.0, 1.0, xtol=0.02, rtol=0.02))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Moment:
    """Free components of a state, forces, and strain and stretch of Maxwell branches."""

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
    most_iterations: int = 25,
    most_halvings: int = 6,
    solver: str = "auto",
) -> Iterator[State]:
    """Integrate in time by average acceleration and Newton's method, without end.

    Other arguments, the states and the errors are those of `transient`.

    Parameters
    ----------
    initial : state with initial displacement and velocity; at rest by default
    tolerance : last Newton correction relative to the displacement of the step
    most_iterations : largest number of Newton iterations in a step
    most_halvings : how often a step is halved if it does not converge
    """
    check_step(dt)
    march = _March(body, force, tolerance, most_iterations, solver)
    start = initial or at_rest(body.operators.n_dofs)
    now = march.start(start)
    for step in count(1):
        yield march.state(now)
        try:
            now = march.advance(now, start.time + step * dt, most_halvings)
        except _Stuck as stuck:
            raise Diverged(
                f"step {step} of dt = {dt:g} s, to t = {start.time + step * dt:g} s, did not "
                f"converge in {2**most_halvings} parts to a tolerance of {tolerance:g}; the "
                f"residual is {stuck.args[0]:.2g} of the load; shorten dt or lower the load"
            ) from None


@dataclass(frozen=True, eq=False)
class _March:
    """Time integration of one body under one load. `factors` caches a factorisation for each number
    of halvings that a step may still have.
    """

    body: Elastic
    force: Callable[[float], Floats]
    tolerance: float
    most_iterations: int
    solver: str
    factors: dict[int, Factor] = field(default_factory=dict)

    def start(self, initial: State) -> _Moment:
        """Return the first moment, with the acceleration that balances the forces."""
        body, free = self.body, self.body.operators.free
        u, v = initial.displacement[free], initial.velocity[free]
        strain = tuple(part.strain(u) for part in body.relaxing)
        stretch = initial.stretch or tuple(
            np.zeros((len(part.times), *e.shape))
            for part, e in zip(body.relaxing, strain, strict=True)
        )
        f, internal = self.force(initial.time)[free], self._internal(u, v, stretch)
        a = acceleration(body.operators, f - internal)
        return _Moment(t=initial.time, u=u, v=v, a=a, force=f, internal=internal,
                       strain=strain, stretch=stretch)  # fmt: skip

    def state(self, now: _Moment) -> State:
        """Return the state on all degrees of freedom."""
        expand = self.body.operators.expand
        return State(
            time=now.t, displacement=expand(now.u), velocity=expand(now.v),
            acceleration=expand(now.a), stretch=now.stretch,
        )  # fmt: skip

    def advance(self, now: _Moment, until: float, halvings: int) -> _Moment:
        """Return the state at a time, in one step or, if it does not converge, two halves."""
        try:
            return self._step(now, until, halvings)
        except _Stuck:
            self.factors.pop(halvings, None)
            if not halvings:
                raise
        middle = self.advance(now, (now.t + until) / 2, halvings - 1)
        return self.advance(middle, until, halvings - 1)

    def _step(self, now: _Moment, until: float, halvings: int) -> _Moment:
        body, tolerance = self.body, self.tolerance
        M, free = body.operators.M, body.operators.free
        dt, a, before, residual = until - now.t, now.a, np.inf, np.inf
        shares = [2 * part.times / (dt + 2 * part.times) for part in body.relaxing]
        predicted = now.u + dt * now.v + dt**2 / 4 * now.a
        f = self.force(until)[free]
        load = f + now.force
        slow = 0.3  # ratio of successive corrections above which the tangent is factorised again
        standstill = 1e-6  # of the displacement: smallest scale of a step's correction
        for _ in range(self.most_iterations):
            u = predicted + dt**2 / 4 * a
            v = now.v + dt / 2 * (now.a + a)
            _, stretch = self._branch_stretches(now, u, shares)
            r = load - M @ (a + now.a) - self._internal(u, v, stretch) - now.internal
            residual = float(np.linalg.norm(r) / (np.linalg.norm(load) or 1.0))
            if not np.isfinite(residual):
                break
            try:
                change = self._factor(u, dt, shares, halvings).solve(r)
            except ValueError:  # the tangent is not positive definite
                break
            a = a + change
            sizes = (u - now.u, dt**2 / 4 * a, standstill * u)
            step = max(float(np.linalg.norm(size)) for size in sizes)
            left = dt**2 / 4 * float(np.linalg.norm(change)) / (step or 1.0)
            shrinks = left <= max(slow * before, tolerance / 100)
            if left <= tolerance and (shrinks or before <= tolerance):
                # The remaining error is the square of this correction or, with an old tangent, a
                # small part of it. The balance of forces replaces another residual.
                u, v = u + dt**2 / 4 * change, v + dt / 2 * change
                internal = load - M @ (a + now.a) - now.internal
                strain, stretch = self._branch_stretches(now, u, shares)
                return _Moment(t=until, u=u, v=v, a=a, force=f, internal=internal,
                               strain=strain, stretch=stretch)  # fmt: skip
            if left > slow * before:
                self.factors.pop(halvings)
            before = left
        raise _Stuck(residual)

    def _factor(self, u: Floats, dt: float, shares: list[Floats], halvings: int) -> Factor:
        """Return the cached factorisation, or that of the tangent at u."""
        if halvings not in self.factors:
            body, K = self.body, self.body.tangent(u)
            for part, share in zip(body.relaxing, shares, strict=True):
                K = K + part.tangent(u, share)
            system = body.operators.M + dt * (body.operators.C / 2 + dt / 4 * K)
            self.factors[halvings] = factorise(system, backend=self.solver)
        return self.factors[halvings]

    def _internal(self, u: Floats, v: Floats, stretch: tuple[Floats, ...]) -> Floats:
        """Return the internal force, including viscosity and Maxwell branches."""
        each = zip(self.body.relaxing, stretch, strict=True)
        relaxing = sum((part.force(u, d) for part, d in each), np.zeros_like(u))
        return self.body.internal(u) + self.body.viscous(u, v) + relaxing

    def _branch_stretches(
        self, now: _Moment, u: Floats, shares: list[Floats]
    ) -> tuple[tuple[Floats, ...], tuple[Floats, ...]]:
        """Return strains and stretches of the branches at the end of a step, at displacement u."""
        strain = tuple(part.strain(u) for part in self.body.relaxing)
        each = zip(shares, now.stretch, now.strain, strain, strict=True)
        return strain, tuple(
            np.multiply.outer(2 * x - 1, np.ones_like(new)) * d + np.multiply.outer(x, new - old)
            for x, d, old, new in each
        )
