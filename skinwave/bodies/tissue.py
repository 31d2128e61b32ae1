"""Elastic support, layers and regions of hands: what a parametric palm and a body in a file
share.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

import fem
from fem.load_and_probe import facet_geometry, facet_normals
from meshes import MeshError, TetMesh, boundary_facets, corner_volumes
from simple_model.layers.material import Material
from skinwave.bodies.body import Body
from skinwave.bodies.discretised import Discretised, in_layers
from skinwave.bodies.parts import solid_of
from skinwave.bodies.sizes import coarsest_size, coat, meshed_strata
from skinwave.typing import Floats, Ints

HAND_CELL = 5e-3  # m: within 1.2 % of elements of 3 mm at every probe, at a third of the cost
FINE_PALM = 2e-3  # m: elements of a palm with thin layers, 300,000 dofs; finer ones on request only
# Cosine between the outward normal and straight down, or along the hand, where the support of a
# surface begins, and where it is complete. From 0.5 to 0.9 it would rise within less than an
# element of a palm's rim, and meshes of 5 mm differ by 2.9 %; from 0.2 to 1 they differ by 1.4 %.
BEGINS, ENTIRE = 0.2, 1.0
# Stiffness that stands for bone, over the shear stiffness of the whole thickness.
STIFFEST = 1e6


def hand_size(body: Body) -> float:
    """Default element size of a hand, metre, whatever its depth."""
    return min(HAND_CELL, max(coarsest_size(body), FINE_PALM))


def in_its_layers(
    body: Body,
    h: float,
    mesh: TetMesh,
    rest: Callable[[TetMesh], fem.Support] | None = None,
) -> Discretised:
    """Hand of a mesh with elements of h in metre: in its layers, those that its elements do not
    resolve as a coat, and its regions. `rest` is the support of a mesh, by default below, by the
    normals of its facets.
    """
    region = mesh.region
    rest = rest or (lambda m: support(body, m, facet_normals(m, boundary_facets(m.tets))))
    mesh, materials = in_layers(mesh, meshed_strata(body, h), depths(mesh))
    mesh, materials = in_regions(body, mesh, materials, region, body.file or f"a {body.kind}")
    return Discretised(mesh=mesh, materials=materials, coat=coat(body, h), support=rest)


def support(
    body: Body, mesh: TetMesh, outward: Floats, ends: Sequence[tuple[str, Floats]] = ()
) -> fem.Support:
    """Elastic and absorbing support of a hand, over all of its boundary, where no facet set is
    given: bone below, and at the `ends` of a palm the tissue that it is cut from, each with its
    condition and the cosine (k q,) of its direction with the `outward` normals (k q, 3).

    Of a surface whose normal has a cosine c with either direction, a share s is supported, which
    rises smoothly from 0 at c = 0.2 to 1 at 1. Where that is clamped it rests on soft tissue over
    bone, whose thickness falls from infinite to next to nothing as the share rises: springs of
    mu/d s/(1 - s + 1e-6) per area, with the mean thickness d of the body. Where it is elastic, the
    share has the springs of the base; where it is absorbing, dashpots.
    """
    below = [] if "bottom" in mesh.facets else [(body.base, -outward[:, 2])]
    stiffness, absorbed = np.zeros((2, len(outward)))
    for end, cosine in [*below, *ends]:
        share = _share(cosine)
        if end == "clamped":
            stiffness += _shear_stiffness(body, mesh) * share / (1 - share + 1 / STIFFEST)
        elif end == "elastic":
            stiffness += body.base_stiffness * share
        elif end == "absorbing":
            absorbed = np.maximum(absorbed, share)
    return fem.Support(facets=boundary_facets(mesh.tets), stiffness=stiffness, absorbed=absorbed)


def _share(cosine: Floats) -> Floats:
    """Smooth step from 0 where a surface is free to 1 where all of it is supported."""
    t = np.clip((cosine - BEGINS) / (ENTIRE - BEGINS), 0.0, 1.0)
    return np.asarray(t * t * (3 - 2 * t))


def _shear_stiffness(body: Body, mesh: TetMesh) -> float:
    """Unrelaxed (fast) shear modulus over the mean thickness, N/m3."""
    _, normals = facet_geometry(mesh, boundary_facets(mesh.tets))
    thickness = corner_volumes(mesh.points, mesh.tets).sum() / np.maximum(normals[..., 2], 0).sum()
    return float((body.softest.shear_modulus + body.softest.fast_modulus) / thickness)


def depths(mesh: TetMesh) -> Floats:
    """Depth (m,) in metre of the middle of each tetrahedron below the top, along the beam."""
    from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

    seen = mesh.points[np.unique(mesh.facets["top"])]
    middles = mesh.points[mesh.tets[:, :4]].mean(axis=1)
    height = LinearNDInterpolator(seen[:, :2], seen[:, 2])(middles[:, :2])
    beside = np.isnan(height)
    height[beside] = NearestNDInterpolator(seen[:, :2], seen[:, 2])(middles[beside, :2])
    return height - middles[:, 2]


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
