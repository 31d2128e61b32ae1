"""Modes of a thin plate by Ritz's method: sheets of any support, stretched, with their air."""

import time
from dataclasses import replace
from functools import lru_cache

import numpy as np

from meshes.tetmesh import Floats
from simple_model import Effort, Response
from simple_model.compliance import AIR_DENSITY
from simple_model.load_spectrum import load_lines, synthesise
from simple_model.plate_modes import Plate, PlateModes, plate_modes, steady_response
from simple_model.plate_response import modal_path_forces
from simple_model.sampling import shown
from skinwave.bodies.body import Body
from skinwave.bodies.mounting import EDGES
from skinwave.effort import peak_memory
from skinwave.models import Model, Request, of_surface_motion, register
from skinwave.scene import Scene

ERROR = 0.01  # relative, of a steady waveform beside finite elements of a frame, vacuum and air


def plate_of(body: Body) -> Plate:
    """Thin plate of a sheet in the record of `simple_model.plate_modes`."""
    held, Q = body.mounting, body.solid.plane_stress * body.depth**3 / 12
    support = {edge: held.support if edge in held.edges else "free" for edge in EDGES}
    return Plate(
        size_x=body.width, size_y=body.height, mass_per_area=body.mass_per_area,
        d11=Q[0, 0], d22=Q[1, 1], d12=Q[0, 1], d66=Q[2, 2],
        tension_x=held.tension_x, tension_y=held.tension_y, **support,
        clips=held.clips, clip_radius=held.clip_radius if held.clips else 0.0,
        air_density=AIR_DENSITY if body.air else 0.0,
    )  # fmt: skip


_modes = lru_cache(maxsize=4)(plate_modes)


def middle_compliance(body: Body) -> float:
    """Static deflection of the middle of a held sheet per force there, m/N."""
    modes = _modes(plate_of(replace(body, air=False)))
    return float((modes.at([[0.0, 0.0]]) ** 2 / modes.squared).sum())


def loss_factor(body: Body, frequencies: Floats) -> Floats:
    """Loss factor (f,) of bending at frequencies (f,) in Hz."""
    modulus = body.solid.complex_modulus(2 * np.pi * frequencies)
    return np.asarray(modulus.imag / modulus.real)


def plate_answer(scene: Scene, request: Request) -> Response:
    """Steady state of the modes under every line of the load below half the sampling rate."""
    started, body, pressure = time.perf_counter(), scene.body, scene.pressure
    request.report("modes", 0.0)
    modes: PlateModes = _modes(plate_of(body))
    request.report("lines", 0.0)
    middle = body.placement.offset
    f, forces = load_lines(pressure).gather(modal_path_forces(modes, pressure, middle))
    below = shown(pressure, f, request.times)
    f, forces = f[below], forces[below]
    outputs = modes.at(scene.probe_points - middle)
    lines = steady_response(modes, f, forces, outputs, loss_factor(body, f))
    lines = lines * scene.reading.asked.factor(2j * np.pi * f)[:, None]
    return Response(
        model=MODES.name, times=request.times, probes=scene.probe_points,
        quantity=scene.reading.asked.name, values=synthesise(f, lines, request.times),
        effort=Effort(
            seconds={"evaluate": time.perf_counter() - started}, dofs=len(modes.squared),
            steps=len(f), peak_memory=peak_memory(),
        ),
    )  # fmt: skip


def _refuse(body: Body) -> None:
    if not body.of_kind.is_plate or body.sides != "clamped":
        raise ValueError(
            f"plate-modes is for a sheet that is held, not a {body.kind} with {body.sides} sides; "
            "give it one, or use --model fem"
        )
    if body.base != "free" or body.placement.is_tilted:
        raise ValueError(
            "plate-modes is for a sheet of free faces that lies across the beam; leave out its "
            "base and its tilt, or use --model fem"
        )
    if body.mounting.is_curled:
        raise ValueError("plate-modes is for a flat sheet, not a curled one; use --model fem")
    if body.solid.prony or body.solid.law is not None:
        raise ValueError(
            "plate-modes takes one modulus at all frequencies; give the material a loss_factor or "
            "a viscosity, or use --model fem"
        )


MODES = register(
    Model(
        name="plate-modes",
        method="modes of a thin plate by Ritz's method, line by line",
        words="the steady state of a thin plate, in its modes by Ritz's method",
        solve=plate_answer,
        refuse=_refuse,
        error=lambda scene, h: ERROR,
        seconds=0.5,
        memory=2e8,
        colour="#F0E442",
        reads=of_surface_motion,
        is_steady=True,
    )
)
