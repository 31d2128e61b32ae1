"""Nonlinear models of a sheet at large deflection, from rest.

A sheet is meshed as in the linear models, by an equivalent solid some ten times too thick with the
bending stiffness and mass of the true one. The membrane stiffness of so thick a solid is too small
by the factor d^2 / h^2, and a membrane in its middle plane adds what is missing: bending stiffness,
mass and membrane stiffness are all those of the true sheet, and no element is flat.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import islice
from math import pi

import numpy as np

import fem
from fem import nonlinear
from fem.harmonic import dynamic_stiffness
from meshes import middle_plane
from meshes.tetmesh import Floats
from simple_model import Effort, Response
from simple_model.load_spectrum import Complex, load_lines, reduced_lines
from simple_model.sampling import below_half_the_rate, resolving_step
from skinwave.bodies.build import Build, build
from skinwave.bodies.sheet import air, bending_wavenumber, discretise
from skinwave.effort import Clock
from skinwave.models import Request
from skinwave.models.full import TRANSIENT_RATE, in_time, marched, spent, step_count
from skinwave.models.loads import load_in_steps, surface_load
from skinwave.models.sheet_probes import full_reader, modal_reader
from skinwave.scene import Body, Scene

# Thickness of the mesh over an element's side: the shear of so thick a sheet lowers frequencies by
# as much as elements of this side raise them. At 7 elements a wavelength 0.3 % are left of 5 %.
STOCKY, STOUTEST = 0.48, 0.05
FULL_CELLS, REDUCED_CELLS = 26, 32  # along the shorter side
COARSE_ERROR, ERROR_ORDER = 0.05, 3.0  # of a waveform with FULL_CELLS; measured order 3.2
HIGHEST_MODE = 1500.0  # Hz, of the modes in the basis
FEWEST_MODES, MOST_MODES = 40, 160
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
    """Membrane with the stiffness that a meshed sheet lacks.

    Parameters
    ----------
    body : Body, a sheet
    made : its mesh
    share : of the sheet's whole stiffness, instead of what is lacking

    Returns
    -------
    fem.Membrane
    """
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


def full_answer(scene: Scene, request: Request) -> Response:
    """Direct time integration of all dofs, from rest."""
    clock, size = Clock(), request.h or stretching_size(scene.body, reduced=False)
    with clock("assemble"):
        request.report("assemble", 0.0)
        made = meshed_sheet(scene.body, size)
        body = stretching_body(scene.body, made)
    P, points = surface_load(made)
    dt = request.dt or resolving_step(scene.pressure, 1 / TRANSIENT_RATE)
    load = load_in_steps((scene.pressure,), points, request.times, dt)
    return _marched(
        "fem-nonlinear-transient", scene, request, clock, made, size,
        body=body,
        force=lambda t: P @ load(t),
        read=full_reader(scene.body, made, scene.probe_points, scene.reading),
        dt=dt,
        effort=Effort(dofs=len(body.operators.free)),
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class _Reduced:
    """Sheet reduced to its bending modes, with its load."""

    made: Build
    modes: fem.StretchingModes
    load: Floats  # (n, r), modal forces of unit pressure at the points (n, 3)
    points: Floats
    operators: fem.Operators


def reduced_answer(scene: Scene, request: Request) -> Response:
    """Time integration of the sheet's bending modes, from rest."""
    clock, size = Clock(), request.h or stretching_size(scene.body, reduced=True)
    with clock("reduce"):
        request.report("reduce", 0.0)
        sheet = _reduced(scene.body, size, request.solver)
        read = modal_reader(
            scene.body, sheet.made, sheet.modes, sheet.operators, scene.probe_points,
            scene.reading, request.solver,
        )  # fmt: skip

    dt = request.dt or resolving_step(scene.pressure, 1 / TRANSIENT_RATE)
    return _marched(
        "fem-nonlinear", scene, request, clock, sheet.made, size,
        body=sheet.modes.elastic,
        force=_modal_force(scene, sheet, request.times, dt),
        read=read,
        dt=dt,
        effort=Effort(
            dofs=len(sheet.operators.free), reduced_dofs=len(sheet.modes.hz),
            estimate=sheet.modes.left_out,
        ),
    )  # fmt: skip


def _modal_force(
    scene: Scene, sheet: _Reduced, times: Floats, dt: float
) -> Callable[[float], Floats]:
    """Modal forces (r,) of a load at a time in s: the sum of its lines or, of many, the load
    itself.
    """
    if len(load_lines(scene.pressure).frequencies) > MOST_LINES:
        load = load_in_steps((scene.pressure,), sheet.points, times, dt)
        return lambda t: load(t) @ sheet.load
    hz, forces = reduced_lines(scene.pressure, sheet.points, sheet.load)
    below = below_half_the_rate(hz, times)
    hz, forces = hz[below], forces[below]
    return lambda t: (np.exp(2j * pi * hz * t) @ forces).real


def unstretched_lines(
    scene: Scene, h: float | None = None, solver: str = "auto"
) -> tuple[Floats, Complex]:
    """Steady displacement of the modes of `reduced_answer` under each line of a load so small that
    the sheet does not stretch: what is left of a difference is large deflection.

    Parameters
    ----------
    scene : Scene, of the normal displacement
    h, solver : as of a request

    Returns
    -------
    frequencies (f,) in Hz and complex amplitudes (f, p) in metre
    """
    sheet = _reduced(scene.body, h or stretching_size(scene.body, reduced=True), solver)
    hz, forces = reduced_lines(scene.pressure, sheet.points, sheet.load)
    operators = sheet.modes.elastic.operators
    K, C, M = (part.toarray() for part in (operators.K, operators.C, operators.M))
    z = [np.linalg.solve(dynamic_stiffness(K, C, M, operators.branches, s), f)
         for s, f in zip(2j * pi * hz, forces, strict=True)]  # fmt: skip
    shapes = fem.probe_operator(sheet.made.mesh, scene.probe_points) @ sheet.modes.basis
    return hz, np.array(z) @ shapes.T


@lru_cache(maxsize=1)
def _reduced(body: Body, h: float, solver: str) -> _Reduced:
    """Reduce the sheet to its modes, cached for many Tactons in a row."""
    made = meshed_sheet(body, h)
    operators = stretching_body(body, made).operators
    modes = fem.stretching_modes(
        made.mesh, operators, membrane(body, made, 1.0), mode_count(body),
        added=air(body, made, operators), solver=solver,
    )  # fmt: skip
    P, points = surface_load(made)
    return _Reduced(
        made=made, modes=modes, load=P.T @ modes.basis, points=points, operators=operators
    )


def mode_count(body: Body) -> int:
    """Number of modes below `HIGHEST_MODE`: area times k^2 / 4 pi (Weyl; Courant and Hilbert)."""
    squared = bending_wavenumber(body, HIGHEST_MODE) ** 2
    found = round(body.width * body.height * squared / 4 / pi)
    return min(max(found, FEWEST_MODES), MOST_MODES)


def _marched(
    model: str, scene: Scene, request: Request, clock: Clock, made: Build, h: float, *,
    body: fem.Elastic, force: Callable[[float], Floats], read: Callable[[Floats], Floats],
    dt: float, effort: Effort,
) -> Response:  # fmt: skip
    """Time integration from rest."""
    times, report, solver = request.times, request.report, request.solver
    steps = step_count(float(times[-1]), dt)
    kept = lru_cache(maxsize=2)(force)
    with clock("march"):
        states = nonlinear.dynamic(body, lambda t, u: kept(t), dt, solver=solver)
        stepped, (imbalance, _) = marched(
            nonlinear.with_energy_balance(body, islice(states, steps + 1), kept), steps, read,
            lambda state: nonlinear.total_energy(body, state), report,
        )  # fmt: skip
    effort = replace(
        effort, steps=steps, solver=fem.available()[0] if solver == "auto" else solver,
        energy_imbalance=imbalance, dt=dt,
    )  # fmt: skip
    return Response(
        model=model, times=times, probes=scene.probe_points, quantity=scene.quantity,
        values=in_time(stepped, dt, times, scene, (scene.body.solid,) * len(scene.probes)),
        effort=spent(effort, clock, made, h),
    )  # fmt: skip
