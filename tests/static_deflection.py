"""A model from outside: static compliance of the surface times the pressure, at all times."""

from collections.abc import Iterator

import numpy as np

from simple_model import Response
from skinwave.models import Limit, Model, register
from skinwave.models.limits import of_body, plain_limits
from skinwave.models.options import SolveOptions
from skinwave.scene.scene import Body, Scene
from skinwave.typing import Floats


def per_pressure(body: Body) -> float:
    """Deflection in metre of an elastic layer on a rigid base under a uniform pressure of 1 Pa."""
    solid = body.solid
    modulus = 2 * solid.shear_modulus * (1 - solid.poisson) / (1 - 2 * solid.poisson)
    return body.depth / modulus


def limits(scene: Scene) -> Iterator[Limit]:
    body = scene.body
    if body.base != "clamped" or not np.isfinite(body.depth):
        yield Limit(
            why=f"needs a body of finite depth with a clamped base, not a {body.base} one",
            cure='set base = "clamped"', change=of_body(base="clamped"),
        )  # fmt: skip
    yield from plain_limits(scene)


def solve(scene: Scene, times: Floats, options: SolveOptions) -> Response:
    pressure = np.array([scene.pressure(scene.probe_points, t) for t in times])
    return Response(
        model="static-deflection", times=times, probes=scene.probe_points,
        values=per_pressure(scene.body) * pressure,
    )  # fmt: skip


STATIC = register(
    Model(
        name="static-deflection",
        method="static compliance times pressure",
        words="the static deflection of a layer under the pressure of each time, without waves",
        solve=solve,
        limits=limits,
    )
)
