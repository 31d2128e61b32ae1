"""Error of absorbing bases and sides: what their layer reflects, and the body that keeps it small.

On a coarse mesh the absorbing layer is made twice as wide. The change of the waveforms is most of
what the usual layer returns, because the wider one damps waves more, and near fields end further
out.
"""

from dataclasses import replace
from functools import partial

import numpy as np

import fem
from meshes.tetmesh import Floats
from skinwave.bodies.absorbing_layer import has_layer, layer_of
from skinwave.bodies.mounting import EDGES
from skinwave.bodies.sizes import check_mesh, default_size
from skinwave.bodies.slab import discretise
from skinwave.models.options import DEFAULT, SolveOptions
from skinwave.models.prepared import answer, prepare, reduction_tolerance
from skinwave.planning.estimates import spot_scale
from skinwave.planning.extent import symmetry, within_reflections
from skinwave.planning.records import PlanRow
from skinwave.planning.refinement import about_its_rest, element_sizes, relative_change
from skinwave.scene.scene import Body, Scene

WIDER = 2.0  # times the width of the layer
# Of the change: slabs on springs, free ones and half-spaces had 1.0 to 1.3 times it in error.
MARGIN = 1.5
COARSE = 0.01  # relative error of reduced bodies that cannot be reduced to less
SHARE = 0.25  # of the tolerance: what absorbing ends may leave before the body is extended
MOST_EXTENSIONS = 2


def absorbing_error(scene: Scene, body: Body, options: SolveOptions = DEFAULT) -> float:
    """Relative error of the worst probe's waveform that the absorbing base and sides of a slab
    leave.

    Parameters
    ----------
    scene : Scene, with load and probes
    body : Body that is meshed, the scene's or an extended one
    options : SolveOptions

    Returns
    -------
    float; 0 of a body without an absorbing layer
    """
    if not has_layer(body):
        return 0.0
    size = min(float(element_sizes(body)[0]), 2 * spot_scale(scene.pressure))
    axes = symmetry(scene)

    def answered(wider: float, reduction: float) -> Floats:
        prepared = prepare(
            body, scene.probe_points, options.progress, h=size, symmetry=axes,
            solver=options.solver, tolerance=reduction, reading=scene.reading, load=scene.load,
            discretise=partial(discretise, wider=wider),
        )  # fmt: skip
        return about_its_rest(scene, answer(prepared, scene).values)

    def change(reduction: float) -> float:
        return relative_change(answered(1.0, reduction), answered(WIDER, reduction))

    try:
        return MARGIN * change(reduction_tolerance(options.tolerance))
    except fem.NotReduced:  # a free body has hundreds of modes in a wide layer
        return MARGIN * change(COARSE)


def extent(
    scene: Scene, options: SolveOptions, highest: float
) -> tuple[Body, list[PlanRow], float]:
    """Body without what reflects too little to matter, or extended at its absorbing ends until
    these leave a small share of the tolerance.

    Parameters
    ----------
    scene, options : as for `absorbing_error`
    highest : Hz, of the lines that count

    Returns
    -------
    Body, a row if it is not all of the scene's, and the error that its absorbing ends leave
    """
    body, rows = within_reflections(scene, options.tolerance, highest)
    found, left = body, absorbing_error(scene, body, options)
    for _ in range(MOST_EXTENSIONS):
        larger = _larger(found)
        if left <= SHARE * options.tolerance or larger == found:
            break
        try:
            check_mesh(larger, default_size(larger))
        except ValueError:  # too large
            break
        found, left = larger, absorbing_error(scene, larger, options)
    if found == body:
        return body, rows, left
    size = f"{1e3 * found.width:.0f} x {1e3 * found.height:.0f} x {1e3 * found.depth:.0f} mm"
    row = PlanRow(
        what="extent", value=size,
        reason=f"absorbing ends further away; they leave an error of {100 * left:.2g} %",
    )  # fmt: skip
    return found, [row], left


def _larger(body: Body) -> Body:
    """The body with its absorbing ends further out by the width of their layer; ends of an axis
    whose sides differ stay.
    """
    ends = [{body.side(name) for name, (k, _) in EDGES.items() if k == axis} for axis in (0, 1)]
    by = np.array([*(each == {"absorbing"} for each in ends), body.base == "absorbing"])
    width, height, depth = layer_of(body).width * by * (2, 2, 1)
    return replace(
        body, width=body.width + width, height=body.height + height, depth=body.depth + depth
    )
