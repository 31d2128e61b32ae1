"""Plan of a scene: the cheapest model, extent and element size within a tolerance, with reasons."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

import fem
from simple_model.layers.flat_body import FINEST
from simple_model.load.focus import gaussian_width
from simple_model.load.sampling import resolving_step
from skinwave.bodies.sizes import check_mesh
from skinwave.models import Model, named
from skinwave.models.advice import beyond, check_taken, default_model, refusal, takers, takes
from skinwave.models.flat_body import FLAT_BODY, HARMONIC
from skinwave.models.full import TRANSIENT_RATE, step_count
from skinwave.models.laws import check_laws
from skinwave.models.limits import Limit
from skinwave.models.linear_elements import FEM
from skinwave.models.plate_modes import FROM_REST
from skinwave.models.point_kernel import SAME_LOAD
from skinwave.models.prepared import answer, sample_times
from skinwave.models.sample_grid import sample_grid
from skinwave.models.stretched_plate import STRETCHED
from skinwave.planning.boundaries import absorbing_error, extended
from skinwave.planning.estimates import (
    NO_BOUND,
    cutoff_frequency,
    has_wavenumber_solution,
    response_spectrum,
    side_reflections,
)
from skinwave.planning.extent import extent, left_out, symmetry
from skinwave.planning.mesh_rows import element_rows
from skinwave.planning.records import Plan, PlanRow
from skinwave.planning.refinement import above_band, refined
from skinwave.planning.sensitivity import sensitivity
from skinwave.planning.series import with_series
from skinwave.planning.sheets import why_modes
from skinwave.planning.start import start_left_out, sudden_left_out
from skinwave.planning.stretching import beyond_linear, deflection, stretching_left_out
from skinwave.planning.warnings import (
    error_not_estimated,
    of_elements,
    of_ends_and_band,
    over_tolerance,
    start_over_tolerance,
    sudden_over_tolerance,
)
from skinwave.scene.scene import FLAT, Body, Scene
from skinwave.system.effort import Progress

INTEGRAL_ERROR = 0.002  # of a wavenumber integral, beside finite elements
WAVES_SHARE = 0.8  # of the tolerance: largest reflections of sides that may be neglected


def plan(
    scene: Scene,
    tolerance: float = 0.05,
    *,
    model: str | None = None,
    h: float | None = None,
    dt: float | None = None,
    solver: str = "auto",
    progress: Progress | None = None,
    times: ArrayLike | None = None,
) -> Plan:
    """Plan a scene's simulation to a relative error in its probes' waveforms.

    Parameters
    ----------
    scene : Scene
    tolerance : that error, 0..1
    model, h, dt : given choices: a model's name, element size in metre, time step in s; with both
        a model and h all of the body is modelled, and h alone asks for elements of a sheet
    solver, progress : for the meshes that are tried where the scene needs elements
    times : (t,) float, s, of the response, as for `simulate`: over which a start counts

    Returns
    -------
    Plan

    Raises
    ------
    ValueError
        If the tolerance is not between 0 and 1, there is no body for the model, or h or dt
        cannot be computed with.
    """
    if not 0 < tolerance < 1:
        raise ValueError(f"tolerance = {tolerance} is outside 0 < tolerance < 1")
    found = _planned(
        scene, tolerance, model=model, h=h, dt=dt, solver=solver, progress=progress, times=times
    )
    left = stretching_left_out(scene, named(found.model), tolerance)
    return replace(found, error=found.error + left)


def _planned(
    scene: Scene,
    tolerance: float,
    *,
    model: str | None,
    times: ArrayLike | None,
    h: float | None = None,
    dt: float | None = None,
    solver: str = "auto",
    progress: Progress | None = None,
) -> Plan:
    """The plan, but for what linear bending of a sheet leaves out."""
    asked = named(model) if model else None
    if dt is not None:
        step_count(float(sample_times(scene)[-1]), dt)
    if not scene.body.of_kind.discretise:
        if asked and asked.needs_body:
            check_taken(asked, scene)
        kernel = model or SAME_LOAD.name
        row = PlanRow(what="model", value=kernel, reason="there is no body to move")
        return Plan(model=kernel, body=scene.body, rows=(row,))
    if asked:
        check_taken(asked, scene)
        if asked.error and not asked.needs_body:
            return _unplanned(scene, tolerance, asked, h, times)
    check_laws(scene.body, scene.pressure)
    if asked and asked.error:
        return _unplanned(scene, tolerance, asked, h, times)
    meshed = h is not None and scene.body.of_kind.is_plate and takes(FEM, scene)
    chosen = asked or (FEM if meshed else named(chosen_model(scene, tolerance, times)))
    if chosen is STRETCHED:
        return _stretched(scene, tolerance, times)
    spectrum = response_spectrum(scene, tolerance)
    motion = scene.load.support_motion
    highest = max(cutoff_frequency(*spectrum, tolerance), motion.frequency if motion else 0.0)
    rows = [
        PlanRow(
            what="highest line",
            value=f"{highest:.0f} Hz",
            reason=f"of {len(spectrum[0])} lines in the load; those above move the probes by less "
            f"than {100 * tolerance / 3:.2g} % of the whole",
        )
    ]
    if chosen.is_infinite:
        found = _without_mesh(scene, tolerance, chosen, highest, rows, times)
        return with_series(found, scene, tolerance)
    if chosen is FROM_REST:
        return _by_modes(scene, tolerance, highest, rows)
    if asked is None and chosen is not FEM:
        found = _planned(scene, tolerance, model=chosen.name, dt=dt, solver=solver, times=times)
        why = f"{FEM.name} {beyond(FEM, scene)[0].why}"
        rows = [replace(row, reason=why) if row.what == "model" else row for row in found.rows]
        return replace(found, rows=tuple(rows))
    returned = _returned(scene)
    body: Body = scene.body
    cut: list[PlanRow] = []
    reduced = asked is None or asked.is_reduced
    axes = symmetry(scene) if reduced else ""
    try:
        if model is None or h is None:
            body, cut = extent(scene, tolerance, highest)
            body, at_ends, more = extended(scene, body, tolerance, progress, solver=solver)
            cut = more or cut
        else:  # all of it is meshed, as asked
            at_ends = absorbing_error(scene, body, tolerance, progress, solver=solver)
        rows += [
            PlanRow(what="model", value=model or "fem", reason=_why_elements(scene, returned)),
            *cut,
        ]
        for_mesh = max(tolerance - at_ends, tolerance / 2)
        mesh = refined(scene, body, for_mesh, progress, symmetry=axes, solver=solver, h=h)
    except fem.NotReduced as error:
        limit = Limit(why=f"cannot reduce this body: {error}")
        raise refusal(scene, named(model or "fem"), [limit]) from None
    scene = replace(scene, body=body)
    step = dt or resolving_step(scene.pressure, 1 / TRANSIENT_RATE)
    step_error = _march_error(scene, step) if asked and asked.is_stepped else 0.0
    start = start_left_out(scene, asked, mesh.prepared, times) if asked else 0.0
    grid, _ = sample_grid(scene, times)
    sudden = above_band(answer(mesh.prepared, scene, times=grid).values, grid[1])
    found = Plan(
        model=model or "fem", body=body, symmetry=axes, h=mesh.h, highest=highest,
        error=mesh.error + mesh.prepared.effort.estimate + at_ends + sudden + step_error + start,
        seconds=sum(mesh.prepared.effort.seconds.values()),
        memory=mesh.prepared.effort.peak_memory,
        rows=(*rows, *element_rows(scene, tolerance, axes, mesh, highest, h)),
        warnings=(
            *of_elements(scene, mesh.h, mesh.error, tolerance),
            *of_ends_and_band(scene, at_ends, sudden, tolerance),
            *over_tolerance(f"a time step of {1e3 * step:.3g} ms", step_error, tolerance,
                      "a smaller one is"),
            *start_over_tolerance(asked, start, tolerance),
        ),
        prepared=mesh.prepared,
    )  # fmt: skip
    return with_series(found, scene, tolerance)


def chosen_model(scene: Scene, tolerance: float = 0.05, times: ArrayLike | None = None) -> str:
    """Name of the model that a plan takes: the cheapest within the tolerance.

    Parameters
    ----------
    scene, tolerance, times : as for `plan`

    Returns
    -------
    str

    Raises
    ------
    ValueError
        If no model takes the scene.
    """
    if not scene.body.of_kind.discretise:
        return SAME_LOAD.name
    if beyond_linear(scene, tolerance):
        return STRETCHED.name
    if _returned(scene) <= WAVES_SHARE * tolerance and takes(FLAT_BODY, scene):
        try:  # reflections are of the load's lines, the start of the body's own: their powers add
            start = start_left_out(scene, HARMONIC, times=times)
        except (ValueError, ArithmeticError):  # no steady state
            return FLAT_BODY.name
        steady = np.hypot(_returned(scene), start) <= tolerance
        return HARMONIC.name if steady else FLAT_BODY.name
    return FROM_REST.name if why_modes(scene, tolerance) else default_model(scene)


@lru_cache(maxsize=64)
def _returned(scene: Scene) -> float:
    """Relative reflections from the sides that a wavenumber integral leaves out."""
    return side_reflections(scene) if has_wavenumber_solution(scene) else NO_BOUND


def _unplanned(
    scene: Scene, tolerance: float, model: Model, h: float | None, times: ArrayLike | None
) -> Plan:
    """Plan of a model that states its own error. That of a sheet at large deflection does not come
    from the linear response: stiffened by stretching it has longer waves and fewer resonances.
    """
    start = start_left_out(scene, model, times=times)
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


def _stretched(scene: Scene, tolerance: float, times: ArrayLike | None) -> Plan:
    """Plan of a sheet at large deflection."""
    found = _unplanned(scene, tolerance, STRETCHED, None, times)
    left = stretching_left_out(scene, FROM_REST, tolerance)
    reason = (
        f"a linear sheet would deflect by {deflection(scene):.2g} thicknesses, and stretching "
        f"changes its motion by {100 * left:.2g} %"
    )
    rows = [replace(row, reason=reason) if row.what == "model" else row for row in found.rows]
    return replace(found, rows=tuple(rows))


def _by_modes(scene: Scene, tolerance: float, highest: float, rows: list[PlanRow]) -> Plan:
    """Plan of a sheet by its modes, from rest."""
    reason = why_modes(scene, tolerance)
    rows = [
        *rows, PlanRow(what="model", value=FROM_REST.name, reason=reason),
        *left_out(scene, highest),
    ]  # fmt: skip
    error = FROM_REST.error(scene, None) if FROM_REST.error else np.nan
    return Plan(
        model=FROM_REST.name, body=scene.body, highest=highest, error=error,
        seconds=FROM_REST.seconds, memory=FROM_REST.memory, rows=tuple(rows),
        warnings=over_tolerance(f"the {FROM_REST.method}", error, tolerance, "a larger one is"),
    )  # fmt: skip


def _without_mesh(
    scene: Scene,
    tolerance: float,
    asked: Model,
    highest: float,
    rows: list[PlanRow],
    times: ArrayLike | None,
) -> Plan:
    returned, start = _returned(scene), start_left_out(scene, asked, times=times)
    model, left = asked.name, start if asked.is_steady else 0.0
    sudden = sudden_left_out(scene, asked, times)
    reason = f"{_section(scene.body)} without reflecting sides: wavenumber integral, no mesh"
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
        *sudden_over_tolerance(scene, FINEST / 4, sudden, tolerance),
    )
    rows = [
        *rows,
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


def _section(body: Body) -> str:
    layers = len(body.strata)
    return "a homogeneous flat slab" if layers == 1 else f"a flat slab of {layers} layers"


def _march_error(scene: Scene, dt: float) -> float:
    """Expected relative error of a time step."""
    known = sensitivity(scene)
    # Average acceleration lowers frequencies by (w dt)^2/12 (Hughes 1987, chapter 9).
    return min(1.0, known.value * (2 * np.pi * known.frequency * dt) ** 2 / 12)


def _why_elements(scene: Scene, returned: float) -> str:
    body = scene.body
    if not scene.load.is_plain and not takes(FLAT_BODY, scene):
        return f"the wavenumber integral has no {scene.reading.words} under {scene.load.words}"
    if gaussian_width(scene.pressure.height, scene.pressure.profile) is None:
        return (
            f"the wavenumber integral needs a Gaussian focus, not '{scene.pressure.profile_name}'"
        )
    if not body.of_kind.compliance:
        return f"a body of kind '{body.kind}' has no wavenumber integral"
    if body.placement != FLAT:
        return "the body is tilted or moved; the wavenumber integral is for one across the beam"
    if body.of_kind.is_plate and body.sides == "absorbing":
        return "absorbing sides of a sheet reflect in part; the wavenumber integral has no sides"
    if body.of_kind.is_plate:
        return f"the {body.sides} sides of this sheet reflect; the wavenumber integral has no sides"
    if body.sides == "absorbing":
        return "as asked; this body has a wavenumber integral, too"
    reflected = f"about {100 * returned:.3g} %" if returned < 1 else "as much as the load causes"
    return f"the {body.sides} sides reflect {reflected}; the wavenumber integral has no sides"
