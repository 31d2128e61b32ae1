"""Modes of a thin plate by Ritz's method: sheets of any support, stretched, with their air; in the
steady state, and from rest.
"""

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import fem
from meshes.tetmesh import Floats
from simple_model import Effort, Response
from simple_model.layers.compliance import AIR_DENSITY
from simple_model.load.sampling import below_half_the_rate, highest_driving
from simple_model.load.spectrum import lines_from_rest, synthesise
from simple_model.plates.free_modes import free_modes
from simple_model.plates.modes import (
    Plate,
    PlateModes,
    modal_motion,
    modal_motion_apart,
    plate_modes,
)
from simple_model.plates.path_forces import modal_path_forces
from simple_model.typing import Complex
from skinwave.bodies.body import Body
from skinwave.bodies.supports import EDGES
from skinwave.models import Limit, Model, register
from skinwave.models.laws import has_own_law
from skinwave.models.limits import of_body, of_held_sheet, surface_motion
from skinwave.models.options import SolveOptions, sample_times
from skinwave.scene.scene import Scene
from skinwave.system.effort import peak_memory

PLATES = "A. W. Leissa: Vibration of Plates. NASA SP-160, 1969"
ERROR = 0.01  # relative, of a steady waveform beside finite elements of a frame, vacuum and air


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


def middle_compliance(body: Body) -> float:
    """Static deflection of the middle of a held sheet per force there, m/N."""
    modes = modes_of(plate_of(replace(body, air=False)))
    at_rest = relative_modulus(body, 0.0).real
    stiffness = modes.squared * (1 + (at_rest - 1) * modes.elastic)
    return float((modes.at([[0.0, 0.0]]) ** 2 / stiffness).sum())


def relative_modulus(body: Body, omega: ArrayLike) -> Any:
    """Complex modulus of bending (...) at angular frequencies (...) in rad/s, over the one that
    modes have.
    """
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
        quantity=scene.reading.asked.name, values=values,
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
    rates = scene.reading.asked.factor(2j * np.pi * driven.frequencies)[:, None]
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
    start *= scene.reading.asked.factor(free.poles)
    vibrates = free.residues != 0
    outputs = np.broadcast_to(driven.outputs.T[:, None], (*vibrates.shape, len(driven.outputs)))
    amplitudes = start[vibrates][:, None] * outputs[vibrates]
    return fem.exponential_sum(free.poles[vibrates], amplitudes, times)


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
