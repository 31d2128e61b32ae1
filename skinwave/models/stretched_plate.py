"""Thin plate of von Karman in its modes: a sheet at large deflection, from rest, without a mesh.

The motion without stretching is that of `plate-modes-transient`, of all modes and without time
steps. To it is added the difference that stretching makes, by time steps of the lowest modes. Their
number and the steps are as the tolerance asks: over the first part of each answer two errors are
measured, by steps half as long and by fewer modes.
"""

import time
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise
from math import ceil

import numpy as np

from meshes.tetmesh import Floats
from simple_model import Effort, MovingPressure, Response
from simple_model.load.sampling import step
from simple_model.plates.karman_motion import linear_motion, stretched_motion
from simple_model.plates.modes import PlateModes
from simple_model.plates.von_karman import KarmanPlate, karman_plate
from skinwave.models import Model, register
from skinwave.models.laws import has_own_law, slowest_and_fastest
from skinwave.models.options import SolveOptions, sample_times
from skinwave.models.plate_modes import ERROR as PLATE_ERROR
from skinwave.models.plate_modes import FROM_REST, PLATES, limits, modes_of, plate_of
from skinwave.models.stretching import relative
from skinwave.scene.scene import Scene
from skinwave.system.effort import peak_memory

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

_karman = lru_cache(maxsize=6)(karman_plate)


def _answer(scene: Scene, times: Floats, options: SolveOptions) -> Response:
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
        quantity=scene.reading.asked.name, expected_error=PLATE_ERROR + error,
        effort=replace(effort, seconds=seconds),
    )  # fmt: skip


def first_part(pressure: MovingPressure, times: Floats) -> Floats:
    """Times (s,) in s of the part of a response in which errors are measured: a period of the
    slowest strong line, and `CHECKED` at the least.
    """
    slowest, _ = slowest_and_fastest(pressure)
    return times[: max(2, round(max(CHECKED, 1 / slowest) / step(times)) + 1)]


def linear_error(scene: Scene, times: Floats, linear: Floats) -> float:
    """Largest relative error of linear bending: what stretching adds to the linear response (t, p)
    from rest at times (t,) in s.
    """
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
    if rate := scene.reading.asked.rate:
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
    Model(
        name="plate-modes-nonlinear",
        method="large deflection of a thin plate in its modes, from rest",
        words="a thin plate that stretches as it bends, in its modes by Ritz's method, from rest",
        solve=_answer,
        limits=limits,
        error=lambda scene, h: PLATE_ERROR,
        seconds=5.0,
        memory=4e8,
        colour="#4D4D9F",
        sources=(PLATES, KARMAN),
        is_nonlinear=True,
        takes_series=has_own_law,
    )
)
