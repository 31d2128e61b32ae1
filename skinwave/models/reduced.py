"""Reduced bodies: the offline stage, which `reduced_cache` keeps, and the response to any load.

    reduce_body:  body, outputs, surface load -> ReducedBody
    reduce_scene: scene -> ReducedBody that its probes read, once per machine
    respond:      ReducedBody, moving pressure -> ReducedResponse
    answer:       ReducedBody, scene -> Response from rest

    u(t) = Re sum_f lines exp(2 pi i f t) + Re sum_m start exp(pole t)

A body is reduced either for its probes, to compute their waveforms under any load, or for the load
of one path, to compute the motion of many probes or of the whole body.
"""

from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from scipy import sparse

import fem
from fem.energy import mean_power
from fem.krylov import load_subspace
from fem.maxwell import maxwell_only
from fem.reduced import exponential_sum, impulse_response, line_response
from simple_model import Effort, Material, MovingPressure, Response
from simple_model.load.focus import spot_width
from simple_model.load.path_cells import path_samples
from simple_model.load.sampling import below_half_the_rate, highest_driving
from simple_model.load.spectrum import merge_lines, reduced_lines, synthesise
from simple_model.quantities import Quantity
from skinwave.bodies.build import Build
from skinwave.bodies.discretised import Discretise
from skinwave.bodies.sheet import air
from skinwave.bodies.sizes import default_size
from skinwave.models import meshed
from skinwave.models.laws import relaxing
from skinwave.models.options import DEFAULT, SolveOptions, sample_times, underflow_to_zero
from skinwave.models.reduced_cache import cache_key, cached_record, path_key
from skinwave.models.symmetry import even_part, images, modelled_axes
from skinwave.scene.load import PRESSURE, Load
from skinwave.scene.scene import SURFACE, Body, Reading, Scene
from skinwave.system.effort import Clock, Progress, peak_memory, silent
from skinwave.typing import Bools, Floats


@dataclass(frozen=True, kw_only=True)
class ReductionAccuracy:
    """Accuracy of reduced bodies."""

    share: float = 1 / 15  # of the tolerance of a waveform, for the reduction
    largest: float = 4e-3  # tolerance of a reduction, at most
    series: float = 5.0  # times the latter: error of a Prony series, as in `series_tolerance`
    path: float = 3.0  # times the latter: error of the load along a path
    many_outputs: int = 24  # about as many as a load along one path has parts
    weakest_line: float = 1e-7  # over the strongest line at the probes


ACCURACY = ReductionAccuracy()


def reduction_tolerance(tolerance: float) -> float:
    """Return the tolerance of a reduction, a small share of the waveform's."""
    return min(ACCURACY.largest, ACCURACY.share * tolerance)


@dataclass(frozen=True, kw_only=True, eq=False)
class ReducedBody:
    """Reduced body, the load on its surface, and the quantity of its probes.

    The `poles` of the reduced model define its coordinates (r,), in which the model has a `damping`
    (r, r), `radiation` (r, r), and Maxwell `branches` (r, r). The `forces` (c k, r) are those of
    unit pressure of the c components of the `load` at the surface `points` (k, 3) in m. On a
    support that moves, coordinates are relative to the support, and `inertia` (r,) is the inertial
    force per acceleration.

    The `probes` (p, 2) in m read the quantity of `reading`. Its static components are `read`
    (p c, r) of the coordinates, `sag` (p c,) under gravity, and `translation` (p c,) for 1 m of
    support motion. The materials of the probes are `solids`, if the quantity depends on them. If
    the body is reduced for one path, `path` identifies it. The `effort` is that of the offline
    stage.
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
    translation: Floats | float = 0.0
    reading: Reading = SURFACE
    solids: tuple[Material, ...] = ()
    path: str = ""


@dataclass(frozen=True, kw_only=True, eq=False)
class ReducedResponse:
    """Response from rest, in reduced coordinates or as displacement in m at outputs.

    The steady state has complex `lines` (f, q) at `frequencies` (f,) in Hz. The free vibration
    after the start has complex amplitudes `start` (m, q) at `poles` (m,) in 1/s. `imbalance` is the
    relative error of the energy balance, and `radiated` the share of the losses that is
    due to absorbing boundaries.
    """

    frequencies: Floats
    lines: fem.Complex
    poles: fem.Complex
    start: fem.Complex
    imbalance: float
    radiated: float


@underflow_to_zero()
def reduce_scene(
    scene: Scene, options: SolveOptions = DEFAULT, *, symmetry: str = "",
    reduction: float | None = None, discretise: Discretise | None = None, own_path: bool = False,
) -> ReducedBody:  # fmt: skip
    """Mesh, assemble, factorise and reduce the body of a scene, once per machine for all Tactons.

    If all probes lie on a symmetry plane of the body, one half is modelled. `symmetry` has the axes
    across which all loads are symmetric, for normal motion under a pressure. `reduction` is the
    relative error of the reduction, by default `reduction_tolerance` of the options. `discretise`
    replaces the mesh of the body's kind. With `own_path`, a body with many outputs is reduced for
    the path of the scene's focus only.
    """
    clock, report, solver = Clock(), options.progress, options.solver
    probes, reading, load = scene.probe_points, scene.reading, scene.load
    tolerance = reduction or reduction_tolerance(options.tolerance)
    body = relaxing(scene.body, ACCURACY.series * tolerance)
    symmetry = modelled_axes(body, probes, symmetry, reading, load)
    report("mesh", 0.0)
    build = meshed.mesh_body(body, options.h, clock, silent, symmetry, discretise)
    outputs, solids = meshed.probe_rows(body, build, images(probes, symmetry), reading)
    own = None if reading.is_plain else outputs
    along = scene.loads[0] if own_path and outputs.shape[0] > ACCURACY.many_outputs else None
    path, rate = (path_key(along), reading.record.rate) if along else ("", 0)
    name = cache_key(
        body, build, probes, solver, tolerance, outputs=own, load=load,
        path=f"{path} {rate}" if along else "", band=options.band,
    )  # fmt: skip

    def reduce() -> ReducedBody:
        operators = meshed.assemble(build, clock, report)
        support = load.support_motion
        with clock("factorise and reduce"):
            report("factorise", 0.0)
            P, points = even_part(*meshed.surface_load(build, load), build.symmetry)
            still = meshed.sag(build, operators, outputs, load, solver)
            loads = meshed.spread(P, typical_spots(body, points))
            if along:
                loads = path_loads(P, points, along, ACCURACY.path * tolerance)
            reduced, _ = reduce_body(
                body, build, operators, outputs, tolerance, surface=(P, points), loads=loads,
                inertia=meshed.inertia(build, support.unit) if support else None, solver=solver,
                report=report, from_loads=along is not None, rate=rate, band=options.band,
            )  # fmt: skip
        shift = outputs @ meshed.translation(build, support.unit if support else (0.0, 0.0, 0.0))
        return replace(reduced, sag=still, translation=shift, probes=probes, path=path)

    reduced = cached_record(name, clock, reduce)
    # Another size may have made the same mesh.
    effort = meshed.with_cost(reduced.effort, clock, build, options.h or default_size(body))
    return replace(reduced, reading=reading, solids=solids, load=load, effort=effort)


def path_loads(
    P: sparse.csr_array, points: Floats, pressure: MovingPressure, tolerance: float
) -> Floats:
    """Return nodal forces (3 n, s) that span the load along a path to a tolerance."""
    spots = pressure.spot(points, path_samples(pressure)).T
    return load_subspace(meshed.spread(P, spots), tolerance)


def typical_spots(body: Body, points: Floats) -> Floats:
    """Return unit Gaussian spots (n, 12) at random places near the origin, for error estimates."""
    reach = min(20e-3, body.width / 3, body.height / 3)
    centres = np.random.default_rng(0).uniform(-reach, reach, (12, 2))
    squared = ((points[:, None, :2] - centres) ** 2).sum(axis=2)
    return np.exp(-squared / (2 * spot_width(0.2) ** 2))


def reduce_body(
    body: Body, build: Build, operators: fem.Operators, outputs: sparse.csr_array,
    tolerance: float, *, surface: tuple[sparse.csr_array, Floats], loads: Floats | None = None,
    inertia: Floats | None = None, solver: str = "auto", report: Progress = silent,
    from_loads: bool = False, rate: int = 0, band: float = DEFAULT.band,
) -> tuple[ReducedBody, fem.ReducedModel]:  # fmt: skip
    """Return the reduced body of a mesh and its operators, and its fem.ReducedModel with the basis.

    `outputs`, `loads`, `tolerance` and `solver` are as in `fem.reduce`; `surface` is the load
    operator (3 n, c k) with its points (k, 3), of `surface_load` or a part of them; `inertia`
    (3 n,) the nodal forces per acceleration of a support that moves. With `from_loads`, the basis
    grows from the loads: by reciprocity they and the outputs change places. The tolerance is then
    one of the strongest response, or of its time derivative of order `rate`.
    """
    P, points = surface
    if inertia is not None and loads is not None:  # with the same weight as all others
        size = np.linalg.norm(loads) / np.linalg.norm(inertia)
        loads = np.column_stack([loads, size * inertia])
    start, others = outputs, loads
    if from_loads and loads is not None:
        start, others = sparse.csr_array(loads.T), outputs.toarray().T
    model = fem.reduce(
        operators, start, band, tolerance, loads=others, air=air(body, build, operators.free),
        weighted=from_loads, rate=rate, point=meshed.expansion_point(body, build), solver=solver,
        progress=partial(report, "reduce"),
    )  # fmt: skip
    P = P.tocsr()
    loaded = np.flatnonzero(np.diff(P.indptr))  # a few of all dofs
    effort = Effort(
        dofs=len(operators.free), reduced_dofs=model.basis.shape[1], solver=model.solver,
        factorisations=1, estimate=model.estimate,
    )  # fmt: skip
    read = outputs @ model.basis if from_loads else model.outputs
    reduced = reduced_of(
        model.operators, P[loaded].T @ model.basis[loaded], points, effort, read=read
    )
    still = np.zeros(model.basis.shape[1])
    return replace(reduced, inertia=still if inertia is None else inertia @ model.basis), model


def reduced_of(
    operators: fem.Operators, forces: Floats, points: Floats, effort: Effort, **fields: Any
) -> ReducedBody:
    """Return the reduced body of projected operators and `forces` (k, r) at points (k, 3)."""
    return ReducedBody(
        poles=fem.poles(operators), damping=operators.C, radiation=operators.R,
        branches=maxwell_only(operators.branches), forces=forces, points=points, effort=effort,
        **{"probes": np.zeros((0, 2)), "read": np.zeros((0, forces.shape[1]))} | fields,
    )  # fmt: skip


def reduced_forces(reduced: ReducedBody, *pressures: MovingPressure) -> tuple[Floats, fem.Complex]:
    """Return distinct frequencies (f,) in Hz and reduced forces (f, r) of a load."""
    parts = np.split(reduced.forces, len(pressures))
    each = [
        reduced_lines(p, reduced.points, part) for p, part in zip(pressures, parts, strict=True)
    ]
    if support := reduced.load.support_motion:
        inertial = -support.acceleration * np.asarray(reduced.inertia)
        each.append((np.array([support.frequency]), inertial[None]))
    if len(each) == 1:
        return each[0]
    frequencies, forces = zip(*each, strict=True)
    return merge_lines(np.concatenate(frequencies), np.vstack(forces))


def respond(
    reduced: ReducedBody, *pressures: MovingPressure, highest: float = np.inf
) -> ReducedResponse:
    """Return the response of a reduced body, in its coordinates, to the lines of a moving load
    below `highest` in Hz. Raises `fem.Diverged` if it violates the energy balance.
    """
    frequencies, forces = reduced_forces(reduced, *pressures)
    frequencies, forces = frequencies[frequencies < highest], forces[frequencies < highest]
    lines, start = line_response(reduced.poles, forces, frequencies)
    if support := reduced.load.support_motion:  # it moves at once, with the body at rest
        start += impulse_response(reduced.poles, -support.speed * np.asarray(reduced.inertia))
    damping = reduced.damping, reduced.radiation
    power = mean_power(*damping, forces, lines, frequencies, reduced.branches)
    imbalance, radiated = meshed.energy_balance(power)
    return ReducedResponse(
        frequencies=frequencies, lines=lines, poles=reduced.poles.values, start=start,
        imbalance=imbalance, radiated=radiated,
    )  # fmt: skip


@underflow_to_zero()
def answer(
    reduced: ReducedBody, scene: Scene, progress: Progress | None = None, *,
    times: Floats | None = None,
) -> Response:  # fmt: skip
    """Return the response of a reduced body from rest to the scene's Tacton, at times (t,) in s
    equally spaced from 0. Raises `fem.Diverged` if it violates the energy balance.
    """
    if scene.load.moving != reduced.load.moving:
        raise ValueError(
            f"the body is reduced for {reduced.load.words}, not for {scene.load.words}; reduce it "
            "for the load of the scene"
        )
    if reduced.path and reduced.path != path_key(scene.loads[0]):
        raise ValueError(
            "the body is reduced for many probes and the path of another focus; reduce it for the "
            "path of the scene"
        )
    clock, quantity = Clock(), reduced.reading.record
    times = sample_times(scene) if times is None else times
    if progress:
        progress("lines", 0.0)
    with clock("lines"):
        highest = highest_driving(scene.pressure, times)
        motion = components(reduced, *scene.loads, highest=highest)
        # The mean of an unconstrained body has no bound, so that lines are not compared with it.
        strength, is_mean = np.abs(motion.lines).max(axis=1), motion.frequencies == 0
        strongest = strength[~is_mean].max(initial=0.0)
        chosen = is_mean | (strength > ACCURACY.weakest_line * strongest)
        chosen &= below_half_the_rate(motion.frequencies, times)
        vibration = from_rest(select_lines(motion, chosen), times)
        waveforms = meshed.with_sag(vibration, reduced.sag, quantity)
    seconds = {**reduced.effort.seconds, **clock.seconds}
    effort = replace(
        reduced.effort, seconds=seconds, steps=int(chosen.sum()), peak_memory=peak_memory(),
        energy_imbalance=motion.imbalance, radiated=motion.radiated,
    )  # fmt: skip
    return Response(
        model="fem", times=times, probes=reduced.probes, quantity=quantity.name,
        values=quantity.waveforms(waveforms, len(reduced.probes)), effort=effort,
    )  # fmt: skip


def steady_waveforms(reduced: ReducedBody, scene: Scene, times: Floats) -> Floats:
    """Return waveforms (t, p) in the steady state, as in fem-harmonic, at times (t,) in s."""
    motion, quantity = components(reduced, *scene.loads), reduced.reading.record
    # Under the mean an unconstrained body has no steady state.
    chosen = below_half_the_rate(motion.frequencies, times)
    chosen &= scene.body.is_held | (motion.frequencies > 0)
    vibration = synthesise(motion.frequencies[chosen], motion.lines[chosen], times)
    waveforms = meshed.with_sag(vibration, reduced.sag, quantity)
    return quantity.waveforms(waveforms, len(reduced.probes))


def components(
    reduced: ReducedBody, *pressures: MovingPressure, highest: float = np.inf
) -> ReducedResponse:
    """Return the response of the quantity's components at the probes, for lines below `highest`."""
    motion = read_at(respond(reduced, *pressures, highest=highest), reduced.read)
    if support := reduced.load.support_motion:
        frequencies = np.append(motion.frequencies, support.frequency)
        lines = np.vstack([motion.lines, support.line * np.asarray(reduced.translation)])
        frequencies, lines = merge_lines(frequencies, lines)
        motion = replace(motion, frequencies=frequencies, lines=lines)
    return in_motion(motion, reduced.reading.record, reduced.solids)


def in_motion(
    static: ReducedResponse, quantity: Quantity, solids: tuple[Material, ...]
) -> ReducedResponse:
    """Return the components of a quantity, with rates and relaxing stress, from `static` ones."""
    if not (quantity.rate or quantity.relaxes):
        return static
    s, outputs = 2j * np.pi * static.frequencies, static.lines.shape[1]
    return replace(
        static,
        lines=static.lines * meshed.line_factor(quantity, s, solids, outputs),
        start=static.start * meshed.line_factor(quantity, static.poles, solids, outputs),
    )


def read_at(motion: ReducedResponse, outputs: Floats) -> ReducedResponse:
    """Return the response at outputs (p, r) of the reduced coordinates."""
    return replace(motion, lines=motion.lines @ outputs.T, start=motion.start @ outputs.T)


def select_lines(motion: ReducedResponse, chosen: Bools) -> ReducedResponse:
    """Return the response with only the chosen lines (f,)."""
    return replace(motion, frequencies=motion.frequencies[chosen], lines=motion.lines[chosen])


def oscillating(motion: ReducedResponse) -> ReducedResponse:
    """Return the response without the mean."""
    return select_lines(motion, motion.frequencies > 0)


def from_rest(motion: ReducedResponse, times: Floats) -> Floats:
    """Return the displacement or coordinates (t, q) from rest at times (t,) in s."""
    rates = np.concatenate([2j * np.pi * motion.frequencies, motion.poles])
    return exponential_sum(rates, np.vstack([motion.lines, motion.start]), times)


def from_rest_at(motion: ReducedResponse, times: Floats) -> Floats:
    """Return what `from_rest` does, at any times (t,) in s."""
    rates = np.concatenate([2j * np.pi * motion.frequencies, motion.poles])
    amplitudes, turn = np.vstack([motion.lines, motion.start]), np.exp(np.outer(times, rates))
    return np.asarray(turn.real @ amplitudes.real - turn.imag @ amplitudes.imag)
