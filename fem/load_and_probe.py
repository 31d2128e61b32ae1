"""Load and probe operators on the surface of a body, and points inside it.

nodal forces = P q at the facets' quadrature points,  displacement into the body = S u
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from fem.elements import shape_derivatives, shape_functions, triangle_rule
from fem.typing import Bools, Floats, Ints
from meshes import TetMesh, facet_set

BESIDE = 1e-6  # barycentric: how far outside a facet a point still counts as on it
CLOSE = 1e-9  # of a facet's size: Newton's method has found a point
MOST_STEPS, FURTHEST = 12, 3.0  # of Newton's method, and how far outside a facet it is followed
EDGE_ON = 1e-9  # of a facet's squared size: the area of one that is seen edge-on
SAME_HEIGHT = 1e-6  # of the surface's extent: neighbours meet at one height
AT_ONCE = 2_000_000  # pairs of points and facets
OUTSIDE = 1e-6  # barycentric: how far outside all elements a point still counts as in the body
BOWED = 0.3  # of an element's size: the same where the straight element stands for a curved one
REACH = 0.05  # of an element's size, by which a curved element may reach beyond its corners
NODES = np.vstack([np.eye(3), [[0.5, 0.5, 0], [0, 0.5, 0.5], [0.5, 0, 0.5]]])  # of a facet


def load_operator(mesh: TetMesh, facets: str | Ints = "top") -> sparse.csr_array:
    """Load operator P (3 n, k q): nodal forces in N of pressures in Pa at `facet_points`.

    Pressure pushes into the body, against the outward normal.
    """
    N, normals = facet_geometry(mesh, facet_set(mesh, facets))
    return _forces(mesh, facets, -np.einsum("qa,eqi->eaiq", N, normals))


def traction_operator(
    mesh: TetMesh, tractions: Floats, facets: str | Ints = "top"
) -> sparse.csr_array:
    """Load operator (3 n, k q) of tractions: nodal forces int N_a t dA in N of the traction vectors
    (k q, 3) of unit values at the `facet_points`.
    """
    N, normals = facet_geometry(mesh, facet_set(mesh, facets))
    area = np.linalg.norm(normals, axis=2)
    at_points = tractions.reshape(*area.shape, 3)
    return _forces(mesh, facets, np.einsum("eq,qa,eqi->eaiq", area, N, at_points))


def _forces(mesh: TetMesh, facets: str | Ints, values: Floats) -> sparse.csr_array:
    """Load operator (3 n, e q) of nodal forces (e, a, i, q) of unit values."""
    nodes, (k, _, _, q) = facet_set(mesh, facets), values.shape
    rows = (3 * nodes[:, :, None, None] + np.arange(3)[:, None]).repeat(q, axis=3)
    columns = np.broadcast_to(np.arange(k * q).reshape(k, 1, 1, q), rows.shape)
    shape = (mesh.n_dofs, k * q)
    return sparse.csr_array((values.ravel(), (rows.ravel(), columns.ravel())), shape=shape)


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

    A point is projected along z onto the highest of the facets. Positive is the direction of a
    pressure, against the normal of the facet or, next to a crease, where that depends on the mesh,
    against the mean normal of a patch.

    Parameters
    ----------
    mesh : TetMesh
    points : (p, 2 or 3) float, metre
    facets : a facet set's name or nodes (e, a)
    patch : metre, standard deviation of the Gaussian that weights the normals about a point, or 0

    Returns
    -------
    (p, 3 n) sparse, without unit

    Raises
    ------
    ValueError
        If a point lies outside the facets, or has no finite coordinates.
    """
    return _inwards(mesh, *_surface_frame(mesh, points, facets, patch))


def node_operator(
    mesh: TetMesh, facets: str | Ints = "top", *, patch: float = 0.0
) -> tuple[Ints, sparse.csr_array]:
    """Nodes (s,) of a surface in ascending order, and the operator (s, 3 n) of their displacement
    into the body, against the mean normal of the facets at each, or of a patch as for
    `probe_operator`.
    """
    nodes = facet_set(mesh, facets)
    surface, local = np.unique(nodes, return_inverse=True)
    if patch:
        normals = _mean_normals(mesh, nodes, mesh.points[surface], patch)
    else:
        normals, own = np.zeros((len(surface), 3)), local.reshape(nodes.shape)
        for number, at in enumerate(NODES[: nodes.shape[1]]):
            here = np.broadcast_to(at, (len(nodes), 3))
            np.add.at(normals, own[:, number], np.cross(*_facet_tangents(mesh, nodes, here)))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return surface, _inwards(mesh, surface[:, None], np.ones((len(surface), 1)), normals)


def _inwards(mesh: TetMesh, nodes: Ints, N: Floats, normals: Floats) -> sparse.csr_array:
    """Displacement against normals (p, 3), of nodes (p, a) with weights (p, a)."""
    values = -np.einsum("pa,pi->pai", N, normals)
    columns = 3 * nodes[:, :, None] + np.arange(3)
    rows = np.broadcast_to(np.arange(len(nodes))[:, None, None], columns.shape)
    shape = (len(nodes), mesh.n_dofs)
    return sparse.csr_array((values.ravel(), (rows.ravel(), columns.ravel())), shape=shape)


def surface_frame(
    mesh: TetMesh, points: ArrayLike, facets: str | Ints = "top", *, patch: float = 0.0
) -> tuple[Floats, Floats]:
    """Places (p, 3) in metre on a surface, and unit normals (p, 3) out of the body there; arguments
    and errors are those of `probe_operator`.
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
    owner, barycentric = _seen(mesh.points[nodes], points[:, :2])
    if (beside := owner < 0).any():
        x_mm, y_mm = 1e3 * points[beside][0, :2]
        raise ValueError(
            f"point ({x_mm:g}, {y_mm:g}) mm is not on the surface of the body; move it inside"
        )
    N = shape_functions(barycentric, nodes.shape[1])
    if patch:
        places = np.einsum("pa,pai->pi", N, mesh.points[nodes[owner]])
        normals = _mean_normals(mesh, nodes, places, patch)
    else:
        normals = np.cross(*_facet_tangents(mesh, nodes[owner], barycentric))
    return nodes[owner], N, normals / np.linalg.norm(normals, axis=1, keepdims=True)


def _mean_normals(mesh: TetMesh, nodes: Ints, places: Floats, patch: float) -> Floats:
    """Mean normals (p, 3) of facets (k, a) about places (p, 3), weighted by area and distance."""
    at, areas = facet_points(mesh, nodes), facet_geometry(mesh, nodes)[1].reshape(-1, 3)
    found, count = np.empty((len(places), 3)), max(1, AT_ONCE // len(at))
    for start in range(0, len(places), count):
        part = slice(start, start + count)
        squared = ((places[part, None] - at) ** 2).sum(axis=2)
        nearest = squared.min(axis=1, keepdims=True)  # of facets larger than the patch one is left
        found[part] = np.exp((nearest - squared) / (2 * patch**2)) @ areas
    return found


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
    """Barycentric coordinates (p, 4) of points (p, 3) in curved tetrahedra with nodes (p, a, 3), by
    Newton's method from others.
    """
    for _ in range(4):
        miss, tangents = _missed(elements, barycentric, points)
        step = np.linalg.solve(tangents, miss[:, :, None])[:, :, 0]
        barycentric = barycentric + np.column_stack([-step.sum(axis=1), step])
    return barycentric


def on_surface(mesh: TetMesh, points: Floats, facets: str | Ints = "top") -> Bools:
    """Mask (p,) of the points (p, 2) in metre at which `probe_operator` can read."""
    return _seen(mesh.points[facet_set(mesh, facets)], points)[0] >= 0


def _seen(facets: Floats, points: Floats) -> tuple[Ints, Floats]:
    """Highest of the facets (k, a, 3) at each of the points (p, 2), seen along z, -1 where there is
    none, and the barycentric coordinates (p, 3) there: a point is on a facet only if Newton's
    method ends inside of it, as shape functions extrapolate without bound on a facet that is seen
    edge-on.
    """
    who, which = _near(facets[:, :, :2], points)
    barycentric, found = _within(facets[which, :, :2], points[who])
    who, which, barycentric = who[found], which[found], barycentric[found]
    height = np.einsum(
        "ma,ma->m", shape_functions(barycentric, facets.shape[1]), facets[which, :, 2]
    )
    size = np.ptp(facets[:, :, :2], axis=(0, 1)).max(initial=0.0)
    level = np.rint(height / (SAME_HEIGHT * size or 1.0))
    # Last is the highest; of neighbours that share an edge, the one that it is deepest inside.
    order = np.lexsort((barycentric.min(axis=1), level, who))
    last = order[np.append(np.diff(who[order]) > 0, True)[: len(order)]]
    owner, coordinates = np.full(len(points), -1), np.zeros((len(points), 3))
    # On an edge exactly: nodes off a clamped one would add round-off to what stays at rest.
    barycentric = np.where(np.abs(barycentric) < CLOSE, 0.0, barycentric)[last]
    owner[who[last]] = which[last]
    coordinates[who[last]] = barycentric / barycentric.sum(axis=1, keepdims=True)
    return owner, coordinates


def _near(facets: Floats, points: Floats) -> tuple[Ints, Ints]:
    """Pairs (m,) of points (p, 2) and facets (k, a, 2) whose bounding boxes they lie in."""
    hull = facets.copy()
    if facets.shape[1] == 6:  # the control points of their edges, between which curves stay
        corners = facets[:, :3]
        hull[:, 3:] = 2 * facets[:, 3:] - (corners + np.roll(corners, -1, axis=1)) / 2
    low, high = hull.min(axis=1), hull.max(axis=1)
    slack = BESIDE * (high - low).max(axis=1, initial=0.0, keepdims=True)
    (left, below), (right, above) = (low - slack).T, (high + slack).T
    who, which = [np.zeros(0, np.intp)], [np.zeros(0, np.intp)]
    count = max(1, AT_ONCE // max(len(facets), 1))
    for start in range(0, len(points), count):
        x, y = points[start : start + count].T[:, :, None]
        pairs = np.nonzero((left <= x) & (x <= right) & (below <= y) & (y <= above))
        who.append(pairs[0] + start)
        which.append(pairs[1])
    return np.concatenate(who), np.concatenate(which)


def _within(facets: Floats, points: Floats) -> tuple[Floats, Bools]:
    """Barycentric coordinates (m, 3) of points (m, 2) on facets (m, a, 2), and whether each is on
    its facet.
    """
    found = np.full((len(points), 3), 1 / 3)
    size = np.ptp(facets, axis=1).max(axis=1, initial=0.0)
    missed, active = np.full(len(points), np.inf), np.arange(len(points))
    for _ in range(MOST_STEPS):
        miss, tangents = _missed(facets[active], found[active], points[active])
        missed[active] = np.linalg.norm(miss, axis=1) / size[active]
        (a, b), (c, d) = np.moveaxis(tangents, 0, 2)
        area = a * d - b * c
        standing = np.abs(area) < EDGE_ON * size[active] ** 2
        missed[active[standing]] = np.inf  # seen edge-on there
        going = ~standing & (missed[active] > CLOSE)
        miss, area = miss[going], area[going]
        second = (d[going] * miss[:, 0] - b[going] * miss[:, 1]) / area
        third = (a[going] * miss[:, 1] - c[going] * miss[:, 0]) / area
        active = active[going]
        found[active] += np.column_stack([-second - third, second, third])
        active = active[np.abs(found[active]).max(axis=1, initial=0.0) < FURTHEST]
        if not len(active):
            break
    return found, (missed <= CLOSE) & (found.min(axis=1) >= -BESIDE)


def _missed(elements: Floats, barycentric: Floats, points: Floats) -> tuple[Floats, Floats]:
    """Vectors (p, i) from places in elements (p, a, i) to points (p, i), and tangents (p, i, d)."""
    N = shape_functions(barycentric, elements.shape[1])
    derivatives = shape_derivatives(barycentric, elements.shape[1])
    miss = points - np.einsum("pa,pai->pi", N, elements)
    return miss, np.einsum("pad,pai->pid", derivatives, elements)


def locate(mesh: TetMesh, points: ArrayLike) -> tuple[Ints, Floats]:
    """Element (p,) that each point (p, 3) in metre lies in, and its barycentric coordinates (p, 4).
    A point outside the body raises a ValueError.
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
    """The straight element that a point (3,) is in, or the least outside of those near it, and its
    coordinates, which are nan if none is near.
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
    """Displacement operator (3 p, 3 n), component fastest, at points (p, 3) in metre inside a body.
    A point outside raises a ValueError.
    """
    owner, barycentric = locate(mesh, points)
    nodes = mesh.tets[owner]
    N = shape_functions(barycentric, nodes.shape[1])
    rows, component = np.arange(len(owner))[:, None, None], np.arange(3)
    columns = 3 * nodes[:, :, None] + component
    values = np.broadcast_to(N[:, :, None], columns.shape).ravel()
    places = np.broadcast_to(3 * rows + component, columns.shape).ravel(), columns.ravel()
    return sparse.csr_array((values, places), shape=(3 * len(owner), mesh.n_dofs))
