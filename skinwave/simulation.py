"""From a scene to a response, for every model by one name."""

from dataclasses import asdict, dataclass, replace

import numpy as np

import fem
from meshes.tetmesh import Floats
from simple_model import Effort, MovingPressure, Response, flat_body, point_kernel
from simple_model.choices import choose
from simple_model.focus import spot_reach, spot_width
from skinwave import cache
from skinwave.bodies import Build, compliance
from skinwave.effort import Clock, Progress, peak_memory, silent, versions
from skinwave.full import assembled, harmonic_answer, meshed, transient_answer
from skinwave.plan import (
    BAND,
    LOAD_RATE,
    REDUCTION_TOLERANCE,
    SAMPLE_RATE,
    plan,
)
from skinwave.scene import Body, Scene

MODELS = ("auto", "point-kernel", "flat-body", "fem", "fem-harmonic", "fem-transient")


def simulate(
    scene: Scene,
    model: str = "auto",
    tolerance: float = 0.05,
    progress: Progress | None = None,
    *,
    h: float | None = None,
    dt: float | None = None,
    solver: str = "auto",
) -> Response:
    """Motion of a scene's probes.

    Parameters
    ----------
    scene : Scene
    model : "point-kernel"; "flat-body", exact waves in an endless body; "fem", the reduced model;
        "fem-harmonic", the steady state line by line; "fem-transient", every time step; or
        "auto": what `plan` chooses
    tolerance : float, relative error that may be made; reduction takes at most a fiftieth of it
    progress : called with the name of the phase and the fraction done
    h : float, metre, element size; planned from the body if not given
    dt : float, s, time step of "fem-transient"
    solver : a backend of `fem.linear_solver`

    Raises
    ------
    ValueError
        If the model is unknown or does not fit the scene, or a number is out of range.
    """
    choose("model", model, MODELS)
    check_knobs(solver, h=h, dt=dt)
    if not 0 < tolerance < 1:
        raise ValueError(f"tolerance = {tolerance} is outside 0 < tolerance < 1")
    if model == "auto":
        required = plan(scene, tolerance)
        model, h = required.model, h or required.h
    times = sample_times(scene)
    if model == "point-kernel":
        return point_kernel(scene.pressure, scene.probe_points, times)
    if model == "flat-body":
        return flat_body(compliance(scene.body), scene.pressure, scene.probe_points, times)
    report = progress or silent
    if model == "fem-transient":
        return transient_answer(scene, times, report, h=h, dt=dt, solver=solver)
    if model == "fem-harmonic":
        return harmonic_answer(scene, times, report, h=h, solver=solver, threshold=tolerance / 50)
    reduction = min(REDUCTION_TOLERANCE, tolerance / 50)
    prepared = prepare(
        scene.body, scene.probe_points, report, h=h, solver=solver, tolerance=reduction
    )
    return answer(prepared, scene, report)


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


def sample_times(scene: Scene, rate: float = SAMPLE_RATE) -> Floats:
    """Times (t,) in s of a response: from 0 up to the duration, at least two."""
    return np.arange(max(2, round(scene.tacton.duration * rate))) / rate


@dataclass(frozen=True, kw_only=True, eq=False)
class Prepared:
    """A body ready to answer any Tacton at its probes.

    `poles` of the reduced model; `load` (k, r): reduced forces of unit pressure at the surface
    points (k, 2).
    """

    probes: Floats
    poles: fem.Poles
    load: Floats
    points: Floats
    effort: Effort


def prepare(
    body: Body,
    probes: Floats,
    progress: Progress | None = None,
    *,
    h: float | None = None,
    solver: str = "auto",
    tolerance: float = REDUCTION_TOLERANCE,
) -> Prepared:
    """Mesh, assemble, factorise and reduce a body: once for all Tactons, and once per machine."""
    clock = Clock()
    build = meshed(body, h, clock, silent)
    mesh, ends = build.mesh, (build.fixed, build.absorbing)
    name = cache.key(
        mesh.points, mesh.tets, build.material, *ends, probes, BAND, tolerance, versions()
    )
    with clock("read from cache"):
        if entry := cache.load(name):
            poles = fem.Poles(**{field: entry[field] for field in ("values", "inputs", "outputs")})
            effort = Effort(**entry["meta"])
    if not entry:
        report = progress or silent
        return _prepared_anew(body, build, probes, clock, report, solver, tolerance, name)
    effort = replace(effort, seconds=clock.seconds, peak_memory=peak_memory())
    return Prepared(
        probes=probes, poles=poles, load=entry["load"], points=entry["points"], effort=effort
    )


def _prepared_anew(
    body: Body,
    build: Build,
    probes: Floats,
    clock: Clock,
    report: Progress,
    solver: str,
    tolerance: float,
    name: str,
) -> Prepared:
    report("mesh", 1.0)
    mesh, operators = build.mesh, assembled(build, clock, report)
    with clock("factorise and reduce"):
        report("factorise", 0.0)
        P, points = fem.load_operator(mesh), fem.facet_points(mesh)[:, :2]
        model = fem.reduce(
            operators,
            fem.probe_operator(mesh, probes),
            BAND,
            tolerance,
            loads=P @ typical_spots(body, points),
            solver=solver,
            progress=lambda fraction: report("reduce", fraction),
        )
    with clock("diagonalise"):
        poles, load = fem.poles(model), P.T @ model.basis
    effort = Effort(
        seconds=clock.seconds,
        dofs=len(operators.free),
        reduced_dofs=len(model.K),
        peak_memory=peak_memory(),
        solver=model.solver,
        estimate=model.estimate,
        versions=versions(),
    )
    arrays = {"values": poles.values, "inputs": poles.inputs, "outputs": poles.outputs}
    cache.store(name, asdict(effort), **arrays, load=load, points=points)
    return Prepared(probes=probes, poles=poles, load=load, points=points, effort=effort)


def answer(prepared: Prepared, scene: Scene, progress: Progress | None = None) -> Response:
    """Motion of the prepared probes under a scene's Tacton."""
    clock = Clock()
    if progress:
        progress("march", 0.0)
    with clock("march"):
        oversampling = round(LOAD_RATE / SAMPLE_RATE)
        times = sample_times(scene)
        fine = np.arange(oversampling * (len(times) - 1) + 1) / LOAD_RATE
        forces, position = footprints(scene.pressure, prepared.points, prepared.load, fine)
        gain = scene.pressure.gain(fine)
        displacement = fem.respond(prepared.poles, forces, position, gain, 1 / LOAD_RATE)
    effort = replace(
        prepared.effort,
        seconds={**prepared.effort.seconds, **clock.seconds},
        steps=len(fine),
        peak_memory=peak_memory(),
    )
    return Response(
        model="fem",
        times=times,
        probes=prepared.probes,
        displacement=np.ascontiguousarray(displacement[::oversampling]),
        effort=effort,
    )


def footprints(
    pressure: MovingPressure, points: Floats, load: Floats, times: Floats
) -> tuple[Floats, Floats]:
    """Reduced forces (k, r) at knots along the path, and where (t,) among them the focus is.

    A moving spot is its gain times one of few shapes. Knots a fortieth of the spot's standard
    deviation apart, with linear interpolation, are right to 1e-4 of the peak.
    """
    path = pressure.tacton.trajectory
    if path.is_static:
        return pressure.spot(points, path.position(np.zeros(1))) @ load, np.zeros(len(times))
    intervals = 12 * int(np.ceil(path.length / (spot_width(pressure.height) / 40) / 12))
    centres = path.at_phase(np.linspace(0, 1, intervals + 1))  # 12: knots in every corner
    reach = spot_reach(pressure.height, pressure.focus)
    forces = []
    for part in np.array_split(centres, intervals // 64 + 1):
        low, high = part.min(axis=0) - reach, part.max(axis=0) + reach
        near = ((points > low) & (points < high)).all(axis=1)
        forces.append(pressure.spot(points[near], part) @ load[near])
    return np.vstack(forces), path.phase(times) * intervals


def typical_spots(body: Body, points: Floats) -> Floats:
    """Unit Gaussian spots (n, 12) where palm-sized paths run, to judge a reduction by."""
    reach = min(20e-3, body.width / 3, body.height / 3)
    centres = np.random.default_rng(0).uniform(-reach, reach, (12, 2))
    squared = ((points[:, None] - centres) ** 2).sum(axis=2)
    return np.exp(-squared / (2 * spot_width(0.2) ** 2))
