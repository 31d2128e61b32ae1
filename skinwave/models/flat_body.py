"""Wavenumber integrals of a laterally infinite body: in time from rest, and the steady state."""

import time
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

import simple_model
from simple_model import Effort, Response, steady_state
from simple_model.layers.flat_body import field_history, steady_history
from simple_model.layers.flat_quantities import quantity_field, surface_field, traction_field
from simple_model.layers.wavenumber_integral import Field
from simple_model.load.focus import gaussian_width
from skinwave.bodies.analytic import compliance, stack
from skinwave.bodies.parts import FLAT
from skinwave.models import Limit, Model, register
from skinwave.models.laws import has_table
from skinwave.models.limits import (
    load_limit,
    of_alike_directions,
    of_body,
    of_part,
    read_at_surface,
    reading_limit,
)
from skinwave.models.options import SolveOptions
from skinwave.scene.scene import Scene
from skinwave.typing import Floats

LAYERS = (
    "E. Kausel, J. M. Roesset: Stiffness matrices for layered soils. Bulletin of the Seismological "
    "Society of America 71 (1981) 1743-1761"
)
STEP = "wavenumber integral"


def _from_rest(scene: Scene, times: Floats, options: SolveOptions) -> Response:
    options.progress(STEP, 0.0)
    if not (scene.reading.is_plain and scene.load.is_plain):
        return _read("flat-body", field_history, scene, times)
    return simple_model.flat_body(compliance(scene.body), scene.pressure, scene.probe_points, times)


def _steady(scene: Scene, times: Floats, options: SolveOptions) -> Response:
    options.progress(STEP, 0.0)
    if not (scene.reading.is_plain and scene.load.is_plain):
        return _read("flat-body-harmonic", steady_history, scene, times)
    return steady_state(compliance(scene.body), scene.pressure, scene.probe_points, times)


def _read(model: str, history: Callable[..., Floats], scene: Scene, times: Floats) -> Response:
    """Response of a quantity, the probes of one depth together."""
    started = time.perf_counter()
    asked, depths = scene.reading.record, np.array(scene.depths)
    values = np.empty((len(times), len(depths)))
    for depth in np.unique(depths).tolist():
        here = depths == depth
        components = [
            history(field, pressure, scene.probe_points[here], times)
            for field, pressure in zip(fields_read(scene, depth), scene.loads, strict=True)
        ]
        values[:, here] = asked.waveforms(np.sum(components, axis=0), int(here.sum()))
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
    asked, layers = scene.reading.record, stack(scene.body)
    return tuple(traction_field(asked, layers, direction) for direction in upright)


def _limits(scene: Scene) -> Iterator[Limit]:
    body, reading, load, pressure = scene.body, scene.reading, scene.load, scene.pressure
    if body.of_kind.compliance is None:
        yield Limit(why=f"takes a slab or a sheet, not a {body.kind}")
        return
    if body.placement != FLAT:
        yield Limit(
            why="takes a body that lies flat at the origin, not a tilted or moved one",
            cure="leave out [placement]", change=of_body(placement=FLAT),
        )  # fmt: skip
    if body.of_kind.is_plate:
        yield from of_alike_directions(body)
    if gaussian_width(pressure.height, pressure.profile) is None:
        yield Limit(
            why=f"takes a Gaussian focus, not the profile {pressure.profile_name}",
            cure='take profile = "gaussian"',
            change=lambda scene: replace(
                scene, pressure=replace(scene.pressure, profile="gaussian")
            ),
        )
    of_surface = reading.record.is_normal and reading.is_on_surface
    if body.of_kind.is_plate and not of_surface:
        yield reading_limit(scene)
    if not load.is_plain and (body.of_kind.is_plate or load.gravity or load.support_motion):
        yield load_limit(scene)
    elif not (load.is_plain or of_surface):
        yield Limit(
            why=f"has no {reading.words} under {load.words}",
            cure="ask for the displacement at the surface", change=read_at_surface,
        )  # fmt: skip


def _steady_limits(scene: Scene) -> Iterator[Limit]:
    yield from _limits(scene)
    if not any(solid.has_loss for solid in scene.body.solids):
        yield Limit(
            why="takes a material with loss, not one whose resonances are unbounded",
            cure="give the material a viscosity_pa_s", change=_with_loss,
        )  # fmt: skip


def _with_loss(scene: Scene) -> Scene:
    """The scene with a loss tangent of a tenth at 100 Hz."""
    viscosity = 0.1 * scene.body.solid.shear_modulus / (2 * np.pi * 100)
    return of_part("solid", viscosity=viscosity)(scene)


def field_read(scene: Scene, depth: float) -> Field:
    """Field of the quantity that a scene reads, at a depth in metre of its infinite body."""
    body, asked = scene.body, scene.reading.record
    if body.of_kind.is_layer:
        return quantity_field(asked, stack(body), depth)
    return surface_field(asked, compliance(body))


FLAT_BODY = register(
    Model(
        name="flat-body",
        method=STEP,
        words="linear waves of a laterally infinite flat body, by the wavenumber integral",
        solve=_from_rest,
        limits=_limits,
        error=None,
        seconds=2.0,
        memory=3e8,
        colour="#009E73",
        sources=(LAYERS,),
        is_infinite=True,
        takes_series=has_table,
    )
)
HARMONIC = register(
    replace(
        FLAT_BODY,
        name="flat-body-harmonic",
        method="wavenumber integral, line by line",
        words="the steady state of linear waves of a laterally infinite flat body, by the "
        "wavenumber integral",
        solve=_steady,
        limits=_steady_limits,
        colour="#E69F00",
        from_rest="flat-body",
        takes_series=lambda body: False,
    )
)
