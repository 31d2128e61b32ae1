"""Point kernel under the scene's own load, and under that of the paper."""

from dataclasses import replace

from simple_model import Effort, ErrorPart, point_kernel, point_kernel_published
from simple_model.load.sampling import highest_line, oversampling, step
from simple_model.quantities import PRESSURE
from skinwave.models import Cost, Model, register
from skinwave.models.costs import UNITS, Cheaper, computed_times
from skinwave.models.limits import load_limit
from skinwave.models.options import SolveOptions
from skinwave.scene.scene import Scene


def _cost(scene: Scene, options: SolveOptions, effort: Effort) -> Cost:
    times = computed_times(scene, options)
    parts = oversampling(highest_line(scene.pressure), step(times))
    values = len(times) * parts * len(scene.probes)
    spot = 3e-8  # s of the pressure of a focus at a probe and a sample
    seconds = UNITS.start + spot * values * len(scene.tacton.foci)
    return Cost(parts={Cheaper.PROBES: seconds}, memory=UNITS.process + 24 * values)


SAME_LOAD = register(
    Model(
        name="point-kernel",
        label="kernel, same load",
        method="point kernel",
        words="the local pressure in Pa, from the distance to the moving focus; nothing propagates",
        solve=lambda scene, times, _: point_kernel(scene.pressure, scene.probe_points, times),
        parts=lambda scene, options: [
            ErrorPart(  # on any body, measured 0.98 to 1.04
                name="no waves", source="the point kernel", error=1.0, cure="use a model with waves"
            )
        ],
        cost=_cost,
        colour="#000000",
        limits=lambda scene: [] if scene.load.is_plain else [load_limit(scene)],
        quantity=PRESSURE.name,
        needs_body=False,
    )
)
PUBLISHED = register(
    replace(
        SAME_LOAD,
        name="point-kernel-published",
        label="kernel, as published",
        words="the point kernel with the load of Lim, Seifi and Park (the commanded signal "
        "without its mean)",
        solve=lambda scene, times, _: point_kernel_published(
            scene.pressure, scene.probe_points, times
        ),
        colour="#999999",
    )
)
