"""Expected error and warnings of a response on a given mesh.

The error of a mesh is extrapolated from a coarser one, as in `refinement`. An element size that was
asked for is compared with the next coarser one; a default one with one of twice the size, which
costs a tenth of it and overestimates errors by up to a half.
"""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from simple_model import Response
from skinwave.bodies.sizes import check_mesh, default_size
from skinwave.models import named
from skinwave.models.laws import own_laws, series_tolerance
from skinwave.models.options import DEFAULT, SolveOptions
from skinwave.models.reduced import ReducedBody, answer, prepare, reduction_tolerance
from skinwave.planning.extent import absorbing_error
from skinwave.planning.left_out import series_error, stretching_left_out
from skinwave.planning.plan import plan
from skinwave.planning.refinement import (
    about_its_rest,
    above_band,
    compared_with,
    convergence,
    quantity_of_interest,
)
from skinwave.planning.rows import (
    of_elements,
    of_ends_and_band,
    response_warnings,
    series_over_tolerance,
)
from skinwave.scene.scene import Body, Load, Reading, Scene
from skinwave.typing import Array

Coarser = tuple[float, ReducedBody]  # element size in metre, and the body with it

QUICKLY = 2.0  # times as coarse


def assessed(
    scene: Scene,
    response: Response,
    moved: ReducedBody | Array,
    options: SolveOptions = DEFAULT,
    *,
    compared: Coarser | None = None,
    meshed: Body | None = None,
) -> Response:
    """Response of linear elements with its expected error and all warnings.

    It is of the reduced body `moved`, or of another model with the quantity of interest `moved`:
    waveforms (t, p), or the lines (f, p) of an unconstrained body. `compared` is an element size in
    metre to compare with, and the body with it, else chosen here; `meshed` the body whose mesh both
    sizes are of, if its nodes were moved to those of the scene's.
    """
    if isinstance(moved, ReducedBody):
        moved = quantity_of_interest(moved, scene, response)
    body, tolerance = scene.body, options.tolerance
    size = options.h or default_size(body)
    other, coarse = compared or coarser_body(scene, options)
    same = coarse.effort.dofs == response.effort.dofs
    fine = about_its_rest(scene, moved)
    found = fine if same else quantity_of_interest(coarse, scene, answer(coarse, scene))
    _, error = convergence(meshed or body, (other, size), (found, fine), tolerance, same=same)
    series = series_error(scene, response.model, tolerance, coarse)
    at_ends = absorbing_error(scene, body, options)
    sudden = above_band(response.values, response.times[1] - response.times[0])
    solids = own_laws(body)
    words = solids[0].series(series_tolerance(tolerance)).words if solids else ""
    warnings = (
        *sentences(scene, response, tolerance, h=size, error=error),
        *of_ends_and_band(scene, at_ends, sudden, tolerance),
        *series_over_tolerance(words, series, tolerance),
    )
    error += response.effort.estimate + series + at_ends + sudden
    error += stretching_left_out(scene, named(response.model), tolerance)
    effort = replace(response.effort, warnings=warnings)
    return replace(response, expected_error=error, effort=effort)


def coarser_body(scene: Scene, options: SolveOptions = DEFAULT) -> Coarser:
    """Element size in metre of the mesh that `assessed` compares with, and the body on it."""
    body, h = scene.body, options.h
    other = compared_with(body, h) if h else _coarser(body, default_size(body))
    reduction = reduction_tolerance(options.tolerance)
    solid = body, scene.probes, scene.reading, scene.load
    return other, _prepared(*solid, other, options.solver, reduction)


def sentences(
    scene: Scene,
    response: Response,
    tolerance: float = 0.05,
    *,
    h: float | None = None,
    error: float = 0.0,
) -> tuple[str, ...]:
    """All warnings of a response, without computing a mesh: of a linear model with elements of h in
    metre, with the relative error that is expected of these, or nan.
    """
    if named(response.model).default_size and h:
        known, predicted = of_elements(scene, h, error, tolerance), error
    else:
        options = SolveOptions(tolerance=tolerance, model=response.model, times=response.times)
        planned = plan(scene, options)
        known, predicted = planned.warnings, planned.error
    return (*known, *response_warnings(scene, response, predicted, tolerance))


def _coarser(body: Body, h: float) -> float:
    """Coarser size in metre to compare a default one with at little cost, if it can be meshed."""
    try:
        check_mesh(body, QUICKLY * h)
    except ValueError:
        return compared_with(body, h)
    return QUICKLY * h


@lru_cache(maxsize=4)  # of Tactons on the same bodies
def _prepared(
    body: Body, probes: tuple[tuple[float, float], ...], reading: Reading, load: Load,
    h: float, solver: str, tolerance: float,
) -> ReducedBody:  # fmt: skip
    return prepare(
        body, np.array(probes), h=h, solver=solver, tolerance=tolerance, reading=reading, load=load
    )
