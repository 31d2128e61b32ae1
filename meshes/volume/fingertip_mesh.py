"""Tetrahedral mesh of a fingertip, with nodes on the surfaces of its tissue and its bone."""

from dataclasses import replace

import numpy as np

from meshes.facets import geometry
from meshes.shapes.fingertip import Fingertip, lattice_of, placed, shell_of
from meshes.shapes.structured import check_size, round_up
from meshes.tetmesh import EDGES, Floats, MeshError, TetMesh, boundary_facets, quadratic
from meshes.volume.curving import LEAST_RATIO, keep_jacobians
from meshes.volume.quality import jacobian_ratios

TISSUE, BONE = 0, 1  # regions
EASINGS, EASED = 6, 0.7
FEWEST, BONY = 3, 2  # shells, and those of them in the bone


def shells_of(shape: Fingertip, h: float) -> int:
    """Number of shells of cells of a size h in metre at the skin."""
    return max(FEWEST, round_up(quarter_of(shape) / h))


def quarter_of(shape: Fingertip) -> float:
    """A quarter of the way around a fingertip in metre."""
    return float(np.pi / 4 * (shape.breadth + shape.thickness) / 2)


def fingertip_mesh(shape: Fingertip, h: float) -> TetMesh:
    """Ten-node tetrahedra of a fingertip, curved at its skin and its bone.

    Parameters
    ----------
    shape : Fingertip
    h : float, metre, edge length aimed at at the skin

    Returns
    -------
    TetMesh with the regions `tissue` (0) and `bone` (1) and the facet sets `top`, which looks
    upwards, `sides`, where it is cut, and `bottom`, the rest

    Raises
    ------
    MeshError
        If h is not above 0, or there would be too many elements.
    """
    if not 0 < h < np.inf:
        raise MeshError(f"h = {h} m must be finite and above 0")
    shells = shells_of(shape, h)
    bone = max(BONY, shells - max(1, round(shape.cover / h)))
    layers = max(1, round_up((shape.length - shape.breadth / 2) / h))
    check_size((2 * shells, 2 * shells, layers + shells), order=2)
    lattice, tets = lattice_of(shells, layers)
    points = placed(shape, lattice, (bone, shells), layers)
    region = np.where(shell_of(lattice)[tets].max(axis=1) <= bone, BONE, TISSUE)
    names = {TISSUE: "tissue", BONE: "bone"}
    mesh = quadratic(TetMesh(points=points, tets=tets, region=region, region_names=names))
    edges = np.moveaxis(mesh.tets[:, EDGES], 2, 0)
    curved = np.array(mesh.points)
    for shell in (bone, shells):
        # Seen from above, the outline stays the polygon of facets in which probes are looked for.
        outline = (lattice[edges, 2] == 0).all(axis=0) & (shell == shells)
        own = (shell_of(lattice)[edges] == shell).all(axis=0) & ~outline
        middles = lattice[edges[:, own]].mean(axis=0)
        curved[mesh.tets[:, 4:][own]] = placed(shape, middles, (bone, shells), layers)
    return _tagged(shape, replace(mesh, points=_eased(mesh, curved)))


def _eased(mesh: TetMesh, curved: Floats) -> Floats:
    """Curved nodes (n, 3), less so where elements would be distorted: the bone has few elements."""
    share, way = np.ones((len(curved), 1)), curved - mesh.points
    for _ in range(EASINGS):
        bad = jacobian_ratios(mesh.points + share * way, mesh.tets) < LEAST_RATIO
        share[np.unique(mesh.tets[bad, 4:])] *= EASED
    return keep_jacobians(mesh.tets, mesh.points, mesh.points + share * way)[0]


def _tagged(shape: Fingertip, mesh: TetMesh) -> TetMesh:
    """The mesh with its facet sets, by where and how its facets lie."""
    facets = boundary_facets(mesh.tets)
    centroids, normals = geometry(mesh, facets)
    cut = centroids[:, 1] < -shape.length / 2 * (1 - 1e-9)
    top = ~cut & (normals[:, 2] > 0)
    sets = {"top": facets[top], "sides": facets[cut], "bottom": facets[~cut & ~top]}
    return replace(mesh, facets=sets)
