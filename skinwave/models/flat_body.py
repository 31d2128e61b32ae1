"""Wavenumber integrals of a laterally infinite body: in time from rest, and the steady state."""

import time
from collections.abc import Callable

import numpy as np

import simple_model
from meshes.tetmesh import Floats
from simple_model import Effort, Response, steady_state
from simple_model.flat_quantities import (
    from_rest,
    quantity_field,
    steady,
    surface_field,
    traction_field,
)
from simple_model.wavenumber_integral import Field
from skinwave.bodies.analytic import exact_waves, stack
from skinwave.models import Model, Request, of_waves, register
from skinwave.models.laws import has_table
from skinwave.models.sources import LAYERS
from skinwave.scene import Scene

STEP = "wavenumber integral"


def _from_rest(scene: Scene, request: Request) -> Response:
    compliance = exact_waves(scene.body, "flat-body")
    request.report(STEP, 0.0)
    if not (scene.reading.is_plain and scene.load.is_plain):
        return _read("flat-body", from_rest, scene, request)
    return simple_model.flat_body(compliance, scene.pressure, scene.probe_points, request.times)


def _steady(scene: Scene, request: Request) -> Response:
    compliance = exact_waves(scene.body, "flat-body-harmonic")
    request.report(STEP, 0.0)
    if not (scene.reading.is_plain and scene.load.is_plain):
        return _read("flat-body-harmonic", steady, scene, request)
    return steady_state(compliance, scene.pressure, scene.probe_points, request.times)


def _read(model: str, waveforms: Callable[..., Floats], scene: Scene, request: Request) -> Response:
    """Response of a quantity, the probes of one depth together."""
    started, times = time.perf_counter(), request.times
    asked, depths = scene.reading.asked, np.array(scene.depths)
    values = np.empty((len(times), len(depths)))
    for depth in np.unique(depths).tolist():
        here = depths == depth
        values[:, here] = sum(
            waveforms(field, asked, pressure, scene.probe_points[here], times)
            for field, pressure in zip(fields_read(scene, depth), scene.loads, strict=True)
        )
    effort = Effort(seconds={"evaluate": time.perf_counter() - started}, steps=len(times))
    return Response(
        model=model, times=times, probes=scene.probe_points, quantity=asked.name, values=values,
        effort=effort,
    )  # fmt: skip


def fields_read(scene: Scene, depth: float) -> tuple[Field, ...]:
    """Fields of the quantity that a scene reads, one for each component of its load."""
    if scene.load.is_plain:
        return (field_read(scene, depth),)
    upright = scene.load.tractions(np.array([[0.0, 0.0, 1.0]]))[:, 0]
    asked, layers = scene.reading.asked, stack(scene.body)
    return tuple(traction_field(asked, layers, direction) for direction in upright)


def takes_load(scene: Scene) -> bool:
    """Whether it takes a scene's load: of tractions of any direction, which need a stack of layers,
    it has the normal motion of the surface.
    """
    reading, load = scene.reading, scene.load
    own = reading.asked.is_normal and reading.is_on_surface and scene.body.of_kind.is_layer
    return load.is_plain or (own and not load.gravity and not load.support_motion)


def field_read(scene: Scene, depth: float) -> Field:
    """Field of the quantity that a scene reads, at a depth in metre of its laterally infinite body.

    Raises
    ------
    ValueError
        If the body has no wavenumber integral, or no such depth.
    """
    body, asked = scene.body, scene.reading.asked
    if body.of_kind.is_layer:
        return quantity_field(asked, stack(body), depth)
    return surface_field(asked, exact_waves(body, "flat-body"))


FLAT_BODY = register(
    Model(
        name="flat-body",
        method=STEP,
        words="linear waves of a laterally infinite flat body, by the wavenumber integral",
        solve=_from_rest,
        refuse=lambda body: exact_waves(body, "flat-body"),
        error=None,
        seconds=2.0,
        memory=3e8,
        colour="#009E73",
        sources=(LAYERS,),
        reads=of_waves,
        takes_load=takes_load,
        is_infinite=True,
        takes_series=has_table,
    )
)
HARMONIC = register(
    Model(
        name="flat-body-harmonic",
        method="wavenumber integral, line by line",
        words="the steady state of linear waves of a laterally infinite flat body, by the "
        "wavenumber integral",
        solve=_steady,
        refuse=lambda body: exact_waves(body, "flat-body-harmonic"),
        error=None,
        seconds=2.0,
        memory=3e8,
        colour="#E69F00",
        sources=(LAYERS,),
        reads=of_waves,
        takes_load=takes_load,
        is_infinite=True,
        from_rest="flat-body",
    )
)
