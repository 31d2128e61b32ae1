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
from fem.stress import relaxed
from meshes import MeshError
from simple_model import Effort, Material, Response
from simple_model.load.sampling import below_half_the_rate, resolving_step
from simple_model.load.spectrum import load_lines, synthesise
from simple_model.numbers import significant
from simple_model.quantities import Quantity
from skinwave.bodies.body import Body
from skinwave.bodies.build import Build
from skinwave.bodies.parts import PHALANX, PLAIN
from skinwave.bodies.sizes import check_mesh, default_size
from skinwave.models import Limit, Model, register
from skinwave.models.laws import has_own_law, relaxing, series_tolerance
from skinwave.models.limits import of_air_in_a_frame, of_body, of_vacuum
from skinwave.models.meshed import (
    assembled,
    energy_balance,
    even_part,
    images,
    inertia,
    line_factor,
    load_in_steps,
    load_lines_at,
    meshed,
    modelled_axes,
    probe_rows,
    sag,
    spent,
    surface_load,
    translation,
    with_sag,
)
from skinwave.models.options import SolveOptions
from skinwave.models.reduced import answer, prepare, reduction_tolerance
from skinwave.scene.load import SupportMotion
from skinwave.scene.scene import Scene
from skinwave.system.effort import Clock, Progress
from skinwave.typing import Floats

REDUCTION = (
    "Z. Bai, Y. Su: Dimension reduction of large-scale second-order dynamical systems via a "
    "second-order Arnoldi method. SIAM Journal on Scientific Computing 26 (2005) 1692-1709"
)
ARNOLDI = (
    "D. Lu, Y. Su, Z. Bai: Stability analysis of the two-level orthogonal Arnoldi procedure. SIAM "
    "Journal on Matrix Analysis and Applications 37 (2016) 195-214"
)
NEWMARK = (
    "N. M. Newmark: A method of computation for structural dynamics. Journal of the Engineering "
    "Mechanics Division 85 (1959) 67-94"
)
MACROELEMENTS = (
    "R. Stenberg: Analysis of mixed finite element methods for the Stokes problem: a unified "
    "approach. Mathematics of Computation 42 (1984) 9-23"
)
MOST_SLENDER = 10  # sides of a sheet, of which its default elements make a mesh
FINITE = 15e-3  # m: a finite depth in place of a half-space, or below its layers and probes
THICKER = 1.25  # from one thickness that is tried to the next
CHECKED_EACH = 50  # steps of a transient
TRANSIENT_RATE = 20_000.0  # Hz of the full time stepping: 0.3 % at 600 Hz
MOST_LINES = 1000  # of fem-harmonic, each a factorisation
MOST_STEPS = 1_000_000  # five times the longest Tacton at that rate


@lru_cache(maxsize=64)
def of_mesh(body: Body, h: float | None = None) -> tuple[Limit, ...]:
    """Limits of elements of h in metre, by default those of the body: what has no mesh."""
    if not isfinite(body.depth):
        return (
            Limit(
                why="takes a body of finite depth, not thickness_mm = inf",
                cure="give a finite thickness_mm", change=_of_finite_depth,
            ),
        )  # fmt: skip
    try:
        check_mesh(body, h or default_size(body))
    except MeshError as error:  # too many elements
        why = _cause(error)
        cure, change = _coarser(body)
    except ValueError as error:  # layers that its elements do not follow
        why = _cause(error)
        cure, change = 'take kind = "slab"', _as_slab
    else:
        return ()
    return (Limit(why=f"cannot mesh this body: {why}", cure=cure, change=change),)


def _of_finite_depth(scene: Scene) -> Scene:
    below = max(0.0, *scene.depths, *scene.body.interfaces[:-1])
    return of_body(depth=below + FINITE)(scene)


def _as_slab(scene: Scene) -> Scene:
    """The scene on a slab of the same size and layers."""
    return of_body(kind="slab", relief=PLAIN, bone=PHALANX, regions=())(scene)


def _cause(error: ValueError) -> str:
    """What is wrong, by a message that ends with a cure."""
    return str(error).rpartition("; ")[0]


def _coarser(body: Body) -> tuple[str, Callable[[Scene], Scene] | None]:
    """The change to a thicker body or a shorter sheet, whose default elements are few."""
    if body.of_kind.is_plate:
        longest = MOST_SLENDER * min(body.width, body.height)
        values = {"width": min(body.width, longest), "height": min(body.height, longest)}
        return f"make it at most {1e3 * longest:g} mm long", of_body(**values)
    depths = body.depth * THICKER ** np.arange(1, 40)
    for depth in (significant(1e3 * each, 2) for each in depths.tolist()):
        thicker = replace(body, depth=float(depth) / 1e3)
        if _fits(thicker):
            return f"give it thickness_mm = {depth} or more", of_body(depth=thicker.depth)
    return "", None


def _fits(body: Body) -> bool:
    try:
        check_mesh(body, default_size(body))
    except ValueError:
        return False
    return True


def _limits(
    of_air: Callable[[Body], Iterator[Limit]], may_move: bool, scene: Scene
) -> Iterator[Limit]:
    yield from of_mesh(scene.body)
    yield from of_air(scene.body)
    if scene.load.support_motion and not may_move:
        yield Limit(
            why=f"does not take {scene.load.support_motion.words}",
            cure="leave out support_motion",
            change=lambda scene: replace(scene, load=replace(scene.load, support_motion=None)),
        )


def _reduced(scene: Scene, times: Floats, options: SolveOptions) -> Response:
    prepared = prepare(
        scene.body, scene.probe_points, options.progress, h=options.h, solver=options.solver,
        tolerance=reduction_tolerance(options.tolerance), reading=scene.reading, load=scene.load,
    )  # fmt: skip
    return answer(prepared, scene, options.progress, times=times)


def transient_answer(scene: Scene, times: Floats, options: SolveOptions) -> Response:
    """Direct time integration of all dofs in steps of dt, interpolated by a cubic spline."""
    report, solver = options.progress, options.solver
    dt = options.dt or resolving_step(scene.pressure, 1 / TRANSIENT_RATE)
    steps = step_count(float(times[-1]), dt)
    clock, body = Clock(), relaxing(scene.body, series_tolerance(options.tolerance))
    build = meshed(body, options.h, clock, report)
    ops = assembled(build, clock, report)
    P, points = surface_load(build, scene.load)
    S, solids = probe_rows(scene.body, build, scene.probe_points, scene.reading)
    report("factorise", 0.0)

    load = load_in_steps(scene.loads, points, times, dt)

    @lru_cache(maxsize=4)
    def force(t: float) -> Floats:
        return P @ load(t)

    with clock("march"):
        states = fem.transient(ops, force, dt, solver=solver)
        balanced = fem.with_energy_balance(ops, islice(states, steps + 1), force)
        stepped, energy = marched(
            balanced, steps, lambda u: S @ u, lambda state: fem.stored(ops, state), report
        )
    still = sag(build, ops, S, scene.load, solver)
    effort = Effort(
        dofs=len(ops.free), steps=steps, energy_imbalance=energy[0], radiated=energy[1], dt=dt,
        solver=fem.available()[0] if solver == "auto" else solver,
    )  # fmt: skip
    return Response(
        model="fem-transient", times=times, probes=scene.probe_points, quantity=scene.quantity,
        values=in_time(stepped, dt, times, scene, solids, sag=still),
        effort=spent(effort, clock, build, options.h or default_size(scene.body)),
    )  # fmt: skip


def in_time(
    stepped: Floats,
    dt: float,
    times: Floats,
    scene: Scene,
    solids: tuple[Material, ...] = (),
    *,
    sag: Floats | float = 0.0,
) -> Floats:
    """Waveforms (t, p) of a scene's quantity at times (t,) in s, from its components at rest
    `stepped` (n, p c) in steps of dt from 0 and under gravity, `sag` (p c,). Rates are those of the
    cubic spline that is sampled; stress relaxes in the p `solids` of the probes.
    """
    asked = scene.reading.record
    sampled = sampled_components(stepped, dt, times, asked, solids)
    return asked.waveforms(with_sag(sampled, sag, asked), len(scene.probes))


def sampled_components(
    stepped: Floats, dt: float, times: Floats, asked: Quantity, solids: tuple[Material, ...] = ()
) -> Floats:
    """Components (t, p c) of a quantity at sample times, as of `in_time`."""
    from scipy.interpolate import CubicSpline  # which takes long to import

    if asked.relaxes:
        each = np.split(stepped, len(solids), axis=1)
        stepped = np.hstack([relaxed(x, dt, m) for x, m in zip(each, solids, strict=True)])
    return np.asarray(CubicSpline(np.arange(len(stepped)) * dt, stepped)(times, asked.rate))


def marched(
    balanced: Iterator[tuple[fem.State, fem.EnergyBalance]],
    steps: int,
    read: Callable[[Floats], Floats],
    stored: Callable[[fem.State], float],
    report: Progress,
) -> tuple[Floats, tuple[float, float]]:
    """Readings (steps + 1, p) of displacements (3 n,) in metre in a time integration, and its last
    `energy_balance`, by what each state has `stored` in J. Raises `fem.Diverged` if the balance is
    violated in one of the states that are checked.
    """
    found = []
    for k, (state, energies) in enumerate(balanced):
        found.append(read(state.displacement))
        report("march", k / steps)
        if k % CHECKED_EACH == 0 or k == steps:
            when = f" at t = {state.time:g} s, step {k}"
            energy = energy_balance(energies, stored(state), when)
    return np.array(found), energy


def step_count(duration: float, dt: float) -> int:
    """Number of steps of dt that reach a duration in s, at most `MOST_STEPS`."""
    if dt > duration:
        raise ValueError(
            f"dt = {dt:g} s is longer than the response, {duration:g} s; take a shorter step"
        )
    if duration / dt > MOST_STEPS:
        raise ValueError(
            f"dt = {dt:g} s makes {duration / dt:.2g} steps, the limit is {MOST_STEPS:,}; take a "
            "longer step or a shorter duration"
        )
    return max(3, ceil(duration / dt - 1e-9))


def harmonic_answer(scene: Scene, times: Floats, options: SolveOptions) -> Response:
    """Steady state: one factorisation for each line of the load above a threshold, but for the mean
    if the body is unconstrained. Of a body that is its own mirror image only one side is modelled
    where all probes lie on the plane.
    """
    report, solver = options.progress, options.solver
    threshold = options.tolerance / 50  # of the strongest line
    clock = Clock()
    probes, reading = scene.probe_points, scene.reading
    axes = modelled_axes(scene.body, probes, "", reading, scene.load)
    build = meshed(scene.body, options.h, clock, report, axes)
    ops = assembled(build, clock, report)
    P, points = even_part(*surface_load(build, scene.load), axes)
    S, solids = probe_rows(scene.body, build, images(probes, axes), reading)
    asked = reading.record
    solve = fem.LineSolver(ops, solver)
    with clock("lines"):
        lines = load_lines(scene.loads[0], threshold)
        if (count := len(np.unique(np.round(lines.frequencies, 9)))) > MOST_LINES:
            raise ValueError(
                f"this load has {count:,} lines, the limit is {MOST_LINES:,}; take --model fem"
            )
        frequencies, pressures = load_lines_at(scene.loads, points, threshold)
        if not scene.body.is_held:  # under its mean an unconstrained body would drift
            frequencies, pressures = frequencies[frequencies > 0], pressures[frequencies > 0]
        amplitudes = np.empty((len(frequencies), S.shape[0]), np.complex128)
        total = fem.EnergyBalance()
        report("lines", 0.0)
        answers = options.mapped(partial(_line, ops, P, S, solve), frequencies, pressures)
        for k, (amplitudes[k], power) in enumerate(answers):
            report("lines", (k + 1) / len(frequencies))
            energy_balance(power, when=f" at {frequencies[k]:g} Hz")
            total += power
        still = sag(build, ops, S, scene.load, solver)
        if motion := scene.load.support_motion:
            moved, power = moved_line(build, ops, S, solve, motion)
            total += power
            frequencies = np.append(frequencies, motion.frequency)
            amplitudes = np.vstack([amplitudes, moved])
    energy = energy_balance(total)
    amplitudes = amplitudes * line_factor(asked, 2j * np.pi * frequencies, solids, S.shape[0])
    below = below_half_the_rate(frequencies, times)
    effort = Effort(
        dofs=len(ops.free), steps=len(frequencies), energy_imbalance=energy[0], radiated=energy[1],
        solver=fem.available()[0] if solver == "auto" else solver,
    )  # fmt: skip
    return Response(
        model="fem-harmonic", times=times, probes=scene.probe_points, quantity=scene.quantity,
        values=asked.waveforms(
            with_sag(synthesise(frequencies[below], amplitudes[below], times), still, asked),
            len(scene.probes),
        ),
        effort=spent(effort, clock, build, options.h or default_size(scene.body)),
    )  # fmt: skip


def _line(
    ops: fem.Operators,
    P: sparse.csr_array,
    S: sparse.csr_array,
    solve: fem.LineSolver,
    frequency: float,
    pressure: fem.Complex,
) -> tuple[fem.Complex, fem.EnergyBalance]:
    """Components (p c,) at rest of the probes at one line, and its mean power balance."""
    force, free = P @ pressure, ops.free
    u = solve(frequency, force)
    line = force[None, free], u[None, free], np.array([frequency])
    return S @ u, mean_power(ops.C, ops.R, *line, ops.branches)


def moved_line(
    build: Build,
    ops: fem.Operators,
    S: sparse.csr_array,
    solve: fem.LineSolver,
    motion: SupportMotion,
) -> tuple[fem.Complex, fem.EnergyBalance]:
    """Components (p c,) on a support that moves, and the mean power balance about it."""
    force = sparse.csr_array(-inertia(build, motion.unit)[:, None])
    acceleration = np.array([motion.acceleration])
    seen, power = _line(ops, force, S, solve, motion.frequency, acceleration)
    return seen + S @ translation(build, motion.unit) * motion.line, power


FEM = register(
    Model(
        name="fem",
        method="10-node tetrahedra, reduced-order model",
        words="linear waves on 10-node tetrahedra by a reduced-order model",
        solve=_reduced,
        error=None,
        default_size=default_size,
        limits=partial(_limits, of_air_in_a_frame, True),
        colour="#0072B2",
        sources=(REDUCTION, ARNOLDI, MACROELEMENTS),
        is_reduced=True,
        takes_series=has_own_law,
    )
)
HARMONIC = register(
    replace(
        FEM,
        name="fem-harmonic",
        method="10-node tetrahedra, line by line",
        words="the steady state of linear waves on 10-node tetrahedra",
        solve=harmonic_answer,
        limits=partial(_limits, of_vacuum, True),
        colour="#CC79A7",
        sources=(MACROELEMENTS,),
        from_rest="fem",
        is_reduced=False,
        takes_series=lambda body: False,
    )
)
TRANSIENT = register(
    replace(
        FEM,
        name="fem-transient",
        method="10-node tetrahedra, step by step",
        words="linear waves on 10-node tetrahedra, step by step",
        solve=transient_answer,
        limits=partial(_limits, of_vacuum, False),
        colour="#D55E00",
        sources=(NEWMARK, MACROELEMENTS),
        is_reduced=False,
        is_stepped=True,
    )
)
