"""Modes of a thin plate by Ritz's method: sheets of any support, stretched, with their air; in the
steady state, from rest, and at large deflection by von Karman's equations.

At large deflection the motion without stretching is that of `plate-modes-transient`, of all modes
and without time steps. To it is added the difference that stretching makes, by time steps of the
lowest modes. Their number and the steps are as the tolerance asks: over the first part of each
answer two errors are measured, by steps half as long and by fewer modes.
"""

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import pairwise
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fem.reduced import exponential_sum
from simple_model import Effort, MovingPressure, Response
from simple_model.layers.compliance import AIR_DENSITY
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
)
from simple_model.plates.path_forces import modal_path_forces
from simple_model.plates.von_karman import KarmanPlate, karman_plate
from skinwave.bodies.body import Body
from skinwave.bodies.supports import EDGES
from skinwave.models import Limit, Model, register
from skinwave.models.laws import has_own_law, slowest_and_fastest
from skinwave.models.limits import of_body, of_held_sheet, surface_motion
from skinwave.models.options import SolveOptions, sample_times
from skinwave.scene.scene import Scene
from skinwave.system.effort import peak_memory
from skinwave.typing import Complex, Floats

PLATES = "A. W. Leissa: Vibration of Plates. NASA SP-160, 1969"
ERROR = 0.01  # relative, of a steady waveform beside finite elements of a frame, vacuum and air
KARMAN = (
    "S. Bilbao, O. Thomas, C. Touze, M. Ducceschi: Conservative numerical methods for the full von "
    "Karman plate equations. Numerical Methods for Partial Differential Equations 31 (2015) "
    "1948-1970. doi 10.1002/num.21974"
)
LONGEST, SHORTEST = 1e-4, 2.5e-5  # s, of time steps
COUNTS = 42, 60, 86, 120  # modes that stretch a sheet, each number judged beside the one before
CHECKED = 0.2  # s of an answer at the least, of which errors are measured
SHARE = 0.3  # of the tolerance, for steps and for modes
DEGREE = 5  # of the splines that are differentiated
STANDSTILL = 1e-9  # of the motion of the probe that moves most


def plate_of(body: Body) -> Plate:
    """Thin plate of a sheet in the record of `simple_model.plates.modes`."""
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
    """Static deflection of the middle of a held sheet per force there, m/N."""
    modes = modes_of(plate_of(replace(body, air=False)))
    at_rest = relative_modulus(body, 0.0).real
    stiffness = modes.squared * (1 + (at_rest - 1) * modes.elastic)
    return float((modes.at([[0.0, 0.0]]) ** 2 / stiffness).sum())


def relative_modulus(body: Body, omega: ArrayLike) -> Any:
    """Complex modulus of bending at frequencies in rad/s, over that of the modes."""
    return body.solid.complex_modulus(omega) / body.solid.shear_modulus


@dataclass(frozen=True, kw_only=True, eq=False)
class Driven:
    """Modes of a scene's plate, the `forces` (f, m) in N kg^-1/2 of its load's lines at
    `frequencies` (f,) in Hz, and the shapes `outputs` (p, m) where it is read.
    """

    modes: PlateModes
    frequencies: Floats
    forces: Complex
    outputs: Floats


def steady_answer(scene: Scene, times: Floats, options: SolveOptions) -> Response:
    """Steady state of the modes under every line of the load below half the sampling rate."""
    started, driven = time.perf_counter(), _driven(scene, times, options)
    values = _steady(scene, driven, _motion(scene, driven), times)
    return _response(scene, times, MODES.name, driven, values, started)


def steady_lines(scene: Scene, places: Floats | None = None) -> tuple[Floats, Complex]:
    """Frequencies (f,) in Hz and complex amplitudes (f, p) of a scene's quantity in the steady
    state, at places (p, 2) in metre, or its probes; a ValueError of a load without lines.
    """
    driven = _driven(scene, sample_times(scene), SolveOptions())
    if places is not None:
        outputs = driven.modes.at(places - scene.body.placement.offset)
        driven = replace(driven, outputs=outputs)
    return driven.frequencies, _amplitudes(scene, driven, _motion(scene, driven))


def answer_from_rest(scene: Scene, times: Floats, options: SolveOptions) -> Response:
    """The steady state and the free vibration that a start from rest leaves."""
    started, driven = time.perf_counter(), _driven(scene, times, options)
    motion = _motion(scene, driven)
    values = _steady(scene, driven, motion, times) + _transient(scene, driven, motion, times)
    return _response(scene, times, FROM_REST.name, driven, values, started)


def _driven(scene: Scene, times: Floats, options: SolveOptions) -> Driven:
    body, pressure = scene.body, scene.pressure
    options.progress("modes", 0.0)
    modes: PlateModes = modes_of(plate_of(body))
    options.progress("lines", 0.0)
    middle = body.placement.offset
    f, forces = lines_from_rest(pressure).gather(modal_path_forces(modes, pressure, middle))
    driving = f < highest_driving(pressure, times)
    return Driven(
        modes=modes, frequencies=f[driving], forces=forces[driving],
        outputs=modes.at(scene.probe_points - middle),
    )  # fmt: skip


def _response(
    scene: Scene, times: Floats, model: str, driven: Driven, values: Floats, started: float
) -> Response:
    return Response(
        model=model, times=times, probes=scene.probe_points,
        quantity=scene.reading.record.name, values=values,
        effort=Effort(
            seconds={"evaluate": time.perf_counter() - started}, dofs=len(driven.modes.squared),
            steps=len(driven.frequencies), peak_memory=peak_memory(),
        ),
    )  # fmt: skip


def _motion(scene: Scene, driven: Driven) -> Complex:
    """Steady modal coordinates (f, m) of all lines."""
    modulus = partial(relative_modulus, scene.body)
    return modal_motion(driven.modes, driven.frequencies, driven.forces, modulus)


def _steady(scene: Scene, driven: Driven, motion: Complex, times: Floats) -> Floats:
    """Steady state (t, p)."""
    below = below_half_the_rate(driven.frequencies, times)
    amplitudes = _amplitudes(scene, driven, motion)
    return synthesise(driven.frequencies[below], amplitudes[below], times)


def _amplitudes(scene: Scene, driven: Driven, motion: Complex) -> Complex:
    """Lines (f, p) of the quantity that is asked for."""
    rates = scene.reading.record.factor(2j * np.pi * driven.frequencies)[:, None]
    return np.asarray(motion @ driven.outputs.T * rates)


def _transient(scene: Scene, driven: Driven, motion: Complex, times: Floats) -> Floats:
    """Free vibration (t, p) that ends the state of rest before t = 0: of each mode apart, and of
    coupled ones such that all are at rest at t = 0.
    """
    modes, f, forces = driven.modes, driven.frequencies, driven.forces
    free = free_modes(modes, scene.body.solid)
    beside = motion - modal_motion_apart(modes, f, forces, partial(relative_modulus, scene.body))
    speed = (2j * np.pi * f @ beside).real
    start = free.start(f, forces) - free.impulse(beside.real.sum(axis=0), speed)
    start *= scene.reading.record.factor(free.poles)
    vibrates = free.residues != 0
    outputs = np.broadcast_to(driven.outputs.T[:, None], (*vibrates.shape, len(driven.outputs)))
    amplitudes = start[vibrates][:, None] * outputs[vibrates]
    return exponential_sum(free.poles[vibrates], amplitudes, times)


def limits(scene: Scene) -> Iterator[Limit]:
    """Limits of thin plates in their modes: flat sheets that are held, read at the surface."""
    body = scene.body
    if not body.of_kind.is_plate:
        yield Limit(why=f"takes a sheet, not a {body.kind}")
        return
    yield from of_held_sheet(body)
    if body.base != "free":
        yield Limit(
            why=f"takes a sheet of free faces, not one with the base {body.base}",
            cure='take base = "free"', change=of_body(base="free"),
        )  # fmt: skip
    yield from surface_motion(scene)


MODES = register(
    Model(
        name="plate-modes",
        method="modes of a thin plate by Ritz's method, line by line",
        words="the steady state of a thin plate, in its modes by Ritz's method",
        solve=steady_answer,
        limits=limits,
        error=lambda scene, h: ERROR,
        seconds=0.5,
        memory=2e8,
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
        method="modes of a thin plate by Ritz's method, from rest",
        words="a thin plate from rest, in its modes by Ritz's method",
        colour="#8C510A",
    )
)


def relative(change: Floats, values: Floats) -> Floats:
    """Relative changes (p,) of waveforms (t, p); 0 where nothing moves."""
    sizes = np.linalg.norm(values, axis=0)
    moves = sizes > STANDSTILL * sizes.max()
    found = np.linalg.norm(change, axis=0) / np.where(moves, sizes, 1)
    return np.asarray(np.where(moves, found, 0.0))


def stretched_answer(scene: Scene, times: Floats, options: SolveOptions) -> Response:
    """Linear motion from rest, and what stretching adds to it."""
    started = time.perf_counter()
    linear = FROM_REST.solve(scene, times, options)
    modes: PlateModes = modes_of(plate_of(scene.body))
    options.progress("large deflection", 0.0)
    count, parts, error = _resolved(scene, times, options, modes, linear.values)
    options.progress("large deflection", 0.2)
    effort = Effort(
        seconds={"evaluate": time.perf_counter() - started}, dofs=len(modes.squared),
        reduced_dofs=count, steps=parts * (len(times) - 1), dt=step(times) / parts,
        peak_memory=peak_memory(),
    )  # fmt: skip
    values = linear.values + _added(scene, times, modes, count, parts)
    seconds = {"evaluate": time.perf_counter() - started}
    return Response(
        model=STRETCHED.name, times=times, probes=scene.probe_points, values=values,
        quantity=scene.reading.record.name, expected_error=ERROR + error,
        effort=replace(effort, seconds=seconds),
    )  # fmt: skip


def first_part(pressure: MovingPressure, times: Floats) -> Floats:
    """Times (s,) in s in which errors are measured: a period of the slowest strong line."""
    slowest, _ = slowest_and_fastest(pressure)
    return times[: max(2, round(max(CHECKED, 1 / slowest) / step(times)) + 1)]


def linear_error(scene: Scene, times: Floats, linear: Floats) -> float:
    """Largest relative error of the linear response (t, p) of a scene from rest."""
    modes: PlateModes = modes_of(plate_of(scene.body))
    parts = ceil(step(times) / LONGEST - 1e-9)
    added = _added(scene, times, modes, min(COUNTS[0], len(modes.squared)), parts)
    return float(relative(added, linear + added).max())


def settled(scene: Scene, tolerance: float) -> tuple[Floats, Floats, PlateModes]:
    """Motion of a whole sheet about its mean, in the later half of a scene: times (t,) in s,
    coordinates (t, m) in kg^1/2 m of all modes, and the modes.
    """
    times = sample_times(scene)
    options = SolveOptions(tolerance=tolerance)
    modes: PlateModes = modes_of(plate_of(scene.body))
    linear = FROM_REST.solve(scene, times, options).values
    count, parts, _ = _resolved(scene, times, options, modes, linear)
    kept = slice(len(times) // 2, None)
    middle = scene.body.placement.offset
    z = linear_motion(modes, scene.pressure, scene.body.solid, times[kept], middle=middle)
    plate, added = _moved(scene, times, modes, count, parts)
    z[:, plate.chosen] += added[::parts][kept]
    return times[kept], z - z.mean(axis=0), modes


def _resolved(
    scene: Scene, times: Floats, options: SolveOptions, modes: PlateModes, linear: Floats
) -> tuple[int, int, float]:
    """Number of modes that stretch the sheet and of time steps a sample, and the error they make:
    measured over the first part of an answer, and as small as the tolerance asks or as can be had.
    """
    sample = step(times)
    parts = ceil(sample / (options.dt or LONGEST) - 1e-9)
    counts = [min(count, len(modes.squared)) for count in COUNTS]
    start = first_part(scene.pressure, times)
    known: dict[tuple[int, int], Floats] = {}

    def added(count: int, parts: int) -> Floats:
        if (count, parts) not in known:
            known[count, parts] = _added(scene, start, modes, count, parts)
        return known[count, parts]

    for fewer, count in pairwise(counts):
        while True:
            part = added(count, parts)
            size = linear[: len(start)] + part
            # Steps are of second order: a quarter of the error with steps half as long.
            by_steps = 4 / 3 * float(relative(added(count, 2 * parts) - part, size).max())
            by_modes = float(relative(added(fewer, parts) - part, size).max())
            may_be_shorter = options.dt is None and sample / parts > SHORTEST
            if by_steps <= SHARE * options.tolerance or not may_be_shorter:
                break
            parts *= 2
        if by_modes <= SHARE * options.tolerance:
            break
    return count, parts, by_steps + by_modes


def _added(scene: Scene, times: Floats, modes: PlateModes, count: int, parts: int) -> Floats:
    """Part (t, p) of the scene's quantity that stretching adds, by steps of a part of a sample."""
    plate, moved = _moved(scene, times, modes, count, parts)
    read = moved @ plate.shapes(scene.probe_points - scene.body.placement.offset).T
    if rate := scene.reading.record.rate:
        from scipy.interpolate import make_interp_spline  # which takes long to import

        steps = step(times) / parts * np.arange(len(moved))
        read = make_interp_spline(steps, read, DEGREE)(steps, rate)
    return np.asarray(read[::parts])


def _moved(
    scene: Scene, times: Floats, modes: PlateModes, count: int, parts: int
) -> tuple[KarmanPlate, Floats]:
    """The plate, and the coordinates (n, r) in kg^1/2 m at all steps that stretching adds."""
    body, dt = scene.body, step(times) / parts
    plate = _karman(modes, body.depth, count)
    steps = np.asarray(dt * np.arange(parts * (len(times) - 1) + 1), np.float64)
    # Faster lines hardly deflect the sheet, and do not stretch it.
    linear = linear_motion(
        modes, scene.pressure, body.solid, steps, middle=body.placement.offset,
        chosen=plate.chosen, highest=0.5 / dt,
    )  # fmt: skip
    return plate, stretched_motion(plate, linear, dt, body.solid).coordinates - linear


STRETCHED = register(
    replace(
        FROM_REST,
        name="plate-modes-nonlinear",
        method="large deflection of a thin plate in its modes, from rest",
        words="a thin plate that stretches as it bends, in its modes by Ritz's method, from rest",
        solve=stretched_answer,
        seconds=5.0,
        memory=4e8,
        colour="#4D4D9F",
        sources=(PLATES, KARMAN),
        is_nonlinear=True,
    )
)
