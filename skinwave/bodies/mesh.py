"""Body in a file: a surface that is filled with elements, or a volume mesh."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from meshes import TetMesh, body_from_file, boundary_facets, quadratic
from meshes.facets import visible_from_above
from meshes.tetmesh import facet_keys
from skinwave.bodies.body import Body, BodyKind, register
from skinwave.bodies.discretised import Discretised
from skinwave.bodies.tissue import hand_size, in_tissue_layers


def discretise(body: Body, h: float) -> Discretised:
    """Return ten-node tetrahedra about the middle of a hand, growing away from it.

    Facet sets are `top`, a `bottom` if the file names one, and `sides`, cut here or named in the
    file. The support acts on other facets that face downwards.
    """
    mesh = quadratic(body_from_file(body.file, h, unit=body.unit, up=body.up))
    cut = [mesh.facets[name] for name in ("cut", "sides") if name in mesh.facets]
    facets = {"top": mesh.facets["top"], "sides": np.vstack([mesh.facets["top"][:0], *cut])}
    if not _is_remainder(mesh):
        facets["bottom"] = mesh.facets["bottom"]
    mesh = replace(mesh, facets=facets)
    return in_tissue_layers(body, h, mesh)


def _is_remainder(mesh: TetMesh) -> bool:
    """Whether `bottom` is all of the boundary that is not visible from above, except the cut."""
    hidden = boundary_facets(mesh.tets)[~visible_from_above(mesh)]
    bottom, cut, rest = (
        set(facet_keys(facets, len(mesh.points)).tolist())
        for facets in (mesh.facets["bottom"], mesh.facets.get("cut", hidden[:0]), hidden)
    )
    return bottom | cut == rest | cut


register(
    BodyKind(
        name="mesh",
        keys=("file", "unit", "up", "regions"),
        words=lambda body: f"mesh from {Path(body.file).name}, {body.up} towards the device",
        discretise=discretise,
        default_size=hand_size,
        is_bounded=False,
        may_be_coated=True,
        normal_patch=3e-3,  # m, standard deviation: two thirds of that of the focal spot
    )
)
