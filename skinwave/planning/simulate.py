"""Simulation of a scene by any model: plan, then solve, then check.

`simulate` does all three. `compute` runs one model without a plan and without checks.
"""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import Any

from simple_model import Response
from skinwave.models import named
from skinwave.models.laws import check_laws
from skinwave.models.limits import check_takes
from skinwave.models.options import SolveOptions, from_first, sample_grid
from skinwave.models.reduced import answer
from skinwave.planning.errors import with_statement
from skinwave.planning.plan import plan
from skinwave.planning.record import Plan
from skinwave.scene.scene import Scene
from skinwave.system.effort import Progress, SkinwaveWarning, versions
from skinwave.system.progress_bar import expecting, progress_callback


def simulate(
    scene: Scene,
    model: str = "auto",
    tolerance: float = 0.05,
    progress: Progress | bool | None = None,
    **options: Any,
) -> Response:
    """Simulate a scene: compute the quantity that its probes read, with its expected error.

    For each part of the request that is not met, a `SkinwaveWarning` is issued and added to
    `effort.warnings` of the response. The error of elements is estimated with a second, coarser
    mesh.

    Parameters
    ----------
    scene : Scene
    model : str, "auto" for the choice of `plan`, or a name of `skinwave.models.names()`, such as
        "point-kernel", "flat-body", "fem" or "plate-modes-nonlinear"
    tolerance : float, acceptable relative error
    progress : True for a bar, or a function of the name of the phase and the fraction done
    **options : h, dt, solver and times of `SolveOptions`

    Returns
    -------
    Response, (t, p) of the scene's quantity, or stimulation in Pa for the point kernel

    Raises
    ------
    ValueError
        If the model is unknown or does not take the scene, or a number is out of range.
    Diverged
        If a nonlinear model does not converge, or a response violates the energy balance.

    Examples
    --------
    >>> import skinwave
    >>> scene = skinwave.loads("[tacton]\\nduration_s = 0.02\\n[body]\\nthickness_mm = inf")
    >>> response = skinwave.simulate(scene)
    >>> response.model, response.effort.errors.words
    ('flat-body', 'integral 0.20 %; together below 0.50 %')
    """
    with progress_callback(progress) as report:
        request = SolveOptions(model=model, tolerance=tolerance, progress=report, **options)
        response = solve_as_planned(scene, plan(scene, request))
    for sentence in response.effort.warnings:
        warnings.warn(sentence, SkinwaveWarning, stacklevel=2)
    return response


def solve_as_planned(scene: Scene, planned: Plan) -> Response:
    """Solve a scene as planned, and state the error; raises the errors of `simulate`."""
    options = replace(planned.options, model=planned.model, h=planned.h or planned.options.h)
    if planned.prepared and named(planned.model).is_reduced:
        times, first = sample_grid(scene, options.times)
        whole = answer(planned.prepared, scene, options.progress, times=times)
        response = from_first(whole, first)
    else:
        with expecting(options.progress, planned.seconds):
            response = _solve_by_model(replace(scene, body=planned.body), options)
    # A model that measures its errors replaces the planned ones.
    statement = planned.statement.with_parts(response.effort.errors.parts)
    return with_statement(scene, response, statement, planned.cautions)


def compute(scene: Scene, model: str, **options: Any) -> Response:
    """Solve a scene by one model, without a plan or warnings; see `SolveOptions` for `options`. The
    error is unknown unless the model measures it. Raises the errors of `simulate`.
    """
    return _solve_by_model(scene, SolveOptions(model=model, **options))


def _solve_by_model(scene: Scene, options: SolveOptions) -> Response:
    """Return the response of a model, on its default mesh or that of the options."""
    model = named(options.model)
    check_takes(model, scene)
    if model.needs_body:
        check_laws(scene.body, scene.pressure)
    times, first = sample_grid(scene, options.times)
    response = from_first(model.solve(scene, times, options), first)
    effort = replace(response.effort, versions=response.effort.versions or versions())
    return replace(response, load=scene.pressure, effort=effort)
