"""From a scene to a response, for every model by one name."""

from dataclasses import replace

import numpy as np

import fem
from simple_model import Response, point_kernel, point_kernel_published
from simple_model.choices import choose
from skinwave.effort import Progress, silent
from skinwave.models.bodies import EXACT, exact_waves
from skinwave.models.full import Map, harmonic_answer, transient_answer
from skinwave.models.prepared import answer, prepare, reduction_tolerance, sample_times
from skinwave.models.stretching import full_answer, reduced_answer
from skinwave.planning.plan import plan
from skinwave.scene import Scene

MODELS = (
    "auto", "point-kernel", "point-kernel-published", "flat-body", "flat-body-harmonic",
    "fem", "fem-harmonic", "fem-transient", "fem-nonlinear", "fem-nonlinear-transient",
)  # fmt: skip
KERNELS = {"point-kernel": point_kernel, "point-kernel-published": point_kernel_published}


def simulate(
    scene: Scene,
    model: str = "auto",
    tolerance: float = 0.05,
    progress: Progress | None = None,
    *,
    h: float | None = None,
    dt: float | None = None,
    solver: str = "auto",
    mapped: Map = map,
) -> Response:
    """Motion of a scene's probes.

    Parameters
    ----------
    scene : Scene
    model : "point-kernel", without propagation, under the scene's own load;
        "point-kernel-published", the same under the paper's load (linear drive, main lobe);
        "flat-body", exact waves in an endless body; "fem", the reduced model;
        "fem-transient", every time step; "flat-body-harmonic" and "fem-harmonic", the steady state
        line by line; "fem-nonlinear", a sheet that stretches as it bends, in its modes, about its
        rest under the mean pressure; "fem-nonlinear-transient", the same with all unknowns; or
        "auto": what `plan` chooses, which is linear
    tolerance : float, relative error that may be made; reduction takes at most a fiftieth of it
    progress : called with the name of the phase and the fraction done
    h : float, metre, element size; planned if not given, and with it how much of the body counts
    dt : float, s, time step of "fem-transient" and the nonlinear models
    solver : a backend of `fem.linear_solver`
    mapped : shaped like the built-in `map`, for the lines of "fem-harmonic", which are solved one
        by one; `engine.mapped_on` spreads them over the workers of a Dask scheduler

    Raises
    ------
    ValueError
        If the model is unknown or does not fit the scene, or a number is out of range.
    Diverged
        If a nonlinear model does not converge, or an answer does not account for its energy.
    """
    choose("model", model, MODELS)
    check_knobs(solver, h=h, dt=dt)
    if not 0 < tolerance < 1:
        raise ValueError(f"tolerance = {tolerance} is outside 0 < tolerance < 1")
    if model == "auto" or (model.startswith("fem") and h is None):
        asked = None if model == "auto" else model
        required = plan(scene, tolerance, model=asked, h=h, dt=dt, solver=solver, progress=progress)
        if required.model == "fem" and required.prepared:
            return warned(answer(required.prepared, scene, progress), required.warnings)
        scene = replace(scene, body=required.body)
        found = simulate(
            scene, required.model, tolerance, progress,
            h=required.h or h, dt=dt, solver=solver, mapped=mapped,
        )  # fmt: skip
        return warned(found, required.warnings)
    times = sample_times(scene)
    if model in KERNELS:
        return KERNELS[model](scene.pressure, scene.probe_points, times)
    if model in EXACT:
        waves, body = EXACT[model], exact_waves(scene.body, model)
        return waves(body, scene.pressure, scene.probe_points, times)
    report = progress or silent
    if model == "fem-transient":
        return transient_answer(scene, times, report, h=h, dt=dt, solver=solver)
    if model == "fem-harmonic":
        return harmonic_answer(
            scene, times, report, h=h, solver=solver, threshold=tolerance / 50, mapped=mapped
        )
    if model == "fem-nonlinear":
        return reduced_answer(scene, times, report, h=h, dt=dt, solver=solver)
    if model == "fem-nonlinear-transient":
        return full_answer(scene, times, report, h=h, dt=dt, solver=solver)
    prepared = prepare(
        scene.body, scene.probe_points, report, h=h, solver=solver,
        tolerance=reduction_tolerance(tolerance),
    )  # fmt: skip
    return answer(prepared, scene, report)


def warned(response: Response, warnings: tuple[str, ...]) -> Response:
    """A response that says what is less than was asked for."""
    return replace(response, effort=replace(response.effort, warnings=warnings))


def check_knobs(solver: str, **lengths: float | None) -> None:
    """Refuse a solver that is not installed and sizes that are no sizes, before any work.

    Raises
    ------
    ValueError
        If there is one.
    """
    choose("solver", solver, ("auto", *fem.available()))
    for name, value in lengths.items():
        if value is not None and not (np.isfinite(value) and value > 0):
            raise ValueError(f"{name} = {value} must be a finite number above 0")
