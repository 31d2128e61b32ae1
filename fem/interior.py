"""Points inside a body: the element that each lies in, and the displacement there."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from fem.elements import shape_functions
from fem.load_and_probe import on_curved
from fem.typing import Bools, Floats, Ints
from meshes import TetMesh

OUTSIDE = 1e-6  # barycentric: how far outside all elements a point still counts as in the body
BOWED = 0.3  # of an element's size: the same where the straight element stands for a curved one
REACH = 0.05  # of an element's size, by which a curved element may reach beyond its corners


def locate(mesh: TetMesh, points: ArrayLike) -> tuple[Ints, Floats]:
    """Element (p,) that each point (p, 3) in metre lies in, and its barycentric coordinates (p, 4).

    Raises
    ------
    ValueError
        If a point is outside the body.
    """
    points = np.atleast_2d(np.asarray(points, np.float64))
    owner, barycentric, inside = _located(mesh, points)
    if not inside.all():
        x, y, z = 1e3 * points[~inside][0]
        raise ValueError(f"point ({x:.4g}, {y:.4g}, {z:.4g}) mm is not in the body; move it inside")
    return owner, barycentric


def is_inside(mesh: TetMesh, points: ArrayLike) -> Bools:
    """Mask (p,) of the points (p, 3) in metre that are in the body."""
    return _located(mesh, np.atleast_2d(np.asarray(points, np.float64)))[2]


def _located(mesh: TetMesh, points: Floats) -> tuple[Ints, Floats, Bools]:
    """Element (p,) of each point (p, 3), its coordinates (p, 4), and whether it is inside of it."""
    corners = mesh.points[mesh.tets[:, :4]]
    low, high = corners.min(axis=1), corners.max(axis=1)
    slack = REACH * (high - low).max(axis=1, keepdims=True)
    low, high = low - slack, high + slack
    found = [_containing(corners, low, high, point) for point in points]
    owner = np.array([element for element, _ in found])
    barycentric = np.array([coordinates for _, coordinates in found])
    inside = np.isfinite(barycentric).all(axis=1)
    if mesh.order == 2:
        nodes = mesh.points[mesh.tets[owner[inside]]]
        barycentric[inside] = on_curved(nodes, barycentric[inside], points[inside])
    inside[inside] = barycentric[inside].min(axis=1) >= -BOWED * REACH - OUTSIDE
    return owner, barycentric, inside


def _containing(corners: Floats, low: Floats, high: Floats, point: Floats) -> tuple[int, Floats]:
    """The straight element that a point (3,) is in, or the least outside of those near it; none of
    its coordinates are numbers if none is near.
    """
    near = np.flatnonzero(((low <= point) & (point <= high)).all(axis=1))
    if not len(near):
        return 0, np.full(4, np.nan)
    first = corners[near, 0]
    edges = (corners[near, 1:] - first[:, None]).swapaxes(1, 2)
    inner = np.linalg.solve(edges, (point - first)[:, :, None])[:, :, 0]
    coordinates = np.column_stack([1 - inner.sum(axis=1), inner])
    best = int(coordinates.min(axis=1).argmax())
    return int(near[best]), coordinates[best]


def displacement_operator(mesh: TetMesh, points: ArrayLike) -> sparse.csr_array:
    """Displacement operator (3 p, 3 n), component fastest: u(x_p) = sum_a N_a(x_p) u_a at points
    (p, 3) in metre inside a body.

    Raises
    ------
    ValueError
        If a point is outside the body.
    """
    owner, barycentric = locate(mesh, points)
    nodes = mesh.tets[owner]
    N = shape_functions(barycentric, nodes.shape[1])
    rows, component = np.arange(len(owner))[:, None, None], np.arange(3)
    columns = 3 * nodes[:, :, None] + component
    values = np.broadcast_to(N[:, :, None], columns.shape).ravel()
    places = np.broadcast_to(3 * rows + component, columns.shape).ravel(), columns.ravel()
    return sparse.csr_array((values, places), shape=(3 * len(owner), mesh.n_dofs))
