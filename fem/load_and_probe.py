"""Load and probe operators on the surface of a body.

nodal forces = P q at the facets' quadrature points,  displacement into the body = S u
"""

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
    """Probe operator S (p, 3 n): displacement into the body, metre, at surface points (p, 2 or 3).

    A point is projected along z onto the facets; positive is the direction of a pressure, against
    the normal of the facet; or, with a `patch` in metre, against the mean normal of the surface,
    weighted by a Gaussian of that standard deviation about the point. Next to a crease the facet
    itself depends on the mesh.

    Raises
    ------
    ValueError
        If a point lies outside the facets, or has no finite coordinates.
    """
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
        barycentric = _on_curved(mesh.points[nodes[owner], :2], barycentric, points)
    N = shape_functions(barycentric, nodes.shape[1])
    if patch:
        places = np.einsum("pa,pai->pi", N, mesh.points[nodes[owner]])
        normals = _mean_normals(mesh, nodes, places, patch)
    else:
        normals = np.cross(*_facet_tangents(mesh, nodes[owner], barycentric))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    values = -np.einsum("pa,pi->pai", N, normals)
    columns = 3 * nodes[owner][:, :, None] + np.arange(3)
    rows = np.broadcast_to(np.arange(len(points))[:, None, None], columns.shape)
    shape = (len(points), mesh.n_dofs)
    return sparse.csr_array((values.ravel(), (rows.ravel(), columns.ravel())), shape=shape)


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
    tangents = np.einsum("pal,pai->pli", derivatives, mesh.points[nodes])
    return tangents[:, 0], tangents[:, 1]


def facet_geometry(mesh: TetMesh, nodes: Ints) -> tuple[Floats, Floats]:
    """Shape values (q, a) and outward normals (e, q, i) times area and quadrature weight."""
    return facet_areas(mesh.points[nodes])


def facet_areas(places: Floats) -> tuple[Floats, Floats]:
    """`facet_geometry` of facets whose nodes are at places (e, a, i)."""
    barycentric, weights = triangle_rule()
    derivatives = shape_derivatives(barycentric, places.shape[1])
    tangents = np.einsum("qal,eai->eqli", derivatives, places, optimize=True)
    normals = np.cross(tangents[:, :, 0], tangents[:, :, 1]) / 2
    return shape_functions(barycentric, places.shape[1]), normals * weights[:, None]


def _on_curved(facets: Floats, barycentric: Floats, points: Floats) -> Floats:
    """Barycentric coordinates (p, 3) of points (p, 2) on curved facets (p, a, 2) seen along z, by
    Newton's method.

    A point next to the edge of a bowed facet may lie a little beyond it, which does no harm.
    """
    for _ in range(4):
        N = shape_functions(barycentric, facets.shape[1])
        miss = points - np.einsum("pa,pai->pi", N, facets)
        tangents = np.einsum(
            "pal,pai->pil", shape_derivatives(barycentric, facets.shape[1]), facets
        )
        step = np.linalg.solve(tangents, miss[:, :, None])[:, :, 0]
        barycentric = barycentric + np.column_stack([-step.sum(axis=1), step])
    return barycentric


def on_surface(mesh: TetMesh, points: Floats, facets: str | Ints = "top") -> NDArray[np.bool_]:
    """Whether `probe_operator` can read at points (p, 2) in metre."""
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
