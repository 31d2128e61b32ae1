"""Mesh of a palm whose nodes move smoothly with its thickness, onto the palms of a range.

Meshes made for each thickness are not smooth in it: their nodes go from the flat to the round part
of the rim, and edges that are curved become straight ones. Here the nodes of one mesh keep their
places on the surface: those above the side wall go up and those below it down, with the rounded
edges, until they meet the mounds. The inner ones follow, harmonically. Between a few thicknesses
each node is on the polynomial through its places.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy import sparse

from meshes.shapes.palm import Palm, gradient, level_set, rise
from meshes.tetmesh import EDGES, Floats, Ints, MeshError, TetMesh, boundary_facets
from meshes.volume.mapped_palm import along_normals, without_mounds
from meshes.volume.quality import angles_between_faces
from meshes.volume.tetrahedralise import SHARPEST

PLACES = 7  # of each node: 12 to 20 mm with edges of 5 mm are met within 2 um, by 5 within 14
AT = (1 - np.cos(np.pi * np.arange(PLACES) / (PLACES - 1))) / 2  # shares of the range
NO_WALL = 1e-9  # m: half the height of a side wall that is none
LIES_ON, FOLLOWS = 1e-4, 5e-3  # of the thickness: nodes this close to the surface, and to others


def stretched_palm(mesh: TetMesh, thinnest: Palm, thickest: Palm) -> Callable[[float], TetMesh]:
    """Meshes of the palms of a range of thicknesses, whose nodes are those of one mesh.

    Parameters
    ----------
    mesh : TetMesh of ten-node tetrahedra, of the thinnest palm
    thinnest, thickest : Palm, which differ by their thickness alone

    Returns
    -------
    Function of a thickness in metre, within the range, that returns a TetMesh with its nodes moved

    Raises a MeshError if the nodes do not follow the palm's surface, or elements get too flat.
    """
    from scipy.interpolate import BarycentricInterpolator  # which takes long to import

    low, high = thinnest.thickness, thickest.thickness
    if low == high:
        return lambda thickness: mesh
    at = low + AT * (high - low)
    each = [_shifts(mesh, thinnest, replace(thinnest, thickness=thickness)) for thickness in at[1:]]
    shifts = BarycentricInterpolator(at, np.stack([np.zeros_like(mesh.points), *each]))

    def moved(thickness: float) -> TetMesh:
        return replace(mesh, points=mesh.points + shifts(thickness), unmoved=mesh.points)

    on = _on_surface(mesh, thinnest)
    for thickness in (at[:2].mean(), high):
        _check(moved(thickness), replace(thinnest, thickness=thickness), on)
    return moved


def _check(mesh: TetMesh, palm: Palm, on: Ints) -> None:
    sharpest = float(angles_between_faces(mesh.points, mesh.tets).min())
    off, limit = np.abs(level_set(palm, mesh.points[on])).max(), FOLLOWS * palm.thickness
    if sharpest < SHARPEST or off > limit:
        raise MeshError(
            f"a mesh stretched to a palm {1e3 * palm.thickness:.3g} mm thick has a dihedral angle "
            f"of {sharpest:.2g} degrees, at least {SHARPEST:g} is needed, and misses its surface "
            f"by {1e3 * off:.2g} mm, at most {1e3 * limit:.2g}; take a narrower range"
        )


def _on_surface(mesh: TetMesh, palm: Palm) -> Ints:
    """Nodes (k,) of the boundary that lie on a palm's surface."""
    outer = np.unique(boundary_facets(mesh.tets))
    return outer[np.abs(level_set(palm, mesh.points[outer])) < LIES_ON * palm.thickness]


def _shifts(mesh: TetMesh, palm: Palm, other: Palm) -> Floats:
    """Shifts (n, 3) in metre of the nodes of a palm's mesh to where they are on another's."""
    corners, middles = np.unique(mesh.tets[:, :4]), np.unique(mesh.tets[:, 4:])
    on = _on_surface(mesh, palm)
    shifts = np.zeros_like(mesh.points)
    first = np.intersect1d(on, corners)
    shifts[first] = _along_rim(palm, other, mesh.points[first])
    shifts[first] += _onto(palm, other, mesh.points[first], shifts[first])
    shifts = _harmonic(mesh, np.setdiff1d(corners, first), shifts)
    shifts[mesh.tets[:, 4:]] = shifts[mesh.tets[:, EDGES]].mean(axis=2)
    then = np.intersect1d(on, middles)
    shifts[then] += _onto(palm, other, mesh.points[then], shifts[then])
    return shifts


def _along_rim(palm: Palm, other: Palm, points: Floats) -> Floats:
    """Shifts (n, 3) that leave points (n, 3) where they are on the rounded edges of a palm without
    mounds, and stretch its side wall.
    """
    above_middle = points[:, 2] - rise(palm, points[:, :2]) + palm.thickness / 2
    wall = max(palm.thickness / 2 - palm.edge_radius, NO_WALL)
    thicker = (other.thickness - palm.thickness) / 2
    shifts = np.zeros_like(points)
    shifts[:, 2] = thicker * (np.clip(above_middle / wall, -1, 1) - 1)
    return shifts


def _onto(palm: Palm, other: Palm, points: Floats, shifts: Floats) -> Floats:
    """Further shifts (n, 3) onto the surface of the other palm, along normals without mounds."""
    start = points + shifts
    return along_normals(other, start, gradient(without_mounds(palm), points)) - start


def _harmonic(mesh: TetMesh, inner: Ints, values: Floats) -> Floats:
    """Values (n, 3) with those of inner corners such that each is the mean of its neighbours',
    weighted by one over the squared length of the edge.
    """
    pairs = np.unique(np.sort(mesh.tets[:, EDGES].reshape(-1, 2), axis=1), axis=0)
    weights = np.linalg.norm(np.diff(mesh.points[pairs], axis=1)[:, 0], axis=1) ** -2
    n = len(mesh.points)
    A = sparse.coo_array((weights, pairs.T), shape=(n, n)).tocsr()
    A = A + A.T
    rows = (sparse.diags_array(A.sum(axis=1)) - A).tocsr()[inner]
    found = values.copy()
    found[inner] = sparse.linalg.spsolve(rows[:, inner].tocsc(), -(rows @ values))
    return found
