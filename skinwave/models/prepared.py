"""Reduced body (offline stage), and its response to any Tacton (online stage)."""

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

import fem
from meshes import cache
from meshes.tetmesh import Floats
from simple_model import Effort, MovingPressure, Response
from simple_model.focus import spot_reach, spot_width
from simple_model.load_spectrum import load_lines, path_fourier, path_samples, path_weights
from simple_model.sampling import shown
from skinwave.bodies.build import Build
from skinwave.bodies.sheet import air
from skinwave.bodies.sizes import default_size
from skinwave.effort import Clock, Progress, one_thread, peak_memory, silent, versions
from skinwave.models.full import assembled, energy_balance, meshed
from skinwave.models.loads import surface_load, surface_motion
from skinwave.scene import SAMPLE_RATE, Body, Scene

BAND = 1000.0  # Hz up to which the reduced model must meet its tolerance
REDUCTION_TOLERANCE = 1e-3
FORMAT = 2  # of what is cached of a body
POLES = ("values", "inputs", "outputs")
ARRAYS = ("damping", "radiation", "relaxing", "relaxation_times", "read", "load", "points")
NEGLIGIBLE_LINE = 1e-7  # of the strongest line at the probes


def reduction_tolerance(tolerance: float) -> float:
    """Tolerance of a reduction: a small share of the relative error that a waveform may have."""
    return min(REDUCTION_TOLERANCE, tolerance / 50)


def sample_times(scene: Scene, rate: float = SAMPLE_RATE) -> Floats:
    """Sample times (t,) in s of a response: from 0 up to the duration, at least two."""
    return np.arange(max(2, round(scene.tacton.duration * rate))) / rate


@dataclass(frozen=True, kw_only=True, eq=False)
class Prepared:
    """Reduced body: the model of its probes' response to any Tacton.

    `poles` of the reduced model, which give its coordinates (r,), its `damping` (r, r), the
    `radiation` (r, r) in it, and `relaxing` stiffness (j, r, r) with its `relaxation_times` (j,);
    `read` (p, r): displacement of the probes; `load` (k, r): reduced forces of unit pressure at
    the surface points (k, 3).
    """

    probes: Floats
    poles: fem.Poles
    damping: Floats
    radiation: Floats
    relaxing: Floats
    relaxation_times: Floats
    read: Floats
    load: Floats
    points: Floats
    effort: Effort

    @property
    def branches(self) -> tuple[fem.MaxwellBranch, ...]:
        """Generalised Maxwell branches of the reduced model."""
        both = zip(self.relaxing, self.relaxation_times.tolist(), strict=True)
        return tuple(fem.MaxwellBranch(K=K, time=time) for K, time in both)


def prepare(
    body: Body,
    probes: Floats,
    progress: Progress | None = None,
    *,
    h: float | None = None,
    solver: str = "auto",
    tolerance: float = REDUCTION_TOLERANCE,
    symmetry: str = "",
) -> Prepared:
    """Offline stage: mesh, assemble, factorise and reduce a body, once for all Tactons and, by the
    cache, once per machine.

    With `symmetry`, as in `bodies.build`, once for all Tactons that have it.
    """
    clock = Clock()
    (progress or silent)("mesh", 0.0)
    build = meshed(body, h, clock, silent, symmetry)
    name = _entry_name(body, build, probes, solver, tolerance)
    with clock("read from cache"):
        entry = cache.load(name)
    size, report = h or default_size(body), progress or silent
    if entry and (found := _from_cache(entry, size, probes, clock)):
        return found
    with one_thread():  # a second one gains a tenth of the time, and rounds otherwise
        return _prepared_anew(body, build, size, probes, clock, report, solver, tolerance, name)


def _entry_name(body: Body, build: Build, probes: Floats, solver: str, tolerance: float) -> str:
    """Cache key of everything that a reduced body depends on."""
    mesh = build.mesh
    # A file may call other facets of the same mesh its top, or fix others.
    named = [mesh.facets[facets] for facets in ("top", *build.fixed)]
    rests = tuple(vars(build.support).values()) if build.support else ()
    used = fem.available()[0] if solver == "auto" else solver
    return cache.key(
        FORMAT, body, mesh.points, mesh.tets, mesh.region, *named, build.material, build.symmetry,
        build.fixed, build.absorbing, build.drag, *rests, probes, BAND, tolerance, used, versions(),
    )  # fmt: skip


def _from_cache(entry: dict[str, Any], h: float, probes: Floats, clock: Clock) -> Prepared | None:
    """The reduced body of an entry; None if its arrays do not fit each other."""
    if not {*POLES, *ARRAYS} <= set(entry):
        return None
    modes, unknowns = len(entry["values"]), entry["read"].shape[-1]
    surface, branches = len(entry["points"]), len(entry["relaxation_times"])
    square = (unknowns, unknowns)
    expected = {
        "values": (modes,), "inputs": (modes, unknowns), "outputs": (unknowns, modes),
        "damping": square, "radiation": square, "relaxing": (branches, *square),
        "relaxation_times": (branches,),
        "read": (len(probes), unknowns), "load": (surface, unknowns), "points": (surface, 3),
    }  # fmt: skip
    if any(entry[field].shape != shape for field, shape in expected.items()):
        return None
    try:
        # `h` is that of today: other sizes may make the same mesh.
        effort = Effort(**{**entry["meta"], "h": h})
    except TypeError:  # that of another version
        return None
    return Prepared(
        probes=probes,
        poles=fem.Poles(**{name: entry[name] for name in POLES}),
        effort=replace(effort, seconds=clock.seconds, peak_memory=peak_memory()),
        **{name: entry[name] for name in ARRAYS},
    )


def _prepared_anew(
    body: Body,
    build: Build,
    h: float,
    probes: Floats,
    clock: Clock,
    report: Progress,
    solver: str,
    tolerance: float,
    name: str,
) -> Prepared:
    operators = assembled(build, clock, report)
    with clock("factorise and reduce"):
        report("factorise", 0.0)
        P, points = surface_load(build)
        model = fem.reduce(
            operators,
            surface_motion(body, build, _mirrored(probes, build.symmetry)),
            BAND,
            tolerance,
            loads=P @ typical_spots(body, points),
            added=air(body, build, operators),
            solver=solver,
            progress=lambda fraction: report("reduce", fraction),
        )
    with clock("diagonalise"):
        poles = fem.poles(model, outputs=np.eye(len(model.K)))
        arrays = {
            "damping": model.C, "radiation": model.R, "read": model.outputs,
            "relaxing": np.array([b.K for b in model.branches]).reshape(-1, *model.K.shape),
            "relaxation_times": np.array([b.time for b in model.branches]),
            "load": P.T @ model.basis, "points": points,
        }  # fmt: skip
    effort = Effort(
        seconds=clock.seconds,
        dofs=len(operators.free),
        reduced_dofs=len(model.K),
        peak_memory=peak_memory(),
        h=h,
        mesh=cache.digest(build.mesh.points, build.mesh.tets),
        solver=model.solver,
        estimate=model.estimate,
        versions=versions(),
    )
    cache.store(name, asdict(effort), **asdict(poles), **arrays)
    return Prepared(probes=probes, poles=poles, effort=effort, **arrays)


def _mirrored(probes: Floats, symmetry: str) -> Floats:
    """Mirror images of the probes in the part that is modelled."""
    kept = probes.copy()
    for axis in ("xy".index(a) for a in symmetry):
        kept[:, axis] = np.abs(kept[:, axis])
    return kept


def answer(prepared: Prepared, scene: Scene, progress: Progress | None = None) -> Response:
    """Online stage: response of a reduced body to a scene's Tacton from rest, as the steady state
    of every line of the load and the free vibration of its start.
    """
    clock, times = Clock(), sample_times(scene)
    if progress:
        progress("lines", 0.0)
    with clock("lines"):
        frequencies, forces = reduced_lines(scene.pressure, prepared.points, prepared.load)
        motion, start = fem.line_response(prepared.poles, forces, frequencies)
        damping = prepared.damping, prepared.radiation
        power = fem.mean_power(*damping, forces, motion, frequencies, prepared.branches)
        imbalance, radiated = energy_balance(power)
        lines, start = motion @ prepared.read.T, start @ prepared.read.T
        # Lines are not weighed against the mean: that of an unconstrained body has no bound.
        strength, mean = np.abs(lines).max(axis=1), frequencies == 0
        heard = mean | (strength > NEGLIGIBLE_LINE * strength[~mean].max(initial=0.0))
        heard &= shown(scene.pressure, frequencies, times)
        rates = np.concatenate([2j * np.pi * frequencies[heard], prepared.poles.values])
        displacement = fem.exponential_sum(rates, np.vstack([lines[heard], start]), times)
    effort = replace(
        prepared.effort,
        seconds={**prepared.effort.seconds, **clock.seconds},
        steps=int(heard.sum()),
        energy_imbalance=imbalance,
        radiated=radiated,
        peak_memory=peak_memory(),
    )
    return Response(
        model="fem",
        times=times,
        probes=prepared.probes,
        displacement=displacement,
        effort=effort,
    )


def reduced_lines(
    pressure: MovingPressure, points: Floats, load: Floats
) -> tuple[Floats, fem.Complex]:
    """Reduced load spectrum: frequencies (f,) in Hz of its lines, and their forces (f, r)."""
    lines = load_lines(pressure)
    knots, reach = path_samples(pressure), spot_reach(pressure.height, pressure.focus)
    forces = []
    for part in np.array_split(knots, len(knots) // 64 + 1):
        low, high = part.min(axis=0) - reach, part.max(axis=0) + reach
        near = ((points[:, :2] > low) & (points[:, :2] < high)).all(axis=1)
        forces.append(pressure.spot(points[near], part) @ load[near])
    weighted = np.vstack(forces) * path_weights(pressure)[:, None]
    return lines.gather(path_fourier(weighted.T).T)


def typical_spots(body: Body, points: Floats) -> Floats:
    """Unit Gaussian focal spots (n, 12) where palm-sized paths run, to estimate errors with."""
    reach = min(20e-3, body.width / 3, body.height / 3)
    centres = np.random.default_rng(0).uniform(-reach, reach, (12, 2))
    squared = ((points[:, None, :2] - centres) ** 2).sum(axis=2)
    return np.exp(-squared / (2 * spot_width(0.2) ** 2))
