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
from skinwave.models.costs import (
    DURATION,
    LINES,
    PROBES,
    PROCESS,
    START,
    SUMMED,
    computed_times,
    lines_below,
    synthesis,
)
from skinwave.models.laws import has_own_law, slowest_and_fastest
from skinwave.models.limits import clamped_sheet_limits, of_body, surface_limits, takes
from skinwave.models.options import SolveOptions, response_of, sample_times
from skinwave.models.relative_change import relative_changes
from skinwave.scene.scene import Scene
from skinwave.system.effort import Progress, one_thread, peak_memory, silent
from skinwave.typing import Complex, Floats

PLATES = "A. W. Leissa: Vibration of Plates. NASA SP-160, 1969"
ERROR = ErrorPart(  # of a steady waveform, by finite elements of a frame, vacuum and air
    name="modes", source="Ritz's method", error=0.01, cure="use a larger tolerance"
)
# Error of a thin plate over the effect of shear and rotary inertia: 0.6 to 1.3 for plates of 0.04
# to 0.2 times their side, simply supported or clamped, by finite elements; 2.0 near a clamped edge.
CLAMPED = 2.0
DETUNING = 1e-3  # of natural frequencies, for the sensitivity
KARMAN = (
    "S. Bilbao, O. Thomas, C. Touze, M. Ducceschi: Conservative numerical methods for the full von "
    "Karman plate equations. Numerical Methods for Partial Differential Equations 31 (2015) "
    "1948-1970. doi 10.1002/num.21974"
)
LONGEST, SHORTEST = 1e-4, 2.5e-5  # s, of time steps
COUNTS = 42, 60, 86, 120  # modes that stretch a sheet, each number compared with the one before
FIRST_DURATION = 0.2  # s of a response, at least, that decides whether a sheet stretches
NEGLIGIBLE_LINE = 1e-4  # of the strongest: weaker lines do not change the sensitivity
NEGLIGIBLE_MODE = 1e-4  # of the mode that moves most: weaker modes do not show on a map
SHARE = 0.6  # of the tolerance, for the error of steps and modes
# Error over the change by fewer modes: 0.2 to 1.7, because modes converge slowly near a resonance.
TRUNCATION = 2.0
EXTRAPOLATED = 0.5  # of the error of the steps, left by extrapolation: 0.02 to 0.3
LEAST_RATIO = 1.5  # of two lengths of steps that are extrapolated
# Seconds of two modes of one symmetry, in the modes, and in a line with tension; of a line and a
# mode. Seconds and bytes of the states of stress; seconds of a time step at large deflection, with
# all its repetitions; bytes of a sample, a probe and a mode, and of a step.
OF_MODES, COUPLED_LINE, MODAL_FORCE = 1.4e-6, 3e-9, 1e-7
OF_STATES, STRETCHED_STEP, OF_SUM, OF_STEP = (1.0, 2e7), 1.6e-4, 0.7, 6e3
DEGREE = 5  # of the splines that are differentiated


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


@one_thread()
def steady_answer(scene: Scene, times: Floats, options: SolveOptions) -> Response:
    """Solve the steady state of the modes for all lines below half the sampling rate."""
    started, driven = time.perf_counter(), _drive(scene, times, options.progress)
    return _response(scene, times, MODES.name, driven, _steady(scene, driven, times), started)


@one_thread()
def steady_lines(scene: Scene, places: Floats | None = None) -> tuple[Floats, Complex]:
    """Return frequencies (f,) in Hz and complex amplitudes (f, p) of a scene's quantity in the
    steady state, at places (p, 2) in m or at its probes. Raises a ValueError if the load has no
    lines.
    """
    driven = _drive(scene, sample_times(scene))
    if places is not None:
        outputs = driven.modes.at(places - scene.body.placement.offset)
        driven = replace(driven, outputs=outputs)
    return driven.frequencies, _amplitudes(scene, driven)


@one_thread()
def answer_from_rest(scene: Scene, times: Floats, options: SolveOptions) -> Response:
    """Solve the steady state and the free vibration after a start from rest."""
    started, driven = time.perf_counter(), _drive(scene, times, options.progress)
    values = _from_rest(scene, driven, times)
    return _response(scene, times, FROM_REST.name, driven, values, started)


@one_thread()
def thin_plate_part(scene: Scene) -> ErrorPart:
    """Return the part of the error that is due to shear and rotary inertia.

    The effect on the first part of a record grows at most in proportion to time. If it is then
    negligible, the whole record is not computed.
    """
    times = sample_times(scene)
    first = len(first_part(scene, times))
    error = CLAMPED * effect_of(_shear_and_inertia, scene, first) * len(times) / first
    if error > ERROR.error and first < len(times):
        error = CLAMPED * effect_of(_shear_and_inertia, scene, len(times))
    return without_shear(scene, error)


def thick_mesh_part(scene: Scene) -> Iterator[ErrorPart]:
    """Yield the part due to the shear and rotary inertia that a mesh has because it is thicker
    than its sheet.
    """
    if equivalent(scene.body) <= scene.body.depth or not takes(FROM_REST, scene):
        return
    error = CLAMPED * effect_of(_thick_mesh, scene, len(sample_times(scene)))
    source = f"the mesh, {1e3 * equivalent(scene.body):.2g} mm thick for the same bending"
    yield ErrorPart(
        name="thick mesh", source=source, error=error, cure=f"use --model {FROM_REST.name}"
    )


def without_shear(scene: Scene, error: float) -> ErrorPart:
    """Return the part of the error of a thin plate."""
    cure = "use --model fem" if takes(named("fem"), scene) else "use a thinner sheet"
    source = "shear and rotary inertia, which a thin plate leaves out"
    return ErrorPart(name="thin plate", source=source, error=error, cure=cure)


@one_thread()
def sensitivity(scene: Scene) -> float:
    """Return the relative change of the waveforms per relative change of natural frequencies."""
    return effect_of(_detuned, scene, len(sample_times(scene))) / DETUNING


Factors = tuple[Floats | float, Floats | float]  # of the stiffness of bending and of modal mass


@lru_cache(maxsize=64)
def effect_of(change: Callable[[Body, PlateModes], Factors], scene: Scene, samples: int) -> float:
    """Return the relative change of the first samples from rest with other modes, without coupling.

    `change` returns the factors (m,) of a body's modes.
    """
    times, (driven, values) = sample_times(scene)[:samples], _uncoupled(scene, samples)
    count = len(driven.modes.squared)
    bending, mass = (np.broadcast_to(f, count) for f in change(scene.body, driven.modes))
    modes = scaled_modes(driven.modes, bending=bending, mass=mass)
    forces, outputs = (each / np.sqrt(mass) for each in (driven.forces, driven.outputs))
    other = _apart(replace(driven, modes=modes, forces=forces, outputs=outputs), scene.body)
    changed = _from_rest(scene, other, times)
    return float(relative_changes(changed - values, changed).max())


def _shear_and_inertia(body: Body, modes: PlateModes) -> Factors:
    return _of_thickness(body, modes, body.depth)


def _thick_mesh(body: Body, modes: PlateModes) -> Factors:
    return _of_thickness(body, modes, equivalent(body))


def _of_thickness(body: Body, modes: PlateModes, thickness: float) -> Factors:
    bent = np.maximum(modes.squared * modes.elastic, 0.0)
    k = np.asarray((bent * body.mass_per_area / body.bending_stiffness) ** 0.25)
    return thick_plate(k * thickness, body.solid.poisson)


def _detuned(body: Body, modes: PlateModes) -> Factors:
    return 1.0, (1 + DETUNING) ** -2


@lru_cache(maxsize=2)
def _uncoupled(scene: Scene, samples: int) -> tuple[Driven, Floats]:
    """Return the motion from rest (t, p) without coupling between modes, and its modes, under the
    lines that matter.
    """
    times = sample_times(scene)[:samples]
    driven = _drive(scene, times)
    sizes = np.linalg.norm(driven.motion, axis=1)
    strong = sizes > NEGLIGIBLE_LINE * sizes.max(initial=0.0)
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


def _response(
    scene: Scene, times: Floats, model: str, driven: Driven, values: Floats, started: float
) -> Response:
    effort = Effort(
        seconds={"evaluate": time.perf_counter() - started}, dofs=len(driven.modes.squared),
        steps=len(driven.frequencies), peak_memory=peak_memory(),
    )  # fmt: skip
    return response_of(scene, model, times, values, effort)


def _from_rest(scene: Scene, driven: Driven, times: Floats) -> Floats:
    """Return the motion from rest (t, p)."""
    return _steady(scene, driven, times) + _free_vibration(scene, driven, times)


def _steady(scene: Scene, driven: Driven, times: Floats) -> Floats:
    """Return the steady state (t, p)."""
    below = below_half_the_rate(driven.frequencies, times)
    return synthesise(driven.frequencies[below], _amplitudes(scene, driven)[below], times)


def _amplitudes(scene: Scene, driven: Driven) -> Complex:
    """Return the lines (f, p) of the scene's quantity."""
    rates = scene.reading.record.factor(2j * np.pi * driven.frequencies)[:, None]
    return np.asarray(driven.motion @ driven.outputs.T * rates)


def _free_vibration(scene: Scene, driven: Driven, times: Floats) -> Floats:
    """Return the free vibration (t, p) after the state of rest before t = 0."""
    vibrates = driven.start != 0
    rates = driven.poles[vibrates]
    outputs = np.broadcast_to(driven.outputs.T[:, None], (*vibrates.shape, len(driven.outputs)))
    amplitudes = driven.start[vibrates] * scene.reading.record.factor(rates)
    return exponential_sum(rates, amplitudes[:, None] * outputs[vibrates], times)


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
    return Cost(
        parts={
            "use a smaller sheet": START + OF_MODES * pairs,
            LINES: lines * (COUPLED_LINE * pairs * coupled + MODAL_FORCE * int(sizes.sum())),
            PROBES: SUMMED * summed,
            DURATION: seconds,
        },
        memory=PROCESS + size + OF_SUM * summed,
    )


MODES = register(
    Model(
        name="plate-modes",
        method="modes of a thin plate by Ritz's method, line by line",
        words="the steady state of a thin plate, in its modes by Ritz's method",
        solve=steady_answer,
        limits=limits,
        parts=lambda scene, options: [ERROR, thin_plate_part(scene)],
        cost=partial(_cost, False),
        colour="#F0E442",
        sources=(PLATES,),
        from_rest="plate-modes-transient",
    )
)
FROM_REST = register(
    replace(
        MODES,
        name="plate-modes-transient",
        from_rest="",
        takes_series=has_own_law,
        solve=answer_from_rest,
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
    found = stretched(scene, len(times), step(times), options.tolerance, options.dt)
    used = found.runs[0][1]
    effort = Effort(
        seconds={"evaluate": time.perf_counter() - started}, dofs=len(modes.squared),
        reduced_dofs=used.count, steps=used.steps,
        dt=float(times[-1]) / used.steps, peak_memory=peak_memory(),
        errors=Statement(
            parts=(ERROR, thin_plate_part(scene), found.error), tolerance=options.tolerance
        ),
    )  # fmt: skip
    return response_of(scene, STRETCHED.name, times, found.linear + found.values, effort)


def first_part(scene: Scene, times: Floats) -> Floats:
    """Return the times (s,) in s for which steps and modes are chosen."""
    slowest, _ = slowest_and_fastest(scene.pressure)
    return times[: max(2, round(max(FIRST_DURATION, 1 / slowest) / step(times)) + 1)]


@one_thread()
def linear_error(scene: Scene, times: Floats, linear: Floats) -> float:
    """Return the largest relative error of a linear response (t, p) from rest."""
    count = min(COUNTS[0], len(modes_of(plate_of(scene.body)).squared))
    stretching = added_by_stretching(
        scene, times, Run(count=count, steps=_step_count(times, LONGEST))
    )
    return float(relative_changes(stretching, linear + stretching).max())


@lru_cache(maxsize=1)
@one_thread()
def sheet_motion(scene: Scene, tolerance: float) -> tuple[Floats, Floats, Callable[..., Floats]]:
    """Return the motion of a whole sheet from rest: times (t,) in s, coordinates (t, m) in kg^1/2 m
    of all modes that move, and the function of their shapes (p, m) at places (p, 2) in m.
    """
    times, body, pressure = sample_times(scene), scene.body, scene.pressure
    middle, modes = body.placement.offset, modes_of(plate_of(body))
    found, driven = stretched(scene, len(times), step(times), tolerance, None), _drive(scene, times)
    driving = highest_driving(pressure, times)
    stretching = [
        (weight, *_coordinates(pressure, body, float(times[-1]), run, driving))
        for weight, run in found.runs
    ]
    sizes, chosen = np.linalg.norm(driven.motion, axis=0), [p.chosen for _, p, _ in stretching]
    moving = np.union1d(np.flatnonzero(sizes > NEGLIGIBLE_MODE * sizes.max()), np.hstack(chosen))
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
def stretched(
    scene: Scene, samples: int, sample: float, tolerance: float, dt: float | None
) -> Stretching:  # fmt: skip
    """Return what stretching adds at every `sample` in s, within the tolerance if possible.

    Errors are those of the whole record: a resonance may build up slowly. Steps are chosen with the
    fewest modes, and modes are compared in the longest steps. Steps of two lengths give the limit
    of short steps by Richardson's extrapolation.
    """
    times: Floats = sample * np.arange(samples, dtype=np.float64)
    linear = FROM_REST.solve(scene, times, SolveOptions(tolerance=tolerance, dt=dt)).values
    allowed, most = SHARE * tolerance, len(modes_of(plate_of(scene.body)).squared)
    counts = [min(count, most) for count in COUNTS]
    first, base = counts[0], _step_count(times, dt or LONGEST)
    finest = base if dt else max(base, _step_count(times, SHORTEST))
    values = lru_cache(partial(added_by_stretching, scene, times))

    def change(run: Run, other: Run) -> float:
        found = values(run)
        return float(relative_changes(found - values(other), linear + found).max())

    def by_steps(count: int, steps: int, fewer: int) -> float:
        """Return what extrapolation leaves of the error of the steps, which is of second order."""
        run, other = (Run(count=count, steps=n) for n in (steps, fewer))
        return EXTRAPOLATED * change(run, other) / ((steps / fewer) ** 2 - 1)

    steps, fewer = base, ceil(base / 2)
    while (left := by_steps(first, steps, fewer)) > allowed / 2 and steps < finest:
        ratio = max(LEAST_RATIO, sqrt(left / (allowed / 2)))
        shorter = min(ceil(ratio * steps), finest)
        steps, fewer = shorter, min(steps, int(shorter / LEAST_RATIO))
    for less, count in pairwise(counts):
        by_modes = TRUNCATION * change(Run(count=count, steps=base), Run(count=less, steps=base))
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
    """Return the number of equal steps that end at the last of times (t,) in s. Twice as long ones
    are enough for a spline.
    """
    return max(2 * DEGREE, ceil(times[-1] / longest - 1e-6))


def steps_part(source: str, error: float, more: str = "") -> ErrorPart:
    """Return the part of the error of the steps and the modes of a sheet that stretches."""
    cure = f"use a lower pressure or a material with more loss{more}"
    return ErrorPart(name="steps and modes", source=source, error=error, cure=cure)


def _planned_parts(scene: Scene, options: SolveOptions) -> Iterator[ErrorPart]:
    """Yield the parts of a sheet that stretches, with the error at which steps and modes suffice,
    which the response replaces by its own.
    """
    yield from (ERROR, thin_plate_part(scene))
    yield steps_part("modes that stretch, in time steps", SHARE * options.tolerance)


def added_by_stretching(scene: Scene, times: Floats, run: Run) -> Floats:
    """Return what stretching adds to the quantity (t, p)."""
    driving = highest_driving(scene.pressure, times)
    plate, coordinates = _coordinates(scene.pressure, scene.body, float(times[-1]), run, driving)
    values = coordinates @ plate.shapes(scene.probe_points - scene.body.placement.offset).T
    return _at(values, times, scene.reading.record.rate)


def _at(values: Floats, times: Floats, rate: int = 0) -> Floats:
    """Return values (t, p) at times (t,) in s, or their derivatives of order `rate`, from those (n,
    p) after equal steps to the last time.
    """
    if len(values) == len(times) and not rate:
        return values
    from scipy.interpolate import make_interp_spline  # slow to import

    steps = np.linspace(0.0, times[-1], len(values))
    return np.asarray(make_interp_spline(steps, values, DEGREE)(times, rate))


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
    parts = ceil(step(times) / (options.dt or LONGEST) - 1e-9)
    steps = (len(times) + len(first_part(scene, times))) * parts
    return Cost(
        parts={
            **linear.parts,
            LINES: 2 * linear.parts[LINES],
            DURATION: OF_STATES[0] + STRETCHED_STEP * steps,
        },
        memory=linear.memory + OF_STATES[1] + OF_STEP * steps,
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
        sources=(PLATES, KARMAN),
        is_nonlinear=True,
    )
)
