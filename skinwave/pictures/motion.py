"""Motion of a whole body, for pictures.

u(x, t) = basis [Re sum_f lines exp(2 pi i f t) + Re sum_m start exp(pole t)]
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

import fem
from meshes import TetMesh, cache, part
from meshes.tetmesh import Floats
from simple_model import Effort, Response
from simple_model.load_spectrum import path_samples
from skinwave.effort import Clock, Progress, peak_memory, silent, versions
from skinwave.models.bodies import air, default_size, surface_load
from skinwave.models.full import assembled, energy_balance, meshed
from skinwave.models.prepared import BAND, reduced_lines, sample_times
from skinwave.scene import Scene
from skinwave.simulation import check_options

MOST_VALUES = 500_000_000  # of the motion of a whole body, 4 GB


@dataclass(frozen=True, kw_only=True, eq=False)
class Waves:
    """All of a body's motion under a load, in the reduced coordinates that its nodes share.

    `basis` (3 n, r) of the nodes of `mesh`; complex `lines` (f, r) at `frequencies` (f,) in Hz;
    the free vibration that the start leaves, complex `start` (m, r) at `poles` (m,) in 1/s.
    """

    mesh: TetMesh
    basis: Floats
    frequencies: Floats
    lines: fem.Complex
    poles: fem.Complex
    start: fem.Complex
    effort: Effort


def probe_response(scene: Scene, moved: Waves) -> Response:
    """Response at the probes of a scene, from its body's motion."""
    times, points = sample_times(scene), scene.probe_points
    read = fem.probe_operator(moved.mesh, points) @ moved.basis
    return Response(
        model="fem", times=times, probes=points, displacement=from_rest(moved, times) @ read.T,
        effort=moved.effort,
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
    check_options(solver, h=h)
    clock, report = Clock(), progress or silent
    build = meshed(scene.body, h, clock, report)
    operators = assembled(build, clock, report)
    P, points = surface_load(build)
    with clock("factorise and reduce"):
        report("factorise", 0.0)
        spots = scene.pressure.spot(points, path_samples(scene.pressure))
        seeds = fem.load_subspace(P @ spots.T, tolerance / 10)
        model = fem.reduce(
            operators, sparse.csr_array(seeds.T), BAND, tolerance,
            added=air(scene.body, build, operators),
            solver=solver, progress=lambda fraction: report("reduce", fraction),
        )  # fmt: skip
    with clock("lines"):
        poles = fem.poles(model, outputs=np.eye(len(model.K)))
        frequencies, forces = reduced_lines(scene.pressure, points, P.T @ model.basis)
        lines, start = fem.line_response(poles, forces, frequencies)
        load = forces, lines, frequencies
        power = fem.mean_power(model.C, model.R, *load, model.branches)
        imbalance, radiated = energy_balance(power)
    effort = Effort(
        seconds=clock.seconds,
        dofs=len(operators.free),
        reduced_dofs=len(model.K),
        steps=len(frequencies),
        peak_memory=peak_memory(),
        h=h or default_size(scene.body),
        mesh=cache.digest(build.mesh.points, build.mesh.tets),
        solver=model.solver,
        estimate=model.estimate,
        energy_imbalance=imbalance,
        radiated=radiated,
        versions=versions(),
    )
    mesh, basis = build.mesh, model.basis
    if build.drag is not None:  # the layer around a body is none of it
        mesh, nodes = part(mesh, build.drag == 0)
        basis = basis.reshape(-1, 3, basis.shape[1])[nodes].reshape(3 * len(nodes), -1)
    return Waves(
        mesh=mesh, basis=basis, frequencies=frequencies, lines=lines,
        poles=poles.values, start=start, effort=effort,
    )  # fmt: skip


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


def from_rest(moved: Waves, times: Floats) -> Floats:
    """Reduced coordinates (t, r) after a start from rest at equally spaced times (t,) from 0."""
    rates = np.concatenate([2j * np.pi * moved.frequencies, moved.poles])
    return fem.exponential_sum(rates, np.vstack([moved.lines, moved.start]), times)


def vibration(moved: Waves, times: Floats) -> Floats:
    """Reduced coordinates (t, r) of the steady state about its mean at times as in `from_rest`."""
    moving = moved.frequencies > 0
    if not moving.any():
        return np.zeros((len(times), moved.lines.shape[1]))
    rates = np.asarray(2j * np.pi * moved.frequencies[moving], np.complex128)
    return fem.exponential_sum(rates, moved.lines[moving], times)


def line_amplitudes(moved: Waves, read: sparse.csr_array) -> tuple[Floats, Floats]:
    """Frequencies (f,) in Hz above 0 and amplitudes (f, p) in metre that an operator (p, 3 n)
    reads.
    """
    moving = moved.frequencies > 0
    return moved.frequencies[moving], np.abs(moved.lines[moving] @ (read @ moved.basis).T)
