"""Extent of the modelled body: its symmetry, and the distance of its absorbing ends.

To estimate the error of an absorbing layer, a coarse mesh is solved again with a layer twice as
wide. A wider layer damps waves more, and near fields end further out. The change of the waveforms
is therefore most of the reflection of the usual layer.
"""

from dataclasses import replace
from functools import partial

import numpy as np

import fem
from simple_model.numbers import percent
from skinwave.bodies.absorbing_layer import has_layer, layer_of
from skinwave.bodies.analytic import is_flat_layer
from skinwave.bodies.sizes import check_mesh, default_size
from skinwave.bodies.slab import discretise
from skinwave.bodies.supports import EDGES
from skinwave.models.options import DEFAULT, SolveOptions
from skinwave.models.reduced import answer, reduce_scene, reduction_tolerance
from skinwave.models.relative_change import relative_changes
from skinwave.models.symmetry import mirrored_axes
from skinwave.planning.estimates import ESTIMATE, absorbing_reflection
from skinwave.planning.record import PlanRow
from skinwave.planning.refinement import about_its_rest, element_sizes
from skinwave.scene.scene import Body, Scene
from skinwave.typing import Floats


def symmetry(scene: Scene) -> str:
    """Return the axes across whose middle planes body and load are symmetric at all times."""
    if not isinstance(scene.pressure.profile, str):  # a measured profile may have no symmetry
        return ""
    path = scene.tacton.trajectory
    points = path.at_phase(np.zeros(1)) if path.is_static else path.outline
    axes = mirrored_axes(scene.body, scene.reading, scene.load)
    on_plane = np.abs(points).max(axis=0) < 1e-9
    return "".join(
        axis for axis, is_on in zip("xy", on_plane, strict=True) if is_on and axis in axes
    )


def absorbing_error(
    scene: Scene, body: Body, options: SolveOptions = DEFAULT, *, wider: float = 2.0,
    margin: float = 1.5,
) -> float:  # fmt: skip
    """Return the error of the absorbing base and sides of a meshed body, 0 without any.

    It is `margin` times the change by a layer `wider` times as wide. For slabs on springs and
    half-spaces it was 1.0 to 1.3 times this change.
    """
    if not has_layer(body):
        return 0.0
    size = min(float(element_sizes(body)[0]), 2 * scene.pressure.spot_scale)
    axes = symmetry(scene)

    def waveforms(width: float, reduction: float) -> Floats:
        prepared = reduce_scene(
            replace(scene, body=body), replace(options, h=size), symmetry=axes,
            reduction=reduction, discretise=partial(discretise, wider=width),
        )  # fmt: skip
        return about_its_rest(scene, answer(prepared, scene).values)

    def change(reduction: float) -> float:
        usual, wide = waveforms(1.0, reduction), waveforms(wider, reduction)
        return float(relative_changes(wide - usual, wide).max())

    coarse_reduction = 0.01  # relative error of bodies that cannot be reduced to less
    try:
        return margin * change(reduction_tolerance(options.tolerance) / 3)  # both have this error
    except fem.NotReduced:  # a free body has hundreds of modes in a wide layer
        return margin * change(coarse_reduction)


def extent(
    scene: Scene, options: SolveOptions, highest: float
) -> tuple[Body, list[PlanRow], float]:
    """Return the body to model, a row if it is not the scene's, and the error of its absorbing
    ends.

    The body is cut where reflections of lines up to `highest` in Hz are negligible, or extended at
    its absorbing ends until their error is a small share of the tolerance.
    """
    body, rows = _within_reflections(scene, options.tolerance, highest)
    larger, error = body, absorbing_error(scene, body, options)
    share = 0.25  # of the tolerance: error of absorbing ends above which the body is extended
    most_extensions = 2
    for _ in range(most_extensions):
        if error <= share * options.tolerance or (next_larger := _larger(larger)) == larger:
            break
        try:
            check_mesh(next_larger, default_size(next_larger))
        except ValueError:  # too large
            break
        larger, error = next_larger, absorbing_error(scene, next_larger, options)
    if larger == body:
        return body, rows, error
    size = f"{1e3 * larger.width:.0f} x {1e3 * larger.height:.0f} x {1e3 * larger.depth:.0f} mm"
    reason = f"absorbing ends further away, whose reflections are {percent(error)}"
    return larger, [PlanRow(what="extent", value=size, reason=reason)], error


def _within_reflections(
    scene: Scene, tolerance: float, highest: float
) -> tuple[Body, list[PlanRow]]:
    """Return the part of the body beyond which reflections of lines up to `highest` in Hz are
    negligible, and a row if it is not the whole body. Only absorbing sides are moved inwards,
    because reflections from others belong to the response.
    """
    body = scene.body
    if not is_flat_layer(body) or (body.base, body.sides) != ("clamped", "absorbing"):
        return body, []
    half = np.array([body.width, body.height]) / 2
    cut = half.copy()
    for axis in (0, 1):
        alone = np.where(np.arange(2) == axis, half, ESTIMATE.far)
        for shorter in np.arange(0.03, min(0.8 * half[axis], ESTIMATE.far), 0.01):
            alone[axis] = shorter
            if absorbing_reflection(scene, alone, highest) <= tolerance / 10:
                cut[axis] = shorter
                break
    if (cut == half).all():
        return body, []
    width, height = map(float, 2 * cut)
    row = PlanRow(
        what="extent",
        value=f"{1e3 * width:.0f} x {1e3 * height:.0f} mm",
        reason=f"absorbing sides there reflect less than {percent(tolerance / 10)} and save "
        f"{percent(1 - cut.prod() / half.prod())} of the body",
    )
    return replace(body, width=width, height=height), [row]


def _larger(body: Body) -> Body:
    """Return the body with its absorbing ends moved out by the width of their layer."""
    ends = [{body.side(name) for name, (k, _) in EDGES.items() if k == axis} for axis in (0, 1)]
    absorbs = np.array([*(each == {"absorbing"} for each in ends), body.base == "absorbing"])
    width, height, depth = layer_of(body).width * absorbs * (2, 2, 1)
    return replace(
        body, width=body.width + width, height=body.height + height, depth=body.depth + depth
    )
