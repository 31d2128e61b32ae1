"""Load and probe operators on the surface of a body.

nodal forces = P q at the facets' quadrature points,  displacement into the body = S u
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from fem.elements import shape_derivatives, shape_functions, triangle_rule
from meshes import TetMesh, facet_set
from meshes.tetmesh import Floats, Ints

BESIDE = 1e-9  # barycentric: how far outside a facet a point still counts as on it


def load_operator(mesh: TetMesh, facets: str | Ints = "top") -> sparse.csr_array:
    """Load operator P (3 n, k q): nodal forces in N of pressures in Pa at `facet_points`.

    Pressure pushes into the body, against the outward normal.
    """
    nodes = facet_set(mesh, facets)
    N, normals = facet_geometry(mesh, nodes)  # normals carry the quadrature weight and area
    k, q = normals.shape[:2]
    forces = -np.einsum("qa,eqi->eaiq", N, normals)
    rows = (3 * nodes[:, :, None, None] + np.arange(3)[:, None]).repeat(q, axis=3)
    columns = np.broadcast_to(np.arange(k * q).reshape(k, 1, 1, q), rows.shape)
    shape = (mesh.n_dofs, k * q)
    return sparse.csr_array((forces.ravel(), (rows.ravel(), columns.ravel())), shape=shape)


def traction_operator(
    mesh: TetMesh, tractions: Floats, facets: str | Ints = "top"
) -> sparse.csr_array:
    """Load operator (3 n, k q) of tractions: nodal forces int N_a t dA in N per value at each of
    the `facet_points`.

    Parameters
    ----------
    mesh : TetMesh
    tractions : (k q, 3) float, traction vector of a unit value at each point
    facets : a facet set's name or nodes (k, a)

    Returns
    -------
    (3 n, k q) sparse
    """
    nodes = facet_set(mesh, facets)
    N, normals = facet_geometry(mesh, nodes)
    k, q = normals.shape[:2]
    area = np.linalg.norm(normals, axis=2)
    forces = np.einsum("eq,qa,eqi->eaiq", area, N, tractions.reshape(k, q, 3))
    rows = (3 * nodes[:, :, None, None] + np.arange(3)[:, None]).repeat(q, axis=3)
    columns = np.broadcast_to(np.arange(k * q).reshape(k, 1, 1, q), rows.shape)
    shape = (mesh.n_dofs, k * q)
    return sparse.csr_array((forces.ravel(), (rows.ravel(), columns.ravel())), shape=shape)


def pressure_force(
    mesh: TetMesh, facets: str | Ints = "top", *, kind: str = "dead"
) -> Callable[[Floats, Floats], Floats]:
    """Dead or follower load of a pressure.

    A "dead" pressure has the direction and the area of the body at rest, as `load_operator`; a
    "follower" acts on the displaced surface: f_ai = -int N_a q (x_,1 x x_,2)_i (Belytschko, Liu and
    Moran, Nonlinear Finite Elements for Continua and Structures (2000), chapter 6).

    Parameters
    ----------
    mesh : TetMesh
    facets : a facet set's name or nodes (e, a)
    kind : "dead" or "follower"

    Returns
    -------
    function of pressures (e q,) in Pa and a displacement (3 n,) in metre, to forces (3 n,) in N

    Raises
    ------
    ValueError
        If the kind is neither.
    """
    P, nodes = load_operator(mesh, facets), facet_set(mesh, facets)
    if kind == "dead":
        return lambda pressure, u: P @ pressure
    if kind != "follower":
        raise ValueError(f"pressure kind '{kind}' is unknown; use dead or follower")
    dofs = 3 * nodes[:, :, None] + np.arange(3)

    def follow(pressure: Floats, u: Floats) -> Floats:
        N, normals = facet_areas(mesh.points[nodes] + u[dofs])
        forces = -np.einsum("qa,eqi,eq->eai", N, normals, pressure.reshape(normals.shape[:2]))
        total: Floats = np.bincount(dofs.ravel(), forces.ravel(), mesh.n_dofs).astype(np.float64)
        return total

    return follow


def facet_points(mesh: TetMesh, facets: str | Ints = "top") -> Floats:
    """Quadrature points (k q, 3) in metre at which `load_operator` takes the pressure."""
    nodes = facet_set(mesh, facets)
    N = shape_functions(triangle_rule()[0], nodes.shape[1])
    return np.einsum("qa,eai->eqi", N, mesh.points[nodes]).reshape(-1, 3)


def facet_normals(mesh: TetMesh, facets: str | Ints = "top") -> Floats:
    """Unit normals (k q, 3) out of the body at the points of `facet_points`."""
    normals = facet_geometry(mesh, facet_set(mesh, facets))[1].reshape(-1, 3)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def probe_operator(
    mesh: TetMesh, points: ArrayLike, facets: str | Ints = "top", *, patch: float = 0.0
) -> sparse.csr_array:
    """Probe operator S: displacement into the body at surface points.

    A point is projected along z onto the facets; positive is the direction of a pressure, against
    the normal of the facet; or, with a patch, against the mean normal of the surface. Next to a
    crease the facet itself depends on the mesh.

    Parameters
    ----------
    mesh : TetMesh
    points : (p, 2 or 3) float, metre
    facets : a facet set's name or nodes (e, a)
    patch : metre, standard deviation of the Gaussian that weights the normals about a point; 0: the
        facet's own normal

    Returns
    -------
    (p, 3 n) sparse, without unit

    Raises
    ------
    ValueError
        If a point lies outside the facets, or has no finite coordinates.
    """
    nodes, N, normals = _surface_frame(mesh, points, facets, patch)
    values = -np.einsum("pa,pi->pai", N, normals)
    columns = 3 * nodes[:, :, None] + np.arange(3)
    rows = np.broadcast_to(np.arange(len(nodes))[:, None, None], columns.shape)
    shape = (len(nodes), mesh.n_dofs)
    return sparse.csr_array((values.ravel(), (rows.ravel(), columns.ravel())), shape=shape)


def surface_frame(
    mesh: TetMesh, points: ArrayLike, facets: str | Ints = "top", *, patch: float = 0.0
) -> tuple[Floats, Floats]:
    """Places (p, 3) in metre on a surface and unit normals (p, 3) out of the body there.

    Parameters
    ----------
    mesh, points, facets, patch : as for `probe_operator`, with its errors

    Returns
    -------
    places, normals
    """
    nodes, N, normals = _surface_frame(mesh, points, facets, patch)
    return np.einsum("pa,pai->pi", N, mesh.points[nodes]), normals


def _surface_frame(
    mesh: TetMesh, points: ArrayLike, facets: str | Ints, patch: float
) -> tuple[Ints, Floats, Floats]:
    """Nodes (p, a) of the facet below each point, shape functions (p, a) and normals (p, 3)."""
    nodes = facet_set(mesh, facets)
    points = np.atleast_2d(np.asarray(points, np.float64))
    if points.ndim != 2 or points.shape[1] not in (2, 3) or not np.isfinite(points).all():
        raise ValueError(f"points of shape {points.shape}: give (p, 2 or 3) finite coordinates")
    if not len(nodes):
        raise ValueError("there are no facets to read; name a facet set that is not empty")
    points = points[:, :2]
    owner, barycentric = _nearest(mesh.points[nodes[:, :3], :2], points)
    if (beside := (barycentric < -BESIDE).any(axis=1)).any():
        x_mm, y_mm = 1e3 * points[beside][0]
        raise ValueError(
            f"point ({x_mm:g}, {y_mm:g}) mm is not on the surface of the body; move it inside"
        )
    if mesh.order == 2:
        barycentric = on_curved(mesh.points[nodes[owner], :2], barycentric, points)
    N = shape_functions(barycentric, nodes.shape[1])
    if patch:
        places = np.einsum("pa,pai->pi", N, mesh.points[nodes[owner]])
        normals = _mean_normals(mesh, nodes, places, patch)
    else:
        normals = np.cross(*_facet_tangents(mesh, nodes[owner], barycentric))
    return nodes[owner], N, normals / np.linalg.norm(normals, axis=1, keepdims=True)


def _mean_normals(mesh: TetMesh, nodes: Ints, places: Floats, patch: float) -> Floats:
    """Mean normals (p, 3) of facets (k, a) about places (p, 3), weighted by area and distance."""
    at = facet_points(mesh, nodes)
    squared = ((places[:, None] - at) ** 2).sum(axis=2)
    nearest = squared.min(axis=1, keepdims=True)  # of facets larger than the patch one is left
    weights = np.exp((nearest - squared) / (2 * patch**2))
    return np.asarray(weights @ facet_geometry(mesh, nodes)[1].reshape(-1, 3))


def _facet_tangents(mesh: TetMesh, nodes: Ints, barycentric: Floats) -> tuple[Floats, Floats]:
    """The two edge tangents at one barycentric point (p, 3) per facet (p, a)."""
    derivatives = shape_derivatives(barycentric, nodes.shape[1])
    tangents = np.einsum("pad,pai->pdi", derivatives, mesh.points[nodes])
    return tangents[:, 0], tangents[:, 1]


def facet_geometry(mesh: TetMesh, nodes: Ints) -> tuple[Floats, Floats]:
    """Shape values (q, a) and outward normals (e, q, i) times area and quadrature weight."""
    return facet_areas(mesh.points[nodes])


def facet_areas(places: Floats) -> tuple[Floats, Floats]:
    """`facet_geometry` of facets whose nodes are at places (e, a, i)."""
    barycentric, weights = triangle_rule()
    derivatives = shape_derivatives(barycentric, places.shape[1])
    tangents = np.einsum("qad,eai->eqdi", derivatives, places, optimize=True)
    normals = np.cross(tangents[:, :, 0], tangents[:, :, 1]) / 2
    return shape_functions(barycentric, places.shape[1]), normals * weights[:, None]


def on_curved(elements: Floats, barycentric: Floats, points: Floats) -> Floats:
    """Barycentric coordinates of points on curved facets seen along z, or in curved tetrahedra, by
    Newton's method.

    A point next to the edge of a bowed facet may lie a little beyond it, which does no harm.

    Parameters
    ----------
    elements : (p, a, i) float, metre, nodes of the facet or tetrahedron of each point
    barycentric : (p, i + 1) float, to start from
    points : (p, i) float, metre

    Returns
    -------
    (p, i + 1) float
    """
    for _ in range(4):
        N = shape_functions(barycentric, elements.shape[1])
        miss = points - np.einsum("pa,pai->pi", N, elements)
        tangents = np.einsum(
            "pad,pai->pid", shape_derivatives(barycentric, elements.shape[1]), elements
        )
        step = np.linalg.solve(tangents, miss[:, :, None])[:, :, 0]
        barycentric = barycentric + np.column_stack([-step.sum(axis=1), step])
    return barycentric


def on_surface(mesh: TetMesh, points: Floats, facets: str | Ints = "top") -> NDArray[np.bool_]:
    """Points at which `probe_operator` can read.

    Parameters
    ----------
    mesh : TetMesh
    points : (p, 2) float, metre
    facets : a facet set's name or nodes (e, a)

    Returns
    -------
    (p,) bool
    """
    _, barycentric = _nearest(mesh.points[facet_set(mesh, facets)[:, :3], :2], points)
    return np.all(barycentric >= -BESIDE, axis=1)


def _nearest(triangles: Floats, points: Floats) -> tuple[Ints, Floats]:
    """Index (p,) of the triangle (k, 3, 2) that each point (p, 2) lies in, or the least outside,
    and its barycentric coordinates (p, 3) there.
    """
    origin, edges = triangles[:, 0], triangles[:, 1:] - triangles[:, :1]
    area = edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]
    standing = np.abs(area) < 1e-12 * (edges**2).sum(axis=(1, 2))
    inverse_area = np.where(standing, np.nan, 1 / np.where(standing, 1, area))
    owners, coordinates = [], []
    for point in points:
        x, y = (point - origin).T
        second = (x * edges[:, 1, 1] - y * edges[:, 1, 0]) * inverse_area
        third = (y * edges[:, 0, 0] - x * edges[:, 0, 1]) * inverse_area
        inside = np.minimum(np.minimum(second, third), 1 - second - third)
        owner = int(np.nanargmax(inside))
        owners.append(owner)
        coordinates.append([1 - second[owner] - third[owner], second[owner], third[owner]])
    return np.array(owners), np.array(coordinates)
