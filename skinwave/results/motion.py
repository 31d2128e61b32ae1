"""Steady motion of a whole meshed body, line by line, for maps, films and files of other programs.

What is linear in the motion is about its mean, as the motion of pictures is. An invariant, such as
the largest shear strain, is that of the whole tensor, its mean included, as probes read it; of an
unconstrained body, whose mean has no bound, that of the rest.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import sparse

import fem
from fem.krylov import load_subspace
from fem.stress import SolidPart, nodal_strain, solid_parts
from meshes import TetMesh, part
from simple_model import Effort, Material, Response
from simple_model.layers.tensors import hooke
from simple_model.load.path_cells import path_samples
from simple_model.load.spectrum import synthesise
from simple_model.quantities import NORMAL, STRAIN, VECTOR, Quantity
from skinwave.bodies.build import Build
from skinwave.bodies.sizes import default_size
from skinwave.models.laws import relaxing, series_tolerance
from skinwave.models.meshed import (
    assemble,
    check_coat,
    mesh_body,
    probe_rows,
    spread,
    surface_load,
    with_cost,
)
from skinwave.models.options import SolveOptions, sample_times
from skinwave.models.reduced import (
    ReducedResponse,
    from_rest,
    in_motion,
    oscillating,
    read_at,
    reduce_body,
    respond,
)
from skinwave.scene.scene import Reading, Scene
from skinwave.system.effort import Clock, Progress, silent
from skinwave.typing import Floats, Ints

TOLERANCE = 0.01  # of the reduction; with it stress at the surface meets the load within 3 %
MOST_VALUES = 500_000_000  # of the motion of a whole body, 4 GB
INWARDS = np.array([[0.0, 0.0, -1.0]])  # what is drawn of normal motion


@dataclass(frozen=True, kw_only=True, eq=False)
class BodyMotion:
    """Motion of a meshed body under a load: `motion` in reduced coordinates (r,), and their
    `basis` (3 n, r) at all nodes of the mesh of `build`.
    """

    build: Build
    basis: Floats
    motion: ReducedResponse
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


@dataclass(frozen=True, kw_only=True, eq=False)
class Tensors:
    """Strain and stress (t, q, 6) in Pa of a body about their means at some `frames` (t,) of its
    view: at `nodes` (q,) of its mesh, those between two materials once for each, by which `tets`
    (m, 10) are numbered. Components are xx, yy, zz, xy, xz, yz.
    """

    frames: Ints
    nodes: Ints
    tets: Ints
    strain: Floats
    stress: Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class Shade:
    """Colour of a view: values (t, q) of a quantity, by its name, at `nodes` (q,) of its mesh, at
    each of its times.
    """

    quantity: str
    nodes: Ints
    values: Floats


def waves(
    scene: Scene, tolerance: float = TOLERANCE, progress: Progress | None = None, *,
    h: float | None = None, solver: str = "auto",
) -> BodyMotion:  # fmt: skip
    """Motion of a whole body at any times, as `skinwave.field` reads it; raises what that does."""
    given = {"gravity": scene.load.gravity, "support_motion": scene.load.support_motion}
    if left_out := [key for key, value in given.items() if value]:
        raise ValueError(
            "the motion of a whole body is about its rest without gravity, on a support at rest; "
            f"leave {left_out[0]} out"
        )
    return driven(scene, tolerance, progress, h=h, solver=solver)


def driven(
    scene: Scene, tolerance: float, progress: Progress | None = None, *, h: float | None = None,
    solver: str = "auto",
) -> BodyMotion:  # fmt: skip
    """A meshed body under a load, reduced to the subspace of its path; options and errors as of
    `simulate`.
    """
    SolveOptions(solver=solver, h=h, tolerance=tolerance)  # which refuses what is out of range
    clock, report = Clock(), progress or silent
    body = relaxing(scene.body, series_tolerance(tolerance))
    build = mesh_body(body, h, clock, report)
    operators = assemble(build, clock, report)
    P, points = surface_load(build, scene.load)
    with clock("factorise and reduce"):
        report("factorise", 0.0)
        spots = scene.pressure.spot(points, path_samples(scene.loads[0]))
        subspace = sparse.csr_array(load_subspace(spread(P, spots.T), tolerance / 10).T)
        reduced, model = reduce_body(
            body, build, operators, subspace, tolerance, surface=(P, points), solver=solver,
            report=report,
        )  # fmt: skip
    with clock("lines"):
        motion = respond(reduced, *scene.loads)
    offline = with_cost(reduced.effort, clock, build, h or default_size(scene.body))
    effort = replace(
        offline, steps=len(motion.frequencies), energy_imbalance=motion.imbalance,
        radiated=motion.radiated,
    )  # fmt: skip
    basis = np.ascontiguousarray(model.basis)  # of which some rows are read at a time
    return BodyMotion(build=build, basis=basis, motion=motion, effort=effort)


def probe_lines(scene: Scene, moved: BodyMotion) -> ReducedResponse:
    """Components of the quantity that the probes of a scene read, from its body's motion."""
    rows, solids = probe_rows(scene.body, moved.build, scene.probe_points, scene.reading)
    seen = read_at(moved.motion, rows @ moved.basis)
    return in_motion(seen, scene.reading.record, solids)


def probe_response(scene: Scene, moved: BodyMotion) -> Response:
    """Quantity that the probes of a scene read, from its body's motion."""
    times, points, asked = sample_times(scene), scene.probe_points, scene.reading.record
    components = from_rest(probe_lines(scene, moved), times)
    return Response(
        model="fem", times=times, probes=points, quantity=asked.name,
        values=asked.waveforms(components, len(points)), effort=moved.effort,
    )  # fmt: skip


def check_values(frames: int, nodes: int) -> None:
    """Refuse motion at more times than memory has room for, by a ValueError."""
    if (values := 3 * frames * nodes) > MOST_VALUES:
        raise ValueError(
            f"{frames:,} times of {nodes:,} nodes are {values:,} values, the limit is "
            f"{MOST_VALUES:,}; ask for fewer times or take larger elements"
        )


def vibration(moved: BodyMotion, times: Floats) -> Floats:
    """Displacement (t, m, 3) in metre of the body's own nodes about their mean, in the steady
    state.
    """
    check_values(len(times), len(moved.mesh.points))
    z = _coordinates(oscillating(moved.motion), times)
    return (z @ moved.own_basis.T).reshape(len(times), -1, 3)


def tensors(moved: BodyMotion, times: Floats, frames: Ints) -> Tensors:
    """Strain and stress of a solid body at some frames (t,) of all times (f,) in s."""
    lines, offset = oscillating(moved.motion), 0
    nodes, tets, strains, stresses = [], [], [], []
    z = _coordinates(lines, times[frames])
    for each, own in _parts(moved):
        relaxed = _coordinates(lines, times[frames], each.material)
        u = moved.basis @ np.vstack([z, relaxed]).T
        found = nodal_strain(each, u, own).astype(np.float32)
        still, moving = np.split(np.moveaxis(found, -1, 0), 2)
        nodes.append(np.searchsorted(moved.nodes, each.nodes[own]))
        number = np.full(len(each.nodes), -1)
        number[own] = offset + np.arange(len(own))
        inside = (number[each.tets] >= 0).all(axis=1)
        tets.append(number[each.tets[inside]])
        strains.append(still)
        stresses.append(moving @ hooke(each.material).T.astype(np.float32))
        offset += len(own)
    return Tensors(
        frames=frames, nodes=np.concatenate(nodes), tets=np.vstack(tets),
        strain=np.concatenate(strains, axis=1), stress=np.concatenate(stresses, axis=1),
    )  # fmt: skip


def shade(scene: Scene, moved: BodyMotion, times: Floats, nodes: Ints) -> Shade:
    """Quantity that a scene's probes read, at nodes (q,) of `moved.mesh` and times (t,) in s.

    Raises
    ------
    ValueError
        If it is of a sheet and not of its normal motion, is strain or stress in a coat, or has
        too many values.
    """
    asked = scene.reading.record
    if scene.body.of_kind.is_plate and not asked.is_normal:
        raise ValueError(
            f"{asked.words} of a sheet is not drawn, because its mesh is thicker than it; ask for "
            "displacement, velocity or acceleration, or for its probes by skinwave run"
        )
    check_values(len(times), len(nodes))
    whole = asked.invariant is not None and scene.body.is_held
    lines = moved.motion if whole else oscillating(moved.motion)
    if asked.field == STRAIN:
        check_coat(moved.build, Reading(quantity=asked.name))
        values = _of_strain(asked, lines, moved, times, nodes)
    else:
        rows = {NORMAL: INWARDS, VECTOR: asked.rows(scene.body.solid)}[asked.field]
        basis = moved.own_basis.reshape(len(moved.mesh.points), 3, -1)[nodes]
        z = _coordinates(lines, times, None, asked)
        values = z @ np.einsum("ci,nim->nm", rows, basis).T
    return Shade(quantity=asked.name, nodes=nodes, values=values.astype(np.float32))


def _of_strain(
    asked: Quantity, lines: ReducedResponse, moved: BodyMotion, times: Floats, nodes: Ints
) -> Floats:
    """Values (t, q) of a quantity of strain; between materials the mean of those on both sides."""
    total, count = np.zeros((len(times), len(nodes))), np.zeros(len(nodes))
    for each, own in _parts(moved):
        here = np.searchsorted(moved.nodes, each.nodes[own])
        seen = np.isin(here, nodes)
        z = _coordinates(lines, times, each.material, asked)
        strain = nodal_strain(each, moved.basis @ z.T, own[seen])
        found = np.einsum("vc,qct->tqv", asked.rows(each.material), strain, optimize=True)
        at = np.searchsorted(nodes, here[seen])
        total[:, at] += asked.waveforms(found.reshape(len(times), -1), int(seen.sum()))
        count[at] += 1
    return total / count


def _parts(moved: BodyMotion) -> Iterator[tuple[SolidPart, Ints]]:
    """Parts of a driven mesh, of one material each, and which of their nodes are the body's."""
    for each in solid_parts(moved.build.mesh, moved.build.material):
        own = np.flatnonzero(np.isin(each.nodes, moved.nodes))
        if len(own):
            yield each, own


def _coordinates(
    lines: ReducedResponse, times: Floats, material: Material | None = None,
    asked: Quantity | None = None,
) -> Floats:  # fmt: skip
    """Reduced coordinates (t, r) of lines with the rates of a quantity and, of a material, with the
    relaxation of its stress.
    """
    f = lines.frequencies
    if not len(f):
        return np.zeros((len(times), lines.lines.shape[1]))
    s = 2j * np.pi * f
    modulus = 1.0 if material is None else fem.relaxation(material, s)
    factor = np.asarray(modulus if asked is None else asked.factor(s, modulus))
    return synthesise(f, lines.lines * np.broadcast_to(factor, f.shape)[:, None], times)
