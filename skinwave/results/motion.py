"""Motion of a whole meshed body for maps, films and exported fields: steady, or from rest.

Steady linear quantities are about their mean. Invariants, such as the largest shear strain, are
computed from the whole tensor including its mean, as at probes. For an unconstrained body the mean
is left out, because it grows without bound.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import sparse

import fem
from fem.stress import SolidPart, nodal_strain, solid_parts
from meshes import TetMesh, part
from simple_model import Effort, Material, Response, Trajectory
from simple_model.layers.tensors import hooke
from simple_model.load.spectrum import synthesise
from simple_model.quantities import DISPLACEMENT, NORMAL, STRAIN, VECTOR, Quantity
from skinwave.bodies.build import Build
from skinwave.bodies.sizes import default_size
from skinwave.models.laws import relaxing, series_tolerance
from skinwave.models.meshed import (
    assemble,
    check_coat,
    mesh_body,
    probe_rows,
    surface_load,
    with_cost,
)
from skinwave.models.options import SolveOptions, response_of, sample_times
from skinwave.models.reduced import (
    ReducedResponse,
    from_rest,
    from_rest_at,
    in_motion,
    oscillating,
    path_loads,
    read_at,
    reduce_body,
    respond,
)
from skinwave.scene.scene import Reading, Scene
from skinwave.system.effort import Clock, one_thread
from skinwave.typing import Floats, Ints

REDUCTION_TOLERANCE = 0.01  # stress at the surface then meets the load within 3 %


@dataclass(frozen=True, kw_only=True, eq=False)
class BodyMotion:
    """Motion of a meshed body under a load: `motion` in reduced coordinates (r,), and their
    `basis` (3 n, r) at all nodes of the mesh of `build`; `in_pulses` is the motion while a pulse of
    the load's rhythm is on.
    """

    build: Build
    basis: Floats
    motion: ReducedResponse
    in_pulses: ReducedResponse
    effort: Effort

    @cached_property
    def _own(self) -> tuple[TetMesh, Ints]:
        mesh, drag = self.build.mesh, self.build.drag
        return (mesh, np.arange(len(mesh.points))) if drag is None else part(mesh, drag == 0)

    @property
    def mesh(self) -> TetMesh:
        """Mesh of the body itself, without an absorbing layer around it."""
        return self._own[0]

    @property
    def nodes(self) -> Ints:
        """Indices (m,) of the nodes of `mesh` among all nodes."""
        return self._own[1]

    @cached_property
    def own_basis(self) -> Floats:
        """Rows (3 m, r) of the basis at the nodes of `mesh`."""
        if self.build.drag is None:
            return self.basis
        by_node = self.basis.reshape(-1, 3, self.basis.shape[1])
        return by_node[self.nodes].reshape(3 * len(self.nodes), -1)


@dataclass(frozen=True, kw_only=True, eq=False)
class Tensors:
    """Strain and stress (t, q, 6) in Pa about their means at some `frames` (t,) of a view.

    `nodes` (q,) are nodes of the mesh; a node between two materials is listed once for each.
    `tets` (m, 10) index `nodes`. Components are xx, yy, zz, xy, xz, yz.
    """

    frames: Ints
    nodes: Ints
    tets: Ints
    strain: Floats
    stress: Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class Shade:
    """Colours of a view: values (t, q) of the named quantity at `nodes` (q,) of its mesh."""

    quantity: str
    nodes: Ints
    values: Floats


def whole_motion(scene: Scene, options: SolveOptions) -> BodyMotion:
    """Return the motion of a whole body at any time; raises the errors of `skinwave.field`."""
    given = {"gravity": scene.load.gravity, "support_motion": scene.load.support_motion}
    if left_out := [key for key, value in given.items() if value]:
        raise ValueError(
            "the motion of a whole body is computed about its rest without gravity, on a support "
            f"at rest; remove {left_out[0]} from the scene"
        )
    return reduced_motion(scene, options)


@one_thread()
def reduced_motion(scene: Scene, options: SolveOptions) -> BodyMotion:
    """Mesh a body, reduce it to the subspace of the load along its path, and compute its lines."""
    return next(reduced_motions([scene], options))[1]


def reduced_motions(
    scenes: Sequence[Scene], options: SolveOptions, *, is_steady: bool = False
) -> Iterator[tuple[Scene, BodyMotion]]:
    """Yield scenes that differ in their pressure only, path by path, each with its motion. With
    `is_steady`, the tolerance is one of the strongest part of the steady state.

    The body is meshed once, and reduced once for each path: a subspace for all paths would be as
    large as the sum of theirs, and its cost grows with the square of its size.
    """
    clock, report, tolerance, first = Clock(), options.progress, options.tolerance, scenes[0]
    body = relaxing(first.body, series_tolerance(tolerance))
    build = mesh_body(body, options.h, clock, report)
    operators = assemble(build, clock, report)
    P, points = surface_load(build, first.load)
    groups: dict[Trajectory, list[Scene]] = {}
    for each in scenes:
        groups.setdefault(each.tacton.trajectory, []).append(each)
    for group in groups.values():
        with clock("factorise and reduce"):
            report("factorise", 0.0)
            loads = path_loads(P, points, group[0].loads[0], tolerance / 10)
            if not is_steady:  # the start drives all frequencies, so that weak parts count, too
                loads = loads / np.linalg.norm(loads, axis=0)
            reduced, model = reduce_body(
                body, build, operators, sparse.csr_array(loads.T), tolerance, surface=(P, points),
                solver=options.solver, report=report, from_loads=is_steady,
                rate=first.reading.record.rate,
            )  # fmt: skip
        basis = np.ascontiguousarray(model.basis)  # its rows are read a few at a time
        for scene in group:
            with clock("lines"):
                motion = in_pulses = respond(reduced, *scene.loads)
                if (steady := scene.during_pulses) is not scene:
                    in_pulses = respond(reduced, *steady.loads)
            offline = with_cost(reduced.effort, clock, build, options.h or default_size(first.body))
            effort = replace(
                offline, steps=len(motion.frequencies), energy_imbalance=motion.imbalance,
                radiated=motion.radiated,
            )  # fmt: skip
            moved = BodyMotion(
                build=build, basis=basis, motion=motion, in_pulses=in_pulses, effort=effort
            )
            yield scene, moved


def probe_lines(scene: Scene, moved: BodyMotion) -> ReducedResponse:
    """Return the lines of the components of the probes' quantity."""
    rows, solids = probe_rows(scene.body, moved.build, scene.probe_points, scene.reading)
    return in_motion(read_at(moved.motion, rows @ moved.basis), scene.reading.record, solids)


def probe_response(scene: Scene, moved: BodyMotion) -> Response:
    """Return the response at the probes, in their quantity."""
    times = sample_times(scene)
    components = from_rest(probe_lines(scene, moved), times)
    values = scene.reading.record.waveforms(components, len(scene.probes))
    return response_of(scene, "fem", times, values, moved.effort)


def check_values(frames: int, nodes: int, most: int = 500_000_000) -> None:
    """Raise a ValueError if the motion has more values than fit into 4 GB."""
    if (values := 3 * frames * nodes) > most:
        raise ValueError(
            f"the motion has {values:,} values ({frames:,} times of {nodes:,} nodes); the limit is "
            f"{most:,}. Give fewer times or larger elements"
        )


def vibration(moved: BodyMotion, times: Floats) -> Floats:
    """Return the steady displacement (t, m, 3) in m of the nodes of `mesh` about its mean."""
    check_values(len(times), len(moved.mesh.points))
    z = _coordinates(oscillating(moved.motion), times)
    return (z @ moved.own_basis.T).reshape(len(times), -1, 3)


@one_thread()
def motion_from_rest(moved: BodyMotion, times: Floats, quantity: Quantity = DISPLACEMENT) -> Floats:
    """Return the displacement in m or, for VELOCITY, the velocity in m/s of the nodes of `mesh`
    from rest, (t, m, 3), at any times (t,) in s.
    """
    check_values(len(times), len(moved.mesh.points))
    z = from_rest_at(in_motion(moved.motion, quantity, ()), times)
    return (z @ moved.own_basis.T).reshape(len(times), -1, 3)


@one_thread()
def strain_from_rest(moved: BodyMotion, times: Floats) -> Floats:
    """Return the strain (t, m, 6), components xx, yy, zz, xy, xz, yz, of a solid body at the nodes
    of `mesh` from rest, at any times (t,) in s; the mean of both sides at an interface.
    """
    u, nodes = moved.basis @ from_rest_at(moved.motion, times).T, np.arange(len(moved.nodes))

    def values(solid: SolidPart, wanted: Ints) -> Floats:
        return nodal_strain(solid, u, wanted).T

    strain = _over_parts(moved, np.zeros((len(times), 6, len(nodes))), nodes, values)
    return strain.swapaxes(1, 2)


@one_thread()
def tensors(moved: BodyMotion, times: Floats, frames: Ints) -> Tensors:
    """Return strain and stress of a solid body at some `frames` (t,) of its `times` (f,) in s."""
    lines, offset = oscillating(moved.motion), 0
    nodes, tets, strains, stresses = [], [], [], []
    z = _coordinates(lines, times[frames])
    for solid, own in _parts(moved):
        relaxing_z = _coordinates(lines, times[frames], solid.material)
        u = moved.basis @ np.vstack([z, relaxing_z]).T
        both = nodal_strain(solid, u, own).astype(np.float32)
        strain, relaxing_strain = np.split(np.moveaxis(both, -1, 0), 2)
        nodes.append(np.searchsorted(moved.nodes, solid.nodes[own]))
        number = np.full(len(solid.nodes), -1)
        number[own] = offset + np.arange(len(own))
        inside = (number[solid.tets] >= 0).all(axis=1)
        tets.append(number[solid.tets[inside]])
        strains.append(strain)
        stresses.append(relaxing_strain @ hooke(solid.material).T.astype(np.float32))
        offset += len(own)
    return Tensors(
        frames=frames, nodes=np.concatenate(nodes), tets=np.vstack(tets),
        strain=np.concatenate(strains, axis=1), stress=np.concatenate(stresses, axis=1),
    )  # fmt: skip


def shade(scene: Scene, moved: BodyMotion, times: Floats, nodes: Ints) -> Shade:
    """Return the probes' quantity at nodes (q,) of `moved.mesh` and times (t,) in s.

    Raises a ValueError for a quantity of a sheet other than normal motion, for strain or stress in
    a coat, and for too many values.
    """
    quantity = scene.reading.record
    if scene.body.of_kind.is_plate and not quantity.is_normal:
        raise ValueError(
            f"{quantity.words} of a sheet cannot be drawn, because its mesh is thicker than the "
            "sheet. Choose displacement, velocity or acceleration, or read it at probes with "
            "skinwave run"
        )
    check_values(len(times), len(nodes))
    with_mean = quantity.invariant is not None and scene.body.is_held
    lines = moved.motion if with_mean else oscillating(moved.motion)
    inwards = np.array([[0.0, 0.0, -1.0]])  # the drawn component of normal motion
    if quantity.field == STRAIN:
        check_coat(moved.build, Reading(quantity=quantity.name))
        values = _of_strain(quantity, lines, moved, times, nodes)
    else:
        rows = {NORMAL: inwards, VECTOR: quantity.rows(scene.body.solid)}[quantity.field]
        basis = moved.own_basis.reshape(len(moved.mesh.points), 3, -1)[nodes]
        z = _coordinates(lines, times, None, quantity)
        values = z @ np.einsum("ci,nim->nm", rows, basis).T
    return Shade(quantity=quantity.name, nodes=nodes, values=values.astype(np.float32))


@one_thread()
def _of_strain(
    quantity: Quantity, lines: ReducedResponse, moved: BodyMotion, times: Floats, nodes: Ints
) -> Floats:
    """Return values (t, q) of a quantity of strain, averaged over both sides of an interface."""

    def values(solid: SolidPart, wanted: Ints) -> Floats:
        z = _coordinates(lines, times, solid.material, quantity)
        strain = nodal_strain(solid, moved.basis @ z.T, wanted)
        components = np.einsum("vc,qct->tqv", quantity.rows(solid.material), strain, optimize=True)
        return quantity.waveforms(components.reshape(len(times), -1), len(wanted))

    return _over_parts(moved, np.zeros((len(times), len(nodes))), nodes, values)


def _over_parts(
    moved: BodyMotion, total: Floats, nodes: Ints, values: Callable[[SolidPart, Ints], Floats]
) -> Floats:
    """Add to `total` (..., q) the values (..., w) of each part at some of its nodes (w,), and
    return the mean over the parts at nodes (q,) of `moved.mesh`.
    """
    count = np.zeros(len(nodes))
    for solid, own in _parts(moved):
        numbers = np.searchsorted(moved.nodes, solid.nodes[own])
        wanted = np.isin(numbers, nodes)
        at = np.searchsorted(nodes, numbers[wanted])
        total[..., at] += values(solid, own[wanted])
        count[at] += 1
    return total / count


def _parts(moved: BodyMotion) -> Iterator[tuple[SolidPart, Ints]]:
    """Yield the parts, each of one material, and a mask of their nodes in the body."""
    for solid in solid_parts(moved.build.mesh, moved.build.material):
        own = np.flatnonzero(np.isin(solid.nodes, moved.nodes))
        if len(own):
            yield solid, own


def _coordinates(
    lines: ReducedResponse, times: Floats, material: Material | None = None,
    quantity: Quantity | None = None,
) -> Floats:  # fmt: skip
    """Return coordinates (t, r) with the rates of a quantity and the relaxation of a material."""
    f = lines.frequencies
    if not len(f):
        return np.zeros((len(times), lines.lines.shape[1]))
    s = 2j * np.pi * f
    modulus = 1.0 if material is None else fem.relaxation(material, s)
    factor = np.asarray(modulus if quantity is None else quantity.factor(s, modulus))
    return synthesise(f, lines.lines * np.broadcast_to(factor, f.shape)[:, None], times)
