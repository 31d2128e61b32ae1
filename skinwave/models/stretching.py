"""Nonlinear models of a sheet at large deflection, from rest.

A sheet is meshed as in the linear models, by an equivalent solid some ten times too thick with the
bending stiffness and mass of the true one. The membrane stiffness of so thick a solid is too small
by the factor d^2 / h^2, and a membrane in its middle plane adds what is missing: bending stiffness,
mass and membrane stiffness are all those of the true sheet, and no element is flat.

Time steps make an error that grows with frequency. In modes, the linear part of the motion is known
exactly: the same steps of the linear part are replaced by it, so that steps affect only what
stretching changes. What remains is measured with each answer, in the quantity of the scene:
the linear part differs from that of a thin plate in its own modes by the error of elements and of
the modes that are left out.
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
from fem.reduced_nonlinear import StretchingModes, stretching_modes
from meshes import middle_plane
from simple_model import Effort, Material, Response
from simple_model.load.sampling import below_half_the_rate, highest_driving, resolving_step
from simple_model.load.spectrum import load_lines
from simple_model.quantities import ACCELERATION, DISPLACEMENT, VELOCITY, Quantity
from skinwave.bodies.build import Build, build
from skinwave.bodies.sheet import air, bending_wavenumber, discretise
from skinwave.models import Limit, Model, register
from skinwave.models.laws import has_own_law
from skinwave.models.limits import beyond, load_limit, of_air_in_a_frame, of_held_sheet, of_vacuum
from skinwave.models.linear_elements import (
    NEWMARK,
    TRANSIENT_RATE,
    in_time,
    marched,
    of_mesh,
    sampled_components,
    step_count,
)
from skinwave.models.meshed import load_in_steps, spent, surface_load
from skinwave.models.options import SolveOptions
from skinwave.models.plate_modes import ERROR as PLATE_ERROR
from skinwave.models.plate_modes import FROM_REST, relative
from skinwave.models.reduced import (
    ReducedBody,
    ReducedResponse,
    from_rest,
    in_motion,
    read_at,
    reduced_forces,
    reduced_of,
    respond,
    select_lines,
)
from skinwave.models.sheet_probes import full_reader, modal_reader
from skinwave.scene.scene import Body, Scene
from skinwave.system.effort import Clock
from skinwave.typing import Floats

NEWTON = (
    "T. Belytschko, W. K. Liu, B. Moran: Nonlinear Finite Elements for Continua and Structures. "
    "Wiley, 2000"
)
# Thickness of the mesh over an element's side: the shear of so thick a sheet lowers frequencies by
# as much as elements of this side raise them. At 7 elements a wavelength 0.3 % are left of 5 %.
STOCKY, STOUTEST = 0.48, 0.05
FULL_CELLS, REDUCED_CELLS = 26, 32  # along the shorter side
COARSE_ERROR, ERROR_ORDER = 0.05, 3.0  # of a waveform with FULL_CELLS; measured order 3.2
HIGHEST_MODE = 1500.0  # Hz, of the modes in the basis
FEWEST_MODES, MOST_MODES = 40, 160
RATES = DISPLACEMENT, VELOCITY, ACCELERATION
MOST_LINES = 500  # of a load that are summed in each step


def stretching_size(body: Body, *, reduced: bool) -> float:
    """Default element size of a sheet at large deflection, metre."""
    return min(body.width, body.height) / (REDUCED_CELLS if reduced else FULL_CELLS)


def expected_error(body: Body, h: float) -> float:
    """Relative error of a waveform with elements of h in metre, as measured on a sheet of paper."""
    return min(1.0, COARSE_ERROR * (h * FULL_CELLS / min(body.width, body.height)) ** ERROR_ORDER)


def meshed_sheet(body: Body, h: float) -> Build:
    """Mesh of the equivalent sheet in cells of h in metre, with a thickness to match."""
    thickness = min(STOCKY * h, STOUTEST * min(body.width, body.height))
    return build(body, h, discretise=partial(discretise, thickness=thickness))


def membrane(body: Body, made: Build, share: float | None = None) -> fem.Membrane:
    """Membrane with the stiffness that a meshed sheet lacks, or a share of its whole stiffness."""
    ratio = body.depth / float(np.ptp(made.mesh.points[:, 2]))
    share = 1 - ratio**2 if share is None else share
    triangles = middle_plane(made.mesh)
    return fem.Membrane(triangles=triangles, thickness=share * body.depth, material=body.solid)


def stretching_body(body: Body, made: Build) -> fem.Elastic:
    """Full-order model of the meshed sheet at large displacement."""
    missing = membrane(body, made)
    return fem.finite_strain(
        made.mesh,
        made.material,
        fixed=made.constraints,
        membrane=missing if missing.thickness > 1e-9 * body.depth else None,
        tension=made.tension,
    )


def full_answer(scene: Scene, times: Floats, options: SolveOptions) -> Response:
    """Direct time integration of all dofs, from rest."""
    clock, size = Clock(), options.h or stretching_size(scene.body, reduced=False)
    with clock("assemble"):
        options.progress("assemble", 0.0)
        made = meshed_sheet(scene.body, size)
        body = stretching_body(scene.body, made)
    P, points = surface_load(made)
    dt = options.dt or resolving_step(scene.pressure, 1 / TRANSIENT_RATE)
    load = load_in_steps((scene.pressure,), points, times, dt)
    march = _march(
        body, lambda t: P @ load(t), dt, times, options, clock,
        read=full_reader(scene.body, made, scene.probe_points, scene.reading),
        rows=fem.probe_operator(made.mesh, scene.probe_points),
    )  # fmt: skip
    values = in_time(march.steps, dt, times, scene, (scene.body.solid,) * len(scene.probes))
    plain = _normal(scene)
    linear = in_time(march.linear, dt, times, plain)
    return _response(
        "fem-nonlinear-transient", scene, times, clock, made, size,
        values=values, error=_plate_error(plain, times, options, linear, size),
        effort=replace(march.effort, dofs=len(body.operators.free)),
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class _Reduced:
    """Sheet reduced to its bending modes, and the same without stretching, with its load."""

    made: Build
    modes: StretchingModes
    linear: ReducedBody
    operators: fem.Operators


def reduced_answer(scene: Scene, times: Floats, options: SolveOptions) -> Response:
    """Time integration of the sheet's bending modes, from rest, with an exact linear part."""
    clock, size = Clock(), options.h or stretching_size(scene.body, reduced=True)
    asked, probes = scene.reading.record, scene.probe_points
    with clock("reduce"):
        options.progress("reduce", 0.0)
        sheet = _reduced(scene.body, size, options.solver)
        read = modal_reader(
            scene.body, sheet.made, sheet.modes, sheet.operators, probes, scene.reading,
            options.solver,
        )  # fmt: skip

    each = np.eye(len(sheet.modes.hz))
    rows = np.stack([(read(z) - read(-z)) / 2 for z in each], axis=1)  # the rest is quadratic
    dt = options.dt or resolving_step(scene.pressure, 1 / TRANSIENT_RATE)
    force = _modal_force(scene, sheet.linear, times, dt)
    march = _march(sheet.modes.elastic, force, dt, times, options, clock, read=read, rows=rows)
    with clock("linear part"):
        solids, plain = (scene.body.solid,) * len(scene.probes), _normal(scene)
        highest = highest_driving(scene.pressure, times)
        motion = respond(sheet.linear, scene.pressure, highest=highest)
        linear = _from_rest(motion, rows, times, asked, solids)
        bent, stepped = (
            sampled_components(steps, dt, times, asked, solids)
            for steps in (march.steps - march.linear, march.linear)
        )
        values, exact, stepped = (
            asked.waveforms(each, len(probes)) for each in (linear + bent, linear, stepped)
        )
        shapes = fem.probe_operator(sheet.made.mesh, probes) @ sheet.modes.basis
        elements = _plate_error(
            plain, times, options, _from_rest(motion, shapes, times, plain.reading.record, ()), size
        )
    # Steps of the linear part are corrected: what they do to the rest is as small as it is.
    share = np.minimum(relative(values - exact, values), 1)
    error = elements + float((share * relative(stepped - exact, values)).max())
    return _response(
        "fem-nonlinear", scene, times, clock, sheet.made, size, values=values, error=error,
        effort=replace(
            march.effort, dofs=len(sheet.operators.free), reduced_dofs=len(sheet.modes.hz),
            estimate=sheet.modes.left_out,
        ),
    )  # fmt: skip


def _modal_force(
    scene: Scene, linear: ReducedBody, times: Floats, dt: float
) -> Callable[[float], Floats]:
    """Modal forces (r,) at a time in s, by lines or, of many, by the load itself."""
    if len(load_lines(scene.pressure).frequencies) > MOST_LINES:
        load = load_in_steps((scene.pressure,), linear.points, times, dt)
        return lambda t: load(t) @ linear.forces
    hz, forces = reduced_forces(linear, scene.pressure)
    below = below_half_the_rate(hz, times)
    hz, forces = hz[below], forces[below]
    return lambda t: (np.exp(2j * pi * hz * t) @ forces).real


def _from_rest(
    motion: ReducedResponse,
    rows: Floats,
    times: Floats,
    asked: Quantity,
    solids: tuple[Material, ...],
) -> Floats:
    """Components (t, p c) of the linear part of the motion, exact for its modes."""
    components = in_motion(read_at(motion, rows), asked, solids)
    below = below_half_the_rate(components.frequencies, times)
    return from_rest(select_lines(components, below), times)


@lru_cache(maxsize=1)
def _reduced(body: Body, h: float, solver: str) -> _Reduced:
    """Reduce the sheet to its modes, cached for many Tactons in a row."""
    made = meshed_sheet(body, h)
    operators = stretching_body(body, made).operators
    modes = stretching_modes(
        made.mesh, operators, membrane(body, made, 1.0), mode_count(body),
        added=air(body, made, operators.free), solver=solver,
    )  # fmt: skip
    P, points = surface_load(made)
    modal = modes.elastic.operators
    dense = replace(
        modal, K=modal.K.toarray(), C=modal.C.toarray(), M=modal.M.toarray(), R=modal.R.toarray(),
        branches=tuple(replace(each, K=each.K.toarray()) for each in modal.branches),
    )  # fmt: skip
    linear = reduced_of(dense, P.T @ modes.basis, points, Effort(dofs=len(operators.free)))
    return _Reduced(made=made, modes=modes, linear=linear, operators=operators)


def mode_count(body: Body) -> int:
    """Number of modes below `HIGHEST_MODE`: area times k^2 / 4 pi (Weyl; Courant and Hilbert)."""
    squared = bending_wavenumber(body, HIGHEST_MODE) ** 2
    found = round(body.width * body.height * squared / 4 / pi)
    return min(max(found, FEWEST_MODES), MOST_MODES)


@dataclass(frozen=True, kw_only=True, eq=False)
class _March:
    """Components (n, p c) that probes read at all steps, those of the linear part alone by the same
    steps, and the cost.
    """

    steps: Floats
    linear: Floats
    effort: Effort


def _march(
    body: fem.Elastic, force: Callable[[float], Floats], dt: float, times: Floats,
    options: SolveOptions, clock: Clock, *, read: Callable[[Floats], Floats], rows: Any,
) -> _March:  # fmt: skip
    """Time integration from rest, and of the linear part, of which `rows` (p c, r) are read."""
    solver, steps = options.solver, step_count(float(times[-1]), dt)
    kept, linear = lru_cache(maxsize=2)(force), []

    def states() -> Iterator[fem.State]:
        bent = nonlinear.dynamic(body, kept, dt, solver=solver)
        straight = fem.transient(body.operators, kept, dt, solver=solver)
        for state, other in zip(islice(bent, steps + 1), straight, strict=False):
            linear.append(rows @ other.displacement)
            yield state

    with clock("march"):
        stepped, (imbalance, _) = marched(
            fem.with_energy_balance(body, states(), kept), steps, read,
            lambda state: fem.stored(body, state), options.progress,
        )  # fmt: skip
    effort = Effort(
        steps=steps, solver=fem.available()[0] if solver == "auto" else solver,
        energy_imbalance=imbalance, dt=dt,
    )  # fmt: skip
    return _March(steps=stepped, linear=np.array(linear), effort=effort)


def _normal(scene: Scene) -> Scene:
    """The scene with a normal motion whose error is no smaller than its quantity's."""
    asked = scene.reading.record
    rate = min(asked.rate + (not asked.is_normal), len(RATES) - 1)
    return replace(scene, quantity=RATES[rate].name, depth=0.0)


def _plate_error(
    plain: Scene, times: Floats, options: SolveOptions, linear: Floats, h: float
) -> float:
    """Relative error of a linear part (t, p) of the normal motion, by that of a thin plate."""
    if beyond(FROM_REST, plain):
        return expected_error(plain.body, h)
    plate = FROM_REST.solve(plain, times, options).values
    error = float(relative(linear - plate, plate).max())
    return error + PLATE_ERROR


def _response(
    model: str, scene: Scene, times: Floats, clock: Clock, made: Build, h: float, *,
    values: Floats, error: float, effort: Effort,
) -> Response:  # fmt: skip
    return Response(
        model=model, times=times, probes=scene.probe_points, quantity=scene.quantity,
        values=values, expected_error=error, effort=spent(effort, clock, made, h),
    )  # fmt: skip


def _limits(
    of_air: Callable[[Body], Iterator[Limit]], size: Callable[[Body], float], scene: Scene
) -> Iterator[Limit]:
    body = scene.body
    if not body.of_kind.is_plate:
        yield Limit(why=f"takes a sheet, not a {body.kind}")
        return
    yield from of_held_sheet(body)
    yield from of_air(body)
    yield from of_mesh(body, size(body))
    if not scene.load.is_plain:
        yield load_limit(scene)


REDUCED_SIZE, FULL_SIZE = (partial(stretching_size, reduced=which) for which in (True, False))
REDUCED = register(
    Model(
        name="fem-nonlinear",
        method="large deflection, step by step from rest",
        words="a sheet that stretches as it bends, in its modes, from rest",
        solve=reduced_answer,
        limits=partial(_limits, of_air_in_a_frame, REDUCED_SIZE),
        error=lambda scene, h: expected_error(scene.body, h or 0.0),
        default_size=REDUCED_SIZE,
        sources=(NEWMARK, NEWTON),
        is_nonlinear=True,
        takes_series=has_own_law,
    )
)
FULL = register(
    replace(
        REDUCED,
        name="fem-nonlinear-transient",
        words="a sheet that stretches as it bends, on 10-node tetrahedra, step by step",
        solve=full_answer,
        limits=partial(_limits, of_vacuum, FULL_SIZE),
        default_size=FULL_SIZE,
    )
)
