"""Regions of a mesh with materials of their own, such as bone in soft tissue."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from meshes import MeshError, TetMesh, corner_volumes
from meshes.tetmesh import Ints
from simple_model.layers.material import Material
from skinwave.bodies.body import Body
from skinwave.bodies.parts import solid_of


def in_regions(
    body: Body, mesh: TetMesh, materials: Sequence[Material], region: Ints, source: str
) -> tuple[TetMesh, list[Material]]:
    """Mesh whose regions are those of its materials, and materials by region: those of the mesh,
    and where the `region` (m,) of an element is named in `body.regions`, its own. Raises a
    MeshError if names and regions of the `source` do not fit, or `body.material` is nowhere.
    """
    named = replace(mesh, region=region)
    if not body.regions and len(np.unique(region)) > 1:
        raise MeshError(
            f"{source} has regions {described(named)}, and the scene does not say which material "
            "they are of; name those of another material than the rest in [body.regions]"
        )
    now = np.array(mesh.region)
    numbers = [_number_of(name, named, source) for name, _ in body.regions]
    for k, number in enumerate(numbers):
        if number in numbers[:k]:
            raise MeshError(
                f"[body.regions] names region {number} of {source} twice; leave one of them out"
            )
        now[region == number] = len(materials) + k
    own = [solid_of(material) for _, material in body.regions]
    if (now >= len(materials)).all() and body.solid not in own:
        raise MeshError(
            f"[body.regions] names all of {source}, {described(named)}, and none of them is of "
            "[body] material, that of the rest; give it the material of the softest of them"
        )
    return replace(mesh, region=now), [*materials, *own]


def _number_of(name: str, mesh: TetMesh, source: str) -> int:
    """Number of a region of a mesh by its name or number; raises if there is none."""
    numbers = set(np.unique(mesh.region).tolist())
    known = {title: number for number, title in mesh.region_names.items() if number in numbers}
    known = {str(number): number for number in numbers} | known
    if name not in known:
        raise MeshError(
            f"[body.regions] has '{name}', but the regions of {source} are {described(mesh)}; take "
            "one of them, or mesh the surface of a bone with the body: skinwave mesh --inner"
        )
    return known[name]


def described(mesh: TetMesh) -> str:
    """Regions of a mesh by name and number, with their volumes."""
    volumes = np.bincount(mesh.region, corner_volumes(mesh.points, mesh.tets))
    return ", ".join(
        f"{mesh.region_names.get(r, '')} {r} ({1e6 * volumes[r]:.3g} cm3)".strip()
        for r in np.unique(mesh.region).tolist()
    )
