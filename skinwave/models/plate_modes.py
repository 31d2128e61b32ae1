"""Modes of a thin plate by Ritz's method, for sheets with any support, tension and air: in the
steady state, from rest, and at large deflection by von Karman's equations.

At large deflection, the motion without stretching is that of `plate-modes-transient`, with all
modes and without time steps. Time steps of the lowest modes add the effect of stretching. The
numbers of steps and modes follow from the tolerance and from the change with steps twice as long
and with fewer modes. They are chosen for the first part of a response, and confirmed by the whole.

A thin plate has no shear and no rotary inertia. Their effect on the motion of each mode, by
`thick_plate`, is part of the expected error.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import pairwise
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fem.reduced import exponential_sum
from simple_model import Effort, ErrorPart, MovingPressure, Response, Statement
from simple_model.layers.compliance import AIR_DENSITY, thick_plate
from simple_model.load.sampling import below_half_the_rate, highest_driving, step
from simple_model.load.spectrum import lines_from_rest, synthesise
from simple_model.plates.free_modes import free_modes
from simple_model.plates.karman_motion import linear_motion, stretched_motion
from simple_model.plates.modes import (
    Plate,
    PlateModes,
    modal_motion,
    modal_motion_apart,
    plate_modes,
    scaled_modes,
)
from simple_model.plates.path_forces import modal_path_forces
from simple_model.plates.von_karman import KarmanPlate, karman_plate
from skinwave.bodies.body import Body
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
from skinwave.system.effort import Progress, peak_memory, silent
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
FIRST_DURATION = 0.2  # s of a response, at least, for which steps and modes are chosen
NEGLIGIBLE_MODE = 1e-4  # of the mode that moves most: weaker modes do not show on a map
SHARE = 0.3  # of the tolerance, for the change by longer steps and fewer modes
# Error over this change: 0.2 to 1.7, because modes converge slowly near a resonance.
TRUNCATION = 2.0
# Seconds of two modes of one symmetry, in the modes, and in a line with tension; of a line and a
# mode. Seconds and bytes of the states of stress; seconds of a time step at large deflection, with
# all its repetitions; bytes of a sample, a probe and a mode, and of a step.
OF_MODES, COUPLED_LINE, MODAL_FORCE = 3e-7, 1.7e-8, 1e-7
OF_STATES, STRETCHED_STEP, OF_SUM, OF_STEP = (1.5, 8e7), 4e-4, 0.7, 6e3
DEGREE = 5  # of the splines that are differentiated


def plate_of(body: Body) -> Plate:
    """Return the thin plate of a sheet as a record of `simple_model.plates.modes`."""
    held, Q = body.mounting, body.solid.plane_stress * body.depth**3 / 12
    support = {edge: held.support if edge in held.edges else "free" for edge in EDGES}
    return Plate(
        size_x=body.width, size_y=body.height, mass_per_area=body.mass_per_area,
        d11=Q[0, 0], d22=Q[1, 1], d12=Q[0, 1], d66=Q[2, 2],
        tension_x=held.tension_x, tension_y=held.tension_y, **support,
        clips=held.clips, clip_radius=held.clip_radius if held.clips else 0.0,
        air_density=AIR_DENSITY if body.air else 0.0,
    )  # fmt: skip


modes_of = lru_cache(maxsize=4)(plate_modes)
_karman = lru_cache(maxsize=6)(karman_plate)


def middle_compliance(body: Body) -> float:
    """Return the static deflection at the middle of a supported sheet per force there, in m/N."""
    modes = modes_of(plate_of(replace(body, air=False)))
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
    `motion` (f, m) in the steady state.
    """

    modes: PlateModes
    frequencies: Floats
    forces: Complex
    motion: Complex
    outputs: Floats


def steady_answer(scene: Scene, times: Floats, options: SolveOptions) -> Response:
    """Solve the steady state of the modes for all lines below half the sampling rate."""
    started, driven = time.perf_counter(), _drive(scene, times, options.progress)
    return _response(scene, times, MODES.name, driven, _steady(scene, driven, times), started)


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


def answer_from_rest(scene: Scene, times: Floats, options: SolveOptions) -> Response:
    """Solve the steady state and the free vibration after a start from rest."""
    started, driven = time.perf_counter(), _drive(scene, times, options.progress)
    values = _from_rest(scene, driven, times)
    return _response(scene, times, FROM_REST.name, driven, values, started)


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


def without_shear(scene: Scene, error: float) -> ErrorPart:
    """Return the part of the error of a thin plate."""
    cure = "use --model fem" if takes(named("fem"), scene) else "use a thinner sheet"
    source = "shear and rotary inertia, which a thin plate leaves out"
    return ErrorPart(name="thin plate", source=source, error=error, cure=cure)


def sensitivity(scene: Scene) -> float:
    """Return the relative change of the waveforms per relative change of natural frequencies."""
    return effect_of(_detuned, scene, len(sample_times(scene))) / DETUNING


Factors = tuple[Floats | float, Floats | float]  # of the stiffness of bending and of modal mass


@lru_cache(maxsize=64)
def effect_of(change: Callable[[Body, PlateModes], Factors], scene: Scene, samples: int) -> float:
    """Return the relative change of the first samples from rest with other modes, without coupling.

    `change` returns the factors (m,) of a body's modes.
    """
    times, modulus = sample_times(scene)[:samples], partial(relative_modulus, scene.body)
    driven, values = _uncoupled(scene, samples)
    count = len(driven.modes.squared)
    bending, mass = (np.broadcast_to(f, count) for f in change(scene.body, driven.modes))
    modes = scaled_modes(driven.modes, bending=bending, mass=mass)
    forces, outputs = (each / np.sqrt(mass) for each in (driven.forces, driven.outputs))
    motion = modal_motion_apart(modes, driven.frequencies, forces, modulus)
    other = replace(driven, modes=modes, forces=forces, outputs=outputs, motion=motion)
    changed = _from_rest(scene, other, times)
    return float(relative_changes(changed - values, changed).max())


def _shear_and_inertia(body: Body, modes: PlateModes) -> Factors:
    bent = np.maximum(modes.squared * modes.elastic, 0.0)
    k = np.asarray((bent * body.mass_per_area / body.bending_stiffness) ** 0.25)
    return thick_plate(k * body.depth, body.solid.poisson)


def _detuned(body: Body, modes: PlateModes) -> Factors:
    return 1.0, (1 + DETUNING) ** -2


@lru_cache(maxsize=2)
def _uncoupled(scene: Scene, samples: int) -> tuple[Driven, Floats]:
    """Return the motion from rest (t, p) without coupling between modes, and its modes."""
    times = sample_times(scene)[:samples]
    driven = _drive(scene, times, motion=modal_motion_apart)
    return driven, _from_rest(scene, driven, times)


def _drive(
    scene: Scene,
    times: Floats,
    progress: Progress = silent,
    motion: Callable[..., Complex] = modal_motion,
) -> Driven:
    body, pressure = scene.body, scene.pressure
    progress("modes", 0.0)
    modes: PlateModes = modes_of(plate_of(body))
    progress("lines", 0.0)
    middle = body.placement.offset
    f, forces = lines_from_rest(pressure).gather(modal_path_forces(modes, pressure, middle))
    driving = f < highest_driving(pressure, times)
    f, forces = f[driving], forces[driving]
    return Driven(
        modes=modes, frequencies=f, forces=forces, outputs=modes.at(scene.probe_points - middle),
        motion=motion(modes, f, forces, partial(relative_modulus, body)),
    )  # fmt: skip


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
    """Return the free vibration (t, p) after the state of rest before t = 0. Uncoupled modes are
    solved separately; coupled ones such that all are at rest at t = 0.
    """
    modes, f, forces = driven.modes, driven.frequencies, driven.forces
    free = free_modes(modes, scene.body.solid)
    uncoupled = modal_motion_apart(modes, f, forces, partial(relative_modulus, scene.body))
    coupling = driven.motion - uncoupled
    speed = (2j * np.pi * f @ coupling).real
    start = free.start(f, forces) - free.impulse(coupling.real.sum(axis=0), speed)
    start *= scene.reading.record.factor(free.poles)
    vibrates = free.residues != 0
    outputs = np.broadcast_to(driven.outputs.T[:, None], (*vibrates.shape, len(driven.outputs)))
    amplitudes = start[vibrates][:, None] * outputs[vibrates]
    return exponential_sum(free.poles[vibrates], amplitudes, times)


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
    coupled = any(family.bending is not None for family in modes.families)
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


def stretched_answer(scene: Scene, times: Floats, options: SolveOptions) -> Response:
    """Solve the linear motion from rest, and add the effect of stretching."""
    started = time.perf_counter()
    modes: PlateModes = modes_of(plate_of(scene.body))
    options.progress("large deflection", 0.0)
    found = _stretch(scene, len(times), step(times), options.tolerance, options.dt)
    effort = Effort(
        seconds={"evaluate": time.perf_counter() - started}, dofs=len(modes.squared),
        reduced_dofs=found.count, steps=found.parts * (len(times) - 1),
        dt=step(times) / found.parts, peak_memory=peak_memory(),
        errors=Statement(
            parts=(ERROR, thin_plate_part(scene), found.error), tolerance=options.tolerance
        ),
    )  # fmt: skip
    return response_of(scene, STRETCHED.name, times, found.linear + found.values, effort)


def first_part(scene: Scene, times: Floats) -> Floats:
    """Return the times (s,) in s for which steps and modes are chosen."""
    slowest, _ = slowest_and_fastest(scene.pressure)
    return times[: max(2, round(max(FIRST_DURATION, 1 / slowest) / step(times)) + 1)]


def linear_error(scene: Scene, times: Floats, linear: Floats) -> float:
    """Return the largest relative error of a linear response (t, p) from rest."""
    modes: PlateModes = modes_of(plate_of(scene.body))
    parts = ceil(step(times) / LONGEST - 1e-9)
    stretching = _stretching(scene, times, min(COUNTS[0], len(modes.squared)), parts)
    return float(relative_changes(stretching, linear + stretching).max())


@lru_cache(maxsize=1)
def sheet_motion(scene: Scene, tolerance: float) -> tuple[Floats, Floats, Callable[..., Floats]]:
    """Return the motion of a whole sheet from rest: times (t,) in s, coordinates (t, m) in kg^1/2 m
    of all modes that move, and the function of their shapes (p, m) at places (p, 2) in m.
    """
    times, middle = sample_times(scene), scene.body.placement.offset
    modes: PlateModes = modes_of(plate_of(scene.body))
    found = _stretch(scene, len(times), step(times), tolerance, None)
    plate, stretching = _coordinates(
        scene.pressure, scene.body, len(times), step(times), found.count, found.parts
    )
    sizes = np.linalg.norm(_drive(scene, times).motion, axis=0)
    moving = np.union1d(np.flatnonzero(sizes > NEGLIGIBLE_MODE * sizes.max()), plate.chosen)
    z = linear_motion(modes, scene.pressure, scene.body.solid, times, middle=middle, chosen=moving)
    z[:, np.searchsorted(moving, plate.chosen)] += stretching[:: found.parts]
    return times, z, lambda places: modes.at(places - middle)[:, moving]


@dataclass(frozen=True, kw_only=True, eq=False)
class Stretching:
    """What stretching adds to a `linear` response (t, p), `values` (t, p), with `count` modes, and
    `parts` time steps for each sample, and the `error` of both.
    """

    linear: Floats
    values: Floats
    count: int
    parts: int
    error: ErrorPart


@lru_cache(maxsize=1)  # a response and a map of the same motion
def _stretch(
    scene: Scene, samples: int, sample: float, tolerance: float, dt: float | None
) -> Stretching:  # fmt: skip
    """Return what stretching adds at every `sample` in s, within the tolerance if possible.

    The whole record is solved with what its first part needs, and with more if that is too little:
    a resonance may build up slowly, and errors grow with it.
    """
    times: Floats = sample * np.arange(samples, dtype=np.float64)
    options = SolveOptions(tolerance=tolerance, dt=dt)
    linear = FROM_REST.solve(scene, times, options).values
    start = first_part(scene, times)
    found = _resolve(scene, start, options, linear[: len(start)])
    if len(start) < len(times):
        found = _resolve(scene, times, options, linear, (found.count, found.parts))
    return found


def _resolve(
    scene: Scene, times: Floats, options: SolveOptions, linear: Floats,
    least: tuple[int, int] = (0, 1),
) -> Stretching:  # fmt: skip
    """Return what stretching adds, with at least the given numbers of modes and of parts."""
    sample, allowed = step(times), SHARE * options.tolerance
    modes: PlateModes = modes_of(plate_of(scene.body))
    counts = [min(count, len(modes.squared)) for count in COUNTS]
    # A record of few samples cannot have longer steps.
    parts = max(least[1], 1 + (len(times) <= 4 * DEGREE))
    parts = max(parts, ceil(sample / (options.dt or LONGEST) - 1e-9))
    solved = partial(_stretching, scene, times)

    def with_longer_steps(count: int) -> tuple[Floats, int, float]:
        """Return the values with longer steps, their stride, and the ratio of the steps."""
        if parts > 1:
            return solved(count, parts // 2), 1, parts / (parts // 2)
        return _stretching(scene, times[::2], count, 1), 2, 2.0

    def change(other: Floats, stride: int = 1) -> float:
        whole = (linear + values)[::stride]
        return float(relative_changes(values[::stride] - other, whole).max())

    for fewer, count in pairwise(counts):
        if count < least[0]:
            continue
        while True:
            values = solved(count, parts)
            # Fewer modes in longer steps bound both errors in one run.
            other, stride, ratio = with_longer_steps(fewer)
            if (error := change(other, stride)) <= allowed:
                break
            other, stride, ratio = with_longer_steps(count)
            by_steps = change(other, stride) / (ratio**2 - 1)  # of second order
            if by_steps <= allowed or options.dt or sample / parts <= SHORTEST:
                error = by_steps + change(solved(fewer, parts))
                break
            parts *= 2
        if error <= 2 * allowed:
            break
    shorter = f"{sample / parts / 2:.7f}".rstrip("0")
    part = steps_part(
        f"{count} modes that stretch, in steps of {1e3 * sample / parts:.3g} ms",
        TRUNCATION * error, f", or skinwave run --dt {shorter}",
    )  # fmt: skip
    return Stretching(linear=linear, values=values, count=count, parts=parts, error=part)


def steps_part(source: str, error: float, more: str = "") -> ErrorPart:
    """Return the part of the error of the steps and the modes of a sheet that stretches."""
    cure = f"use a lower pressure or a material with more loss{more}"
    return ErrorPart(name="steps and modes", source=source, error=error, cure=cure)


def _planned_parts(scene: Scene, options: SolveOptions) -> Iterator[ErrorPart]:
    """Yield the parts of a sheet that stretches, with the error at which steps and modes suffice,
    which the response replaces by its own.
    """
    yield from (ERROR, thin_plate_part(scene))
    allowed = TRUNCATION * SHARE * options.tolerance
    yield steps_part("modes that stretch, in time steps", allowed)


def _stretching(scene: Scene, times: Floats, count: int, parts: int) -> Floats:
    """Return what stretching adds to the quantity (t, p), with `parts` steps per sample."""
    plate, coordinates = _coordinates(
        scene.pressure, scene.body, len(times), step(times), count, parts
    )
    values = coordinates @ plate.shapes(scene.probe_points - scene.body.placement.offset).T
    if rate := scene.reading.record.rate:
        from scipy.interpolate import make_interp_spline  # slow to import

        steps = step(times) / parts * np.arange(len(coordinates))
        values = make_interp_spline(steps, values, DEGREE)(steps, rate)
    return np.asarray(values[::parts])


@lru_cache(maxsize=3)  # the response, the map and the picture of a sheet need the same ones
def _coordinates(
    pressure: MovingPressure, body: Body, samples: int, sample: float, count: int, parts: int
) -> tuple[KarmanPlate, Floats]:
    """Return the plate, and the coordinates (n, r) in kg^1/2 m that stretching adds at each of
    `parts` steps of every `sample` in s.
    """
    modes, dt = modes_of(plate_of(body)), sample / parts
    plate = _karman(modes, body.depth, count)
    steps = np.asarray(dt * np.arange(parts * (samples - 1) + 1), np.float64)
    # Faster lines hardly deflect the sheet, and do not stretch it.
    linear = linear_motion(
        modes, pressure, body.solid, steps, middle=body.placement.offset, chosen=plate.chosen,
        highest=0.5 / dt,
    )  # fmt: skip
    return plate, stretched_motion(plate, linear, dt, body.solid).coordinates - linear


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
