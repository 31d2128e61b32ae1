"""A model from outside that takes half a second of nobody's time: the pressure at the probes."""

import time

from simple_model import Response
from skinwave.models import Model, Request, register
from skinwave.scene import Scene

SECONDS = 0.5


def solve(scene: Scene, request: Request) -> Response:
    time.sleep(SECONDS)
    return Response(
        model="waiting", times=request.times, probes=scene.probe_points,
        values=1e-9 * scene.pressure(scene.probe_points, request.times),
    )  # fmt: skip


WAITING = register(
    Model(
        name="waiting",
        method="1 nm for each Pa, after a while",
        words="the pressure itself, for tests of what waits",
        solve=solve,
    )
)
