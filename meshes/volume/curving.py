"""Ten-node elements whose boundary follows a level set instead of its facets."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from meshes.tetmesh import (
    EDGES,
    Floats,
    Ints,
    MeshError,
    TetMesh,
    boundary_facets,
    corner_volumes,
)
from meshes.volume.quality import edge_lengths, jacobian_ratios, moved_back

log = logging.getLogger(__name__)

LEAST_RATIO = 0.3  # of det J to that of the straight element, below which edges stay straight
FURTHEST = 0.5  # of the edges around: what lies further from the level set is no part of it

Function = Callable[[Floats], Floats]


def curve_boundary(mesh: TetMesh, level_set: Function, gradient: Function) -> TetMesh:
    """Mesh with the nodes of its boundary moved onto a level set: corners first, then mid-side
    nodes. Where an element would lose more than 70 % of its Jacobian, or of its volume, nodes stay.

    Parameters
    ----------
    mesh : TetMesh of ten-node tetrahedra
    level_set, gradient : functions of points (n, 3) in metre: values (n,), slopes (n, 3)

    Returns
    -------
    TetMesh

    Raises a MeshError if the elements have four nodes.
    """
    if mesh.order != 2:
        raise MeshError("elements of 4 nodes have no curved edges; make them `meshes.quadratic`")
    chosen = boundary_facets(mesh.tets)
    corners, middles = np.unique(chosen[:, :3]), np.unique(chosen[:, 3:])
    reach = FURTHEST * _mean_edge(mesh)

    def target(points: Floats, nodes: Ints) -> Floats:
        """Where nodes are on the level set; where they are if it is too far or not found."""
        moved = project_to_level_set(points[nodes], level_set, gradient)
        way = np.linalg.norm(moved - points[nodes], axis=1)
        found = (way < reach[nodes]) & (np.abs(level_set(moved)) < 1e-3 * reach[nodes])
        return np.where(found[:, None], moved, points[nodes])

    points = np.array(mesh.points)
    points[corners] = target(points, corners)
    least = LEAST_RATIO * corner_volumes(mesh.points, mesh.tets)
    points, _ = moved_back(
        mesh.points, points, mesh.tets[:, :4], lambda at: corner_volumes(at, mesh.tets) < least
    )
    ends = points[mesh.tets[:, EDGES]]
    points[mesh.tets[:, 4:]] = ends.mean(axis=2)
    straight = points.copy()
    points[middles] = target(points, middles)
    points, kept = keep_jacobians(mesh.tets, straight, points)
    log.info("curved %d edges, %d stay straight", len(middles) - kept, kept)
    return replace(mesh, points=points)


def project_to_level_set(
    points: Floats, level_set: Function, gradient: Function, steps: int = 4
) -> Floats:
    """Points (n, 3) moved onto a level set that is near by Newton steps along its gradient."""
    for _ in range(steps):
        slope = gradient(points)
        steepness = np.maximum(np.einsum("ni,ni->n", slope, slope), 1e-12)
        points = points - (level_set(points) / steepness)[:, None] * slope
    return points


def _mean_edge(mesh: TetMesh) -> Floats:
    """Mean length (n,) of the edges of the elements at each node, metre."""
    nodes, own = mesh.tets.ravel(), edge_lengths(mesh).mean(axis=1)
    count = np.bincount(nodes, minlength=len(mesh.points))
    total = np.bincount(nodes, np.repeat(own, mesh.tets.shape[1]), len(mesh.points))
    return total / np.maximum(count, 1)


def keep_jacobians(tets: Ints, straight: Floats, points: Floats) -> tuple[Floats, int]:
    """Curved points (n, 3), straight ones where elements would be distorted, and their number."""
    return moved_back(
        straight, points, tets[:, 4:], lambda at: jacobian_ratios(at, tets) < LEAST_RATIO
    )
