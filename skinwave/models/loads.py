"""Load and probes of a meshed body under a moving pressure."""

from typing import Any

import numpy as np
from scipy import sparse

import fem
from fem.interior import displacement_operator
from fem.load_and_probe import (
    facet_normals,
    facet_points,
    load_operator,
    probe_operator,
    surface_frame,
)
from fem.stress import materials_at, strain_operator
from meshes.tetmesh import Floats
from simple_model.material import Material
from simple_model.quantities import STRAIN, Quantity
from skinwave.bodies.body import Body
from skinwave.bodies.build import Build
from skinwave.models.sheet_probes import sheet_rows
from skinwave.scene import Reading


def surface_load(build: Build) -> tuple[sparse.csr_array, Floats]:
    """Load operator P (3 n, k): nodal forces in N of the pressure in Pa on a surface across the
    beam, and the points (k, 3) in metre where it is taken.

    Radiation pressure goes with the square of the cosine of incidence: once for the beam that is
    spread over a sloping surface, and once for the momentum that is reflected along its normal.
    """
    cosine = np.maximum(facet_normals(build.mesh)[:, 2], 0.0)
    return load_operator(build.mesh) * cosine**2, facet_points(build.mesh)


def surface_motion(body: Body, build: Build, probes: Floats) -> sparse.csr_array:
    """Probe operator S: displacement into a meshed body.

    The surface in a file is made of flat triangles, at whose edges its own normals jump: there the
    direction into the body is that of the mean normal about a probe.

    Parameters
    ----------
    body : Body
    build : its mesh
    probes : (p, 2) float, metre

    Returns
    -------
    (p, 3 n) sparse, without unit
    """
    return probe_operator(build.mesh, probes, patch=body.of_kind.normal_patch)


def probe_rows(
    body: Body, build: Build, probes: Floats, reading: Reading
) -> tuple[sparse.csr_array, tuple[Material, ...]]:
    """Probe operator S of what probes read at rest, and the material at each probe.

    Parameters
    ----------
    body : Body
    build : its mesh
    probes : (p, 2) float, metre
    reading : Reading

    Returns
    -------
    (p c, 3 n) sparse, the c components of a probe next to each other; p materials, none where
    nothing depends on them

    Raises
    ------
    ValueError
        If a probe is not in the body, or its strain in a coat.
    """
    asked = reading.asked
    check_coat(build, reading)
    if asked.is_normal and (reading.is_on_surface or body.of_kind.is_plate):
        return surface_motion(body, build, probes), ()
    if body.of_kind.is_plate:
        return sheet_rows(body, build, probes, reading)
    mesh = build.mesh
    places, normals = surface_frame(mesh, probes, patch=body.of_kind.normal_patch)
    points = places - np.broadcast_to(reading.depths or 0.0, len(probes))[:, None] * normals
    if asked.is_normal:
        inwards = sparse.block_diag(-normals[:, None], format="csr")
        return (inwards @ displacement_operator(mesh, points)).tocsr(), ()
    solids = materials_at(mesh, build.material, points)
    rows = sparse.block_diag([asked.rows(solid) for solid in solids], format="csr")
    if asked.field == STRAIN:
        return (rows @ strain_operator(mesh, build.material, points)).tocsr(), solids
    return (rows @ displacement_operator(mesh, points)).tocsr(), solids


def check_coat(build: Build, reading: Reading) -> None:
    """Refuse strain and stress in a coat, where elements are of the material below it.

    Raises
    ------
    ValueError
        If it is so.
    """
    thickness = sum(build.coat.thicknesses) if build.coat else 0.0
    least = min(reading.depths, default=0.0)
    if reading.asked.field == STRAIN and least < thickness:
        raise ValueError(
            f"{reading.asked.words} at a depth of {1e3 * least:g} mm is in layers of "
            f"{1e3 * thickness:g} mm that are a coat, without elements of their own; take smaller "
            "elements, or a greater depth"
        )


def line_factor(asked: Quantity, s: Any, solids: tuple[Material, ...], outputs: int) -> fem.Complex:
    """Factor (f, p c) of the components of a quantity at complex frequencies s (f,) in rad/s.

    Parameters
    ----------
    asked : Quantity
    s : (f,) complex, rad/s
    solids : p materials of the probes, or none
    outputs : p c, components in all

    Returns
    -------
    (f, p c) complex
    """
    if not asked.relaxes:
        return np.broadcast_to(np.asarray(asked.factor(s))[:, None], (len(s), outputs))
    each = {solid: asked.factor(s, fem.relaxation(solid, s)) for solid in set(solids)}
    return np.stack([each[solid] for solid in solids], axis=1).repeat(
        outputs // len(solids), axis=1
    )
