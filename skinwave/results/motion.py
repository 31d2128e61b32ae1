"""Motion of a whole body, for pictures."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import sparse

import fem
from meshes import TetMesh, part
from meshes.tetmesh import Floats, Ints
from simple_model import Effort, Response
from simple_model.load.path_cells import path_samples
from skinwave.bodies.build import Build
from skinwave.bodies.sizes import default_size
from skinwave.models import reduction
from skinwave.models.laws import relaxing, series_tolerance
from skinwave.models.meshed import assembled, meshed, probe_rows, spent, spread, surface_load
from skinwave.models.options import SolveOptions, sample_times
from skinwave.models.prepared import in_motion
from skinwave.scene.scene import Scene
from skinwave.system.effort import Clock, Progress, silent

TOLERANCE = 0.01  # of the reduction; with it stress at the surface meets the load within 3 %
MOST_VALUES = 500_000_000  # of the motion of a whole body, 4 GB


@dataclass(frozen=True, kw_only=True, eq=False)
class BodyMotion:
    """Motion of a meshed body under a load, line by line.

    Parameters
    ----------
    build : Build, with the mesh
    basis : (3 n, r) float, of all nodes of that mesh
    motion : ReducedResponse, in reduced coordinates (r,)
    effort : Effort
    """

    build: Build
    basis: Floats
    motion: reduction.ReducedResponse
    effort: Effort

    @cached_property
    def _own(self) -> tuple[TetMesh, Ints]:
        mesh, drag = self.build.mesh, self.build.drag
        return (mesh, np.arange(len(mesh.points))) if drag is None else part(mesh, drag == 0)

    @property
    def mesh(self) -> TetMesh:
        """The mesh of the body itself, without an absorbing layer around it."""
        return self._own[0]

    @property
    def nodes(self) -> Ints:
        """Its nodes (m,) among all nodes."""
        return self._own[1]

    @cached_property
    def own_basis(self) -> Floats:
        """Rows (3 m, r) of the basis of these nodes."""
        if self.build.drag is None:
            return self.basis
        each = self.basis.reshape(-1, 3, self.basis.shape[1])
        return each[self.nodes].reshape(3 * len(self.nodes), -1)


def probe_lines(scene: Scene, moved: BodyMotion) -> reduction.ReducedResponse:
    """Components of the quantity that the probes of a scene read, from its body's motion."""
    rows, solids = probe_rows(scene.body, moved.build, scene.probe_points, scene.reading)
    seen = reduction.read_at(moved.motion, rows @ moved.basis)
    return in_motion(seen, scene.reading.asked, solids)


def probe_response(scene: Scene, moved: BodyMotion) -> Response:
    """Quantity that the probes of a scene read, from its body's motion."""
    times, points, asked = sample_times(scene), scene.probe_points, scene.reading.asked
    components = reduction.from_rest(probe_lines(scene, moved), times)
    return Response(
        model="fem", times=times, probes=points, quantity=asked.name,
        values=asked.waveforms(components, len(points)), effort=moved.effort,
    )  # fmt: skip


def waves(
    scene: Scene,
    tolerance: float = TOLERANCE,
    progress: Progress | None = None,
    *,
    h: float | None = None,
    solver: str = "auto",
) -> BodyMotion:
    """Motion of a whole body at any times, as `skinwave.field` reads it; raises what that does."""
    if scene.load.gravity:
        raise ValueError(
            "the motion of a whole body is that about its rest under gravity; leave gravity out"
        )
    if scene.load.support_motion:
        raise ValueError(
            "the motion of a whole body is that on a support at rest; leave support_motion out"
        )
    return driven(scene, tolerance, progress, h=h, solver=solver)


def driven(
    scene: Scene,
    tolerance: float,
    progress: Progress | None = None,
    *,
    h: float | None = None,
    solver: str = "auto",
) -> BodyMotion:
    """A meshed body under a load, reduced to the subspace of its path.

    Parameters
    ----------
    scene, tolerance, progress, h, solver : as for `waves`, with its errors

    Returns
    -------
    BodyMotion
    """
    SolveOptions(solver=solver, h=h, tolerance=tolerance)  # which refuses what is out of range
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
    basis = np.ascontiguousarray(model.basis)  # of which some rows are read at a time
    return BodyMotion(build=build, basis=basis, motion=motion, effort=effort)


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


def vibration(moved: BodyMotion, times: Floats) -> Floats:
    """Reduced coordinates (t, r) of the steady state about its mean at times as in `from_rest`."""
    moving = reduction.oscillating(moved.motion)
    if not len(moving.frequencies):
        return np.zeros((len(times), moving.lines.shape[1]))
    rates = np.asarray(2j * np.pi * moving.frequencies, np.complex128)
    return fem.exponential_sum(rates, moving.lines, times)


def line_amplitudes(moved: BodyMotion, read: sparse.csr_array) -> tuple[Floats, Floats]:
    """Frequencies (f,) in Hz above 0 and amplitudes (f, p) in metre that an operator (p, 3 n)
    reads.
    """
    seen = reduction.read_at(reduction.oscillating(moved.motion), read @ moved.basis)
    return seen.frequencies, np.abs(seen.lines)
