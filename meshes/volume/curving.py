"""Ten-node elements whose boundary follows a level set instead of straight facets."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from meshes.tetmesh import EDGES, MeshError, TetMesh, boundary_facets, corner_volumes
from meshes.typing import Floats, Ints
from meshes.volume.quality import edge_lengths, jacobian_ratios, restore_bad

log = logging.getLogger(__name__)

LEAST_RATIO = 0.3  # of det J to that of the straight element; below, edges stay straight

Function = Callable[[Floats], Floats]


def curve_boundary(mesh: TetMesh, level_set: Function, gradient: Function) -> TetMesh:
    """Move the boundary nodes of a mesh onto a level set: corners first, then mid-side nodes.

    Nodes stay where an element would lose more than 70 % of its Jacobian or volume.

    Parameters
    ----------
    mesh : TetMesh of ten-node tetrahedra
    level_set, gradient : functions of points (n, 3) in m that return values (n,) and slopes (n, 3)

    Raises a MeshError for four-node elements.
    """
    if mesh.order != 2:
        raise MeshError(
            "4-node elements have no curved edges; convert them with `meshes.quadratic`"
        )
    facets = boundary_facets(mesh.tets)
    corners, middles = np.unique(facets[:, :3]), np.unique(facets[:, 3:])
    furthest = 0.5  # of the mean edge at a node: nodes further from the level set stay
    reach = furthest * _mean_edge(mesh)

    def target(points: Floats, nodes: Ints) -> Floats:
        """Positions of nodes on the level set, unchanged if it is too far away."""
        moved = points[nodes]
        for _ in range(4):  # Newton steps along the gradient
            slope = gradient(moved)
            steepness = np.maximum(np.einsum("ni,ni->n", slope, slope), 1e-12)
            moved = moved - (level_set(moved) / steepness)[:, None] * slope
        distance = np.linalg.norm(moved - points[nodes], axis=1)
        is_near = (distance < reach[nodes]) & (np.abs(level_set(moved)) < 1e-3 * reach[nodes])
        return np.where(is_near[:, None], moved, points[nodes])

    points = np.array(mesh.points)
    points[corners] = target(points, corners)
    least = LEAST_RATIO * corner_volumes(mesh.points, mesh.tets)
    points, _ = restore_bad(
        mesh.points, points, mesh.tets[:, :4], lambda at: corner_volumes(at, mesh.tets) < least
    )
    ends = points[mesh.tets[:, EDGES]]
    points[mesh.tets[:, 4:]] = ends.mean(axis=2)
    straight = points.copy()
    points[middles] = target(points, middles)
    points, count = keep_jacobians(mesh.tets, straight, points)
    log.info("curved %d edges, %d stay straight", len(middles) - count, count)
    return replace(mesh, points=points)


def _mean_edge(mesh: TetMesh) -> Floats:
    """Mean edge length (n,) in m of the elements at each node."""
    nodes, own = mesh.tets.ravel(), edge_lengths(mesh).mean(axis=1)
    count = np.bincount(nodes, minlength=len(mesh.points))
    total = np.bincount(nodes, np.repeat(own, mesh.tets.shape[1]), len(mesh.points))
    return total / np.maximum(count, 1)


def keep_jacobians(tets: Ints, straight: Floats, points: Floats) -> tuple[Floats, int]:
    """Return points (n, 3), curved unless this distorts elements, and how many are straight."""
    return restore_bad(
        straight, points, tets[:, 4:], lambda at: jacobian_ratios(at, tets) < LEAST_RATIO
    )
