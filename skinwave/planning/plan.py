"""Plan of a scene: the cheapest model, extent and element size within a tolerance, with reasons."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

import fem
from simple_model import Effort, ErrorPart, Statement
from simple_model.layers.flat_body import TRANSFORM_RATE
from simple_model.numbers import change_text, percent, plural, significant
from skinwave.bodies.sizes import check_mesh
from skinwave.models import Limit, Model, named
from skinwave.models.flat_body import FLAT_BODY, HARMONIC
from skinwave.models.laws import check_laws, own_laws, series_tolerance
from skinwave.models.limits import beyond, check_takes, default_model, refusal, takes
from skinwave.models.linear_elements import FEM, step_count, time_step
from skinwave.models.options import (
    DEFAULT,
    SolveOptions,
    sample_grid,
    sample_times,
    underflow_to_zero,
)
from skinwave.models.plate_modes import FROM_REST, RITZ_ERROR, STRETCHED, thin_plate_part
from skinwave.models.point_kernel import SAME_LOAD
from skinwave.models.reduced import answer, reduce_scene
from skinwave.planning import errors, estimates, left_out
from skinwave.planning.deflection import linear_deflection, stretches
from skinwave.planning.estimates import side_reflections
from skinwave.planning.extent import absorbing_error, extent, symmetry
from skinwave.planning.plan_warnings import implausible
from skinwave.planning.record import Plan, PlanRow
from skinwave.planning.refinement import above_band, element_sizes, first_size, refine
from skinwave.planning.rows import cost_row, element_rows, neglected_rows
from skinwave.scene.scene import Scene
from skinwave.system.progress_bar import announce
from skinwave.typing import Floats

Grid = tuple[Floats, int]  # see `sample_grid`
REQUESTED = "as requested"


@dataclass(frozen=True, kw_only=True, eq=False)
class _Request:
    """A scene, the `model` requested or chosen for it, and the `reason`."""

    scene: Scene
    options: SolveOptions
    grid: Grid
    model: Model
    reason: str = REQUESTED
    start: float | None = None  # error of the start that the model leaves out, if known

    def model_row(self, start: float = 0.0, method: str = "") -> PlanRow:
        """Return the row of the model, with the relative error of the start if it is left out."""
        reason = f"{self.reason} ({method})" if method else self.reason
        if start:
            reason += f"; leaves out the initial transient, {change_text(start)}"
        return PlanRow(what="model", value=self.model.name, reason=reason)


@underflow_to_zero()
def plan(scene: Scene, options: SolveOptions = DEFAULT) -> Plan:
    """Plan a scene's simulation to a relative error in its probes' waveforms.

    Parameters
    ----------
    scene : Scene
    options : SolveOptions; with both a model and h, the whole body is modelled; h alone selects
        elements for a sheet

    Returns
    -------
    Plan

    Raises
    ------
    ValueError
        If the model is unknown or does not take the scene, or if times, h or dt are not valid for
        it.

    Examples
    --------
    >>> import skinwave
    >>> scene = skinwave.loads("[tacton]\\nam_frequency_hz = 100\\n[body]\\nthickness_mm = inf")
    >>> plan = skinwave.plan(scene)
    >>> plan.model, round(plan.error, 3)
    ('flat-body-harmonic', 0.014)
    >>> for row in plan.rows:
    ...     if row.what != "cost":
    ...         print(f"{row.what}: {row.value}")
    highest line: 200 Hz
    model: flat-body-harmonic
    expected error: start 1.4 %, integral 0.20 %; together 1.4 %
    """
    announce(options.progress, "choose the model")
    request = _choose_model(scene, options, sample_grid(scene, options.times))
    announce(options.progress, "estimate errors")
    model, tolerance = request.model, options.tolerance
    if scene.body.of_kind.discretise:
        planned, parts = (_plan_elements if model.is_refined else _plan_without_mesh)(request)
        scene = replace(scene, body=planned.body)
        parts += errors.left_out_parts(scene, model, tolerance, planned.prepared)
        laws = own_laws(scene.body) if model.takes_series(scene.body) else []
        series = [law.series(series_tolerance(tolerance)).words for law in laws]
        replaces = f"replaces the law in {model.name}"
        rows = [PlanRow(what="modulus law", value=words, reason=replaces) for words in series]
        planned = replace(planned, rows=(*planned.rows, *rows))
    else:
        planned = Plan(model=model.name, body=scene.body, rows=(request.model_row(),))
        load = ErrorPart(name="load", source="the pressure at the probes", error=0.0)
        parts = [load, *errors.focus_parts(scene)]
    statement = Statement(parts=tuple(parts), tolerance=tolerance)
    planned = _with_cost(planned, scene, model, options)
    cure = f"cure of the largest part: {statement.cure}" if statement.cure else ""
    row = PlanRow(what="expected error", value=statement.words, reason=cure)
    return replace(
        planned, statement=statement, rows=(*planned.rows, row), options=options,
        cautions=(*planned.cautions, *implausible(scene)),
    )  # fmt: skip


def _with_cost(planned: Plan, scene: Scene, model: Model, options: SolveOptions) -> Plan:
    """Return a plan with the cost of the first response, if the model predicts it."""
    if not model.cost:
        return planned
    effort = planned.prepared.effort if planned.prepared else Effort()
    cost = model.cost(scene, replace(options, h=planned.h or options.h), effort)
    row = cost_row(cost, effort if model.is_reduced else None)
    return replace(planned, seconds=cost.seconds, memory=cost.memory, rows=(*planned.rows, row))


def _choose_model(scene: Scene, options: SolveOptions, grid: Grid) -> _Request:
    """Check the request and return it with its model, or the one chosen for the scene."""
    requested, start = None if options.model == "auto" else named(options.model), None
    if options.dt is not None:
        step_count(float(sample_times(scene)[-1]), options.dt)
    if requested:
        check_takes(requested, scene)
    moves = scene.body.of_kind.discretise
    if moves and (not requested or requested.needs_body):
        check_laws(scene.body, scene.pressure)
    if not moves:
        model, reason = requested or SAME_LOAD, "the scene has no body that moves"
    elif requested:
        model, reason = requested, REQUESTED
    else:
        model, reason = model_from_rest(scene, options)
        options = options if model is FEM else replace(options, h=None)
        start = _steady_start(scene, options.tolerance, grid) if model is FLAT_BODY else None
        model = model if start is None else HARMONIC
    return _Request(
        scene=scene, options=options, grid=grid, model=model, reason=reason, start=start
    )


def model_from_rest(scene: Scene, options: SolveOptions = DEFAULT) -> tuple[Model, str]:
    """Return the cheapest model from rest of a body within the tolerance, and the reason for it.

    For a sheet, a given h selects elements. Raises a ValueError if no model takes the scene.
    """
    tolerance = options.tolerance
    if options.h is not None and scene.body.of_kind.is_plate and takes(FEM, scene):
        return FEM, _why_elements(scene)
    if stretching := stretches(scene, tolerance):
        return STRETCHED, (
            f"a linear sheet would deflect by {significant(linear_deflection(scene), 2)} "
            f"thicknesses, and stretching changes its motion by {change_text(stretching)}"
        )
    reflections = side_reflections(scene)
    # Reflections up to this share of the tolerance may be neglected.
    is_infinite = reflections <= 0.8 * tolerance and takes(FLAT_BODY, scene)
    if is_infinite and (scene.body.of_kind.is_layer or _suffices(FLAT_BODY, scene, tolerance)):
        if scene.body.sides == "absorbing":
            return FLAT_BODY, "flat layers with absorbing sides, which need no mesh"
        return FLAT_BODY, f"reflections from the sides are only {percent(reflections)}"
    return model_with_sides(scene, tolerance)


def model_with_sides(scene: Scene, tolerance: float = DEFAULT.tolerance) -> tuple[Model, str]:
    """Return the cheapest linear model from rest that includes any reflecting sides, and the reason
    for it. Raises a ValueError if no model takes the scene.
    """
    if reason := why_modes(scene, tolerance):
        return FROM_REST, reason
    model = named(default_model(scene))
    why_not_elements = "" if model is FEM else f"{FEM.name} {beyond(FEM, scene)[0].why}"
    return model, why_not_elements or _why_elements(scene)


def cheapest_model(scene: Scene) -> str:
    """Return the name of the cheapest model of a scene. Raises a ValueError if none takes it."""
    return _choose_model(scene, DEFAULT, sample_grid(scene)).model.name


def _steady_start(scene: Scene, tolerance: float, grid: Grid) -> float | None:
    """Return the error of the steady state of a flat body by its start; None if it has no steady
    state within the tolerance.
    """
    try:
        start = left_out.start_error(scene, HARMONIC, grid)
    except (ValueError, ArithmeticError):  # no steady state
        return None
    # Lines are reflected, and the start is the body's own vibration: their powers add.
    return start if np.hypot(side_reflections(scene), start) <= tolerance else None


def why_modes(scene: Scene, tolerance: float) -> str:
    """Return the reason to use plate modes instead of elements; "" if elements are better."""
    if not takes(FROM_REST, scene) or not _suffices(FROM_REST, scene, tolerance):
        return ""
    return "a flat sheet on supports, whose modes need no mesh"


def _suffices(model: Model, scene: Scene, tolerance: float) -> bool:
    """Whether the own error of a model is within the tolerance, or elements cannot replace it."""
    own = Statement(parts=errors.own_parts(model, scene))
    return own.error <= tolerance or not takes(FEM, scene)


def _why_elements(scene: Scene) -> str:
    """Return the reason why no wavenumber integral replaces elements."""
    if limits := beyond(FLAT_BODY, scene):
        return f"{FLAT_BODY.name} {limits[0].why}"
    body, reflections = scene.body, side_reflections(scene)
    if takes(FROM_REST, scene) and (thin := thin_plate_part(scene).error) > RITZ_ERROR.error:
        return f"shear and rotary inertia change the motion of this sheet by {change_text(thin)}"
    if body.sides == "absorbing":
        return "absorbing sides of a sheet reflect in part"
    reflected = f" about {percent(reflections)}" if reflections < 1 else ""
    return f"the {body.sides} sides reflect{reflected}, which the wavenumber integral leaves out"


def _highest_line(scene: Scene, tolerance: float) -> tuple[float, PlanRow]:
    """Return the highest relevant line in Hz, and its row."""
    spectrum, support = estimates.response_spectrum(scene, tolerance), scene.load.support_motion
    highest = estimates.cutoff_frequency(*spectrum, tolerance)
    highest = max(highest, support.frequency) if support else highest
    return highest, PlanRow(
        what="highest line",
        value=f"{highest:.0f} Hz",
        reason=f"the load has {plural(len(spectrum[0]), 'line')}; higher ones move the probes by "
        f"less than {percent(tolerance / 3)}",
    )


def _plan_without_mesh(request: _Request) -> tuple[Plan, list[ErrorPart]]:
    """Plan a model whose mesh is not refined, and return the parts of its error.

    The error of a sheet at large deflection does not follow from the linear response, because
    stretching stiffens the sheet and makes its waves longer.
    """
    scene, model, options = request.scene, request.model, request.options
    start, size, highest = request.start, 0.0, 0.0
    if start is None:
        start = left_out.start_error(scene, model, request.grid)
    rows = [request.model_row(start, "" if model.is_infinite else model.method)]
    if model.default_size:
        size = options.h or model.default_size(scene.body)
        check_mesh(scene.body, size)
        reason = REQUESTED if options.h else f"the default of {model.name}"
        rows.append(PlanRow(what="element size", value=f"{1e3 * size:.2f} mm", reason=reason))
    if model.needs_body:
        highest, line_row = _highest_line(scene, options.tolerance)
        rows = [line_row, *rows, *neglected_rows(scene, highest, model.is_nonlinear)]
    own = errors.own_parts(model, scene, replace(options, h=size or None))
    parts = [*own, *errors.start_parts(model, start)]
    if model.is_infinite:
        above = left_out.above_band_error(scene, model, request.grid)
        parts += errors.sides_parts(scene, model, side_reflections(scene), options.tolerance)
        parts.append(errors.band_part(scene, TRANSFORM_RATE / 4, above))
    planned = Plan(
        model=model.name, body=scene.body, h=size or None, highest=highest, rows=tuple(rows)
    )
    return planned, parts


def _plan_elements(request: _Request) -> tuple[Plan, list[ErrorPart]]:
    """Plan linear elements: extent and mesh; and return the parts of their error."""
    scene, model, options, (times, _) = request.scene, request.model, request.options, request.grid
    tolerance = options.tolerance
    highest, line_row = _highest_line(scene, tolerance)
    axes = symmetry(scene) if model.is_reduced else ""
    try:
        if options.model != "auto" and options.h is not None:  # mesh the whole body
            body, rows = scene.body, list[PlanRow]()
            absorbing = absorbing_error(scene, body, options)
        else:
            body, rows, absorbing = extent(scene, options, highest)
        # Independent errors add as squares. The mesh may use half the tolerance in any case.
        of_mesh = max(tolerance**2 - absorbing**2, tolerance**2 / 4) ** 0.5
        for_mesh = replace(options, tolerance=of_mesh)
        if highest > options.band:
            for_mesh = _with_band(replace(scene, body=body), for_mesh, axes, times)
        mesh, band = refine(scene, body, for_mesh, symmetry=axes), for_mesh.band
    except fem.NotReduced as error:
        limit = Limit(why=f"cannot reduce this body: {error}")
        raise refusal(scene, model, [limit]) from None
    scene, effort = replace(scene, body=body), mesh.prepared.effort
    above = above_band(answer(mesh.prepared, scene, times=times).values, times[1], band)
    parts = errors.element_parts(
        scene, tolerance, mesh.h, mesh=mesh.error, reduction=effort.estimate, absorbing=absorbing,
        above_band=above, band=band,
    )  # fmt: skip
    start = left_out.start_error(scene, model, request.grid, mesh.prepared)
    parts += errors.start_parts(model, start)
    if model.is_stepped:
        parts.append(errors.step_part(scene, time_step(scene, options)))
    planned = Plan(
        model=model.name, body=body, symmetry=axes, h=mesh.h, highest=highest,
        prepared=mesh.prepared,
        rows=(
            line_row, request.model_row(start), *rows,
            *element_rows(scene, tolerance, axes, mesh, highest, options.h, band),
        ),
        cautions=errors.element_warnings(scene, mesh.h),
    )  # fmt: skip
    return planned, parts


def _with_band(
    scene: Scene, options: SolveOptions, axes: str, times: Floats, widest: int = 4
) -> SolveOptions:
    """Return options with the band, up to `widest` times the usual one, that has the motion of a
    scene on a coarse mesh: wide for a stiff body under a fast load.
    """
    h = options.h or first_size(scene, element_sizes(scene.body), options.tolerance)
    for band in (options.band * n for n in range(1, widest)):
        tried = replace(options, h=h, band=band)
        coarse = reduce_scene(scene, tried, symmetry=axes, own_path=True)
        moved = answer(coarse, scene, times=times).values
        if above_band(moved, times[1], band) <= options.tolerance / 2:
            return replace(options, band=band)
    return replace(options, band=options.band * widest)
