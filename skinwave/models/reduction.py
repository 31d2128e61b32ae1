"""Reduce and respond: the offline and the online stage of every body that is reduced.

    reduce_body: body, outputs, surface load -> ReducedBody
    respond:     ReducedBody, moving pressure -> ReducedResponse

    u(t) = Re sum_f lines exp(2 pi i f t) + Re sum_m start exp(pole t)

A body is reduced to its probes, for a few waveforms of any load; or to the subspace of one path's
load, for the motion of all of it.
"""

from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

import fem
from fem.maxwell import with_internal
from meshes.tetmesh import Floats
from simple_model import Effort, MovingPressure
from simple_model.load.spectrum import merge_lines, reduced_lines
from skinwave.bodies.build import Build
from skinwave.bodies.sheet import air
from skinwave.models.meshed import energy_balance
from skinwave.scene.scene import Body
from skinwave.scene.support_motion import SupportMotion
from skinwave.system.effort import Progress, silent

BAND = 1000.0  # Hz up to which a reduced model must meet its tolerance


@dataclass(frozen=True, kw_only=True, eq=False)
class ReducedBody:
    """Reduced body and the load on its surface.

    `poles` of the reduced model, which give its coordinates (r,), its `damping` (r, r), the
    `radiation` (r, r) in it and its Maxwell `branches` of (r, r); `load` (k, r): reduced forces of
    unit pressure at the surface points (k, 3) in metre; of a load of c components (c k, r). On a
    support that moves, its `support_motion` and the reduced inertial force `inertia` (r,) per
    acceleration against it; the coordinates are then those seen from the support.
    """

    poles: fem.Poles
    damping: Floats
    radiation: Floats
    branches: tuple[fem.MaxwellBranch, ...]
    load: Floats
    points: Floats
    effort: Effort
    inertia: Floats | float = 0.0
    support_motion: SupportMotion | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class ReducedResponse:
    """Response from rest, in reduced coordinates or, in metre, at outputs of them.

    Steady state: complex `lines` (f, q) at `frequencies` (f,) in Hz; free vibration of the start:
    complex `start` (m, q) at `poles` (m,) in 1/s. The relative error of the energy balance is
    `imbalance`, and `radiated` the share of the losses that absorbing boundaries took.
    """

    frequencies: Floats
    lines: fem.Complex
    poles: fem.Complex
    start: fem.Complex
    imbalance: float
    radiated: float


def reduce_body(
    body: Body,
    build: Build,
    operators: fem.Operators,
    outputs: sparse.csr_array,
    tolerance: float,
    *,
    surface: tuple[sparse.csr_array, Floats],
    loads: Floats | None = None,
    inertia: Floats | None = None,
    solver: str = "auto",
    report: Progress = silent,
) -> tuple[ReducedBody, fem.ReducedModel]:
    """Reduced body, and its fem.ReducedModel with the basis (offline stage).

    Parameters
    ----------
    body, build, operators : Body, its mesh, and the operators of that
    outputs, loads, tolerance, solver : as of `fem.reduce`
    surface : load operator (3 n, c k) and points (k, 3), of `surface_load` or a part of them
    inertia : (3 n,), nodal forces per acceleration of a support that moves
    report : called with the name of the phase and the fraction done
    """
    P, points = surface
    if inertia is not None and loads is not None:  # which counts as much as all others
        size = np.linalg.norm(loads) / np.linalg.norm(inertia)
        loads = np.column_stack([loads, size * inertia])
    model = fem.reduce(
        operators, outputs, BAND, tolerance, loads=loads, added=air(body, build, operators.free),
        solver=solver, progress=partial(report, "reduce"),
    )  # fmt: skip
    P = P.tocsr()
    pushed = np.flatnonzero(np.diff(P.indptr))  # a few of all dofs
    reduced = ReducedBody(
        **_own(model.operators), load=P[pushed].T @ model.basis[pushed], points=points,
        inertia=np.zeros(model.basis.shape[1]) if inertia is None else inertia @ model.basis,
        effort=Effort(
            dofs=len(operators.free), reduced_dofs=model.basis.shape[1], solver=model.solver,
            factorisations=1, estimate=model.estimate,
        ),
    )  # fmt: skip
    return reduced, model


def reduced_variant(
    operators: fem.Operators, load: Floats, points: Floats, effort: Effort
) -> ReducedBody:
    """Reduced body of projected operators (r, r), in coordinates of any mass matrix, with reduced
    forces `load` (k, r) of unit pressure at points (k, 3) in metre.
    """
    return ReducedBody(**_own(operators), load=load, points=points, effort=effort)


def _own(operators: fem.Operators) -> dict[str, Any]:
    """Fields of a `ReducedBody` by its projected operators."""
    return {
        "poles": fem.poles(operators), "damping": operators.C, "radiation": operators.R,
        "branches": with_internal(operators.branches),
    }  # fmt: skip


def reduced_forces(reduced: ReducedBody, *pressures: MovingPressure) -> tuple[Floats, fem.Complex]:
    """Distinct frequencies (f,) in Hz and reduced forces (f, r) of the components of a load."""
    parts = np.split(reduced.load, len(pressures))
    each = [
        reduced_lines(pressure, reduced.points, part)
        for pressure, part in zip(pressures, parts, strict=True)
    ]
    if motion := reduced.support_motion:
        against = -motion.acceleration * np.asarray(reduced.inertia)
        each.append((np.array([motion.frequency]), against[None]))
    if len(each) == 1:
        return each[0]
    frequencies, forces = zip(*each, strict=True)
    return merge_lines(np.concatenate(frequencies), np.vstack(forces))


def respond(
    reduced: ReducedBody, *pressures: MovingPressure, highest: float = np.inf
) -> ReducedResponse:
    """Response of a reduced body to the components of a moving load, of lines below the `highest`
    in Hz, in its coordinates (online stage).

    Raises
    ------
    Diverged
        If its energy balance is violated.
    """
    frequencies, forces = reduced_forces(reduced, *pressures)
    frequencies, forces = frequencies[frequencies < highest], forces[frequencies < highest]
    lines, start = fem.line_response(reduced.poles, forces, frequencies)
    if motion := reduced.support_motion:  # which the body at rest is struck by
        start += fem.impulse_response(reduced.poles, -motion.speed * np.asarray(reduced.inertia))
    damping = reduced.damping, reduced.radiation
    power = fem.mean_power(*damping, forces, lines, frequencies, reduced.branches)
    imbalance, radiated = energy_balance(power)
    return ReducedResponse(
        frequencies=frequencies, lines=lines, poles=reduced.poles.values, start=start,
        imbalance=imbalance, radiated=radiated,
    )  # fmt: skip


def read_at(motion: ReducedResponse, outputs: Floats) -> ReducedResponse:
    """Response at outputs (p, r) of the reduced coordinates."""
    return replace(motion, lines=motion.lines @ outputs.T, start=motion.start @ outputs.T)


def select_lines(motion: ReducedResponse, chosen: NDArray[np.bool_]) -> ReducedResponse:
    """Response with some of the lines alone, those (f,) that are chosen."""
    return replace(motion, frequencies=motion.frequencies[chosen], lines=motion.lines[chosen])


def oscillating(motion: ReducedResponse) -> ReducedResponse:
    """Response without the mean."""
    return select_lines(motion, motion.frequencies > 0)


def from_rest(motion: ReducedResponse, times: Floats) -> Floats:
    """Displacement or coordinates (t, q) after a start from rest at equally spaced times (t,) in s
    from 0.
    """
    rates = np.concatenate([2j * np.pi * motion.frequencies, motion.poles])
    return fem.exponential_sum(rates, np.vstack([motion.lines, motion.start]), times)
