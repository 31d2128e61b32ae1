"""Reduced bodies: the offline stage, which is cached, and the response to any load.

    reduce_body: body, outputs, surface load -> ReducedBody
    prepare:     body, probes -> ReducedBody that its probes read, once per machine
    respond:     ReducedBody, moving pressure -> ReducedResponse
    answer:      ReducedBody, scene -> Response from rest

    u(t) = Re sum_f lines exp(2 pi i f t) + Re sum_m start exp(pole t)

A body is reduced to its probes, for a few waveforms of any load; or to the subspace of one path's
load, for the motion of all of it.
"""

import pickle
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from scipy import sparse

import fem
from fem.energy import mean_power
from fem.maxwell import with_internal
from fem.reduced import exponential_sum, impulse_response, line_response
from meshes import cache
from simple_model import Effort, Material, MovingPressure, Response
from simple_model.load.focus import spot_width
from simple_model.load.sampling import below_half_the_rate, highest_driving
from simple_model.load.spectrum import merge_lines, reduced_lines, synthesise
from simple_model.quantities import Quantity
from skinwave.bodies.build import Build
from skinwave.bodies.discretised import Discretise
from skinwave.bodies.sheet import air
from skinwave.bodies.sizes import default_size
from skinwave.models.laws import relaxing
from skinwave.models.meshed import (
    assembled,
    energy_balance,
    even_part,
    images,
    inertia,
    line_factor,
    meshed,
    modelled_axes,
    probe_rows,
    sag,
    spent,
    spread,
    surface_load,
    translation,
    with_sag,
)
from skinwave.models.options import sample_times
from skinwave.scene.load import PRESSURE, Load
from skinwave.scene.scene import SURFACE, Body, Reading, Scene
from skinwave.system.effort import Clock, Progress, one_thread, peak_memory, silent, versions
from skinwave.typing import Bools, Floats

BAND = 1000.0  # Hz up to which a reduced model must meet its tolerance
REDUCTION_TOLERANCE = 1e-3
SERIES_ERROR = 5  # times that of the reduction: with `reduction_tolerance` the `series_tolerance`
FORMAT = "reduced 8"  # of what is cached of a body
NEGLIGIBLE_LINE = 1e-7  # of the strongest line at the probes


def reduction_tolerance(tolerance: float) -> float:
    """Tolerance of a reduction: a small share of the relative error that a waveform may have."""
    return min(REDUCTION_TOLERANCE, tolerance / 50)


@dataclass(frozen=True, kw_only=True, eq=False)
class ReducedBody:
    """Reduced body, the load on its surface, and what its probes read.

    `poles` of the reduced model, which give its coordinates (r,), its `damping` (r, r), the
    `radiation` (r, r) in it and its Maxwell `branches` of (r, r); `forces` (c k, r): reduced forces
    of unit pressure of the c components of the `load` at the surface points (k, 3) in metre. On a
    support that moves, `inertia` (r,) is the reduced inertial force per acceleration against it;
    the coordinates are then those seen from the support.

    `probes` (p, 2) in metre read the quantity of `reading`: its components at rest are `read`
    (p c, r) of the coordinates, `sag` (p c,) under gravity, and `carried` (p c,) of a translation
    by 1 m of the support; `solids`, if any, are the materials of the probes. `effort` is the cost
    of the offline stage.
    """

    poles: fem.Poles
    damping: Floats
    radiation: Floats
    branches: tuple[fem.MaxwellBranch, ...]
    forces: Floats
    points: Floats
    effort: Effort
    inertia: Floats | float = 0.0
    load: Load = PRESSURE
    probes: Floats
    read: Floats
    sag: Floats | float = 0.0
    carried: Floats | float = 0.0
    reading: Reading = SURFACE
    solids: tuple[Material, ...] = ()


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


def prepare(
    body: Body,
    probes: Floats,
    progress: Progress | None = None,
    *,
    h: float | None = None,
    solver: str = "auto",
    tolerance: float = REDUCTION_TOLERANCE,
    symmetry: str = "",
    reading: Reading = SURFACE,
    load: Load = PRESSURE,
    discretise: Discretise | None = None,
) -> ReducedBody:
    """Offline stage: mesh, assemble, factorise and reduce a body, once for all Tactons and, by the
    cache, once per machine.

    If all probes (p, 2) in metre lie on a symmetry plane of the body, one half of it is modelled.
    `progress`, `h` and `solver` are as for `simulate`; `tolerance` is the relative error of the
    reduction; `symmetry` and `discretise` are as in `bodies.build.build`, of the load of all
    Tactons, and only for normal motion under a pressure.
    """
    clock, report = Clock(), progress or silent
    body = relaxing(body, SERIES_ERROR * tolerance)
    symmetry = modelled_axes(body, probes, symmetry, reading, load)
    report("mesh", 0.0)
    build = meshed(body, h, clock, silent, symmetry, discretise)
    outputs, solids = probe_rows(body, build, images(probes, symmetry), reading)
    own = None if reading.is_plain else outputs
    name = entry_name(body, build, probes, solver, tolerance, outputs=own, load=load)
    with clock("read from cache"):
        found = cached_record(name)
    if found is None:
        with one_thread():  # a second one gains a tenth of the time, and rounds otherwise
            found = _prepared_anew(
                body, build, probes, outputs, clock, report, solver, tolerance, load
            )
        store_record(name, found, found.poles.values, found.read)
    # Others may make the same mesh by another size.
    effort = spent(found.effort, clock, build, h or default_size(body))
    return replace(found, reading=reading, solids=solids, load=load, effort=effort)


def cached_record(name: str) -> Any:
    """A record that is cached under a name; None on a cache miss."""
    entry = cache.load(name)
    return pickle.loads(entry["record"].tobytes()) if entry else None


def store_record(name: str, record: object, *numbers: np.ndarray) -> None:
    """Cache a record under a name, if some of its numbers are finite."""
    checked = {f"numbers_{k}": each for k, each in enumerate(numbers)}
    cache.store(name, {}, record=np.frombuffer(pickle.dumps(record), np.uint8), **checked)


def entry_name(
    body: Body,
    build: Build,
    probes: Floats,
    solver: str,
    tolerance: float,
    *,
    outputs: sparse.csr_array | None,
    load: Load = PRESSURE,
) -> str:
    """Cache key of everything that a reduced body depends on, with the `outputs` (p c, 3 n) of its
    probes, None if these are normal motion at the surface.
    """
    mesh = build.mesh
    # A file may call other facets of the same mesh its top, or fix others.
    named = [mesh.facets[facets] for facets in ("top", *build.fixed)]
    rests = tuple(vars(build.support).values()) if build.support else ()
    used = fem.available()[0] if solver == "auto" else solver
    # Of its motion a reduced body depends on the direction alone.
    way = load.support_motion.unit if load.support_motion else ()
    read = () if outputs is None else (outputs.data, outputs.indices, outputs.indptr)
    return cache.key(
        FORMAT, *Effort.__dataclass_fields__, body, mesh.points, mesh.tets, mesh.region, *named,
        build.material, build.symmetry,
        build.fixed, build.absorbing, build.coat, build.drag, build.held, build.tension,
        *rests, probes, BAND, tolerance, used,
        versions(), *read, replace(load, support_motion=None), way,
    )  # fmt: skip


def _prepared_anew(
    body: Body,
    build: Build,
    probes: Floats,
    outputs: sparse.csr_array,
    clock: Clock,
    report: Progress,
    solver: str,
    tolerance: float,
    load: Load,
) -> ReducedBody:
    operators = assembled(build, clock, report)
    with clock("factorise and reduce"):
        report("factorise", 0.0)
        P, points = even_part(*surface_load(build, load), build.symmetry)
        still = sag(build, operators, outputs, load, solver)
        motion = load.support_motion
        reduced, _ = reduce_body(
            body, build, operators, outputs, tolerance, surface=(P, points),
            loads=spread(P, typical_spots(body, points)),
            inertia=inertia(build, motion.unit) if motion else None, solver=solver, report=report,
        )  # fmt: skip
    carried = outputs @ translation(build, motion.unit if motion else (0.0, 0.0, 0.0))
    return replace(reduced, probes=probes, sag=still, carried=carried)


def typical_spots(body: Body, points: Floats) -> Floats:
    """Unit Gaussian focal spots (n, 12) where palm-sized paths run, to estimate errors with."""
    reach = min(20e-3, body.width / 3, body.height / 3)
    centres = np.random.default_rng(0).uniform(-reach, reach, (12, 2))
    squared = ((points[:, None, :2] - centres) ** 2).sum(axis=2)
    return np.exp(-squared / (2 * spot_width(0.2) ** 2))


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
    """Reduced body of a mesh and its operators, and its fem.ReducedModel with the basis.

    `outputs`, `loads`, `tolerance` and `solver` are as of `fem.reduce`; `surface` is the load
    operator (3 n, c k) with its points (k, 3), of `surface_load` or a part of them; `inertia`
    (3 n,) the nodal forces per acceleration of a support that moves.
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
    effort = Effort(
        dofs=len(operators.free), reduced_dofs=model.basis.shape[1], solver=model.solver,
        factorisations=1, estimate=model.estimate,
    )  # fmt: skip
    reduced = reduced_of(
        model.operators, P[pushed].T @ model.basis[pushed], points, effort, read=model.outputs
    )
    still = np.zeros(model.basis.shape[1])
    return replace(reduced, inertia=still if inertia is None else inertia @ model.basis), model


def reduced_of(
    operators: fem.Operators, forces: Floats, points: Floats, effort: Effort, **known: Any
) -> ReducedBody:
    """Reduced body of projected operators (r, r), in coordinates of any mass matrix, with reduced
    `forces` (k, r) of unit pressure at points (k, 3) in metre, and what is `known` of its probes.
    """
    return ReducedBody(
        poles=fem.poles(operators), damping=operators.C, radiation=operators.R,
        branches=with_internal(operators.branches), forces=forces, points=points, effort=effort,
        **{"probes": np.zeros((0, 2)), "read": np.zeros((0, forces.shape[1]))} | known,
    )  # fmt: skip


def reduced_forces(reduced: ReducedBody, *pressures: MovingPressure) -> tuple[Floats, fem.Complex]:
    """Distinct frequencies (f,) in Hz and reduced forces (f, r) of the components of a load."""
    parts = np.split(reduced.forces, len(pressures))
    each = [
        reduced_lines(pressure, reduced.points, part)
        for pressure, part in zip(pressures, parts, strict=True)
    ]
    if motion := reduced.load.support_motion:
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
    in Hz, in its coordinates. Raises `fem.Diverged` if its energy balance is violated.
    """
    frequencies, forces = reduced_forces(reduced, *pressures)
    frequencies, forces = frequencies[frequencies < highest], forces[frequencies < highest]
    lines, start = line_response(reduced.poles, forces, frequencies)
    if motion := reduced.load.support_motion:  # which the body at rest is struck by
        start += impulse_response(reduced.poles, -motion.speed * np.asarray(reduced.inertia))
    damping = reduced.damping, reduced.radiation
    power = mean_power(*damping, forces, lines, frequencies, reduced.branches)
    imbalance, radiated = energy_balance(power)
    return ReducedResponse(
        frequencies=frequencies, lines=lines, poles=reduced.poles.values, start=start,
        imbalance=imbalance, radiated=radiated,
    )  # fmt: skip


def answer(
    reduced: ReducedBody,
    scene: Scene,
    progress: Progress | None = None,
    *,
    times: Floats | None = None,
) -> Response:
    """Response of a reduced body of a scene's probes to its Tacton from rest, as the steady state
    of every line of the load and the free vibration of its start.

    The times (t,) in s are equally spaced from 0; `sample_times` if not given. Raises
    `fem.Diverged` if the energy balance is violated.
    """
    if scene.load.moving != reduced.load.moving:
        raise ValueError(
            f"the body is reduced for {reduced.load.words}, not {scene.load.words}; reduce it for"
            " the load of the scene"
        )
    clock, asked = Clock(), reduced.reading.record
    times = sample_times(scene) if times is None else times
    if progress:
        progress("lines", 0.0)
    with clock("lines"):
        highest = highest_driving(scene.pressure, times)
        motion = components(reduced, *scene.loads, highest=highest)
        # Lines are not weighed against the mean: that of an unconstrained body has no bound.
        strength, mean = np.abs(motion.lines).max(axis=1), motion.frequencies == 0
        heard = mean | (strength > NEGLIGIBLE_LINE * strength[~mean].max(initial=0.0))
        heard &= below_half_the_rate(motion.frequencies, times)
        moving = from_rest(select_lines(motion, heard), times)
        waveforms = with_sag(moving, reduced.sag, asked)
    effort = replace(
        reduced.effort,
        seconds={**reduced.effort.seconds, **clock.seconds},
        steps=int(heard.sum()),
        energy_imbalance=motion.imbalance,
        radiated=motion.radiated,
        peak_memory=peak_memory(),
    )
    return Response(
        model="fem", times=times, probes=reduced.probes, quantity=asked.name,
        values=asked.waveforms(waveforms, len(reduced.probes)), effort=effort,
    )  # fmt: skip


def steady_waveforms(reduced: ReducedBody, scene: Scene, times: Floats) -> Floats:
    """Waveforms (t, p) in the steady state, as of fem-harmonic, at times (t,) in s."""
    motion, asked = components(reduced, *scene.loads), reduced.reading.record
    # Under its mean an unconstrained body has no steady state.
    heard = below_half_the_rate(motion.frequencies, times)
    heard &= scene.body.is_held | (motion.frequencies > 0)
    moving = synthesise(motion.frequencies[heard], motion.lines[heard], times)
    return asked.waveforms(with_sag(moving, reduced.sag, asked), len(reduced.probes))


def components(
    reduced: ReducedBody, *pressures: MovingPressure, highest: float = np.inf
) -> ReducedResponse:
    """Response of the quantity's components that the probes read, up to a `highest` line."""
    motion = read_at(respond(reduced, *pressures, highest=highest), reduced.read)
    if moved := reduced.load.support_motion:
        frequencies = np.append(motion.frequencies, moved.frequency)
        lines = np.vstack([motion.lines, moved.line * np.asarray(reduced.carried)])
        frequencies, lines = merge_lines(frequencies, lines)
        motion = replace(motion, frequencies=frequencies, lines=lines)
    return in_motion(motion, reduced.reading.record, reduced.solids)


def in_motion(
    rest: ReducedResponse, asked: Quantity, solids: tuple[Material, ...]
) -> ReducedResponse:
    """Components of a quantity with rates and relaxing stress, of those at rest."""
    if not (asked.rate or asked.relaxes):
        return rest
    s, outputs = 2j * np.pi * rest.frequencies, rest.lines.shape[1]
    return replace(
        rest,
        lines=rest.lines * line_factor(asked, s, solids, outputs),
        start=rest.start * line_factor(asked, rest.poles, solids, outputs),
    )


def read_at(motion: ReducedResponse, outputs: Floats) -> ReducedResponse:
    """Response at outputs (p, r) of the reduced coordinates."""
    return replace(motion, lines=motion.lines @ outputs.T, start=motion.start @ outputs.T)


def select_lines(motion: ReducedResponse, chosen: Bools) -> ReducedResponse:
    """Response with some of the lines alone, those (f,) that are chosen."""
    return replace(motion, frequencies=motion.frequencies[chosen], lines=motion.lines[chosen])


def oscillating(motion: ReducedResponse) -> ReducedResponse:
    """Response without the mean."""
    return select_lines(motion, motion.frequencies > 0)


def from_rest(motion: ReducedResponse, times: Floats) -> Floats:
    """Displacement or coordinates (t, q) after a start from rest at times (t,) in s."""
    rates = np.concatenate([2j * np.pi * motion.frequencies, motion.poles])
    return exponential_sum(rates, np.vstack([motion.lines, motion.start]), times)
