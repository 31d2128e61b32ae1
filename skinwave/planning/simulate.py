"""Simulation of a scene by any model, chosen by name."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

import fem
from simple_model import Response
from simple_model.choices import choose
from skinwave.bodies.sizes import check_mesh, default_size
from skinwave.models import MapFunction, Request, named
from skinwave.models.advice import check_taken, takes
from skinwave.models.flat_body import FLAT_BODY
from skinwave.models.laws import check_laws
from skinwave.models.prepared import answer
from skinwave.models.sample_grid import from_first, sample_grid
from skinwave.planning.plan import plan
from skinwave.planning.records import Plan
from skinwave.planning.warnings import (
    beyond_prediction,
    beyond_sampling,
    implausible,
    of_stretching,
)
from skinwave.scene.scene import Scene
from skinwave.system.effort import Progress, SkinwaveWarning, silent, versions
from skinwave.system.progress_bar import reported


def simulate(
    scene: Scene,
    model: str = "auto",
    tolerance: float = 0.05,
    progress: Progress | bool | None = None,
    *,
    times: ArrayLike | None = None,
    h: float | None = None,
    dt: float | None = None,
    solver: str = "auto",
    mapped: MapFunction = map,
) -> Response:
    """Simulate a scene: the quantity that its probes read, with its expected error.

    Where a request is not met, `effort.warnings` of the response say so, and each sentence is a
    `SkinwaveWarning` once. The error of a given h or model is estimated as in a plan, which for
    elements costs another, coarser mesh; `compute` leaves that out.

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
    tolerance : float, relative error that may be made; reduction takes at most a fiftieth of it
    progress : True for a bar; or called with the name of the phase and the fraction done
    times : (t,) float, s, equally spaced within the duration, the first a multiple of their step;
        10 kHz over all of it if not given. Lines above half their rate are left out
    h : float, metre, element size; planned if not given, and with it the extent of the body, as it
        is for "auto"
    dt : float, s, time step of "fem-transient" and the nonlinear models
    solver : a backend of `fem.linear_solver`
    mapped : called like the built-in `map`, for the lines of "fem-harmonic", which are solved one
        by one; `engine.mapped_on` spreads them over the workers of a Dask scheduler

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
        found = answered(
            scene, model, tolerance, report, times=times, h=h, dt=dt, solver=solver, mapped=mapped
        )
    for sentence in found.effort.warnings:
        warnings.warn(sentence, SkinwaveWarning, stacklevel=2)
    return found


def answered(
    scene: Scene,
    model: str = "auto",
    tolerance: float = 0.05,
    progress: Progress | None = None,
    *,
    times: ArrayLike | None = None,
    h: float | None = None,
    dt: float | None = None,
    solver: str = "auto",
    mapped: MapFunction = map,
) -> Response:
    """Response of `simulate`, for callers that show its warnings themselves.

    Parameters
    ----------
    scene, model, tolerance, progress, times, h, dt, solver, mapped : as for `simulate`, with its
        errors

    Returns
    -------
    Response
    """
    sample_grid(scene, times)  # which refuses times before any work
    required = required_plan(
        scene, model, tolerance, progress, h=h, dt=dt, solver=solver, times=times
    )
    return follow(
        scene, required, tolerance, progress,
        times=times, h=h, dt=dt, solver=solver, mapped=mapped,
    )  # fmt: skip


def required_plan(
    scene: Scene,
    model: str = "auto",
    tolerance: float = 0.05,
    progress: Progress | None = None,
    *,
    h: float | None = None,
    dt: float | None = None,
    solver: str = "auto",
    times: ArrayLike | None = None,
) -> Plan:
    """Plan of a request.

    Parameters
    ----------
    scene, model, tolerance, progress, h, dt, solver, times : as for `simulate`

    Returns
    -------
    Plan

    Raises
    ------
    ValueError
        As `simulate` does before any work.
    """
    asked = None if model == "auto" else named(model).name
    check_options(solver, h=h, dt=dt)
    return plan(
        scene, tolerance, model=asked, h=h, dt=dt, solver=solver, progress=progress, times=times
    )


def follow(
    scene: Scene,
    required: Plan,
    tolerance: float = 0.05,
    progress: Progress | None = None,
    *,
    times: ArrayLike | None = None,
    h: float | None = None,
    dt: float | None = None,
    solver: str = "auto",
    mapped: MapFunction = map,
) -> Response:
    """Response of a plan, with its expected error and all warnings.

    A model that measures its error with the answer states at least that error.

    Parameters
    ----------
    required : Plan
    scene, tolerance, progress, times, h, dt, solver, mapped : those of the plan, as for
        `simulate`, with its errors

    Returns
    -------
    Response
    """
    if required.prepared and named(required.model).is_reduced:
        grid, first = sample_grid(scene, times)
        found = from_first(answer(required.prepared, scene, progress, times=grid), first)
    else:
        found = compute(
            replace(scene, body=required.body), required.model, tolerance, progress,
            times=times, h=required.h or h, dt=dt, solver=solver, mapped=mapped,
        )  # fmt: skip
    error = float(np.fmax(required.error, found.expected_error))
    told = (
        *required.warnings, *beyond_prediction(scene, found, required.error, tolerance),
        *of_stretching(scene, found, tolerance), *beyond_sampling(scene, found),
        *implausible(scene),
    )  # fmt: skip
    found = replace(found, expected_error=error, load=scene.pressure)
    return warned(found, told)


def compute(
    scene: Scene,
    model: str,
    tolerance: float = 0.05,
    progress: Progress | None = None,
    *,
    times: ArrayLike | None = None,
    h: float | None = None,
    dt: float | None = None,
    solver: str = "auto",
    mapped: MapFunction = map,
) -> Response:
    """Response of one model, not planned, without warnings. Its expected error is unknown, unless
    the model measures it.

    Parameters
    ----------
    scene, model, tolerance, progress, times, h, dt, solver, mapped : as for `simulate`, without
        "auto"

    Returns
    -------
    Response

    Raises
    ------
    ValueError, Diverged
        As `simulate` does.
    """
    known = named(model)
    check_options(solver, h=h, dt=dt)
    if not 0 < tolerance < 1:
        raise ValueError(f"tolerance = {tolerance} is outside 0 < tolerance < 1")
    check_taken(known, scene)
    if known.needs_body:
        check_laws(scene.body, scene.pressure)
    grid, first = sample_grid(scene, times)
    request = Request(
        times=grid, tolerance=tolerance, report=progress or silent,
        h=h, dt=dt, solver=solver, mapped=mapped,
    )  # fmt: skip
    found = replace(from_first(known.solve(scene, request), first), load=scene.pressure)
    if found.effort.versions:
        return found
    return replace(found, effort=replace(found.effort, versions=versions()))


def has_elements(scene: Scene, h: float | None = None) -> bool:
    """Whether pages compute a scene by finite elements: it has a body, and that can be meshed or
    has no model without a mesh.

    Parameters
    ----------
    scene : Scene
    h : metre, element size; the default of the body if not given

    Returns
    -------
    bool

    Raises
    ------
    ValueError
        If only elements are a model of the body, or their size is given, and it cannot be meshed.
    """
    if not scene.body.of_kind.discretise:
        return False
    try:
        check_mesh(scene.body, h or default_size(scene.body))
    except ValueError:
        if h or not takes(FLAT_BODY, scene):
            raise
        return False
    return True


def warned(response: Response, sentences: tuple[str, ...]) -> Response:
    """The response with these sentences as its warnings."""
    return replace(response, effort=replace(response.effort, warnings=sentences))


def check_options(solver: str, **lengths: float | None) -> None:
    """Refuse a solver that is not installed and sizes that are no sizes, before any work.

    Raises
    ------
    ValueError
        If there is one.
    """
    choose("solver", solver, ("auto", *fem.available()))
    words = {"h": ("element size", 1e3, "mm"), "dt": ("time step", 1.0, "s")}
    for name, value in lengths.items():
        if value is not None and not (np.isfinite(value) and value > 0):
            what, per_unit, unit = words[name]
            raise ValueError(f"{what} {per_unit * value:g} {unit} must be a finite number above 0")
