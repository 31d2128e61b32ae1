"""Simulation of a scene by any model: plan, then solve, then check.

    scene, options -> plan -> solve -> Response, with its error and warnings

`simulate` is the whole way. `compute` is one model alone, without plan and checks.
"""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import Any

import numpy as np

from simple_model import Response
from skinwave.models import named
from skinwave.models.laws import check_laws
from skinwave.models.limits import check_taken
from skinwave.models.options import SolveOptions, from_first, sample_grid
from skinwave.models.reduced import answer
from skinwave.planning.plan import plan
from skinwave.planning.rows import Plan, response_warnings
from skinwave.scene.scene import Scene
from skinwave.system.effort import Progress, SkinwaveWarning, versions
from skinwave.system.progress_bar import reported


def simulate(
    scene: Scene,
    model: str = "auto",
    tolerance: float = 0.05,
    progress: Progress | bool | None = None,
    **options: Any,
) -> Response:
    """Simulate a scene: the quantity that its probes read, with its expected error.

    Where a request is not met, `effort.warnings` of the response say so, and each sentence is a
    `SkinwaveWarning` once. The error of a given h or model is estimated as in a plan, which for
    elements costs another, coarser mesh.

    Parameters
    ----------
    scene : Scene
    model : "point-kernel", without propagation, under the scene's own load;
        "point-kernel-published", the same under the paper's load (linear drive, main lobe);
        "flat-body", the wavenumber integral of an infinite body; "fem", the reduced-order model;
        "fem-transient", direct time integration; "flat-body-harmonic" and "fem-harmonic", the
        steady state line by line; "plate-modes" and "plate-modes-transient", a thin plate in its
        modes; "plate-modes-nonlinear", the same at large deflection; "fem-nonlinear", modes of
        elements at large deflection; "fem-nonlinear-transient", the same with all dofs; or "auto":
        the choice of `plan`
    tolerance : float, relative error that may be made
    progress : True for a bar; or called with the name of the phase and the fraction done
    **options : h, dt, solver, times and mapped of `SolveOptions`

    Returns
    -------
    Response, (t, p) of the scene's quantity, or stimulation in Pa of the point kernel

    Raises
    ------
    ValueError
        If the model is unknown or does not fit the scene, or a number is out of range.
    Diverged
        If a nonlinear model does not converge, or a response violates the energy balance.
    """
    with reported(progress) as report:
        asked = SolveOptions(model=model, tolerance=tolerance, progress=report, **options)
        found = solve(scene, plan(scene, asked))
    for sentence in found.effort.warnings:
        warnings.warn(sentence, SkinwaveWarning, stacklevel=2)
    return found


def solve(scene: Scene, required: Plan) -> Response:
    """Response of a plan of the scene, with its expected error and all warnings; raises what
    `simulate` does. A model that measures its error with the answer states at least that error.
    """
    options = replace(required.options, model=required.model, h=required.h or required.options.h)
    if required.prepared and named(required.model).is_reduced:
        times, first = sample_grid(scene, options.times)
        found = from_first(answer(required.prepared, scene, options.progress, times=times), first)
    else:
        found = _computed(replace(scene, body=required.body), options)
    return _checked(scene, required, found)


def _checked(scene: Scene, required: Plan, found: Response) -> Response:
    """The response with all warnings, and the larger of planned and measured errors."""
    tolerance = required.options.tolerance
    more = response_warnings(scene, found, required.error, tolerance)
    return replace(
        found, load=scene.pressure,
        effort=replace(found.effort, warnings=(*required.warnings, *more)),
        expected_error=float(np.fmax(required.error, found.expected_error)),
    )  # fmt: skip


def compute(scene: Scene, model: str, **options: Any) -> Response:
    """Response of one model, not planned, without warnings, with options of `SolveOptions`. Its
    expected error is unknown, unless the model measures it. Raises what `simulate` does.
    """
    return _computed(scene, SolveOptions(model=model, **options))


def _computed(scene: Scene, options: SolveOptions) -> Response:
    """Response of one model in its default mesh, or that of the options."""
    known = named(options.model)
    check_taken(known, scene)
    if known.needs_body:
        check_laws(scene.body, scene.pressure)
    times, first = sample_grid(scene, options.times)
    found = replace(from_first(known.solve(scene, times, options), first), load=scene.pressure)
    if found.effort.versions:
        return found
    return replace(found, effort=replace(found.effort, versions=versions()))
