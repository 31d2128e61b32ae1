"""Reduced body of probes, cached, and its response to any Tacton."""

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from scipy import sparse

import fem
from meshes import cache
from meshes.tetmesh import Floats
from simple_model import Effort, Material, MovingPressure, Response
from simple_model.load.focus import spot_width
from simple_model.load.sampling import below_half_the_rate, highest_driving
from simple_model.load.spectrum import merge_lines, synthesise
from simple_model.quantities import Quantity
from skinwave.bodies.build import Build
from skinwave.bodies.discretised import Discretise
from skinwave.bodies.sizes import default_size
from skinwave.models.laws import relaxing
from skinwave.models.meshed import (
    assembled,
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
from skinwave.models.reduction import (
    BAND,
    ReducedBody,
    ReducedResponse,
    from_rest,
    read_at,
    reduce_body,
    respond,
    select_lines,
)
from skinwave.scene.load import PRESSURE, Load
from skinwave.scene.scene import SURFACE, Body, Reading, Scene
from skinwave.system.effort import Clock, Progress, one_thread, peak_memory, silent, versions

REDUCTION_TOLERANCE = 1e-3
SERIES_ERROR = 5  # times that of the reduction: with `reduction_tolerance` the `series_tolerance`
FORMAT = 7  # of what is cached of a body
POLES = ("values", "inputs", "outputs")
ARRAYS = ("damping", "radiation", "load", "points", "inertia")
NEGLIGIBLE_LINE = 1e-7  # of the strongest line at the probes


def reduction_tolerance(tolerance: float) -> float:
    """Tolerance of a reduction: a small share of the relative error that a waveform may have."""
    return min(REDUCTION_TOLERANCE, tolerance / 50)


@dataclass(frozen=True, kw_only=True, eq=False)
class Prepared:
    """Reduced body of probes (p, 2) in metre, which read a quantity: its components at rest are
    `read` (p c, r) of the body's coordinates, `sag` (p c,) under gravity, and `carried` (p c,) of a
    translation by 1 m of a support that moves; `solids`, if any, are the materials of the probes.
    It has the `load` for which it is reduced.
    """

    probes: Floats
    read: Floats
    sag: Floats | float = 0.0
    carried: Floats | float = 0.0
    body: ReducedBody
    reading: Reading = SURFACE
    solids: tuple[Material, ...] = ()
    load: Load = PRESSURE

    @property
    def effort(self) -> Effort:
        """Cost of the offline stage."""
        return self.body.effort


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
) -> Prepared:
    """Offline stage: mesh, assemble, factorise and reduce a body, once for all Tactons and, by the
    cache, once per machine.

    Of a body that is its own mirror image only the part on one side is modelled where all probes
    lie on the plane: they see no more of it (`skinwave.models.meshed`).

    Parameters
    ----------
    body : Body
    probes : (p, 2) float, metre
    progress, h, solver : as for `simulate`
    tolerance : relative error of the reduction
    symmetry : as in `bodies.build.build`: of the load of all Tactons, wherever the probes lie
    reading : what the probes read; with symmetry, of normal motion alone
    load : what pushes, with its gravity; with symmetry, a pressure
    discretise : as in `bodies.build.build`
    """
    clock, body = Clock(), relaxing(body, SERIES_ERROR * tolerance)
    symmetry = modelled_axes(body, probes, symmetry, reading, load)
    (progress or silent)("mesh", 0.0)
    build = meshed(body, h, clock, silent, symmetry, discretise)
    outputs, solids = probe_rows(body, build, images(probes, symmetry), reading)
    own = None if reading.is_plain else outputs
    name = entry_name(body, build, probes, solver, tolerance, outputs=own, load=load)
    with clock("read from cache"):
        entry = cache.load(name)
    size = h or default_size(body)
    if entry:
        found = _from_cache(entry, size, probes, clock)
    else:
        with one_thread():  # a second one gains a tenth of the time, and rounds otherwise
            found = _prepared_anew(
                body, build, size, probes, outputs, clock, progress or silent, solver, tolerance,
                name, load,
            )  # fmt: skip
    shaken = replace(found.body, support_motion=load.support_motion)
    return replace(found, reading=reading, solids=solids, load=load, body=shaken)


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


def _from_cache(entry: dict[str, Any], h: float, probes: Floats, clock: Clock) -> Prepared:
    """The reduced body of an entry, with the size h of today: others may make the same mesh."""
    effort = replace(Effort(**entry["meta"]), h=h, seconds=clock.seconds, peak_memory=peak_memory())
    branches = zip(entry["relaxing"], entry["relaxation_times"].tolist(), strict=True)
    reduced = ReducedBody(
        poles=fem.Poles(**{name: entry[name] for name in POLES}), effort=effort,
        branches=tuple(fem.MaxwellBranch(K=K, time=time) for K, time in branches),
        **{name: entry[name] for name in ARRAYS},
    )  # fmt: skip
    return Prepared(
        probes=probes, read=entry["read"], sag=entry["sag"], carried=entry["carried"], body=reduced
    )


def _prepared_anew(
    body: Body,
    build: Build,
    h: float,
    probes: Floats,
    outputs: sparse.csr_array,
    clock: Clock,
    report: Progress,
    solver: str,
    tolerance: float,
    name: str,
    load: Load,
) -> Prepared:
    operators = assembled(build, clock, report)
    with clock("factorise and reduce"):
        report("factorise", 0.0)
        P, points = even_part(*surface_load(build, load), build.symmetry)
        still = sag(build, operators, outputs, load, solver)
        motion = load.support_motion
        reduced, model = reduce_body(
            body, build, operators, outputs, tolerance, surface=(P, points),
            loads=spread(P, typical_spots(body, points)),
            inertia=inertia(build, motion.unit) if motion else None, solver=solver, report=report,
        )  # fmt: skip
    effort = spent(reduced.effort, clock, build, h)
    arrays = {
        "read": model.outputs,
        "sag": still,
        "carried": outputs @ translation(build, motion.unit if motion else (0.0, 0.0, 0.0)),
        "relaxing": np.array([b.K for b in reduced.branches]).reshape(-1, *reduced.damping.shape),
        "relaxation_times": np.array([b.time for b in reduced.branches]),
        **{name: getattr(reduced, name) for name in ARRAYS},
    }
    cache.store(name, asdict(effort), **asdict(reduced.poles), **arrays)
    return Prepared(
        probes=probes, read=model.outputs, sag=still, carried=arrays["carried"],
        body=replace(reduced, effort=effort),
    )  # fmt: skip


def answer(
    prepared: Prepared,
    scene: Scene,
    progress: Progress | None = None,
    *,
    times: Floats | None = None,
) -> Response:
    """Online stage: response of a reduced body to a scene's Tacton from rest, as the steady state
    of every line of the load and the free vibration of its start.

    Parameters
    ----------
    prepared : Prepared, for the body and the probes of the scene
    scene : Scene
    progress : called with the name of the phase and the fraction done
    times : (t,) float, s, equally spaced from 0; `sample_times` if not given

    Raises
    ------
    Diverged
        If the energy balance is violated.
    """
    if scene.load.moving != prepared.load.moving:
        raise ValueError(
            f"the body is reduced for {prepared.load.words}, not {scene.load.words}; reduce it for"
            " the load of the scene"
        )
    clock, asked = Clock(), prepared.reading.asked
    times = sample_times(scene) if times is None else times
    if progress:
        progress("lines", 0.0)
    with clock("lines"):
        highest = highest_driving(scene.pressure, times)
        motion = components(prepared, *scene.loads, highest=highest)
        # Lines are not weighed against the mean: that of an unconstrained body has no bound.
        strength, mean = np.abs(motion.lines).max(axis=1), motion.frequencies == 0
        heard = mean | (strength > NEGLIGIBLE_LINE * strength[~mean].max(initial=0.0))
        heard &= below_half_the_rate(motion.frequencies, times)
        moving = from_rest(select_lines(motion, heard), times)
        waveforms = with_sag(moving, prepared.sag, asked)
    effort = replace(
        prepared.effort,
        seconds={**prepared.effort.seconds, **clock.seconds},
        steps=int(heard.sum()),
        energy_imbalance=motion.imbalance,
        radiated=motion.radiated,
        peak_memory=peak_memory(),
    )
    return Response(
        model="fem", times=times, probes=prepared.probes, quantity=asked.name,
        values=asked.waveforms(waveforms, len(prepared.probes)), effort=effort,
    )  # fmt: skip


def steady_waveforms(prepared: Prepared, scene: Scene, times: Floats) -> Floats:
    """Waveforms (t, p) of a reduced body in the steady state, as of fem-harmonic, at times (t,) in
    s.
    """
    motion, asked = components(prepared, *scene.loads), prepared.reading.asked
    # Under its mean an unconstrained body has no steady state.
    heard = below_half_the_rate(motion.frequencies, times)
    heard &= scene.body.is_held | (motion.frequencies > 0)
    moving = synthesise(motion.frequencies[heard], motion.lines[heard], times)
    return asked.waveforms(with_sag(moving, prepared.sag, asked), len(prepared.probes))


def components(
    prepared: Prepared, *pressures: MovingPressure, highest: float = np.inf
) -> ReducedResponse:
    """Response of the components that the probes read, with rates and the relaxation of stress, to
    the components of a load up to the `highest` line in Hz.
    """
    motion = read_at(respond(prepared.body, *pressures, highest=highest), prepared.read)
    if moved := prepared.load.support_motion:
        frequencies = np.append(motion.frequencies, moved.frequency)
        lines = np.vstack([motion.lines, moved.line * np.asarray(prepared.carried)])
        frequencies, lines = merge_lines(frequencies, lines)
        motion = replace(motion, frequencies=frequencies, lines=lines)
    return in_motion(motion, prepared.reading.asked, prepared.solids)


def in_motion(
    rest: ReducedResponse, asked: Quantity, solids: tuple[Material, ...]
) -> ReducedResponse:
    """Components of a quantity with its rates and the relaxation of stress, of those at rest and
    the materials of the probes, if any.
    """
    if not (asked.rate or asked.relaxes):
        return rest
    s, outputs = 2j * np.pi * rest.frequencies, rest.lines.shape[1]
    return replace(
        rest,
        lines=rest.lines * line_factor(asked, s, solids, outputs),
        start=rest.start * line_factor(asked, rest.poles, solids, outputs),
    )


def typical_spots(body: Body, points: Floats) -> Floats:
    """Unit Gaussian focal spots (n, 12) where palm-sized paths run, to estimate errors with."""
    reach = min(20e-3, body.width / 3, body.height / 3)
    centres = np.random.default_rng(0).uniform(-reach, reach, (12, 2))
    squared = ((points[:, None, :2] - centres) ** 2).sum(axis=2)
    return np.exp(-squared / (2 * spot_width(0.2) ** 2))
