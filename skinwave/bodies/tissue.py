"""Layers, regions and elastic support of tissue: palms, fingers and bodies from files."""

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
FINE_PALM = 2e-3  # m: smallest default elements of a palm with thin layers, 300,000 dofs


def hand_size(body: Body) -> float:
    """Return the default element size in m of a hand of any depth."""
    return min(HAND_CELL, max(coarsest_size(body), FINE_PALM))


def in_tissue_layers(
    body: Body, h: float, mesh: TetMesh, rest: Callable[[TetMesh], fem.Support] | None = None
) -> Discretised:
    """Return the body of a mesh with elements of h in m, with its layers, regions, coat and
    support.

    `rest` is the support of a mesh; by default it acts below, by the normals of the facets.
    """
    region = mesh.region
    rest = rest or (lambda m: support(body, m, facet_normals(m, boundary_facets(m.tets))))
    strata = meshed_strata(body, h)
    # Depths take seconds, and a single stratum needs none.
    deep = depths(mesh) if len(strata) > 1 else np.zeros(len(mesh.tets))
    mesh, materials = in_layers(mesh, strata, deep)
    mesh, materials = in_regions(body, mesh, materials, region, body.file or f"the {body.kind}")
    return Discretised(mesh=mesh, materials=materials, coat=coat(body, h), support=rest)


def support(
    body: Body, mesh: TetMesh, outward: Floats, ends: Sequence[tuple[str, Floats]] = ()
) -> fem.Support:
    """Return the elastic and absorbing support of a hand over its boundary, where no facet set is
    given.

    Bone lies below. The `ends` of a palm are where it was cut: each has a condition and the cosine
    (k q,) of its direction with the `outward` normals (k q, 3). Where the normal of the surface has
    the cosine c with such a direction, a share s is supported, which rises smoothly from 0 at c =
    0.2 to 1 at c = 1. A clamped share rests on soft tissue over bone, whose thickness falls as the
    share rises: springs of mu/d s/(1 - s + 1e-6) per area, with the mean thickness d of the body.
    An elastic share has the springs of the base, an absorbing one dashpots.
    """
    below = [] if "bottom" in mesh.facets else [(body.base, -outward[:, 2])]
    stiffness, absorbed = np.zeros((2, len(outward)))
    stiffest = 1e6  # stiffness of bone, over the shear stiffness of the whole thickness
    for end, cosine in [*below, *ends]:
        share = supported_share(cosine)
        if end == "clamped":
            stiffness += _shear_stiffness(body, mesh) * share / (1 - share + 1 / stiffest)
        elif end == "elastic":
            stiffness += body.base_stiffness * share
        elif end == "absorbing":
            absorbed = np.maximum(absorbed, share)
    return fem.Support(facets=boundary_facets(mesh.tets), stiffness=stiffness, absorbed=absorbed)


def supported_share(cosine: Floats) -> Floats:
    """Return the share, from 0 to 1, of a support where its direction and the outward normal of the
    surface have a cosine.
    """
    # Cosine between the outward normal and straight down, or along the hand, at which the support
    # begins and is complete. Between 0.5 and 0.9, it would rise within less than an element at the
    # rim of a palm, and meshes of 5 mm differ by 2.9 %. Between 0.2 and 1, they differ by 1.4 %.
    begins, entire = 0.2, 1.0
    t = np.clip((cosine - begins) / (entire - begins), 0.0, 1.0)
    return np.asarray(t * t * (3 - 2 * t))


def _shear_stiffness(body: Body, mesh: TetMesh) -> float:
    """Unrelaxed (fast) shear modulus over the mean thickness, N/m3."""
    _, normals = facet_geometry(mesh.points[boundary_facets(mesh.tets)])
    thickness = corner_volumes(mesh.points, mesh.tets).sum() / np.maximum(normals[..., 2], 0).sum()
    return float((body.softest.shear_modulus + body.softest.fast_modulus) / thickness)


def depths(mesh: TetMesh) -> Floats:
    """Return the depth (m,) in m of each tetrahedron's middle below the top, along the beam."""
    from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

    top = mesh.points[np.unique(mesh.facets["top"])]
    middles = mesh.points[mesh.tets[:, :4]].mean(axis=1)
    height = LinearNDInterpolator(top[:, :2], top[:, 2])(middles[:, :2])
    outside = np.isnan(height)
    height[outside] = NearestNDInterpolator(top[:, :2], top[:, 2])(middles[outside, :2])
    return height - middles[:, 2]


def in_regions(
    body: Body, mesh: TetMesh, materials: Sequence[Material], region: Ints, source: str
) -> tuple[TetMesh, list[Material]]:
    """Return the mesh with its own material in each element of a named `region` (m,), and
    materials.

    Raises a MeshError if the names do not fit the regions of the `source`, or if no element has
    `body.material`.
    """
    named = replace(mesh, region=region)
    if not body.regions and len(np.unique(region)) > 1:
        raise MeshError(
            f"{source} has several regions, but the scene gives no materials for them: "
            f"{list_regions(named)}; give in [body.regions] the "
            "material of each region that is not of [body] material"
        )
    merged = np.array(mesh.region)
    numbers = [_number_of(name, named, source) for name, _ in body.regions]
    for k, number in enumerate(numbers):
        if number in numbers[:k]:
            raise MeshError(f"[body.regions] names region {number} of {source} twice; remove one")
        merged[region == number] = len(materials) + k
    own = [solid_of(material) for _, material in body.regions]
    if (merged >= len(materials)).all() and body.solid not in own:
        raise MeshError(
            f"[body.regions] gives other materials to all regions of {source}: "
            f"{list_regions(named)}; set [body] material to that of the softest"
        )
    return replace(mesh, region=merged), [*materials, *own]


def _number_of(name: str, mesh: TetMesh, source: str) -> int:
    """Number of a region of a mesh, given its name or number."""
    numbers = set(np.unique(mesh.region).tolist())
    known = {title: number for number, title in mesh.region_names.items() if number in numbers}
    known = {str(number): number for number in numbers} | known
    if name not in known:
        raise MeshError(
            f"[body.regions] has '{name}', but the regions of {source} are {list_regions(mesh)}; "
            "use one of them, or mesh a bone inside the body with skinwave mesh --inner"
        )
    return known[name]


def list_regions(mesh: TetMesh) -> str:
    """Return the regions of a mesh by name and number, with their volumes, as text."""
    volumes = np.bincount(mesh.region, corner_volumes(mesh.points, mesh.tets))
    return ", ".join(
        f"{mesh.region_names.get(r, '')} {r} ({1e6 * volumes[r]:.3g} cm3)".strip()
        for r in np.unique(mesh.region).tolist()
    )
