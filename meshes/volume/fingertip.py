"""Fingertip: an elliptic cylinder of soft tissue with an ellipsoidal end, and a similar bone
inside.

The mesh maps a lattice of tetrahedra in the half ball |x| + |y| + |z| <= n, y >= 0, and the prisms
that extend its section y = 0. Shells of the lattice become surfaces within the bone, or between
bone and skin. Each eighth of the ball is a simplex in Kuhn's subdivision (Edelsbrunner and Grayson,
Discrete Comput Geom 24:707 (2000)).
"""

from dataclasses import dataclass, replace
from itertools import permutations, product

import numpy as np

from meshes.facets import geometry
from meshes.shapes.structured import check_cell_count, extrude_plane, round_up
from meshes.tetmesh import EDGES, MeshError, TetMesh, boundary_facets, quadratic
from meshes.typing import Floats, Ints
from meshes.volume.curving import LEAST_RATIO, keep_jacobians
from meshes.volume.quality import jacobian_ratios


@dataclass(frozen=True, kw_only=True)
class Fingertip:
    """Shape of a fingertip below the plane z = 0, with its tip towards +y and its middle at the
    origin.

    Parameters
    ----------
    breadth, length, thickness : float, m, along x, y and z
    bone_breadth, bone_thickness : float, m
    cover, tip : float, m, of soft tissue between the pad, or the tip, and the bone

    Raises a MeshError if a length is not finite and above 0, or the bone is not within the tissue.
    """

    breadth: float
    length: float
    thickness: float
    bone_breadth: float
    bone_thickness: float
    cover: float
    tip: float

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not 0 < value < np.inf:
                raise MeshError(f"{name} = {value} m of a fingertip must be finite and above 0")
        if self.length <= self.breadth / 2:
            raise MeshError(
                f"a fingertip of {1e3 * self.length:g} mm is not longer than its round end, half "
                f"of {1e3 * self.breadth:g} mm; make it longer"
            )
        below = self.thickness - self.cover - self.bone_thickness
        if not (self.bone_breadth < self.breadth and below > 0 and self.tip < self.breadth / 2):
            raise MeshError(
                f"a bone of {1e3 * self.bone_breadth:g} x {1e3 * self.bone_thickness:g} mm under "
                f"{1e3 * self.cover:g} mm of tissue, {1e3 * self.tip:g} mm from the tip, is not "
                f"inside a fingertip of {1e3 * self.breadth:g} x {1e3 * self.thickness:g} mm; "
                "make the bone smaller"
            )

    @property
    def section(self) -> float:
        """Position along y, m, where the cylinder ends and the round end begins."""
        return (self.length - self.breadth) / 2

    @property
    def semi_axes(self) -> tuple[Floats, Floats]:
        """Semi-axes (3,) in m of bone and skin at the round end."""
        bone = [self.bone_breadth, self.breadth - 2 * self.tip, self.bone_thickness]
        return np.array(bone) / 2, np.array([self.breadth, self.breadth, self.thickness]) / 2


def shell_count(shape: Fingertip, h: float) -> int:
    """Return the number of shells of a mesh with cells of size h in m at the skin."""
    fewest_shells = 3
    return max(fewest_shells, round_up(quarter_circumference(shape) / h))


def quarter_circumference(shape: Fingertip) -> float:
    """Return a quarter of the circumference of a fingertip in m."""
    return float(np.pi / 4 * (shape.breadth + shape.thickness) / 2)


def fingertip_mesh(shape: Fingertip, h: float) -> TetMesh:
    """Return ten-node tetrahedra of a fingertip, curved at its skin and its bone, with edges of
    about h in m at the skin.

    Its regions are `tissue` (0) and `bone` (1), its facet sets `top` (faces upwards), `sides` (the
    cut) and `bottom`. Raises a MeshError if h is not finite and above 0.
    """
    if not 0 < h < np.inf:
        raise MeshError(f"h = {h} m must be finite and above 0")
    shells = shell_count(shape, h)
    fewest_bone_shells = 2
    bone = max(fewest_bone_shells, shells - max(1, round(shape.cover / h)))
    layers = max(1, round_up((shape.length - shape.breadth / 2) / h))
    check_cell_count((2 * shells, 2 * shells, layers + shells), order=2)
    lattice, tets = _lattice(shells, layers)
    points = _map_lattice(shape, lattice, (bone, shells), layers)
    region = (_shell_of(lattice)[tets].max(axis=1) <= bone).astype(int)
    names = {0: "tissue", 1: "bone"}
    mesh = quadratic(TetMesh(points=points, tets=tets, region=region, region_names=names))
    edges = np.moveaxis(mesh.tets[:, EDGES], 2, 0)
    curved = np.array(mesh.points)
    for shell in (bone, shells):
        # The outline seen from above stays straight, because probes are located in its facets.
        outline = (lattice[edges, 2] == 0).all(axis=0) & (shell == shells)
        own = (_shell_of(lattice)[edges] == shell).all(axis=0) & ~outline
        middles = lattice[edges[:, own]].mean(axis=0)
        curved[mesh.tets[:, 4:][own]] = _map_lattice(shape, middles, (bone, shells), layers)
    return _tag_facets(shape, replace(mesh, points=_reduce_curvature(mesh, curved)))


def _reduce_curvature(mesh: TetMesh, curved: Floats) -> Floats:
    """Curved nodes (n, 3), with less curvature where elements would be distorted, as in a coarse
    bone.
    """
    share, change = np.ones((len(curved), 1)), curved - mesh.points
    for _ in range(6):
        bad = jacobian_ratios(mesh.points + share * change, mesh.tets) < LEAST_RATIO
        share[np.unique(mesh.tets[bad, 4:])] *= 0.7
    return keep_jacobians(mesh.tets, mesh.points, mesh.points + share * change)[0]


def _tag_facets(shape: Fingertip, mesh: TetMesh) -> TetMesh:
    """The mesh with its facet sets, chosen by the position and direction of facets."""
    facets = boundary_facets(mesh.tets)
    centroids, normals = geometry(mesh, facets)
    cut = centroids[:, 1] < -shape.length / 2 * (1 - 1e-9)
    top = ~cut & (normals[:, 2] > 0)
    sets = {"top": facets[top], "sides": facets[cut], "bottom": facets[~cut & ~top]}
    return replace(mesh, facets=sets)


def _lattice(shells: int, layers: int) -> tuple[Floats, Ints]:
    """Points (n, 3) and tetrahedra (e, 4) of half a ball of shells, y >= 0, and layers, y < 0."""
    eighth = _simplex(shells)
    signs = np.array(list(product((-1, 1), (1,), (-1, 1))))
    ball = (eighth * signs[:, None, None]).reshape(-1, 4, 3)
    section = _section(ball)
    plane, triangles = np.unique(section.reshape(-1, 2), axis=0, return_inverse=True)
    rod = extrude_plane(plane, triangles.reshape(-1, 3), np.arange(-layers, 1), order=1)
    corners = np.vstack([ball, np.round(rod.points[rod.tets][..., [0, 2, 1]]).astype(np.int64)])
    points, tets = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    return points.astype(np.float64), tets.reshape(-1, 4)


def _simplex(n: int) -> Ints:
    """Corners (n^3, 4, 3) of the tetrahedra of x, y, z >= 0, x + y + z <= n: where a <= b <= c,
    cubes split along their diagonals, with a = x, b = x + y and c = x + y + z.
    """
    cubes = np.array(list(product(range(n), repeat=3)))
    steps = np.cumsum(
        [[[0] * 3, *np.eye(3, dtype=np.int64)[list(order)]] for order in permutations(range(3))],
        axis=1,
    )
    a, b, c = np.moveaxis((cubes[:, None, None] + steps).reshape(-1, 4, 3), 2, 0)
    inside = ((a <= b) & (b <= c) & (c <= n)).all(axis=1)
    return np.stack([a, b - a, c - b], axis=2)[inside]


def _section(ball: Ints) -> Ints:
    """Triangles (k, 3, 2) along x and z of the section y = 0 of the half ball."""
    on_it = ball[..., 1] == 0
    flat = on_it.sum(axis=1) == 3
    return ball[flat][on_it[flat]].reshape(-1, 3, 3)[..., [0, 2]]


def _shell_of(lattice: Floats) -> Floats:
    """Shell (n,) of lattice points."""
    return np.abs(lattice[:, 0]) + np.maximum(lattice[:, 1], 0) + np.abs(lattice[:, 2])


def _map_lattice(shape: Fingertip, lattice: Floats, ends: tuple[int, int], layers: int) -> Floats:
    """Points (n, 3) in m of lattice points; `ends` are the outermost shells of bone and skin."""
    shell = _shell_of(lattice)[:, None]
    shares = (lattice * [1, 0, 1] + np.maximum(lattice, 0) * [0, 1, 0]) / np.maximum(shell, 1e-300)
    outward = np.sin(np.pi / 2 * shares)  # more even on a sphere than the shares themselves
    outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-300)
    bone_axes, skin_axes = shape.semi_axes
    bone_height, height = -shape.cover - shape.bone_thickness / 2, -shape.thickness / 2
    bone = outward * bone_axes + [0, 0, bone_height]
    skin = outward * skin_axes + [0, 0, height]
    inner, outer = ends
    within = np.minimum(shell / inner, 1)
    beyond = np.maximum(shell - inner, 0) / (outer - inner)
    points = within * bone + (1 - within) * [0, 0, bone_height] + beyond * (skin - bone)
    rod = shape.length - shape.breadth / 2
    return points + [0, shape.section, 0] + np.minimum(lattice[:, 1:2], 0) * [0, rod / layers, 0]
