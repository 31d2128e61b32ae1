"""Quantities of a whole body at its nodes, in the steady state: tensors for files, and what colours
a film.

What is linear in the motion is about its mean, as the motion of pictures is. An invariant, such as
the largest shear strain, is that of the whole tensor, its mean included, as probes read it; of an
unconstrained body, whose mean has no bound, that of the rest.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

import fem
from meshes.tetmesh import Floats, Ints
from simple_model import Material
from simple_model.layers.tensors import hooke
from simple_model.load.spectrum import synthesise
from simple_model.quantities import NORMAL, STRAIN, VECTOR, Quantity
from skinwave.models import reduction
from skinwave.models.meshed import check_coat
from skinwave.results.motion import BodyMotion, check_values
from skinwave.scene.scene import Reading, Scene

INWARDS = np.array([[0.0, 0.0, -1.0]])  # what is drawn of normal motion


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


def tensors(moved: BodyMotion, times: Floats, frames: Ints) -> Tensors:
    """Strain and stress of a body at some frames.

    Parameters
    ----------
    moved : BodyMotion, of a solid body
    times : (f,) float, s, of all frames
    frames : (t,) int, which of them

    Returns
    -------
    Tensors
    """
    waves, offset = reduction.oscillating(moved.motion), 0
    nodes, tets, strains, stresses = [], [], [], []
    for part, own in _parts(moved):
        z = _coordinates(waves, times[frames], None)
        relaxed = _coordinates(waves, times[frames], part.material)
        u = moved.basis @ np.vstack([z, relaxed]).T
        found = fem.nodal_strain(part, u, own).astype(np.float32)
        still, moving = np.split(np.moveaxis(found, -1, 0), 2)
        here = part.nodes[own]
        nodes.append(np.searchsorted(moved.nodes, here))
        number = np.full(len(part.nodes), -1)
        number[own] = offset + np.arange(len(own))
        inside = (number[part.tets] >= 0).all(axis=1)
        tets.append(number[part.tets[inside]])
        strains.append(still)
        stresses.append(moving @ hooke(part.material).T.astype(np.float32))
        offset += len(own)
    return Tensors(
        frames=frames, nodes=np.concatenate(nodes), tets=np.vstack(tets),
        strain=np.concatenate(strains, axis=1), stress=np.concatenate(stresses, axis=1),
    )  # fmt: skip


def shade(scene: Scene, moved: BodyMotion, times: Floats, nodes: Ints) -> Shade:
    """Quantity that a scene's probes read, at nodes of its body.

    Parameters
    ----------
    scene : Scene
    moved : BodyMotion, of the scene
    times : (t,) float, s
    nodes : (q,) int, of `moved.mesh`

    Returns
    -------
    Shade

    Raises
    ------
    ValueError
        If it is of a sheet and not of its normal motion, is strain or stress in a coat, or has
        too many values.
    """
    asked = scene.reading.asked
    if scene.body.of_kind.is_plate and not asked.is_normal:
        raise ValueError(
            f"{asked.words} of a sheet is not drawn, because its mesh is thicker than it; ask for "
            "displacement, velocity or acceleration, or for its probes by skinwave run"
        )
    check_values(len(times), len(nodes))
    if asked.field == STRAIN:
        check_coat(moved.build, Reading(quantity=asked.name))
        values = _of_strain(asked, scene, moved, times, nodes)
    else:
        rows = {NORMAL: INWARDS, VECTOR: asked.rows(scene.body.solid)}[asked.field]
        basis = moved.own_basis.reshape(len(moved.mesh.points), 3, -1)[nodes]
        z = _coordinates(_lines(asked, scene, moved), times, None, asked)
        values = z @ np.einsum("ci,nim->nm", rows, basis).T
    return Shade(quantity=asked.name, nodes=nodes, values=values.astype(np.float32))


def _of_strain(
    asked: Quantity, scene: Scene, moved: BodyMotion, times: Floats, nodes: Ints
) -> Floats:
    """Values (t, q) of a quantity of strain; between materials the mean of those on both sides."""
    lines, total = _lines(asked, scene, moved), np.zeros((len(times), len(nodes)))
    count = np.zeros(len(nodes))
    for part, own in _parts(moved):
        here = np.searchsorted(moved.nodes, part.nodes[own])
        seen = np.isin(here, nodes)
        z = _coordinates(lines, times, part.material, asked)
        strain = fem.nodal_strain(part, moved.basis @ z.T, own[seen])
        found = np.einsum("vc,qct->tqv", asked.rows(part.material), strain, optimize=True)
        at = np.searchsorted(nodes, here[seen])
        values = asked.waveforms(found.reshape(len(times), -1), int(seen.sum()))
        total[:, at] += values
        count[at] += 1
    return total / count


def _lines(asked: Quantity, scene: Scene, moved: BodyMotion) -> reduction.ReducedResponse:
    """Lines that a quantity is made of: with the mean, or about it."""
    whole = asked.invariant is not None and scene.body.is_held
    return moved.motion if whole else reduction.oscillating(moved.motion)


def _parts(moved: BodyMotion) -> Iterator[tuple[fem.SolidPart, Ints]]:
    """Parts of a driven mesh, of one material each, and which of their nodes are the body's."""
    build = moved.build
    for part in fem.solid_parts(build.mesh, build.material):
        own = np.flatnonzero(np.isin(part.nodes, moved.nodes))
        if len(own):
            yield part, own


def _coordinates(
    waves: reduction.ReducedResponse,
    times: Floats,
    material: Material | None,
    asked: Quantity | None = None,
) -> Floats:
    """Reduced coordinates (t, r) of lines with the rates of a quantity and, of a material, with the
    relaxation of its stress.
    """
    f = waves.frequencies
    if not len(f):
        return np.zeros((len(times), waves.lines.shape[1]))
    s = 2j * np.pi * f
    modulus = 1.0 if material is None else fem.relaxation(material, s)
    factor = np.asarray(modulus if asked is None else asked.factor(s, modulus))
    lines = waves.lines * np.broadcast_to(factor, f.shape)[:, None]
    return synthesise(f, lines, times)
