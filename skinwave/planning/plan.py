"""Plan of a scene: the cheapest model, extent and element size within a tolerance, with reasons."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

import fem
from simple_model.layers.flat_body import TRANSFORM_RATE
from simple_model.load.sampling import resolving_step
from skinwave.bodies.sizes import check_mesh
from skinwave.models import Limit, Model, named
from skinwave.models.flat_body import FLAT_BODY, HARMONIC
from skinwave.models.laws import check_laws, own_laws, series_tolerance
from skinwave.models.limits import beyond, check_taken, default_model, refusal, takers, takes
from skinwave.models.linear_elements import FEM, TRANSIENT_RATE, step_count
from skinwave.models.options import DEFAULT, SolveOptions, sample_grid, sample_times
from skinwave.models.plate_modes import ERROR, FROM_REST, STRETCHED
from skinwave.models.point_kernel import SAME_LOAD
from skinwave.models.reduced import answer
from skinwave.planning.estimates import (
    NO_BOUND,
    cutoff_frequency,
    has_wavenumber_solution,
    response_spectrum,
    side_reflections,
)
from skinwave.planning.extent import absorbing_error, extent, symmetry
from skinwave.planning.left_out import (
    beyond_linear,
    deflection,
    sensitivity,
    series_error,
    start_left_out,
    stretching_left_out,
    sudden_left_out,
)
from skinwave.planning.refinement import above_band, refined
from skinwave.planning.rows import (
    Plan,
    PlanRow,
    element_rows,
    error_not_estimated,
    left_out,
    of_elements,
    of_ends_and_band,
    over_tolerance,
    series_over_tolerance,
    start_over_tolerance,
    sudden_over_tolerance,
)
from skinwave.scene.scene import Scene
from skinwave.typing import Floats

INTEGRAL_ERROR = 0.002  # of a wavenumber integral, beside finite elements
Grid = tuple[Floats, int]  # as of `sample_grid`
WAVES_SHARE = 0.8  # of the tolerance: largest reflections of sides that may be neglected


def plan(scene: Scene, options: SolveOptions = DEFAULT) -> Plan:
    """Plan a scene's simulation to a relative error in its probes' waveforms.

    Parameters
    ----------
    scene : Scene
    options : SolveOptions; with both a model and h all of the body is modelled, and h alone asks
        for elements of a sheet

    Returns
    -------
    Plan

    Raises
    ------
    ValueError
        If the model is unknown or does not take the scene, or the times, h or dt do not fit it.
    """
    grid = sample_grid(scene, options.times)
    found = _planned(scene, options, grid)
    left = stretching_left_out(scene, named(found.model), options.tolerance)
    return replace(found, error=found.error + left, options=options)


def _planned(scene: Scene, options: SolveOptions, grid: Grid) -> Plan:
    """The plan, but for what linear bending of a sheet leaves out."""
    asked = None if options.model == "auto" else named(options.model)
    if options.dt is not None:
        step_count(float(sample_times(scene)[-1]), options.dt)
    if asked:
        check_taken(asked, scene)
    if not scene.body.of_kind.discretise:
        kernel = (asked or SAME_LOAD).name
        row = PlanRow(what="model", value=kernel, reason="there is no body to move")
        return Plan(model=kernel, body=scene.body, rows=(row,))
    if not asked or asked.needs_body:
        check_laws(scene.body, scene.pressure)
    if asked and asked.error:
        return _unplanned(scene, options, asked, grid)
    chosen = asked or _chosen(scene, options, grid)
    if chosen is STRETCHED:
        return _stretched(scene, options, grid)
    highest, row = _highest_line(scene, options.tolerance)
    if chosen.is_infinite:
        found = _without_mesh(scene, options, chosen, highest, row, grid)
        return _with_series(found, scene, options.tolerance)
    if chosen is FROM_REST:
        found = _unplanned(scene, replace(options, h=None), FROM_REST, grid)
        found = _because(found, why_modes(scene, options.tolerance))
        return replace(found, highest=highest, rows=(row, *found.rows, *left_out(scene, highest)))
    if asked is None and chosen is not FEM:
        found = _planned(scene, replace(options, model=chosen.name, h=None), grid)
        return _because(found, f"{FEM.name} {beyond(FEM, scene)[0].why}")
    return _by_elements(scene, options, chosen, highest, row, grid)


def _because(found: Plan, reason: str) -> Plan:
    """The plan with another reason for its model."""
    rows = [replace(row, reason=reason) if row.what == "model" else row for row in found.rows]
    return replace(found, rows=tuple(rows))


def _chosen(scene: Scene, options: SolveOptions, grid: Grid) -> Model:
    meshed = options.h is not None and scene.body.of_kind.is_plate and takes(FEM, scene)
    return FEM if meshed else named(chosen_model(scene, options.tolerance, grid))


def _highest_line(scene: Scene, tolerance: float) -> tuple[float, PlanRow]:
    """Highest line in Hz that matters, and why."""
    spectrum, motion = response_spectrum(scene, tolerance), scene.load.support_motion
    highest = max(cutoff_frequency(*spectrum, tolerance), motion.frequency if motion else 0.0)
    return highest, PlanRow(
        what="highest line",
        value=f"{highest:.0f} Hz",
        reason=f"of {len(spectrum[0])} lines in the load; those above move the probes by less "
        f"than {100 * tolerance / 3:.2g} % of the whole",
    )


def _by_elements(
    scene: Scene, options: SolveOptions, chosen: Model, highest: float, row: PlanRow, grid: Grid
) -> Plan:
    """Plan of a model of linear elements, with its mesh."""
    tolerance, whole = options.tolerance, scene
    axes = symmetry(scene) if chosen.is_reduced else ""
    try:
        if options.model == "auto" or options.h is None:
            body, cut, at_ends = extent(scene, options, highest)
        else:  # all of it is meshed, as asked
            body, cut, at_ends = scene.body, [], absorbing_error(scene, scene.body, options)
        for_mesh = replace(options, tolerance=max(tolerance - at_ends, tolerance / 2))
        mesh = refined(scene, body, for_mesh, symmetry=axes)
    except fem.NotReduced as error:
        limit = Limit(why=f"cannot reduce this body: {error}")
        raise refusal(scene, chosen, [limit]) from None
    scene = replace(scene, body=body)
    step = options.dt or resolving_step(scene.pressure, 1 / TRANSIENT_RATE)
    step_error = _march_error(scene, step) if chosen.is_stepped else 0.0
    start = start_left_out(scene, chosen, grid, mesh.prepared)
    times, _ = grid
    sudden = above_band(answer(mesh.prepared, scene, times=times).values, times[1])
    found = Plan(
        model=chosen.name, body=body, symmetry=axes, h=mesh.h, highest=highest,
        error=mesh.error + mesh.prepared.effort.estimate + at_ends + sudden + step_error + start,
        seconds=sum(mesh.prepared.effort.seconds.values()),
        memory=mesh.prepared.effort.peak_memory,
        rows=(
            row, PlanRow(what="model", value=chosen.name, reason=_why_elements(whole)), *cut,
            *element_rows(scene, tolerance, axes, mesh, highest, options.h),
        ),
        warnings=(
            *of_elements(scene, mesh.h, mesh.error, tolerance),
            *of_ends_and_band(scene, at_ends, sudden, tolerance),
            *over_tolerance(f"a time step of {1e3 * step:.3g} ms", step_error, tolerance,
                      "a smaller one is"),
            *start_over_tolerance(chosen, start, tolerance),
        ),
        prepared=mesh.prepared,
    )  # fmt: skip
    return _with_series(found, scene, tolerance)


def chosen_model(scene: Scene, tolerance: float = 0.05, grid: Grid | None = None) -> str:
    """Name of the model that a plan takes: the cheapest within the tolerance, for times as of
    `sample_grid`, those of the scene if not given. Raises a ValueError if no model takes the scene.
    """
    if not scene.body.of_kind.discretise:
        return SAME_LOAD.name
    if beyond_linear(scene, tolerance):
        return STRETCHED.name
    if _returned(scene) <= WAVES_SHARE * tolerance and takes(FLAT_BODY, scene):
        try:  # reflections are of the load's lines, the start of the body's own: their powers add
            start = start_left_out(scene, HARMONIC, grid or sample_grid(scene))
        except (ValueError, ArithmeticError):  # no steady state
            return FLAT_BODY.name
        steady = np.hypot(_returned(scene), start) <= tolerance
        return HARMONIC.name if steady else FLAT_BODY.name
    return FROM_REST.name if why_modes(scene, tolerance) else default_model(scene)


def why_modes(scene: Scene, tolerance: float) -> str:
    """Reason for the modes of a scene's sheet instead of elements; none if elements do."""
    body = scene.body
    if not takes(FROM_REST, scene) or tolerance < ERROR:
        return ""
    if body.air and not body.mounting.is_frame:
        return f"elements have air around a sheet in a frame, not one {body.mounting.words}"
    return "a flat sheet that is held: modes of a thin plate need no mesh"


@lru_cache(maxsize=64)
def _returned(scene: Scene) -> float:
    """Relative reflections from the sides that a wavenumber integral leaves out."""
    return side_reflections(scene) if has_wavenumber_solution(scene) else NO_BOUND


def _unplanned(scene: Scene, options: SolveOptions, model: Model, grid: Grid) -> Plan:
    """Plan of a model that states its own error. That of a sheet at large deflection does not come
    from the linear response: stiffened by stretching it has longer waves and fewer resonances.
    """
    tolerance, h, start = options.tolerance, options.h, start_left_out(scene, model, grid)
    reason = f"as asked: {model.method}{_without(start)}"
    rows = [PlanRow(what="model", value=model.name, reason=reason)]
    what, size = f"the {model.method}", None
    cure = "a larger tolerance is" if model.needs_body else "a model with waves is"
    if model.default_size:
        size = h or model.default_size(scene.body)
        check_mesh(scene.body, size)
        reason = "as asked" if h else f"the default of {model.name}"
        rows.append(PlanRow(what="element size", value=f"{1e3 * size:.2f} mm", reason=reason))
        others = left_out(scene, 0.0)
        rows += [r for r in others if not (model.is_nonlinear and r.what.endswith("stretching"))]
        what, cure = f"elements of {1e3 * size:.3g} mm", "smaller ones are"
    error = model.error(scene, size) if model.error else np.nan
    return Plan(
        model=model.name, body=scene.body, h=size, error=error + start, rows=tuple(rows),
        seconds=model.seconds, memory=model.memory,
        warnings=(
            *error_not_estimated(model.name, error),
            *over_tolerance(what, error, tolerance, cure),
            *start_over_tolerance(model, start, tolerance),
        ),
    )  # fmt: skip


def _stretched(scene: Scene, options: SolveOptions, grid: Grid) -> Plan:
    """Plan of a sheet at large deflection."""
    left = stretching_left_out(scene, FROM_REST, options.tolerance)
    return _because(
        _unplanned(scene, replace(options, h=None), STRETCHED, grid),
        f"a linear sheet would deflect by {deflection(scene):.2g} thicknesses, and stretching "
        f"changes its motion by {100 * left:.2g} %",
    )


def _without_mesh(
    scene: Scene, options: SolveOptions, asked: Model, highest: float, row: PlanRow, grid: Grid
) -> Plan:
    returned, left = _returned(scene), start_left_out(scene, asked, grid)
    model, tolerance = asked.name, options.tolerance
    sudden = sudden_left_out(scene, asked, grid)
    reason = "flat layers without reflecting sides: wavenumber integral, no mesh"
    if scene.body.sides != "absorbing":
        reason = f"reflections from the sides are {100 * returned:.2g} %: wavenumber integral"
    reason += _without(left)
    warnings = (
        *over_tolerance(
            f"{model}, which leaves out reflections from the sides,",
            returned,
            tolerance,
            f"{takers(scene)[0]} is" if takers(scene) else "absorbing sides are",
        ),
        *start_over_tolerance(asked, left, tolerance),
        *sudden_over_tolerance(scene, TRANSFORM_RATE / 4, sudden, tolerance),
    )
    rows = [
        row,
        PlanRow(what="model", value=model, reason="as asked" if warnings else reason),
        *left_out(scene, highest),
    ]
    error = float(np.linalg.norm([returned, left, sudden, INTEGRAL_ERROR]))
    return Plan(
        model=model, body=scene.body, highest=highest, error=error,
        seconds=asked.seconds, memory=asked.memory, rows=tuple(rows), warnings=warnings,
    )  # fmt: skip


def _without(start: float) -> str:
    return f"; the initial transient, {100 * start:.2g} %, is left out" if start else ""


def _with_series(found: Plan, scene: Scene, tolerance: float) -> Plan:
    """Plan whose error counts the Prony series that its model takes for modulus laws."""
    solids = own_laws(scene.body)
    if not solids or not named(found.model).takes_series(scene.body):
        return found
    allowed = series_tolerance(tolerance)
    error = series_error(scene, found.model, tolerance, found.prepared)
    rows = tuple(
        PlanRow(
            what="modulus law",
            value=solid.series(allowed).words,
            reason=f"{found.model} takes it for the law; the motion of the probes is "
            f"{100 * error:.2g} % off by it",
        )
        for solid in solids
    )
    warned = series_over_tolerance(rows[0].value, error, tolerance)
    return replace(
        found, error=found.error + error, rows=(*found.rows, *rows),
        warnings=(*found.warnings, *warned),
    )  # fmt: skip


def _march_error(scene: Scene, dt: float) -> float:
    """Expected relative error of a time step."""
    known = sensitivity(scene)
    # Average acceleration lowers frequencies by (w dt)^2/12 (Hughes 1987, chapter 9).
    return min(1.0, known.value * (2 * np.pi * known.frequency * dt) ** 2 / 12)


def _why_elements(scene: Scene) -> str:
    """Why no wavenumber integral stands for the body of a scene."""
    if limits := beyond(FLAT_BODY, scene):
        return f"{FLAT_BODY.name} {limits[0].why}"
    body, returned = scene.body, _returned(scene)
    if body.sides == "absorbing":
        of_sheet = "absorbing sides of a sheet reflect in part"
        return (
            of_sheet if body.of_kind.is_plate else "as asked; this body has a wavenumber integral"
        )
    reflected = f" about {100 * returned:.3g} %" if returned < 1 else ""
    return f"the {body.sides} sides reflect{reflected}; the wavenumber integral has no sides"
