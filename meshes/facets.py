"""Facet sets of a boundary, by the place and direction of their facets."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from meshes.tetmesh import TetMesh, boundary_facets
from meshes.typing import Floats, Ints

Predicate = Callable[[Floats, Floats], np.ndarray]


def geometry(mesh: TetMesh, facets: Ints) -> tuple[Floats, Floats]:
    """Centroids (k, 3) in metre and outward unit normals (k, 3) of straight facets."""
    a, b, c = (mesh.points[facets[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    return (a + b + c) / 3, normals / np.linalg.norm(normals, axis=1, keepdims=True)


def tag_boundary(
    mesh: TetMesh, *, rest: str | None = None, **parts: Predicate | np.ndarray
) -> TetMesh:
    """Name the boundary of a mesh as the facet set `surface`, and parts of it.

    Parameters
    ----------
    mesh : TetMesh
    rest : name of the facets that are in no part, if wanted
    parts : name -> a function of centroids (k, 3) and outward normals (k, 3) to a mask (k,) of
        boundary facets, or the mask. Parts may overlap.

    Returns
    -------
    TetMesh
    """
    facets = boundary_facets(mesh.tets)
    centroids, normals = geometry(mesh, facets)
    which = {
        name: np.asarray(part(centroids, normals) if callable(part) else part, bool)
        for name, part in parts.items()
    }
    if rest is not None:
        which[rest] = ~np.logical_or.reduce(list(which.values()))
    sets = {name: facets[chosen] for name, chosen in which.items()}
    return replace(mesh, facets={**mesh.facets, "surface": facets, **sets})


def visible_from_above(mesh: TetMesh) -> np.ndarray:
    """Mask (k,) of the boundary facets, in the order of `boundary_facets`, that face upwards and
    have nothing of the body above their centroid.
    """
    from scipy.spatial import cKDTree

    facets = boundary_facets(mesh.tets)
    centroids, normals = geometry(mesh, facets)
    seen, above = normals[:, 2] > 0, np.flatnonzero(normals[:, 2] < 0)
    corners = mesh.points[facets[above, :3]]
    # What lies over a point of the body has an underside there.
    reach = np.linalg.norm(corners[..., :2] - centroids[above, None, :2], axis=2).max()
    asked = np.flatnonzero(seen)
    near = cKDTree(centroids[above, :2]).query_ball_point(centroids[asked, :2], reach)
    count = [len(found) for found in near]
    who = np.repeat(asked, count)
    over = np.concatenate([np.asarray(found, np.int64) for found in near])
    hides = heights_over(corners[over], centroids[who, :2]) > centroids[who, 2]
    seen[who[hides]] = False
    return seen


def heights_over(triangles: Floats, places: Floats) -> Floats:
    """Height (m,) in metre of triangles (m, 3, 3) over places (m, 2) or (2,); -inf beside them."""
    flat = triangles[..., :2] - places[..., None, :]
    x, y = flat[..., 0], flat[..., 1]
    share = np.stack(
        [x[:, b] * y[:, c] - x[:, c] * y[:, b] for b, c in ((1, 2), (2, 0), (0, 1))], axis=1
    )
    total = share.sum(axis=1)
    over = (share * np.sign(total)[:, None] >= 0).all(axis=1) & (total != 0)
    weights = share / np.where(total == 0, 1, total)[:, None]
    return np.where(over, np.einsum("ea,ea->e", weights, triangles[..., 2]), -np.inf)
