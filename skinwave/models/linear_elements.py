"""Linear finite elements: reduced-order model, steady state line by line, and time integration."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import lru_cache, partial
from itertools import islice
from math import ceil, isfinite

import numpy as np
from scipy import sparse

import fem
from fem.energy import mean_power
from fem.memory import BYTES_PER_DOF
from fem.stress import relaxed_stress
from meshes import MeshError
from simple_model import Effort, Material, Response
from simple_model.load.sampling import below_half_the_rate, resolving_step
from simple_model.load.spectrum import load_lines, synthesise
from simple_model.numbers import significant
from simple_model.quantities import Quantity
from skinwave.bodies.body import Body
from skinwave.bodies.parts import PHALANX, PLAIN
from skinwave.bodies.sizes import check_mesh, default_size
from skinwave.models import Cost, Limit, Model, meshed, register
from skinwave.models.costs import UNITS, Cheaper, computed_times, lines_below, synthesis
from skinwave.models.laws import has_own_law, relaxing, series_tolerance
from skinwave.models.limits import edge_and_air_limits, of_body
from skinwave.models.options import SolveOptions, response_of, solver_name
from skinwave.models.reduced import answer, reduce_scene
from skinwave.models.symmetry import even_part, images, modelled_axes
from skinwave.scene.scene import Scene
from skinwave.system.effort import Clock, Progress
from skinwave.typing import Floats

SOURCES = {
    "reduction": "Z. Bai, Y. Su: Dimension reduction of large-scale second-order dynamical systems "
    "via a second-order Arnoldi method. SIAM Journal on Scientific Computing 26 (2005) 1692-1709",
    "Arnoldi": "D. Lu, Y. Su, Z. Bai: Stability analysis of the two-level orthogonal Arnoldi "
    "procedure. SIAM Journal on Matrix Analysis and Applications 37 (2016) 195-214",
    "Newmark": "N. M. Newmark: A method of computation for structural dynamics. Journal of the "
    "Engineering Mechanics Division 85 (1959) 67-94",
    "macroelements": "R. Stenberg: Analysis of mixed finite element methods for the Stokes "
    "problem: a unified approach. Mathematics of Computation 42 (1984) 9-23",
}


@lru_cache(maxsize=64)
def mesh_limits(body: Body, h: float | None = None) -> tuple[Limit, ...]:
    """Return the limits of elements of h in m, by default those of the body."""
    if not isfinite(body.depth):

        def with_finite_depth(scene: Scene) -> Scene:
            below = max(0.0, *scene.depths, *scene.body.interfaces[:-1])
            return of_body(depth=finite_depth(below))(scene)

        why = "needs a body of finite depth, not thickness_mm = inf"
        return (Limit(why=why, cure="set a finite thickness_mm", change=with_finite_depth),)
    try:
        check_mesh(body, h or default_size(body))
    except ValueError as error:
        why = str(error).rpartition("; ")[0]  # without its own cure
        is_too_fine = isinstance(error, MeshError)  # else elements do not follow the layers
        as_slab = of_body(kind="slab", relief=PLAIN, bone=PHALANX, regions=())
        cure, change = _coarser(body) if is_too_fine else ('set kind = "slab"', as_slab)
    else:
        return ()
    return (Limit(why=f"cannot mesh this body: {why}", cure=cure, change=change),)


def finite_depth(below: float, more: float = 15e-3) -> float:
    """Return the depth in m to mesh of a half-space, given that of its lowest layer or probe."""
    return below + more


def _coarser(body: Body) -> tuple[str, Callable[[Scene], Scene] | None]:
    """Return the change to a thicker body or a shorter sheet, with fewer elements."""
    if body.of_kind.is_plate:
        longest = 10 * min(body.width, body.height)  # default elements can mesh this ratio
        sides = {"width": min(body.width, longest), "height": min(body.height, longest)}
        return f"make it at most {1e3 * longest:g} mm long", of_body(**sides)
    for depth in (body.depth * 1.25 ** np.arange(1, 40)).tolist():
        thickness = significant(1e3 * depth, 2)
        thicker = replace(body, depth=float(thickness) / 1e3)
        try:
            check_mesh(thicker, default_size(thicker))
        except ValueError:
            continue
        return f"set thickness_mm = {thickness} or more", of_body(depth=thicker.depth)
    return "", None


def _limits(scene: Scene, *, held_air: bool = False, may_move: bool = True) -> Iterator[Limit]:
    yield from mesh_limits(scene.body)
    yield from edge_and_air_limits(scene.body, held_air=held_air)
    if scene.load.support_motion and not may_move:
        yield Limit(
            why=f"does not take {scene.load.support_motion.words}",
            cure="remove support_motion",
            change=lambda scene: replace(scene, load=replace(scene.load, support_motion=None)),
        )


def time_step(scene: Scene, options: SolveOptions, rate: float = 20_000.0) -> float:
    """Return the step in s of a time integration, by default with an error of 0.3 % at 600 Hz."""
    return options.dt or resolving_step(scene.pressure, 1 / rate)


def transient_answer(scene: Scene, times: Floats, options: SolveOptions) -> Response:
    """Integrate all degrees of freedom in time, in steps of dt that a cubic spline interpolates."""
    report, solver = options.progress, options.solver
    dt = time_step(scene, options)
    steps = step_count(float(times[-1]), dt)
    clock, body = Clock(), relaxing(scene.body, series_tolerance(options.tolerance))
    build = meshed.mesh_body(body, options.h, clock, report)
    ops = meshed.assemble(build, clock, report)
    P, points = meshed.surface_load(build, scene.load)
    S, solids = meshed.probe_rows(scene.body, build, scene.probe_points, scene.reading)
    report("factorise", 0.0)
    load = meshed.load_in_steps(scene.loads, points, times, dt)
    force = lru_cache(maxsize=4)(lambda t: P @ load(t))
    with clock("march"):
        states = fem.transient(ops, force, dt, solver=solver)
        balanced = fem.with_energy_balance(ops, islice(states, steps + 1), force)
        stepped, (imbalance, radiated) = march(
            balanced, steps, lambda u: S @ u, lambda state: fem.mechanical_energy(ops, state),
            report,
        )  # fmt: skip
    still = meshed.sag(build, ops, S, scene.load, solver)
    effort = Effort(
        dofs=len(ops.free), steps=steps, energy_imbalance=imbalance, radiated=radiated, dt=dt,
        solver=solver_name(solver),
    )  # fmt: skip
    effort = meshed.with_cost(effort, clock, build, options.h or default_size(scene.body))
    values = in_time(stepped, dt, times, scene, solids, sag=still)
    return response_of(scene, "fem-transient", times, values, effort)


def in_time(
    stepped: Floats, dt: float, times: Floats, scene: Scene, solids: tuple[Material, ...] = (), *,
    sag: Floats | float = 0.0,
) -> Floats:  # fmt: skip
    """Return waveforms (t, p) of a scene's quantity at times (t,) in s.

    `stepped` (n, p c) are its static components in steps of dt from 0, and `sag` (p c,) those under
    gravity. A cubic spline gives the rates. Stress relaxes in the p `solids` of the probes.
    """
    quantity = scene.reading.record
    sampled = sampled_components(stepped, dt, times, quantity, solids)
    return quantity.waveforms(meshed.with_sag(sampled, sag, quantity), len(scene.probes))


def sampled_components(
    stepped: Floats, dt: float, times: Floats, quantity: Quantity, solids: tuple[Material, ...] = ()
) -> Floats:
    """Return the components (t, p c) of a quantity at sample times, as in `in_time`."""
    from scipy.interpolate import CubicSpline  # slow to import

    if quantity.relaxes:
        each = np.split(stepped, len(solids), axis=1)
        stepped = np.hstack([relaxed_stress(x, dt, m) for x, m in zip(each, solids, strict=True)])
    return np.asarray(CubicSpline(np.arange(len(stepped)) * dt, stepped)(times, quantity.rate))


def march(
    balanced: Iterator[tuple[fem.State, fem.EnergyBalance]], steps: int,
    read: Callable[[Floats], Floats], stored: Callable[[fem.State], float], report: Progress,
    check_every: int = 50,
) -> tuple[Floats, tuple[float, float]]:  # fmt: skip
    """Return readings (steps + 1, p) of the displacements (3 n,) in m of a time integration, and
    its last `energy_balance`; `stored` returns the energy in J of a state. Raises `fem.Diverged` if
    a checked state violates the balance.
    """
    readings = []
    for k, (state, energies) in enumerate(balanced):
        readings.append(read(state.displacement))
        report("march", k / steps)
        if k % check_every == 0 or k == steps:
            when = f" at t = {state.time:g} s, step {k}"
            balance = meshed.energy_balance(energies, stored(state), when)
    return np.array(readings), balance


def step_count(duration: float, dt: float, most: int = 1_000_000) -> int:
    """Return the number of steps of dt in a duration in s; raises a ValueError above `most`."""
    if dt > duration:
        raise ValueError(
            f"dt = {dt:g} s is longer than the response, {duration:g} s; use a shorter step"
        )
    if duration / dt > most:
        raise ValueError(
            f"dt = {dt:g} s makes {duration / dt:.2g} steps, more than {most:,}; use a "
            "longer step or a shorter duration"
        )
    return max(3, ceil(duration / dt - 1e-9))


def harmonic_answer(scene: Scene, times: Floats, options: SolveOptions) -> Response:
    """Solve the steady state with one factorisation for each strong line of the load, without the
    mean if the body is unconstrained. If all probes lie on a symmetry plane, one half is modelled.
    """
    report, solver, most_lines = options.progress, options.solver, 1000  # each a factorisation
    threshold, count = _lines_solved(scene, options)
    clock, quantity = Clock(), scene.reading.record
    axes = modelled_axes(scene.body, scene.probe_points, "", scene.reading, scene.load)
    build = meshed.mesh_body(scene.body, options.h, clock, report, axes)
    ops = meshed.assemble(build, clock, report)
    P, points = even_part(*meshed.surface_load(build, scene.load), axes)
    S, solids = meshed.probe_rows(
        scene.body, build, images(scene.probe_points, axes), scene.reading
    )
    solve = fem.LineSolver(ops, solver)
    with clock("lines"):
        if count > most_lines:
            raise ValueError(
                f"this load has {count:,} lines, more than {most_lines:,}; use --model fem"
            )
        frequencies, pressures = meshed.load_lines_at(scene.loads, points, threshold)
        if not scene.body.is_held:  # under the mean an unconstrained body would drift
            frequencies, pressures = frequencies[frequencies > 0], pressures[frequencies > 0]
        amplitudes = np.empty((len(frequencies), S.shape[0]), np.complex128)
        total = fem.EnergyBalance()
        report("lines", 0.0)
        for k, frequency in enumerate(frequencies):
            amplitudes[k], power = _line(ops, P, S, solve, frequency, pressures[k])
            meshed.energy_balance(power, when=f" at {frequency:g} Hz")
            total += power
            report("lines", (k + 1) / len(frequencies))
        still = meshed.sag(build, ops, S, scene.load, solver)
        if support := scene.load.support_motion:
            force = sparse.csr_array(-meshed.inertia(build, support.unit)[:, None])
            acceleration = np.array([support.acceleration])
            relative, power = _line(ops, force, S, solve, support.frequency, acceleration)
            total += power
            shift = S @ meshed.translation(build, support.unit) * support.line
            frequencies = np.append(frequencies, support.frequency)
            amplitudes = np.vstack([amplitudes, relative + shift])
    imbalance, radiated = meshed.energy_balance(total)
    amplitudes = amplitudes * meshed.line_factor(
        quantity, 2j * np.pi * frequencies, solids, S.shape[0]
    )
    below = below_half_the_rate(frequencies, times)
    effort = Effort(
        dofs=len(ops.free), steps=len(frequencies), energy_imbalance=imbalance, radiated=radiated,
        solver=solver_name(solver),
    )  # fmt: skip
    effort = meshed.with_cost(effort, clock, build, options.h or default_size(scene.body))
    vibration = synthesise(frequencies[below], amplitudes[below], times)
    values = quantity.waveforms(meshed.with_sag(vibration, still, quantity), len(scene.probes))
    return response_of(scene, "fem-harmonic", times, values, effort)


def _lines_solved(scene: Scene, options: SolveOptions) -> tuple[float, int]:
    """Return a threshold over the strongest line, and the number of lines of the load above it."""
    threshold = options.tolerance / 50
    lines = load_lines(scene.loads[0], threshold)
    return threshold, len(np.unique(np.round(lines.frequencies, 9)))


def _line(
    ops: fem.Operators, P: sparse.csr_array, S: sparse.csr_array, solve: fem.LineSolver,
    frequency: float, pressure: fem.Complex,
) -> tuple[fem.Complex, fem.EnergyBalance]:  # fmt: skip
    """Return the probes' components (p c,) at rest of one line, and its power balance."""
    force, free = P @ pressure, ops.free
    u = solve(frequency, force)
    line = force[None, free], u[None, free], np.array([frequency])
    return S @ u, mean_power(ops.C, ops.R, *line, ops.branches)


def _reduced_cost(scene: Scene, options: SolveOptions, effort: Effort) -> Cost:
    """Return the measured cost of the reduced body, and that of a Tacton on it."""
    times, modes = computed_times(scene, options), effort.reduced_dofs
    lines = lines_below(scene, times)
    outputs = len(scene.probes) * (1 if scene.reading.record.is_normal else 6)
    positions = 100  # of the path
    driven = 2e-9 * lines * (modes + positions) * modes  # s of a line and two coordinates
    read = UNITS.exponential * len(times) * outputs * (lines + 2 * modes)
    return Cost(
        parts={
            Cheaper.MESH: sum(effort.seconds.values()),
            Cheaper.LINES: UNITS.start + driven,
            Cheaper.PROBES: read,
        },
        memory=max(UNITS.process + BYTES_PER_DOF * effort.dofs, effort.peak_memory),
    )


def _line_cost(scene: Scene, options: SolveOptions, effort: Effort) -> Cost:
    n, (_, count) = effort.dofs, _lines_solved(scene, options)
    seconds, _ = synthesis(scene, computed_times(scene, options))
    return Cost(
        parts={
            Cheaper.MESH: UNITS.build * n,
            Cheaper.DURATION: seconds,
            Cheaper.REDUCED: UNITS.factor * n**1.5 * (count + 1) + UNITS.product * n * count,
        },
        memory=UNITS.process + 700.0 * n ** (4 / 3),  # bytes of complex factors
    )


def _stepped_cost(scene: Scene, options: SolveOptions, effort: Effort) -> Cost:
    axes = modelled_axes(scene.body, scene.probe_points, "", scene.reading, scene.load)
    n = effort.dofs * 2 ** len(axes)  # the whole body
    return Cost(
        parts={
            Cheaper.MESH: UNITS.build * n + UNITS.factor * n**1.5,
            Cheaper.REDUCED: planned_steps(scene, options) * step_seconds(n),
        },
        memory=UNITS.process + 450.0 * n ** (4 / 3),  # bytes of real factors
    )


def planned_steps(scene: Scene, options: SolveOptions) -> int:
    """Return the number of steps of a time integration."""
    return step_count(float(computed_times(scene, options)[-1]), time_step(scene, options))


def step_seconds(n: float) -> float:
    """Return the seconds of a time step of n degrees of freedom: a solution, and products."""
    return UNITS.solution * n ** (4 / 3) + UNITS.product * n


FEM = register(
    Model(
        name="fem",
        method="10-node tetrahedra, reduced-order model",
        words="linear waves on 10-node tetrahedra by a reduced-order model",
        solve=lambda scene, times, options: answer(
            reduce_scene(scene, options), scene, options.progress, times=times
        ),
        default_size=default_size,
        limits=partial(_limits, held_air=True),
        cost=_reduced_cost,
        colour="#0072B2",
        sources=(SOURCES["reduction"], SOURCES["Arnoldi"], SOURCES["macroelements"]),
        is_reduced=True,
        takes_series=has_own_law,
    )
)
register(
    replace(
        FEM,
        name="fem-harmonic",
        method="10-node tetrahedra, line by line",
        words="the steady state of linear waves on 10-node tetrahedra",
        solve=harmonic_answer,
        limits=_limits,
        cost=_line_cost,
        colour="#CC79A7",
        sources=(SOURCES["macroelements"],),
        from_rest="fem",
        is_reduced=False,
        takes_series=lambda body: False,
    )
)
register(
    replace(
        FEM,
        name="fem-transient",
        method="10-node tetrahedra, step by step",
        words="linear waves on 10-node tetrahedra, step by step",
        solve=transient_answer,
        limits=partial(_limits, may_move=False),
        cost=_stepped_cost,
        colour="#D55E00",
        sources=(SOURCES["Newmark"], SOURCES["macroelements"]),
        is_reduced=False,
        is_stepped=True,
    )
)
