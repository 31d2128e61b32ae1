"""Facet sets of a boundary, chosen by the position and direction of their facets."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from meshes.tetmesh import TetMesh, boundary_facets
from meshes.typing import Floats, Ints

Predicate = Callable[[Floats, Floats], np.ndarray]


def geometry(mesh: TetMesh, facets: Ints) -> tuple[Floats, Floats]:
    """Return centroids (k, 3) in m and outward unit normals (k, 3) of straight facets."""
    a, b, c = (mesh.points[facets[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    return (a + b + c) / 3, normals / np.linalg.norm(normals, axis=1, keepdims=True)


def tag_boundary(
    mesh: TetMesh, *, rest: str | None = None, **parts: Predicate | np.ndarray
) -> TetMesh:
    """Name the boundary of a mesh as the facet set `surface`, and parts of it.

    Parameters
    ----------
    rest : name of the facets that belong to no part, optional
    parts : name -> mask (k,) of the boundary facets, or a function that computes it from their
        centroids (k, 3) and outward normals (k, 3). Parts may overlap.

    >>> from meshes import block
    >>> mesh = block((0.02, 0.02, 0.01), 0.01)
    >>> mesh = tag_boundary(mesh, low=lambda at, normals: at[:, 2] < -0.005)
    >>> {name: len(mesh.facets[name]) for name in ("surface", "low")}
    {'surface': 32, 'low': 16}
    """
    facets = boundary_facets(mesh.tets)
    centroids, normals = geometry(mesh, facets)
    masks = {
        name: np.asarray(part(centroids, normals) if callable(part) else part, bool)
        for name, part in parts.items()
    }
    if rest is not None:
        masks[rest] = ~np.logical_or.reduce(list(masks.values()))
    sets = {name: facets[chosen] for name, chosen in masks.items()}
    return replace(mesh, facets={**mesh.facets, "surface": facets, **sets})


def visible_from_above(mesh: TetMesh) -> np.ndarray:
    """Return the mask (k,) of the `boundary_facets` that face upwards with nothing above them."""
    from scipy.spatial import cKDTree

    facets = boundary_facets(mesh.tets)
    centroids, normals = geometry(mesh, facets)
    visible, undersides = normals[:, 2] > 0, np.flatnonzero(normals[:, 2] < 0)
    corners = mesh.points[facets[undersides, :3]]
    # Any part of the body above a point has an underside over it.
    reach = np.linalg.norm(corners[..., :2] - centroids[undersides, None, :2], axis=2).max()
    upper = np.flatnonzero(visible)
    near = cKDTree(centroids[undersides, :2]).query_ball_point(centroids[upper, :2], reach)
    facet = np.repeat(upper, [len(candidates) for candidates in near])
    over = np.concatenate([np.asarray(candidates, np.int64) for candidates in near])
    hidden = heights_over(corners[over], centroids[facet, :2]) > centroids[facet, 2]
    visible[facet[hidden]] = False
    return visible


def heights_over(triangles: Floats, places: Floats) -> Floats:
    """Return the heights (m,) in m of triangles (m, 3, 3) above places (m, 2) or (2,), or -inf."""
    x, y = np.moveaxis(triangles[..., :2] - places[..., None, :], 2, 0)
    share = np.roll(x, -1, axis=1) * np.roll(y, 1, axis=1)
    share -= np.roll(x, 1, axis=1) * np.roll(y, -1, axis=1)
    total = share.sum(axis=1)
    over = (share * np.sign(total)[:, None] >= 0).all(axis=1) & (total != 0)
    weights = share / np.where(total == 0, 1, total)[:, None]
    return np.where(over, np.einsum("ea,ea->e", weights, triangles[..., 2]), -np.inf)
