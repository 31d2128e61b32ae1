"""Nonlinear models of a sheet at large deflection, from rest.

The sheet is meshed as in the linear models: an equivalent solid, some ten times as thick, has the
bending stiffness and mass of the true sheet. Its membrane stiffness is too small by the factor
d^2 / h^2, and a membrane in the middle plane adds the difference. Bending stiffness, mass and
membrane stiffness are then those of the true sheet, and no element is flat.

The error of time steps grows with frequency. In modes, the linear part of the motion is known
exactly and replaces that of the time steps, so that steps affect only the effect of stretching. The
remaining error is measured with each response, in the quantity of the scene. The error of elements
and of neglected modes is the difference of the linear part from that of a thin plate in its modes.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import islice
from math import pi
from typing import Any

import numpy as np

import fem
from fem import nonlinear
from fem.memory import BYTES_PER_DOF
from fem.reduced_nonlinear import StretchingModes, stretching_modes
from meshes import middle_plane
from simple_model import Effort, ErrorPart, Material, Response, Statement
from simple_model.load.sampling import below_half_the_rate, highest_driving
from simple_model.load.spectrum import load_lines
from simple_model.quantities import ACCELERATION, DISPLACEMENT, VELOCITY, Quantity
from skinwave.bodies.build import Build, build
from skinwave.bodies.sheet import air, bending_wavenumber, discretise
from skinwave.models import Cost, Limit, Model, limits, linear_elements, reduced, register
from skinwave.models.costs import UNITS, Cheaper, computed_times, lines_below
from skinwave.models.laws import has_own_law
from skinwave.models.meshed import load_in_steps, surface_load, with_cost
from skinwave.models.options import SolveOptions, response_of, solver_name
from skinwave.models.plate_modes import FROM_REST, RITZ_ERROR
from skinwave.models.reduced import ReducedBody, ReducedResponse
from skinwave.models.relative_change import relative_changes
from skinwave.models.sheet_probes import full_reader, modal_reader
from skinwave.scene.scene import Body, Scene
from skinwave.system.effort import Clock
from skinwave.typing import Floats

MOST_LINES = 500  # of a load that are summed in each step


def full_size(body: Body, cells: int = 26) -> float:
    """Return the default element size in m of a sheet with `cells` along the shorter side."""
    return min(body.width, body.height) / cells


def reduced_size(body: Body) -> float:
    """Return the default element size in m of a sheet that is reduced to its modes."""
    return full_size(body, 32)


def mesh_part(h: float, error: float) -> ErrorPart:
    """Return the part of the error that is due to elements of h in m."""
    source = f"elements of {1e3 * h:.3g} mm"
    return ErrorPart(name="mesh", source=source, error=error, cure="use smaller elements")


def expected_error(body: Body, h: float) -> float:
    """Return the error of a waveform with elements of h in m: 5 % measured, of order 3.2."""
    return min(1.0, 0.05 * (h / full_size(body)) ** 3)


def meshed_sheet(body: Body, h: float, stocky: float = 0.48) -> Build:
    """Return the mesh of the equivalent sheet with cells of h in m.

    Its thickness is `stocky` times h: its shear then lowers frequencies by as much as elements of
    this side raise them. With 7 elements a wavelength, 0.3 % of 5 % remain.
    """
    thickness = min(stocky * h, 0.05 * min(body.width, body.height))
    return build(body, h, discretise=partial(discretise, thickness=thickness))


def membrane(body: Body, made: Build, share: float | None = None) -> fem.Membrane:
    """Return a membrane with a share of the sheet's stiffness, by default what the mesh lacks."""
    ratio = body.depth / float(np.ptp(made.mesh.points[:, 2]))
    share = 1 - ratio**2 if share is None else share
    triangles = middle_plane(made.mesh)
    return fem.Membrane(triangles=triangles, thickness=share * body.depth, material=body.solid)


def stretching_body(body: Body, made: Build) -> fem.Elastic:
    """Return the full-order model of the meshed sheet at large displacement."""
    missing = membrane(body, made)
    return fem.finite_strain(
        made.mesh, made.material, fixed=made.constraints, tension=made.tension,
        membrane=missing if missing.thickness > 1e-9 * body.depth else None,
    )  # fmt: skip


def full_answer(scene: Scene, times: Floats, options: SolveOptions) -> Response:
    """Integrate all degrees of freedom in time, from rest."""
    clock, size = Clock(), options.h or full_size(scene.body)
    with clock("assemble"):
        options.progress("assemble", 0.0)
        made = meshed_sheet(scene.body, size)
        body = stretching_body(scene.body, made)
    P, points = surface_load(made)
    dt = linear_elements.time_step(scene, options)
    load = load_in_steps((scene.pressure,), points, times, dt)
    stepped, straight, effort = _march(
        body, lambda t: P @ load(t), dt, times, options, clock,
        read=full_reader(scene.body, made, scene.probe_points, scene.reading),
        rows=fem.probe_operator(made.mesh, scene.probe_points),
    )  # fmt: skip
    values = linear_elements.in_time(
        stepped, dt, times, scene, (scene.body.solid,) * len(scene.probes)
    )
    normal = _normal_scene(scene)
    part = _plate_part(
        normal, times, options, linear_elements.in_time(straight, dt, times, normal), size
    )
    errors = Statement(parts=(part,), tolerance=options.tolerance)
    effort = replace(effort, dofs=len(body.operators.free), errors=errors)
    effort = with_cost(effort, clock, made, size)
    return response_of(scene, "fem-nonlinear-transient", times, values, effort)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Reduced:
    """Sheet reduced to its bending modes, with and without stretching, and its load."""

    made: Build
    modes: StretchingModes
    linear: ReducedBody
    operators: fem.Operators


def reduced_answer(scene: Scene, times: Floats, options: SolveOptions) -> Response:
    """Integrate the bending modes of the sheet in time, from rest, with an exact linear part."""
    clock, size = Clock(), options.h or reduced_size(scene.body)
    quantity, probes = scene.reading.record, scene.probe_points
    with clock("reduce"):
        options.progress("reduce", 0.0)
        sheet = _reduce(scene.body, size, options.solver)
        read = modal_reader(
            scene.body, sheet.made, sheet.modes, sheet.operators, probes, scene.reading,
            options.solver,
        )  # fmt: skip

    each = np.eye(len(sheet.modes.hz))
    rows = np.stack([(read(z) - read(-z)) / 2 for z in each], axis=1)  # without the quadratic part
    dt = linear_elements.time_step(scene, options)
    force = _modal_force(scene, sheet.linear, times, dt)
    stepped, straight, effort = _march(
        sheet.modes.elastic, force, dt, times, options, clock, read=read, rows=rows
    )
    with clock("linear part"):
        solids, normal = (scene.body.solid,) * len(scene.probes), _normal_scene(scene)
        highest = highest_driving(scene.pressure, times)
        motion = reduced.respond(sheet.linear, scene.pressure, highest=highest)
        linear = _from_rest(motion, rows, times, quantity, solids)
        stretching, straight = (
            linear_elements.sampled_components(steps, dt, times, quantity, solids)
            for steps in (stepped - straight, straight)
        )
        values, linear, straight = (
            quantity.waveforms(each, len(probes))
            for each in (linear + stretching, linear, straight)
        )
        shapes = fem.probe_operator(sheet.made.mesh, probes) @ sheet.modes.basis
        normal_motion = _from_rest(motion, shapes, times, normal.reading.record, ())
        elements = _plate_part(normal, times, options, normal_motion, size)
    # The linear part has no step error; that of stretching is proportional to stretching.
    share = np.minimum(relative_changes(values - linear, values), 1)
    steps = ErrorPart(
        name="steps", source=f"time steps of {1e3 * dt:.3g} ms",
        error=float((share * relative_changes(straight - linear, values)).max()),
        cure="use a shorter --dt",
    )  # fmt: skip
    effort = replace(
        effort, dofs=len(sheet.operators.free), reduced_dofs=len(sheet.modes.hz),
        estimate=sheet.modes.left_out,
        errors=Statement(parts=(elements, steps), tolerance=options.tolerance),
    )  # fmt: skip
    effort = with_cost(effort, clock, sheet.made, size)
    return response_of(scene, "fem-nonlinear", times, values, effort)


def _modal_force(
    scene: Scene, linear: ReducedBody, times: Floats, dt: float
) -> Callable[[float], Floats]:
    """Return a function from a time in s to modal forces (r,)."""
    if len(load_lines(scene.pressure).frequencies) > MOST_LINES:
        load = load_in_steps((scene.pressure,), linear.points, times, dt)
        return lambda t: load(t) @ linear.forces
    hz, forces = reduced.reduced_forces(linear, scene.pressure)
    below = below_half_the_rate(hz, times)
    hz, forces = hz[below], forces[below]
    return lambda t: (np.exp(2j * pi * hz * t) @ forces).real


def _from_rest(
    motion: ReducedResponse, rows: Floats, times: Floats, quantity: Quantity,
    solids: tuple[Material, ...],
) -> Floats:  # fmt: skip
    """Return the components (t, p c) of the linear part of the motion, exact for its modes."""
    components = reduced.in_motion(reduced.read_at(motion, rows), quantity, solids)
    below = below_half_the_rate(components.frequencies, times)
    return reduced.from_rest(reduced.select_lines(components, below), times)


@lru_cache(maxsize=1)
def _reduce(body: Body, h: float, solver: str) -> _Reduced:
    """Reduce the sheet to its modes; cached for successive Tactons."""
    made = meshed_sheet(body, h)
    operators = stretching_body(body, made).operators
    modes = stretching_modes(
        made.mesh, operators, membrane(body, made, 1.0), mode_count(body),
        air=air(body, made, operators.free), solver=solver,
    )  # fmt: skip
    P, points = surface_load(made)
    modal = modes.elastic.operators
    dense = replace(
        modal, K=modal.K.toarray(), C=modal.C.toarray(), M=modal.M.toarray(), R=modal.R.toarray(),
        branches=tuple(replace(each, K=each.K.toarray()) for each in modal.branches),
    )  # fmt: skip
    linear = reduced.reduced_of(dense, P.T @ modes.basis, points, Effort(dofs=len(operators.free)))
    return _Reduced(made=made, modes=modes, linear=linear, operators=operators)


def mode_count(body: Body, highest: float = 1500.0, within: tuple[int, int] = (40, 160)) -> int:
    """Return the number of modes up to `highest` in Hz, area times k^2 / 4 pi (Weyl), in bounds."""
    squared = bending_wavenumber(body, highest) ** 2
    count = round(body.width * body.height * squared / 4 / pi)
    return min(max(count, within[0]), within[1])


def _march(
    body: fem.Elastic, force: Callable[[float], Floats], dt: float, times: Floats,
    options: SolveOptions, clock: Clock, *, read: Callable[[Floats], Floats], rows: Any,
) -> tuple[Floats, Floats, Effort]:  # fmt: skip
    """Integrate in time from rest. Return components (n, p c) at all steps, those of the linear
    part at the same steps by `rows` (p c, r), and the effort.
    """
    solver, steps = options.solver, linear_elements.step_count(float(times[-1]), dt)
    cached, straight = lru_cache(maxsize=2)(force), []

    def states() -> Iterator[fem.State]:
        bent = nonlinear.dynamic(body, cached, dt, solver=solver)
        linear = fem.transient(body.operators, cached, dt, solver=solver)
        for state, other in zip(islice(bent, steps + 1), linear, strict=False):
            straight.append(rows @ other.displacement)
            yield state

    with clock("march"):
        stepped, (imbalance, _) = linear_elements.march(
            fem.with_energy_balance(body, states(), cached), steps, read,
            lambda state: fem.mechanical_energy(body, state), options.progress,
        )  # fmt: skip
    effort = Effort(steps=steps, solver=solver_name(solver), energy_imbalance=imbalance, dt=dt)
    return stepped, np.array(straight), effort


def _normal_scene(scene: Scene) -> Scene:
    """Return the scene that reads normal motion with an error no smaller than its quantity's."""
    quantity, normal = scene.reading.record, (DISPLACEMENT, VELOCITY, ACCELERATION)
    rate = min(quantity.rate + (not quantity.is_normal), len(normal) - 1)
    return replace(scene, quantity=normal[rate].name, depth=0.0)


def _plate_part(
    normal: Scene, times: Floats, options: SolveOptions, linear: Floats, h: float
) -> ErrorPart:
    """Return the error of a linear part (t, p) of normal motion, compared with a thin plate."""
    error = expected_error(normal.body, h)
    if not limits.beyond(FROM_REST, normal):
        plate = FROM_REST.solve(normal, times, options).values
        measured = float(relative_changes(linear - plate, plate).max())
        error = max(error, measured + RITZ_ERROR.error)
    return mesh_part(h, error)


def _limits(scene: Scene, *, held_air: bool, size: Callable[[Body], float]) -> Iterator[Limit]:
    body = scene.body
    if not body.of_kind.is_plate:
        yield Limit(why=f"needs a sheet, not a {body.kind}")
        return
    yield from limits.clamped_sheet_limits(body)
    yield from limits.edge_and_air_limits(body, held_air=held_air)
    yield from linear_elements.mesh_limits(body, size(body))
    if not scene.load.is_plain:
        yield limits.load_limit(scene)


def sheet_dofs(body: Body, h: float, per_cell: float = 36.0) -> float:
    """Return the approximate number of degrees of freedom of a meshed sheet."""
    return per_cell * body.width * body.height / h**2


def _reduced_cost(scene: Scene, options: SolveOptions, effort: Effort) -> Cost:
    n, r = sheet_dofs(scene.body, options.h or reduced_size(scene.body)), mode_count(scene.body)
    lines = min(MOST_LINES, lines_below(scene, computed_times(scene, options)))
    # s of reducing a degree of freedom to a mode; of a step, two modes in it, a line and a mode.
    reduction, march, pair, line = 3.6e-6, 5e-4, 1.5e-7, 4e-9
    step = march + pair * r**2 + line * lines * r
    steps = linear_elements.planned_steps(scene, options)
    return Cost(
        parts={Cheaper.MESH: reduction * n * r, Cheaper.DURATION: steps * step},
        memory=UNITS.process + (BYTES_PER_DOF + 70.0 * r) * n,
    )


def _full_cost(scene: Scene, options: SolveOptions, effort: Effort) -> Cost:
    n = sheet_dofs(scene.body, options.h or full_size(scene.body))
    iterations, forces = 3, 1e-6  # in a step; s of the forces of a degree of freedom
    step = iterations * (forces * n + linear_elements.step_seconds(n))
    return Cost(
        parts={Cheaper.MODES: linear_elements.planned_steps(scene, options) * step},
        memory=UNITS.process + 2 * BYTES_PER_DOF * n,  # twice that of linear models
    )


REDUCED = register(
    Model(
        name="fem-nonlinear",
        method="large deflection, step by step from rest",
        words="a sheet that stretches as it bends, in its modes, from rest",
        solve=reduced_answer,
        limits=partial(_limits, held_air=True, size=reduced_size),
        parts=lambda scene, options: [
            mesh_part(options.h or 0.0, expected_error(scene.body, options.h or 0.0))
        ],
        cost=_reduced_cost,
        default_size=reduced_size,
        sources=(
            linear_elements.SOURCES["Newmark"],
            "T. Belytschko, W. K. Liu, B. Moran: Nonlinear Finite Elements for Continua and "
            "Structures. Wiley, 2000",
        ),
        is_nonlinear=True,
        takes_series=has_own_law,
    )
)
register(
    replace(
        REDUCED,
        name="fem-nonlinear-transient",
        words="a sheet that stretches as it bends, on 10-node tetrahedra, step by step",
        solve=full_answer,
        limits=partial(_limits, held_air=False, size=full_size),
        cost=_full_cost,
        default_size=full_size,
    )
)
