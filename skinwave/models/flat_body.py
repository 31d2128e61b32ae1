"""Wavenumber integrals of a laterally infinite body: in time from rest, and the steady state."""

import simple_model
from simple_model import Response, steady_state
from skinwave.bodies.analytic import exact_waves
from skinwave.models import Model, Request, register
from skinwave.models.laws import has_table
from skinwave.scene import Scene


def _from_rest(scene: Scene, request: Request) -> Response:
    compliance = exact_waves(scene.body, "flat-body")
    return simple_model.flat_body(compliance, scene.pressure, scene.probe_points, request.times)


def _steady(scene: Scene, request: Request) -> Response:
    compliance = exact_waves(scene.body, "flat-body-harmonic")
    return steady_state(compliance, scene.pressure, scene.probe_points, request.times)


FLAT_BODY = register(
    Model(
        name="flat-body",
        method="wavenumber integral",
        words="linear waves of a laterally infinite flat body, by the wavenumber integral",
        solve=_from_rest,
        refuse=lambda body: exact_waves(body, "flat-body"),
        error=None,
        seconds=2.0,
        memory=3e8,
        colour="#009E73",
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
        is_infinite=True,
        is_steady=True,
    )
)
