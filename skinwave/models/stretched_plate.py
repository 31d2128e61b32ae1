"""Thin plate of von Karman in its modes: a sheet at large deflection, from rest, without a mesh.

The motion without stretching is that of `plate-modes-transient`, of all modes and without time
steps. To it is added the difference that stretching makes, by time steps of the lowest modes. With
each answer two errors are measured over its first part: by steps twice as long, and by fewer modes.
"""

import time
from functools import lru_cache
from math import ceil, pi

import numpy as np
from scipy.interpolate import make_interp_spline

from meshes.tetmesh import Floats
from simple_model import Effort, Response
from simple_model.karman_motion import linear_motion, stretched_motion
from simple_model.plate_modes import PlateModes
from simple_model.response import step
from simple_model.sampling import resolving_step
from simple_model.von_karman import karman_plate
from skinwave.effort import peak_memory
from skinwave.models import Model, Request, register
from skinwave.models.laws import has_own_law, slowest_and_fastest
from skinwave.models.plate_modes import ERROR as PLATE_ERROR
from skinwave.models.plate_modes import FROM_REST, limits, modes_of, plate_of
from skinwave.models.sources import KARMAN, PLATES
from skinwave.models.stretching import relative
from skinwave.scene import Scene

LONGEST = 5e-5  # s, of time steps
FEWEST, MOST = 60, 120  # modes that stretch a sheet
BEYOND = 2.0  # times the highest strong line of a load: modes up to there count
FEWER = 0.7  # of these modes, beside which their number is judged
CHECKED = 0.2  # s of an answer, of which errors are measured
DEGREE = 5  # of the splines that are differentiated

_karman = lru_cache(maxsize=4)(karman_plate)


def _answer(scene: Scene, request: Request) -> Response:
    started, times = time.perf_counter(), request.times
    linear = FROM_REST.solve(scene, request)
    modes: PlateModes = modes_of(plate_of(scene.body))
    count = _count(scene, modes)
    dt = request.dt or resolving_step(scene.pressure, LONGEST)
    parts = 2 * ceil(step(times) / (2 * dt) - 1e-9)  # of a sample, in half as many for the check
    request.report("large deflection", 0.0)
    added = _added(scene, times, modes, count, parts)
    checked = times[: max(2, round(CHECKED / step(times)))]
    values = linear.values + added
    size, part = values[: len(checked)], added[: len(checked)]
    by_steps, by_modes = (
        relative(_added(scene, checked, modes, *given) - part, size).max()
        for given in ((count, parts // 2), (ceil(FEWER * count), parts))
    )
    # Steps are of second order: four times the error with steps twice as long.
    error = float(PLATE_ERROR + by_steps / 3 + by_modes)
    effort = Effort(
        seconds={"evaluate": time.perf_counter() - started}, dofs=len(modes.squared),
        reduced_dofs=count, steps=parts * (len(times) - 1), dt=step(times) / parts,
        peak_memory=peak_memory(),
    )  # fmt: skip
    return Response(
        model=STRETCHED.name, times=times, probes=scene.probe_points, values=values,
        quantity=scene.reading.asked.name, expected_error=error, effort=effort,
    )  # fmt: skip


def _count(scene: Scene, modes: PlateModes) -> int:
    """Number of modes that stretch the sheet: those that the load drives, and more above them."""
    _, highest = slowest_and_fastest(scene.pressure)
    driven = np.count_nonzero(modes.squared < (2 * pi * BEYOND * highest) ** 2)
    return min(max(int(driven), FEWEST), MOST, len(modes.squared))


def _added(scene: Scene, times: Floats, modes: PlateModes, count: int, parts: int) -> Floats:
    """Part (t, p) of the scene's quantity that stretching adds, by steps of a part of a sample."""
    body, middle = scene.body, scene.body.placement.offset
    plate, solid = _karman(modes, body.depth, count), body.solid
    dt = step(times) / parts
    steps = np.asarray(dt * np.arange(parts * (len(times) - 1) + 1), np.float64)
    linear = linear_motion(modes, scene.pressure, solid, steps, middle=middle, chosen=plate.chosen)
    moved = stretched_motion(plate, linear, dt, solid).coordinates - linear
    read = moved @ plate.shapes(scene.probe_points - middle).T
    if rate := scene.reading.asked.rate:
        read = make_interp_spline(steps, read, DEGREE)(steps, rate)
    return np.asarray(read[::parts])


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
