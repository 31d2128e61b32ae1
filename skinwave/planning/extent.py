"""Extent of a body that a scene requires: its symmetry, and how far its absorbing ends are.

On a coarse mesh the absorbing layer is made twice as wide. The change of the waveforms is most of
what the usual layer returns, because the wider one damps waves more, and near fields end further
out.
"""

from dataclasses import replace
from functools import partial

import numpy as np

import fem
from skinwave.bodies.absorbing_layer import has_layer, layer_of
from skinwave.bodies.analytic import is_flat_layer
from skinwave.bodies.sizes import check_mesh, default_size
from skinwave.bodies.slab import discretise
from skinwave.bodies.supports import EDGES
from skinwave.models.meshed import mirrored_axes
from skinwave.models.options import DEFAULT, SolveOptions
from skinwave.models.reduced import answer, prepare, reduction_tolerance
from skinwave.planning.estimates import FAR, absorbed_returned, spot_scale
from skinwave.planning.refinement import about_its_rest, element_sizes, relative_change
from skinwave.planning.rows import PlanRow
from skinwave.scene.scene import Body, Scene
from skinwave.typing import Floats

WIDER = 2.0  # times the width of the layer
# Of the change: slabs on springs, free ones and half-spaces had 1.0 to 1.3 times it in error.
MARGIN = 1.5
COARSE = 0.01  # relative error of reduced bodies that cannot be reduced to less
SHARE = 0.25  # of the tolerance: what absorbing ends may leave before the body is extended
MOST_EXTENSIONS = 2


def symmetry(scene: Scene) -> str:
    """Symmetry axes: across their middle planes the load is its own mirror image at all times."""
    if not isinstance(scene.pressure.profile, str):  # which may have no symmetry
        return ""
    path = scene.tacton.trajectory
    path_points = path.at_phase(np.zeros(1)) if path.is_static else path.outline
    return "".join(
        axis
        for axis, x in zip("xy", path_points.T, strict=True)
        if np.abs(x).max() < 1e-9 and axis in mirrored_axes(scene.body, scene.reading, scene.load)
    )


def absorbing_error(scene: Scene, body: Body, options: SolveOptions = DEFAULT) -> float:
    """Relative error of the worst probe's waveform that the absorbing base and sides of the meshed
    body leave, the scene's or an extended one; 0 without an absorbing layer.
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
    these leave a small share of the tolerance; a row if it is not all of the scene's, and the error
    that its absorbing ends leave. Lines up to the `highest` in Hz count.
    """
    body, rows = _within_reflections(scene, options.tolerance, highest)
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


def _within_reflections(
    scene: Scene, tolerance: float, highest: float
) -> tuple[Body, list[PlanRow]]:
    """Extent of the body out to where reflections of lines up to the `highest` in Hz are
    negligible, and the reason if it is not all of the scene's. Only absorbing sides are moved
    inwards: reflections from others belong to the response.
    """
    body = scene.body
    if not is_flat_layer(body) or (body.base, body.sides) != ("clamped", "absorbing"):
        return body, []
    half = np.array([body.width, body.height]) / 2
    cut = half.copy()
    for axis in (0, 1):
        alone = np.where(np.arange(2) == axis, half, FAR)
        for shorter in np.arange(0.03, min(0.8 * half[axis], FAR), 0.01):
            alone[axis] = shorter
            if absorbed_returned(scene, alone, highest) <= tolerance / 10:
                cut[axis] = shorter
                break
    if (cut == half).all():
        return body, []
    width, height = map(float, 2 * cut)
    row = PlanRow(
        what="extent",
        value=f"{1e3 * width:.0f} x {1e3 * height:.0f} mm",
        reason=f"reflections from further away are below {10 * tolerance:.2g} %; absorbing "
        f"sides there leave out {100 * (1 - cut.prod() / half.prod()):.0f} % of the body",
    )
    return replace(body, width=width, height=height), [row]


def _larger(body: Body) -> Body:
    """The body with its absorbing ends further out by the width of their layer."""
    ends = [{body.side(name) for name, (k, _) in EDGES.items() if k == axis} for axis in (0, 1)]
    by = np.array([*(each == {"absorbing"} for each in ends), body.base == "absorbing"])
    width, height, depth = layer_of(body).width * by * (2, 2, 1)
    return replace(
        body, width=body.width + width, height=body.height + height, depth=body.depth + depth
    )
