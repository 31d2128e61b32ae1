"""Motion of a whole body, for pictures."""

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

import fem
from meshes import TetMesh, part
from meshes.tetmesh import Floats
from simple_model import Effort, Response
from simple_model.load_spectrum import path_samples
from skinwave.bodies.build import Build
from skinwave.bodies.sizes import default_size
from skinwave.effort import Clock, Progress, silent
from skinwave.models import reduction
from skinwave.models.full import assembled, meshed, spent
from skinwave.models.laws import relaxing, series_tolerance
from skinwave.models.loads import spread, surface_load
from skinwave.models.prepared import sample_times
from skinwave.scene import Scene
from skinwave.simulation import check_options

MOST_VALUES = 500_000_000  # of the motion of a whole body, 4 GB


@dataclass(frozen=True, kw_only=True, eq=False)
class Waves:
    """All of a body's motion under a load: `basis` (3 n, r) of the nodes of `mesh` times `motion`
    in reduced coordinates (r,).
    """

    mesh: TetMesh
    basis: Floats
    motion: reduction.ReducedResponse
    effort: Effort


@dataclass(frozen=True, kw_only=True, eq=False)
class DrivenBody:
    """The same as `Waves`, with all that the mesh was built from."""

    build: Build
    basis: Floats
    motion: reduction.ReducedResponse
    effort: Effort


def probe_response(scene: Scene, moved: Waves) -> Response:
    """Displacement of the surface at the probes of a scene, from its body's motion."""
    times, points = sample_times(scene), scene.probe_points
    read = fem.probe_operator(moved.mesh, points) @ moved.basis
    return Response(
        model="fem", times=times, probes=points,
        values=reduction.from_rest(moved.motion, times) @ read.T, effort=moved.effort,
    )  # fmt: skip


def waves(
    scene: Scene,
    tolerance: float = 0.02,
    progress: Progress | None = None,
    *,
    h: float | None = None,
    solver: str = "auto",
) -> Waves:
    """Motion of a whole body at any times, as `skinwave.field` reads it; raises what that does."""
    if scene.load.gravity:
        raise ValueError(
            "the motion of a whole body is that about its rest under gravity; leave gravity out"
        )
    moved = driven(scene, tolerance, progress, h=h, solver=solver)
    mesh, basis = moved.build.mesh, moved.basis
    if moved.build.drag is not None:  # the layer around a body is none of it
        mesh, nodes = part(mesh, moved.build.drag == 0)
        basis = basis.reshape(-1, 3, basis.shape[1])[nodes].reshape(3 * len(nodes), -1)
    return Waves(mesh=mesh, basis=basis, motion=moved.motion, effort=moved.effort)


def driven(
    scene: Scene,
    tolerance: float,
    progress: Progress | None = None,
    *,
    h: float | None = None,
    solver: str = "auto",
) -> DrivenBody:
    """A meshed body under a load, reduced to the subspace of its path.

    Parameters
    ----------
    scene, tolerance, progress, h, solver : as for `waves`, with its errors

    Returns
    -------
    DrivenBody
    """
    check_options(solver, h=h)
    clock, report = Clock(), progress or silent
    body = relaxing(scene.body, series_tolerance(tolerance))
    build = meshed(body, h, clock, report)
    operators = assembled(build, clock, report)
    P, points = surface_load(build, scene.load)
    with clock("factorise and reduce"):
        report("factorise", 0.0)
        spots = scene.pressure.spot(points, path_samples(scene.loads[0]))
        subspace = sparse.csr_array(fem.load_subspace(spread(P, spots.T), tolerance / 10).T)
        reduced, model = reduction.reduce_body(
            body, build, operators, subspace, tolerance, surface=(P, points), solver=solver,
            report=report,
        )  # fmt: skip
    with clock("lines"):
        motion = reduction.respond(reduced, *scene.loads)
    offline = spent(reduced.effort, clock, build, h or default_size(scene.body))
    effort = replace(
        offline, steps=len(motion.frequencies), energy_imbalance=motion.imbalance,
        radiated=motion.radiated,
    )  # fmt: skip
    return DrivenBody(build=build, basis=model.basis, motion=motion, effort=effort)


def check_values(frames: int, nodes: int) -> None:
    """Refuse the motion of a whole body at more times than memory has room for.

    Raises
    ------
    ValueError
        If it is so.
    """
    if (values := 3 * frames * nodes) > MOST_VALUES:
        raise ValueError(
            f"{frames:,} times of {nodes:,} nodes are {values:,} values, the limit is "
            f"{MOST_VALUES:,}; ask for fewer times or take larger elements"
        )


def vibration(moved: Waves, times: Floats) -> Floats:
    """Reduced coordinates (t, r) of the steady state about its mean at times as in `from_rest`."""
    moving = reduction.oscillating(moved.motion)
    if not len(moving.frequencies):
        return np.zeros((len(times), moving.lines.shape[1]))
    rates = np.asarray(2j * np.pi * moving.frequencies, np.complex128)
    return fem.exponential_sum(rates, moving.lines, times)


def line_amplitudes(moved: Waves, read: sparse.csr_array) -> tuple[Floats, Floats]:
    """Frequencies (f,) in Hz above 0 and amplitudes (f, p) in metre that an operator (p, 3 n)
    reads.
    """
    seen = reduction.read_at(reduction.oscillating(moved.motion), read @ moved.basis)
    return seen.frequencies, np.abs(seen.lines)
