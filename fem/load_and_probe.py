"""Load and probe operators on the surface of a body, and points inside it.

nodal forces = P q at the facets' quadrature points,  displacement into the body = S u
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from fem.sparsity import dofs_of, from_entries
from meshes import TetMesh, facet_set
from meshes.elements import shape_derivatives, shape_functions, triangle_rule
from simple_model.typing import Bools, Floats, Ints


def pressure_operator(mesh: TetMesh, facets: str | Ints = "top") -> sparse.csr_array:
    """Return the load operator P (3 n, k q): nodal forces in N for pressures in Pa.

    Pressures are values at `facet_points` and act into the body, against the outward normal. Raises
    a MeshError for an unknown facet set.

    Examples
    --------
    >>> import fem, meshes
    >>> mesh = meshes.block((0.02, 0.02, 0.01), 0.005)
    >>> force = fem.pressure_operator(mesh).sum(axis=1)  # 1 Pa on the whole top, 4 cm2
    >>> float(force[2::3].sum().round(9))  # N
    -0.0004
    """
    N, normals = facet_geometry(mesh.points[facet_set(mesh, facets)])
    return _forces(mesh, facets, -np.einsum("qa,eqi->eaiq", N, normals))


def traction_operator(mesh: TetMesh, tractions: Floats) -> sparse.csr_array:
    """Return the load operator (3 n, k q) of tractions on the top: nodal forces int N_a t dA in N
    for values at `facet_points` times the traction vectors (k q, 3).
    """
    N, normals = facet_geometry(mesh.points[facet_set(mesh, "top")])
    area = np.linalg.norm(normals, axis=2)
    at_points = tractions.reshape(*area.shape, 3)
    return _forces(mesh, "top", np.einsum("eq,qa,eqi->eaiq", area, N, at_points))


def _forces(mesh: TetMesh, facets: str | Ints, values: Floats) -> sparse.csr_array:
    """Return the load operator (3 n, e q) with nodal forces (e, a, i, q) of unit values."""
    k, _, _, q = values.shape
    rows = dofs_of(facet_set(mesh, facets))[..., None]
    columns = np.arange(k * q).reshape(k, 1, 1, q)
    return from_entries(values, rows, columns, (mesh.n_dofs, k * q))


def facet_points(mesh: TetMesh, facets: str | Ints = "top") -> Floats:
    """Return the quadrature points (k q, 3) of `pressure_operator`, in m.

    >>> import fem, meshes
    >>> mesh = meshes.block((0.02, 0.02, 0.01), 0.005)
    >>> len(mesh.facets["top"]), fem.facet_points(mesh).shape
    (32, (192, 3))
    """
    nodes = facet_set(mesh, facets)
    N = shape_functions(triangle_rule()[0], nodes.shape[1])
    return np.einsum("qa,eai->eqi", N, mesh.points[nodes]).reshape(-1, 3)


def facet_normals(mesh: TetMesh, facets: str | Ints = "top") -> Floats:
    """Return unit normals (k q, 3) out of the body at `facet_points`."""
    normals = facet_geometry(mesh.points[facet_set(mesh, facets)])[1].reshape(-1, 3)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def probe_operator(
    mesh: TetMesh, points: ArrayLike, facets: str | Ints = "top", *, patch: float = 0.0
) -> sparse.csr_array:
    """Return the probe operator S: displacement into the body at surface points.

    A point is projected along z onto the highest facet. Displacement is positive in the direction
    of a pressure: against the normal of the facet, or against the mean normal of a patch. Next to a
    crease, the normal of a single facet depends on the mesh.

    Parameters
    ----------
    points : (p, 2) or (p, 3) float, m
    facets : name of a facet set, or nodes (e, a)
    patch : standard deviation in m of the Gaussian weights of normals around a point, or 0

    Returns
    -------
    (p, 3 n) sparse, dimensionless

    Raises
    ------
    ValueError
        If a point lies off the facets or is not finite.

    Examples
    --------
    >>> import fem, meshes, numpy as np
    >>> mesh = meshes.block((0.02, 0.02, 0.01), 0.005)
    >>> down = np.tile([0.0, 0.0, -1e-6], len(mesh.points))  # m, a translation
    >>> fem.probe_operator(mesh, [[0.0, 0.0], [0.004, 0.0]]) @ down
    array([1.e-06, 1.e-06])
    """
    return _inwards(mesh, *_surface_frame(mesh, points, facets, patch))


def node_operator(mesh: TetMesh, *, patch: float = 0.0) -> tuple[Ints, sparse.csr_array]:
    """Return the nodes (s,) of the top in ascending order, and the operator (s, 3 n) of their
    displacement into the body, against the mean normal of their facets or of a `patch`.
    """
    nodes = facet_set(mesh, "top")
    surface, local = np.unique(nodes, return_inverse=True)
    node_places = np.vstack([np.eye(3), [[0.5, 0.5, 0], [0, 0.5, 0.5], [0.5, 0, 0.5]]])
    if patch:
        normals = _mean_normals(mesh, nodes, mesh.points[surface], patch)
    else:
        normals, own = np.zeros((len(surface), 3)), local.reshape(nodes.shape)
        for number, at in enumerate(node_places[: nodes.shape[1]]):
            here = np.broadcast_to(at, (len(nodes), 3))
            np.add.at(normals, own[:, number], np.cross(*_facet_tangents(mesh, nodes, here)))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return surface, _inwards(mesh, surface[:, None], np.ones((len(surface), 1)), normals)


def _inwards(mesh: TetMesh, nodes: Ints, N: Floats, normals: Floats) -> sparse.csr_array:
    """Return the displacement against normals (p, 3) of nodes (p, a) with weights (p, a)."""
    values = -np.einsum("pa,pi->pai", N, normals)
    rows = np.arange(len(nodes))[:, None, None]
    return from_entries(values, rows, dofs_of(nodes), (len(nodes), mesh.n_dofs))


def surface_frame(mesh: TetMesh, points: ArrayLike, *, patch: float = 0.0) -> tuple[Floats, Floats]:
    """Return places (p, 3) in m on the top, and unit normals (p, 3) out of the body there.

    Arguments and errors are those of `probe_operator`.
    """
    nodes, N, normals = _surface_frame(mesh, points, "top", patch)
    return np.einsum("pa,pai->pi", N, mesh.points[nodes]), normals


def _surface_frame(
    mesh: TetMesh, points: ArrayLike, facets: str | Ints, patch: float
) -> tuple[Ints, Floats, Floats]:
    """Return nodes (p, a), shape functions (p, a) and normals (p, 3) of the facets below."""
    nodes = facet_set(mesh, facets)
    points = np.atleast_2d(np.asarray(points, np.float64))
    if points.ndim != 2 or points.shape[1] not in (2, 3) or not np.isfinite(points).all():
        raise ValueError(
            f"points have shape {points.shape}; give finite coordinates of shape (p, 2) or (p, 3)"
        )
    if not len(nodes):
        raise ValueError("the facet set is empty; name another one")
    owner, barycentric = facets_below(mesh.points[nodes], points[:, :2])
    if (outside := owner < 0).any():
        x_mm, y_mm = 1e3 * points[outside][0, :2]
        surface = 1e3 * mesh.points[np.unique(nodes), :2]
        (left, front), (right, back) = surface.min(axis=0), surface.max(axis=0)
        raise ValueError(
            f"point ({x_mm:g}, {y_mm:g}) mm is not on the surface of the body; move it inside the "
            f"outline, which reaches x = {left:.3g} to {right:.3g} mm, y = {front:.3g} to "
            f"{back:.3g} mm"
        )
    N = shape_functions(barycentric, nodes.shape[1])
    if patch:
        places = np.einsum("pa,pai->pi", N, mesh.points[nodes[owner]])
        normals = _mean_normals(mesh, nodes, places, patch)
    else:
        normals = np.cross(*_facet_tangents(mesh, nodes[owner], barycentric))
    return nodes[owner], N, normals / np.linalg.norm(normals, axis=1, keepdims=True)


def _mean_normals(mesh: TetMesh, nodes: Ints, places: Floats, patch: float) -> Floats:
    """Return normals (p, 3) of facets (k, a), averaged by area and distance to places."""
    at, areas = facet_points(mesh, nodes), facet_geometry(mesh.points[nodes])[1].reshape(-1, 3)
    at_once = 2_000_000  # pairs of points and facets
    normals, count = np.empty((len(places), 3)), max(1, at_once // len(at))
    for start in range(0, len(places), count):
        part = slice(start, start + count)
        squared = ((places[part, None] - at) ** 2).sum(axis=2)
        nearest = squared.min(axis=1, keepdims=True)  # counts even if it is beyond the patch
        normals[part] = np.exp((nearest - squared) / (2 * patch**2)) @ areas
    return normals


def _facet_tangents(mesh: TetMesh, nodes: Ints, barycentric: Floats) -> tuple[Floats, Floats]:
    """Return the two edge tangents at one barycentric point (p, 3) of each facet (p, a)."""
    derivatives = shape_derivatives(barycentric, nodes.shape[1])
    tangents = np.einsum("pad,pai->pdi", derivatives, mesh.points[nodes])
    return tangents[:, 0], tangents[:, 1]


def facet_geometry(places: Floats) -> tuple[Floats, Floats]:
    """Return shape functions (q, a), and outward normals (e, q, i) times area and weight, of facets
    with nodes at places (e, a, i).
    """
    barycentric, weights = triangle_rule()
    derivatives = shape_derivatives(barycentric, places.shape[1])
    tangents = np.einsum("qad,eai->eqdi", derivatives, places, optimize=True)
    normals = np.cross(tangents[:, :, 0], tangents[:, :, 1]) / 2
    return shape_functions(barycentric, places.shape[1]), normals * weights[:, None]


def curved_coordinates(elements: Floats, barycentric: Floats, points: Floats) -> Floats:
    """Return barycentric coordinates (p, 4) of points (p, 3) in curved tetrahedra with nodes
    (p, a, 3), by Newton's method from the given ones.
    """
    for _ in range(4):
        miss, tangents = _offsets(elements, barycentric, points)
        step = np.linalg.solve(tangents, miss[:, :, None])[:, :, 0]
        barycentric = barycentric + np.column_stack([-step.sum(axis=1), step])
    return barycentric


def on_surface(mesh: TetMesh, points: Floats) -> Bools:
    """Return a mask (p,) of the points (p, 2) in m that `probe_operator` accepts."""
    return facets_below(mesh.points[facet_set(mesh, "top")], points)[0] >= 0


def facets_below(
    facets: Floats, points: Floats, *, margin: float = 1e-6, tolerance: float = 1e-9
) -> tuple[Ints, Floats]:
    """Return the highest of the facets (k, a, 3) below each point (p, 2), or -1, and the
    barycentric coordinates (p, 3) there.

    Newton's method must end inside a facet, because shape functions extrapolate without bound on a
    facet seen edge-on. It ends within a `tolerance` over the facet's size. Points that are closer
    than a barycentric `margin` outside a facet count as on it.
    """
    point, facet = _candidates(facets[:, :, :2], points, margin)
    barycentric, distance = _facet_coordinates(facets[facet, :, :2], points[point], tolerance)
    is_on = (distance <= tolerance) & (barycentric.min(axis=1) >= -margin)
    point, facet, barycentric = point[is_on], facet[is_on], barycentric[is_on]
    height = np.einsum(
        "ma,ma->m", shape_functions(barycentric, facets.shape[1]), facets[facet, :, 2]
    )
    size = np.ptp(facets[:, :, :2], axis=(0, 1)).max(initial=0.0)
    same_height = 1e-6  # of the surface's extent: facets closer in height are level
    level = np.rint(height / (same_height * size or 1.0))
    # The last is the highest; of neighbours that share an edge, the one the point is deepest in.
    order = np.lexsort((barycentric.min(axis=1), level, point))
    last = order[np.append(np.diff(point[order]) > 0, True)[: len(order)]]
    owner, coordinates = np.full(len(points), -1), np.zeros((len(points), 3))
    # Exactly on an edge: nodes off a clamped edge would add round-off to what stays at rest.
    barycentric = np.where(np.abs(barycentric) < tolerance, 0.0, barycentric)[last]
    owner[point[last]] = facet[last]
    coordinates[point[last]] = barycentric / barycentric.sum(axis=1, keepdims=True)
    return owner, coordinates


def _candidates(facets: Floats, points: Floats, margin: float) -> tuple[Ints, Ints]:
    """Return pairs (m,) of points (p, 2) and facets (k, a, 2) whose bounding boxes contain them."""
    hull = facets.copy()
    if facets.shape[1] == 6:  # the control points of the edges, which bound curved ones
        corners = facets[:, :3]
        hull[:, 3:] = 2 * facets[:, 3:] - (corners + np.roll(corners, -1, axis=1)) / 2
    low, high = hull.min(axis=1), hull.max(axis=1)
    slack = margin * (high - low).max(axis=1, initial=0.0, keepdims=True)
    (left, below), (right, above) = (low - slack).T, (high + slack).T
    order = np.argsort(points[:, 0])  # the points of each box by x are neighbours
    first = np.searchsorted(points[order, 0], left, "left")
    counts = np.searchsorted(points[order, 0], right, "right") - first
    facet = np.repeat(np.arange(len(facets)), counts)
    shift = np.arange(len(facet)) - np.repeat(np.cumsum(counts) - counts, counts)
    point = order[np.repeat(first, counts) + shift]
    y = points[point, 1]
    inside = (below[facet] <= y) & (y <= above[facet])
    point, facet = point[inside], facet[inside]
    by_point = np.lexsort((facet, point))
    return point[by_point], facet[by_point]


def _facet_coordinates(facets: Floats, points: Floats, tolerance: float) -> tuple[Floats, Floats]:
    """Return barycentric coordinates (m, 3) of points in the planes of facets (m, a, 2), and their
    errors (m,) over the sizes of the facets.
    """
    coordinates = np.full((len(points), 3), 1 / 3)
    size = np.ptp(facets, axis=1).max(axis=1, initial=0.0)
    distance, active = np.full(len(points), np.inf), np.arange(len(points))
    newton_steps, newton_reach = 12, 3.0  # it stops after 12 steps, or at a coordinate above 3
    edge_on_area = 1e-9  # of a facet's squared size: the projected area of a facet seen edge-on
    for _ in range(newton_steps):
        miss, tangents = _offsets(facets[active], coordinates[active], points[active])
        distance[active] = np.linalg.norm(miss, axis=1) / size[active]
        (a, b), (c, d) = np.moveaxis(tangents, 0, 2)
        area = a * d - b * c
        edge_on = np.abs(area) < edge_on_area * size[active] ** 2
        distance[active[edge_on]] = np.inf
        going = ~edge_on & (distance[active] > tolerance)
        miss, area = miss[going], area[going]
        second = (d[going] * miss[:, 0] - b[going] * miss[:, 1]) / area
        third = (a[going] * miss[:, 1] - c[going] * miss[:, 0]) / area
        active = active[going]
        coordinates[active] += np.column_stack([-second - third, second, third])
        largest = np.abs(coordinates[active]).max(axis=1, initial=0.0)
        active = active[largest < newton_reach]
        if not len(active):
            break
    return coordinates, distance


def _offsets(elements: Floats, barycentric: Floats, points: Floats) -> tuple[Floats, Floats]:
    """Return vectors (p, i) from places in elements to points, and tangents (p, i, d)."""
    N = shape_functions(barycentric, elements.shape[1])
    derivatives = shape_derivatives(barycentric, elements.shape[1])
    miss = points - np.einsum("pa,pai->pi", N, elements)
    return miss, np.einsum("pad,pai->pid", derivatives, elements)


def straight_coordinates(corners: Floats, point: Floats) -> Floats:
    """Return the barycentric coordinates (e, a) of a point (i,) in straight elements (e, a, i)."""
    first = corners[:, 0]
    edges = (corners[:, 1:] - first[:, None]).swapaxes(1, 2)
    inner = np.linalg.solve(edges, (point - first)[:, :, None])[:, :, 0]
    return np.column_stack([1 - inner.sum(axis=1), inner])


def locate(mesh: TetMesh, points: ArrayLike) -> tuple[Ints, Floats]:
    """Return the element (p,) around each point (p, 3) in m, and its barycentric coordinates
    (p, 4). Raises a ValueError if a point lies outside the body.
    """
    points = np.atleast_2d(np.asarray(points, np.float64))
    owner, barycentric, inside = _elements_at(mesh, points)
    if not inside.all():
        x, y, z = 1e3 * points[~inside][0]
        raise ValueError(f"point ({x:.4g}, {y:.4g}, {z:.4g}) mm is not in the body; move it inside")
    return owner, barycentric


def is_inside(mesh: TetMesh, points: ArrayLike) -> Bools:
    """Return a mask (p,) of the points (p, 3) in m that lie in the body."""
    return _elements_at(mesh, np.atleast_2d(np.asarray(points, np.float64)))[2]


def _elements_at(mesh: TetMesh, points: Floats) -> tuple[Ints, Floats, Bools]:
    """Return the element (p,) and coordinates (p, 4) of each point, and whether it is inside."""
    corners = mesh.points[mesh.tets[:, :4]]
    low, high = corners.min(axis=1), corners.max(axis=1)
    bulge = 0.05  # of an element's size: how far a curved element may extend beyond its corners
    slack = bulge * (high - low).max(axis=1, keepdims=True)
    low, high = low - slack, high + slack
    elements = [_containing(corners, low, high, point) for point in points]
    owner = np.array([element for element, _ in elements])
    barycentric = np.array([coordinates for _, coordinates in elements])
    inside = np.isfinite(barycentric).all(axis=1)
    if mesh.order == 2:
        nodes = mesh.points[mesh.tets[owner[inside]]]
        barycentric[inside] = curved_coordinates(nodes, barycentric[inside], points[inside])
    element_margin = 1e-6  # barycentric: points this close outside all elements count as inside
    bowed_margin = 0.3  # of an element's size: likewise for the straight element of a curved one
    inside[inside] = barycentric[inside].min(axis=1) >= -bowed_margin * bulge - element_margin
    return owner, barycentric, inside


def _containing(corners: Floats, low: Floats, high: Floats, point: Floats) -> tuple[int, Floats]:
    """Return the straight element nearest to a point (3,), and coordinates; nan if none."""
    near = np.flatnonzero(((low <= point) & (point <= high)).all(axis=1))
    if not len(near):
        return 0, np.full(4, np.nan)
    coordinates = straight_coordinates(corners[near], point)
    best = int(coordinates.min(axis=1).argmax())
    return int(near[best]), coordinates[best]


def displacement_operator(mesh: TetMesh, points: ArrayLike) -> sparse.csr_array:
    """Return the displacement operator (3 p, 3 n), component fastest, at points (p, 3) in m inside
    a body. Raises a ValueError if a point lies outside.
    """
    owner, barycentric = locate(mesh, points)
    nodes = mesh.tets[owner]
    N = shape_functions(barycentric, nodes.shape[1])
    rows = dofs_of(np.arange(len(owner)))[:, None]
    return from_entries(N[..., None], rows, dofs_of(nodes), (3 * len(owner), mesh.n_dofs))
