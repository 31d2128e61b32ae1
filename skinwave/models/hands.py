"""Meshes and supports of hands: a parametric palm, or a body in a file, fine under the focus."""

from collections.abc import Callable

import numpy as np

import fem
from fem.load_and_probe import facet_geometry, facet_normals, facet_points
from meshes import (
    MeshError,
    TetMesh,
    body_from_file,
    boundary_facets,
    corner_volumes,
    palm_mesh,
    quadratic,
)
from meshes.facets import seen_from_above
from meshes.files.import_body import GROWTH
from meshes.shapes.palm import gradient
from meshes.tetmesh import Floats, Ints
from skinwave.scene import Body

KINDS = ("palm", "mesh")
COARSEST = 2.0  # elements far from the middle, over those of h
RIM = 0.7  # elements at the rim of a palm, over the radius of its edge
# Elements at the surface, over those of h, because the motion there has the scale of the focal
# spot; up to which radius they have that size; and how much slower than sideways they grow
# downwards.
SURFACE, FINE_RADIUS, DOWNWARDS = 0.8, 25e-3, 0.6
# Cosine between the outward normal and straight down, or along the hand, where the support of a
# surface begins, and where it is complete. From 0.5 to 0.9 it would rise within less than an
# element of a palm's rim, and meshes of 5 mm differ by 2.9 %; from 0.2 to 1 they differ by 1.4 %.
BEGINS, ENTIRE = 0.2, 1.0
# Stiffness that stands for bone, over the shear stiffness of the whole thickness.
STIFFEST = 1e6


def hand(body: Body, h: float) -> TetMesh:
    """Ten-node tetrahedra of h in metre about the middle of the palm, growing away from it.

    The facet sets are `top`, seen from above, and of a mesh in a file its own `bottom`, and `sides`
    where it was cut or has a set of that name. All else that a hand rests on is a `support`.

    Raises
    ------
    MeshError
        If the body cannot be meshed, or its file has several regions.
    """
    if body.kind == "palm":
        # Larger elements do not follow the rim, where waves reflect and the base's support ends.
        coarsest = max(SURFACE * h, min(COARSEST * h, RIM * body.relief.edge_radius))
        mesh = palm_mesh(body.palm, h, sizing=_sizes(h, coarsest))
        return TetMesh(points=mesh.points, tets=mesh.tets, facets={"top": mesh.facets["top"]})
    mesh = quadratic(body_from_file(body.file, h, unit=body.unit, up=body.up))
    _check_regions(body.file, mesh)
    cut = [mesh.facets[name] for name in ("cut", "sides") if name in mesh.facets]
    facets = {"top": mesh.facets["top"], "sides": np.vstack([mesh.facets["top"][:0], *cut])}
    if not _is_rest(mesh):
        facets["bottom"] = mesh.facets["bottom"]
    return TetMesh(points=mesh.points, tets=mesh.tets, facets=facets)


def _sizes(h: float, coarsest: float) -> Callable[[Floats], Floats]:
    """Edge lengths (n,) in metre aimed at in points (n, 3): 0.8 h where the focus travels, h some
    5 mm below it, growing further down and out.
    """
    slope = float(np.log(GROWTH))

    def sizes(points: Floats) -> Floats:
        beside = np.maximum(np.linalg.norm(points[:, :2], axis=1) - FINE_RADIUS, 0.0)
        below = DOWNWARDS * np.minimum(points[:, 2], 0.0)
        return np.minimum(SURFACE * h + slope * np.hypot(beside, below), coarsest)

    return sizes


def support(body: Body, mesh: TetMesh) -> fem.Support:
    """Elastic and absorbing support of a hand where no facet set is given: bone below, and at the
    ends of a palm the tissue that it is cut from.

    Of a surface whose normal has a cosine c with either direction, a share s is supported, which
    rises smoothly from 0 at c = 0.2 to 1 at 1. Where that is clamped it rests on soft tissue over
    bone, whose thickness falls from infinite to next to nothing as the share rises: springs of
    mu/d s/(1 - s + 1e-6) per area, with the mean thickness d of the body. Where it is absorbing,
    the share has dashpots. A palm's normals are those of its level set, others those of the facets.

    Parameters
    ----------
    mesh : of `hand`, as it lies before it is placed
    """
    facets = boundary_facets(mesh.tets)
    outward = _outward(body, mesh, facets)
    ends = [] if "bottom" in mesh.facets else [(body.base, _share(-outward[:, 2]))]
    if body.kind == "palm":
        ends.append((body.sides, _share(np.abs(outward[:, 1]))))
    stiffness, absorbed = np.zeros((2, len(outward)))
    for end, share in ends:
        if end == "clamped":
            stiffness += _shear_stiffness(body, mesh) * share / (1 - share + 1 / STIFFEST)
        elif end == "absorbing":
            absorbed = np.maximum(absorbed, share)
    return fem.Support(facets=facets, stiffness=stiffness, absorbed=absorbed)


def _outward(body: Body, mesh: TetMesh, facets: Ints) -> Floats:
    """Unit normals (k q, 3) out of the body at the points of its facets."""
    if body.kind != "palm":
        return facet_normals(mesh, facets)
    slope = gradient(body.palm, facet_points(mesh, facets))
    return np.asarray(slope / np.linalg.norm(slope, axis=1, keepdims=True))


def _share(cosine: Floats) -> Floats:
    """Smooth step from 0 where a surface is free to 1 where all of it is supported."""
    t = np.clip((cosine - BEGINS) / (ENTIRE - BEGINS), 0.0, 1.0)
    return np.asarray(t * t * (3 - 2 * t))


def _shear_stiffness(body: Body, mesh: TetMesh) -> float:
    """Unrelaxed (fast) shear modulus over the mean thickness, N/m3."""
    _, normals = facet_geometry(mesh, boundary_facets(mesh.tets))
    thickness = corner_volumes(mesh.points, mesh.tets).sum() / np.maximum(normals[..., 2], 0).sum()
    return float((body.solid.shear_modulus + body.solid.fast_modulus) / thickness)


def _check_regions(file: str, mesh: TetMesh) -> None:
    if (count := len(np.unique(mesh.region))) > 1:
        raise MeshError(
            f"{file} has {count} regions, but a body from a file is of one material or of layers "
            "below its top; save it as one region and describe its layers in the scene"
        )


def _is_rest(mesh: TetMesh) -> bool:
    """Whether `bottom` is all of the boundary that is not seen from above, but for the cut."""
    unseen = boundary_facets(mesh.tets)[~seen_from_above(mesh)]
    cut = _corners(mesh.facets["cut"]) if "cut" in mesh.facets else set()
    return _corners(mesh.facets["bottom"]) | cut == _corners(unseen) | cut


def _corners(facets: Ints) -> set[tuple[int, ...]]:
    """The corners of each facet, in rising order."""
    return set(map(tuple, np.sort(facets[:, :3], axis=1).tolist()))


def depths(mesh: TetMesh) -> Floats:
    """Depth (m,) in metre of the middle of each tetrahedron below the top, along the beam."""
    from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

    seen = mesh.points[np.unique(mesh.facets["top"])]
    middles = mesh.points[mesh.tets[:, :4]].mean(axis=1)
    height = LinearNDInterpolator(seen[:, :2], seen[:, 2])(middles[:, :2])
    beside = np.isnan(height)
    height[beside] = NearestNDInterpolator(seen[:, :2], seen[:, 2])(middles[beside, :2])
    return height - middles[:, 2]
