"""Modes of a thin plate by Ritz's method, for sheets with any support, tension and air: in the
steady state, from rest, and at large deflection by von Karman's equations.

At large deflection, the motion without stretching is that of `plate-modes-transient`, with all
modes and without time steps. Time steps of the lowest modes add the effect of stretching. The
numbers of steps and modes follow from the tolerance and from the change with longer steps and with
fewer modes over the whole response. Richardson's extrapolation reduces the error of the steps.

A thin plate has no shear and no rotary inertia. Their effect on the motion of each mode, by
`thick_plate`, is part of the expected error.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import pairwise
from math import ceil, sqrt
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fem.reduced import exponential_sum
from simple_model import Effort, ErrorPart, MovingPressure, Response, Statement
from simple_model.layers.compliance import AIR_DENSITY, thick_plate
from simple_model.load.sampling import below_half_the_rate, highest_driving, step
from simple_model.load.spectrum import synthesise
from simple_model.plates.free_modes import free_modes
from simple_model.plates.karman_motion import linear_motion, modes_from_rest, stretched_motion
from simple_model.plates.modes import (
    Plate,
    PlateModes,
    modal_motion_apart,
    plate_modes,
    scaled_modes,
)
from simple_model.plates.von_karman import KarmanPlate, karman_plate
from skinwave.bodies.body import Body
from skinwave.bodies.sheet import equivalent, frame_in_air
from skinwave.bodies.supports import EDGES
from skinwave.models import Cost, Limit, Model, named, register
from skinwave.models.costs import UNITS, Cheaper, computed_times, lines_below, synthesis
from skinwave.models.laws import has_own_law, slowest_and_fastest
from skinwave.models.limits import clamped_sheet_limits, of_body, surface_limits, takes
from skinwave.models.options import Solve, SolveOptions, response_of, sample_times
from skinwave.models.relative_change import relative_changes
from skinwave.scene.scene import Scene
from skinwave.system.effort import Progress, one_thread, peak_memory, silent
from skinwave.typing import Complex, Floats

RITZ_ERROR = ErrorPart(  # of a steady waveform, by finite elements of a frame, vacuum and air
    name="modes", source="Ritz's method", error=0.01, cure="use a larger tolerance"
)


@dataclass(frozen=True, kw_only=True)
class StretchingAccuracy:
    """Time steps and modes with which stretching is computed, and the estimate of their error.

    Time steps last from `shortest` to `longest` s. Splines of this `degree` interpolate between
    them. Each of the `counts` of modes is compared with the one before. Steps and modes may use a
    `share` of the tolerance.

    The error of modes is `truncation` times the change by fewer modes: 0.2 to 1.7 times it was
    measured, because modes converge slowly near a resonance. Extrapolation from steps whose lengths
    have the ratio `least_ratio` or more leaves `extrapolated` of the error of the steps; 0.02 to
    0.3 of it was measured.
    """

    longest: float = 1e-4
    shortest: float = 2.5e-5
    degree: int = 5
    counts: tuple[int, ...] = (42, 60, 86, 120)
    share: float = 0.6
    truncation: float = 2.0
    extrapolated: float = 0.5
    least_ratio: float = 1.5


ACCURACY = StretchingAccuracy()


def plate_of(body: Body) -> Plate:
    """Return the thin plate of a sheet as a record of `simple_model.plates.modes`."""
    held, Q = body.mounting, body.solid.plane_stress * body.depth**3 / 12
    support: dict[str, Any] = {
        edge: held.support if edge in held.edges else "free" for edge in EDGES
    }
    return Plate(
        size_x=body.width, size_y=body.height, mass_per_area=body.mass_per_area,
        d11=Q[0, 0], d22=Q[1, 1], d12=Q[0, 1], d66=Q[2, 2],
        tension_x=held.tension_x, tension_y=held.tension_y, **support,
        clips=held.clips, clip_radius=held.clip_radius if held.clips else 0.0,
        air_density=AIR_DENSITY if body.air else 0.0, frame_width=frame_in_air(body),
        edge_loss=held.edge_loss,
    )  # fmt: skip


modes_of = lru_cache(maxsize=4)(plate_modes)
_karman = lru_cache(maxsize=6)(karman_plate)


def middle_compliance(body: Body) -> float:
    """Return the static deflection at the middle of a supported sheet per force there, in m/N."""
    modes = modes_of(plate_of(body))
    at_rest = relative_modulus(body, 0.0).real
    stiffness = modes.squared * (1 + (at_rest - 1) * modes.elastic)
    return float((modes.at([[0.0, 0.0]]) ** 2 / stiffness).sum())


def relative_modulus(body: Body, omega: ArrayLike) -> Any:
    """Return the complex bending modulus at frequencies in rad/s, relative to that of the modes."""
    return body.solid.complex_modulus(omega) / body.solid.shear_modulus


@dataclass(frozen=True, kw_only=True, eq=False)
class Driven:
    """Modes of a scene's plate under its load; `outputs` (p, m) are their shapes at the probes.

    The load has lines at `frequencies` (f,) in Hz with modal `forces` (f, m) in N kg^-1/2, and
    `motion` (f, m) in the steady state. From rest, they add exp(t `poles` (m, j)) with the
    amplitudes `start` (m, j).
    """

    modes: PlateModes
    frequencies: Floats
    forces: Complex
    motion: Complex
    poles: Complex
    start: Complex
    outputs: Floats


def _solver(model: str, values_of: Callable[[Scene, Driven, Floats], Floats]) -> Solve:
    """Return the function of a model that computes the values (t, p) of driven modes."""

    @one_thread()
    def solve(scene: Scene, times: Floats, options: SolveOptions) -> Response:
        started, driven = time.perf_counter(), _drive(scene, times, options.progress)
        values = values_of(scene, driven, times)
        effort = Effort(
            seconds={"evaluate": time.perf_counter() - started}, dofs=len(driven.modes.squared),
            steps=len(driven.frequencies), peak_memory=peak_memory(),
        )  # fmt: skip
        return response_of(scene, model, times, values, effort)

    return solve


@one_thread()
def steady_lines(scene: Scene, places: Floats | None = None) -> tuple[Floats, Complex]:
    """Return frequencies (f,) in Hz and complex amplitudes (f, p) of a scene's quantity in the
    steady state, at places (p, 2) in m or at its probes. Raises a ValueError if there are no lines.
    """
    driven = _drive(scene, sample_times(scene))
    if places is not None:
        outputs = driven.modes.at(places - scene.body.placement.offset)
        driven = replace(driven, outputs=outputs)
    return driven.frequencies, _amplitudes(scene, driven)


@one_thread()
def thin_plate_part(scene: Scene) -> ErrorPart:
    """Return the part of the error that is due to shear and rotary inertia.

    The effect on the first part of a record grows at most in proportion to time. If it is then
    negligible, the whole record is not computed.
    """
    times = sample_times(scene)
    first = len(first_part(scene, times))
    error = _thickness_error(scene, scene.body.depth, first) * len(times) / first
    if error > RITZ_ERROR.error and first < len(times):
        error = _thickness_error(scene, scene.body.depth, len(times))
    return shear_part(scene, error)


def thick_mesh_part(scene: Scene) -> Iterator[ErrorPart]:
    """Yield the part due to shear and rotary inertia of a mesh that is thicker than its sheet."""
    thickness = equivalent(scene.body)
    if thickness <= scene.body.depth or not takes(FROM_REST, scene):
        return
    error = _thickness_error(scene, thickness, len(sample_times(scene)))
    source = f"the mesh, {1e3 * thickness:.2g} mm thick for the same bending"
    yield ErrorPart(
        name="thick mesh", source=source, error=error, cure=f"use --model {FROM_REST.name}"
    )


def shear_part(scene: Scene, error: float) -> ErrorPart:
    """Return the part of the error of a thin plate from its size."""
    cure = "use --model fem" if takes(named("fem"), scene) else "use a thinner sheet"
    source = "shear and rotary inertia, which a thin plate leaves out"
    return ErrorPart(name="thin plate", source=source, error=error, cure=cure)


@one_thread()
def sensitivity(scene: Scene, by: float = 1e-3) -> float:
    """Return the relative change of the waveforms per relative change of natural frequencies."""
    return _effect_of(scene, len(sample_times(scene)), detuning=by) / by


def _thickness_error(scene: Scene, thickness: float, samples: int) -> float:
    """Return the error of a thin plate due to the shear and rotary inertia of a `thickness` in m.

    It is 0.6 to 1.3 times their effect on plates of 0.04 to 0.2 times their side, simply supported
    or clamped, by finite elements, and 2.0 times near a clamped edge.
    """
    return 2.0 * _effect_of(scene, samples, thickness=thickness)


@lru_cache(maxsize=64)
def _effect_of(
    scene: Scene, samples: int, *, thickness: float = 0.0, detuning: float = 0.0
) -> float:
    """Return the relative change of the first samples from rest, without coupling between modes, by
    the shear and rotary inertia of a thickness in m and by a detuning of natural frequencies.
    """
    times, (driven, values) = sample_times(scene)[:samples], _uncoupled(scene, samples)
    modes, body = driven.modes, scene.body
    bent = np.maximum(modes.squared * modes.elastic, 0.0)
    k = np.asarray((bent * body.mass_per_area / body.bending_stiffness) ** 0.25)
    bending, mass = thick_plate(k * thickness, body.solid.poisson)
    mass = mass * (1 + detuning) ** -2
    modes = scaled_modes(modes, bending=bending, mass=mass)
    forces, outputs = (each / np.sqrt(mass) for each in (driven.forces, driven.outputs))
    other = _apart(replace(driven, modes=modes, forces=forces, outputs=outputs), body)
    changed = _from_rest(scene, other, times)
    return float(relative_changes(changed - values, changed).max())


@lru_cache(maxsize=2)
def _uncoupled(scene: Scene, samples: int) -> tuple[Driven, Floats]:
    """Return the motion from rest (t, p) under strong lines, and its modes, without coupling."""
    times = sample_times(scene)[:samples]
    driven = _drive(scene, times)
    sizes = np.linalg.norm(driven.motion, axis=1)
    strong = sizes > 1e-4 * sizes.max(initial=0.0)  # weaker lines do not change the sensitivity
    driven = replace(driven, frequencies=driven.frequencies[strong], forces=driven.forces[strong])
    driven = _apart(driven, scene.body)
    return driven, _from_rest(scene, driven, times)


def _apart(driven: Driven, body: Body) -> Driven:
    """Return the motion under the same forces without coupling between modes."""
    f, forces, free = driven.frequencies, driven.forces, free_modes(driven.modes, body.solid)
    motion = modal_motion_apart(driven.modes, f, forces, partial(relative_modulus, body))
    return replace(driven, motion=motion, poles=free.poles, start=free.start(f, forces))


def _drive(scene: Scene, times: Floats, progress: Progress = silent) -> Driven:
    body, pressure = scene.body, scene.pressure
    progress("modes", 0.0)
    modes: PlateModes = modes_of(plate_of(body))
    progress("lines", 0.0)
    x, y = body.placement.offset
    driven = modes_from_rest(modes, pressure, body.solid, (x, y), highest_driving(pressure, times))
    return Driven(modes=modes, outputs=modes.at(scene.probe_points - (x, y)), **vars(driven))


def _steady(scene: Scene, driven: Driven, times: Floats) -> Floats:
    """Return the steady state (t, p)."""
    below = below_half_the_rate(driven.frequencies, times)
    return synthesise(driven.frequencies[below], _amplitudes(scene, driven)[below], times)


def _amplitudes(scene: Scene, driven: Driven) -> Complex:
    """Return the lines (f, p) of the scene's quantity."""
    rates = scene.reading.record.factor(2j * np.pi * driven.frequencies)[:, None]
    return np.asarray(driven.motion @ driven.outputs.T * rates)


def _from_rest(scene: Scene, driven: Driven, times: Floats) -> Floats:
    """Return the motion (t, p) from rest before t = 0: the steady state and the free vibration."""
    vibrates = driven.start != 0
    rates = driven.poles[vibrates]
    outputs = np.broadcast_to(driven.outputs.T[:, None], (*vibrates.shape, len(driven.outputs)))
    amplitudes = driven.start[vibrates] * scene.reading.record.factor(rates)
    free = exponential_sum(rates, amplitudes[:, None] * outputs[vibrates], times)
    return _steady(scene, driven, times) + free


def limits(scene: Scene) -> Iterator[Limit]:
    """Yield the limits of plate modes: a flat sheet with supports, read at the surface."""
    body = scene.body
    if not body.of_kind.is_plate:
        yield Limit(why=f"needs a sheet, not a {body.kind}")
        return
    yield from clamped_sheet_limits(body)
    if body.base != "free":
        yield Limit(
            why=f"needs a sheet with free faces, not with the base {body.base}",
            cure='set base = "free"', change=of_body(base="free"),
        )  # fmt: skip
    yield from surface_limits(scene)


def _cost(from_rest: bool, scene: Scene, options: SolveOptions, effort: Effort) -> Cost:
    """Return the cost of the steady state, and of a start from rest."""
    times, modes = computed_times(scene, options), modes_of(plate_of(scene.body))
    sizes = np.array([len(family.squared) for family in modes.families])
    lines, pairs = lines_below(scene, times), int((sizes**2).sum())
    coupled = any(family.bending is not None or family.air for family in modes.families)
    seconds, size = synthesis(scene, times)
    summed = len(times) * len(scene.probes) * int(sizes.sum()) if from_rest else 0
    # Seconds of two modes of one symmetry, in the modes, and in a line with tension; of a line and
    # a mode; bytes of a sample, a probe and a mode.
    pair, pair_in_line, mode_in_line, value = 1.4e-6, 3e-9, 1e-7, 0.7
    driven = pair_in_line * pairs * coupled + mode_in_line * int(sizes.sum())
    return Cost(
        parts={
            "use a smaller sheet": UNITS.start + pair * pairs,
            Cheaper.LINES: lines * driven,
            Cheaper.PROBES: UNITS.exponential * summed,
            Cheaper.DURATION: seconds,
        },
        memory=UNITS.process + size + value * summed,
    )


MODES = register(
    Model(
        name="plate-modes",
        method="modes of a thin plate by Ritz's method, line by line",
        words="the steady state of a thin plate, in its modes by Ritz's method",
        solve=_solver("plate-modes", _steady),
        limits=limits,
        parts=lambda scene, options: [RITZ_ERROR, thin_plate_part(scene)],
        cost=partial(_cost, False),
        colour="#F0E442",
        sources=("A. W. Leissa: Vibration of Plates. NASA SP-160, 1969",),
        from_rest="plate-modes-transient",
    )
)
FROM_REST = register(
    replace(
        MODES,
        name="plate-modes-transient",
        from_rest="",
        takes_series=has_own_law,
        solve=_solver("plate-modes-transient", _from_rest),
        cost=partial(_cost, True),
        method="modes of a thin plate by Ritz's method, from rest",
        words="a thin plate from rest, in its modes by Ritz's method",
        colour="#8C510A",
    )
)


@one_thread()
def stretched_answer(scene: Scene, times: Floats, options: SolveOptions) -> Response:
    """Solve the linear motion from rest, and add the effect of stretching."""
    started = time.perf_counter()
    modes: PlateModes = modes_of(plate_of(scene.body))
    options.progress("large deflection", 0.0)
    found = solve_stretching(scene, len(times), step(times), options.tolerance, options.dt)
    used = found.runs[0][1]
    effort = Effort(
        seconds={"evaluate": time.perf_counter() - started}, dofs=len(modes.squared),
        reduced_dofs=used.count, steps=used.steps,
        dt=float(times[-1]) / used.steps, peak_memory=peak_memory(),
        errors=Statement(
            parts=(RITZ_ERROR, thin_plate_part(scene), found.error), tolerance=options.tolerance
        ),
    )  # fmt: skip
    return response_of(scene, STRETCHED.name, times, found.linear + found.values, effort)


def first_part(scene: Scene, times: Floats, least: float = 0.2) -> Floats:
    """Return the times (s,) in s, for `least` s or more, that decide whether a sheet stretches."""
    slowest, _ = slowest_and_fastest(scene.pressure)
    return times[: max(2, round(max(least, 1 / slowest) / step(times)) + 1)]


@one_thread()
def linear_error(scene: Scene, times: Floats, linear: Floats) -> float:
    """Return the largest relative error of a linear response (t, p) from rest."""
    count = min(ACCURACY.counts[0], len(modes_of(plate_of(scene.body)).squared))
    run = Run(count=count, steps=_step_count(times, ACCURACY.longest))
    stretching = stretching_in_run(scene, times, run)
    return float(relative_changes(stretching, linear + stretching).max())


@lru_cache(maxsize=1)
@one_thread()
def sheet_motion(scene: Scene, tolerance: float) -> tuple[Floats, Floats, Callable[..., Floats]]:
    """Return the motion of a whole sheet from rest: times (t,) in s, coordinates (t, m) in kg^1/2 m
    of all modes that move, and the function of their shapes (p, m) at places (p, 2) in m.
    """
    times, body, pressure = sample_times(scene), scene.body, scene.pressure
    middle, modes = body.placement.offset, modes_of(plate_of(body))
    found = solve_stretching(scene, len(times), step(times), tolerance, None)
    driving = highest_driving(pressure, times)
    stretching = [
        (weight, *_coordinates(pressure, body, float(times[-1]), run, driving))
        for weight, run in found.runs
    ]
    sizes = np.linalg.norm(_drive(scene, times).motion, axis=0)
    shown = np.flatnonzero(sizes > 1e-4 * sizes.max())  # weaker modes do not show on a map
    moving = np.union1d(shown, np.hstack([plate.chosen for _, plate, _ in stretching]))
    z = linear_motion(
        modes, pressure, body.solid, times, middle=middle, chosen=moving,
        driving=driving, highest=0.5 / step(times),
    )  # fmt: skip
    for weight, plate, coordinates in stretching:
        z[:, np.searchsorted(moving, plate.chosen)] += weight * _at(coordinates, times)
    return times, z, lambda places: modes.at(places - middle)[:, moving]


@dataclass(frozen=True, kw_only=True)
class Run:
    """A computation of what stretching adds, with `count` modes in `steps` time steps."""

    count: int
    steps: int


@dataclass(frozen=True, kw_only=True, eq=False)
class Stretching:
    """What stretching adds to a `linear` response (t, p), `values` (t, p): the sum of `runs`
    times their weights, the first with most modes and shortest steps; and the `error` of both.
    """

    linear: Floats
    values: Floats
    runs: tuple[tuple[float, Run], ...]
    error: ErrorPart


@lru_cache(maxsize=1)  # a response and a map of the same motion
def solve_stretching(
    scene: Scene, samples: int, sample: float, tolerance: float, dt: float | None,
    own: StretchingAccuracy = ACCURACY,
) -> Stretching:  # fmt: skip
    """Return what stretching adds at every `sample` in s, within the tolerance if possible.

    Errors are those of the whole record: a resonance may build up slowly. Steps are chosen with the
    fewest modes, and modes are compared in the longest steps. Steps of two lengths give the limit
    of short steps by Richardson's extrapolation.
    """
    times: Floats = sample * np.arange(samples, dtype=np.float64)
    linear = FROM_REST.solve(scene, times, SolveOptions(tolerance=tolerance, dt=dt)).values
    allowed, most = own.share * tolerance, len(modes_of(plate_of(scene.body)).squared)
    counts = [min(count, most) for count in own.counts]
    first, base = counts[0], _step_count(times, dt or own.longest)
    finest = base if dt else max(base, _step_count(times, own.shortest))
    values = lru_cache(partial(stretching_in_run, scene, times))

    def change(run: Run, other: Run) -> float:
        found = values(run)
        return float(relative_changes(found - values(other), linear + found).max())

    def by_steps(count: int, steps: int, fewer: int) -> float:
        """Return what extrapolation leaves of the error of the steps, which is of second order."""
        run, other = (Run(count=count, steps=n) for n in (steps, fewer))
        return own.extrapolated * change(run, other) / ((steps / fewer) ** 2 - 1)

    steps, fewer = base, ceil(base / 2)
    while (left := by_steps(first, steps, fewer)) > allowed / 2 and steps < finest:
        ratio = max(own.least_ratio, sqrt(left / (allowed / 2)))
        shorter = min(ceil(ratio * steps), finest)
        steps, fewer = shorter, min(steps, int(shorter / own.least_ratio))
    for less, count in pairwise(counts):
        more_modes, fewer_modes = (Run(count=n, steps=base) for n in (count, less))
        by_modes = own.truncation * change(more_modes, fewer_modes)
        if by_modes + left <= allowed:
            break
    same = first if steps == base else count  # without shorter steps, the fewest modes suffice
    left = by_steps(same, steps, fewer)
    weight = 1 / ((steps / fewer) ** 2 - 1)
    runs = (
        (1.0, Run(count=count, steps=steps)), (weight, Run(count=same, steps=steps)),
        (-weight, Run(count=same, steps=fewer)),
    )  # fmt: skip
    dt = times[-1] / steps
    half = f"{dt / 2:.7f}".rstrip("0")
    part = steps_part(
        f"{count} modes that stretch, in steps of {1e3 * dt:.3g} ms",
        by_modes + left, f", or skinwave run --dt {half}",
    )  # fmt: skip
    added = np.asarray(sum(weight * values(run) for weight, run in runs))
    return Stretching(linear=linear, values=added, runs=runs, error=part)


def _step_count(times: Floats, longest: float) -> int:
    """Return the number of equal steps up to the last of times (t,) in s, enough for a spline."""
    return max(2 * ACCURACY.degree, ceil(times[-1] / longest - 1e-6))


def steps_part(source: str, error: float, more: str = "") -> ErrorPart:
    """Return the part of the error of the steps and the modes of a sheet that stretches."""
    cure = f"use a lower pressure or a material with more loss{more}"
    return ErrorPart(name="steps and modes", source=source, error=error, cure=cure)


def _planned_parts(scene: Scene, options: SolveOptions) -> Iterator[ErrorPart]:
    """Yield planned parts of a sheet that stretches; the response replaces the last by its own."""
    yield from (RITZ_ERROR, thin_plate_part(scene))
    yield steps_part("modes that stretch, in time steps", ACCURACY.share * options.tolerance)


def stretching_in_run(scene: Scene, times: Floats, run: Run) -> Floats:
    """Return what stretching adds to the quantity (t, p)."""
    driving = highest_driving(scene.pressure, times)
    plate, coordinates = _coordinates(scene.pressure, scene.body, float(times[-1]), run, driving)
    values = coordinates @ plate.shapes(scene.probe_points - scene.body.placement.offset).T
    return _at(values, times, scene.reading.record.rate)


def _at(values: Floats, times: Floats, rate: int = 0) -> Floats:
    """Return values (t, p) at times (t,) in s, or their derivatives of order `rate`, from values
    (n, p) after equal steps to the last time.
    """
    if len(values) == len(times) and not rate:
        return values
    from scipy.interpolate import make_interp_spline  # slow to import

    steps = np.linspace(0.0, times[-1], len(values))
    return np.asarray(make_interp_spline(steps, values, ACCURACY.degree)(times, rate))


@lru_cache(maxsize=4)  # the response, the map and the picture of a sheet need the same ones
def _coordinates(
    pressure: MovingPressure, body: Body, duration: float, run: Run, driving: float
) -> tuple[KarmanPlate, Floats]:
    """Return the plate, and the coordinates (n + 1, r) in kg^1/2 m that stretching adds at the ends
    of n steps, under lines of the load below `driving` Hz.
    """
    modes, dt = modes_of(plate_of(body)), duration / run.steps
    plate = _karman(modes, body.depth, run.count)
    times = np.linspace(0.0, duration, run.steps + 1)
    # Faster lines hardly deflect the sheet, and do not stretch it.
    linear = linear_motion(
        modes, pressure, body.solid, times, middle=body.placement.offset, chosen=plate.chosen,
        driving=driving, highest=0.5 / dt,
    )  # fmt: skip
    return plate, stretched_motion(plate, linear, dt, body.solid) - linear


def _stretched_cost(scene: Scene, options: SolveOptions, effort: Effort) -> Cost:
    """Return the cost of the linear motion, solved twice, and of the steps with stretching."""
    linear, times = _cost(True, scene, options, effort), computed_times(scene, options)
    parts = ceil(step(times) / (options.dt or ACCURACY.longest) - 1e-9)
    steps = (len(times) + len(first_part(scene, times))) * parts
    # Seconds and bytes of the states of stress, and of a time step with all its repetitions.
    return Cost(
        parts={
            **linear.parts,
            Cheaper.LINES: 2 * linear.parts[Cheaper.LINES],
            Cheaper.DURATION: 1.0 + 1.6e-4 * steps,
        },
        memory=linear.memory + 2e7 + 6e3 * steps,
    )


STRETCHED = register(
    replace(
        FROM_REST,
        name="plate-modes-nonlinear",
        method="large deflection of a thin plate in its modes, from rest",
        words="a thin plate in bending and stretching, from rest, with modes by Ritz's method",
        solve=stretched_answer,
        parts=_planned_parts,
        cost=_stretched_cost,
        colour="#4D4D9F",
        sources=(
            *FROM_REST.sources,
            "S. Bilbao, O. Thomas, C. Touze, M. Ducceschi: Conservative numerical methods for the "
            "full von Karman plate equations. Numerical Methods for Partial Differential Equations "
            "31 (2015) 1948-1970. doi 10.1002/num.21974",
        ),
        is_nonlinear=True,
    )
)
