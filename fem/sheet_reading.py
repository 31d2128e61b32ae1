"""Displacement and strain at points of a thin sheet, from the middle plane of its mesh.

The mesh is thicker than the sheet and has the same bending stiffness; only its middle plane moves
like the sheet. By Kirchhoff's kinematics, at a height z above that plane,

    u_a(z) = u_a - z w,a,   E_ab(z) = (u_a,b + u_b,a + u_i,a u_i,b) / 2 - z w,ab,

and E_zz = -nu / (1 - nu) (E_xx + E_yy) in plane stress, without transverse shear. E is the strain
of Green and Lagrange. Slopes and curvatures are those of polynomials fitted to the derivatives at
the quadrature points around a point, as in `stress`.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from fem.finite_strain import Membrane, Part, membrane_part
from fem.load_and_probe import straight_coordinates
from fem.sparsity import from_entries
from fem.stress import fitted_polynomial
from meshes import TetMesh
from meshes.elements import shape_functions, triangle_rule
from simple_model.typing import Floats, Ints

PAIRS = ((0, 0), (1, 1), (0, 1))  # xx, yy, xy


@dataclass(frozen=True, kw_only=True, eq=False)
class SheetReading:
    """Operators that read p points of a sheet from the n nodes of its mesh: the `value` (p, n) of a
    nodal field, its `slopes` (p, n) along x and y, and its `curvatures` (p, n) xx, yy and xy. `fit`
    (p, e q) maps values at the quadrature points of the `part` to the points.
    """

    part: Part
    value: sparse.csr_array
    slopes: tuple[sparse.csr_array, ...]
    curvatures: tuple[sparse.csr_array, ...]
    fit: sparse.csr_array


def sheet_reading(mesh: TetMesh, membrane: Membrane, points: ArrayLike) -> SheetReading:
    """Return operators that read the middle plane of a meshed sheet, a `Membrane`, at points (p, 2)
    in m. Raises a ValueError if a point lies off the sheet.
    """
    points = np.atleast_2d(np.asarray(points, np.float64))
    part = membrane_part(mesh, membrane)
    owner, inner = _locate(mesh.points[:, :2], part.nodes, points)
    N = shape_functions(inner, part.nodes.shape[1])
    rows, shape = np.arange(len(points))[:, None], (len(points), len(mesh.points))
    value = from_entries(N, rows, part.nodes[owner], shape)
    fit, along_x, along_y = _fits(mesh.points[:, :2], part, owner, points)
    D = part.D[0::2], part.D[1::2]
    mixed = (along_y @ D[0] + along_x @ D[1]) / 2
    return SheetReading(
        part=part, value=value, slopes=(fit @ D[0], fit @ D[1]),
        curvatures=(along_x @ D[0], along_y @ D[1], mixed), fit=fit,
    )  # fmt: skip


def displacement_rows(reading: SheetReading, heights: Floats) -> sparse.csr_array:
    """Return the displacement operator (3 p, 3 n) of bending at heights (p,) in m above the middle
    plane, without in-plane motion of that plane.
    """
    z, nothing = sparse.diags_array(heights), sparse.csr_array(reading.value.shape)
    x, y = (-(z @ slope) for slope in reading.slopes)
    bent = [[nothing, nothing, part] for part in (x, y, reading.value)]
    return _by_point(bent)


def strain_rows(reading: SheetReading, heights: Floats, poisson: float) -> sparse.csr_array:
    """Return the strain operator (6 p, 3 n) in 1/m of bending at heights (p,) in m above the middle
    plane; components xx, yy, zz, xy, xz, yz fastest.
    """
    z, nothing = sparse.diags_array(heights), sparse.csr_array(reading.value.shape)
    bent = _by_point([[nothing, nothing, -(z @ part)] for part in reading.curvatures])
    each = sparse.eye_array(len(heights))
    return (sparse.kron(each, from_plane(poisson), format="csr") @ bent).tocsr()


def from_plane(poisson: float) -> Floats:
    """Return the matrix (6, 3) of all strain components per xx, yy and xy in plane stress."""
    matrix = np.zeros((6, 3))
    matrix[[0, 1, 3], [0, 1, 2]] = 1.0
    matrix[2, :2] = -poisson / (1 - poisson)
    return matrix


def quadratic_strain_at(reading: SheetReading, u: Floats) -> Floats:
    """Return the quadratic part u_i,a u_i,b / 2 (p, 3) of the strains xx, yy and xy of the middle
    plane at a displacement u (3 n,) in m.
    """
    slopes = (reading.part.D @ u.reshape(-1, 3)).reshape(-1, 2, 3)
    return reading.fit @ np.stack(
        [(slopes[:, a] * slopes[:, b]).sum(axis=1) / 2 for a, b in PAIRS], axis=1
    )


def modal_slopes(part: Part, basis: Floats) -> Floats:
    """Return slopes (e, q, 2, m) of the normal displacement at the quadrature points."""
    w = basis.reshape(-1, 3, basis.shape[1])[:, 2]
    return np.asarray((part.D @ w).reshape(*part.G.shape[:3], -1))


def modal_quadratic_strain(reading: SheetReading, basis: Floats) -> Floats:
    """Return Q (p, 3, m, m) with w,a w,b / 2 = z^T Q z / 2 at the points, for xx, yy and xy and a
    normal displacement w in coordinates z of a basis (3 n, m).
    """
    slopes = modal_slopes(reading.part, basis).reshape(-1, 2, basis.shape[1])
    matrices = np.empty((reading.fit.shape[0], 3, *(slopes.shape[2:] * 2)))
    for p in range(len(matrices)):
        row = reading.fit[[p]].tocoo()
        near, weights = slopes[row.col], row.data[:, None, None]
        for c, (a, b) in enumerate(PAIRS):
            product = np.einsum("qm,qn->mn", (weights * near)[:, a], near[:, b])
            matrices[p, c] = (product + product.T) / 2
    return matrices


def in_plane_rows(reading: SheetReading) -> tuple[sparse.csr_array, sparse.csr_array]:
    """Return displacement (2 p, 3 n) and strain xx, yy, xy (3 p, 3 n) in the middle plane."""
    nothing, N = sparse.csr_array(reading.value.shape), reading.value
    x, y = reading.slopes
    moved = _by_point([[N, nothing, nothing], [nothing, N, nothing]])
    strained = _by_point([[x, nothing, nothing], [nothing, y, nothing], [y / 2, x / 2, nothing]])
    return moved, strained


def _by_point(blocks: list[list[sparse.csr_array]]) -> sparse.csr_array:
    """Stack blocks (p, n) by output and displacement component to (c p, 3 n)."""
    rows, (p, n) = len(blocks), blocks[0][0].shape
    whole = sparse.block_array(blocks, format="csr")
    by_point = np.arange(rows * p).reshape(rows, p).T.ravel()
    by_node = np.arange(3 * n).reshape(3, n).T.ravel()
    return whole[by_point][:, by_node].tocsr()


def _locate(places: Floats, triangles: Ints, points: Floats) -> tuple[Ints, Floats]:
    """Return the triangle (p,) of each point, and its barycentric coordinates (p, 3)."""
    corners = places[triangles[:, :3]]
    owner, inner = np.empty(len(points), np.int64), np.empty((len(points), 3))
    edge_margin = 1e-9  # barycentric: points this close outside all triangles are on the sheet
    for p, point in enumerate(points):
        coordinates = straight_coordinates(corners, point)
        owner[p] = coordinates.min(axis=1).argmax()
        inner[p] = coordinates[owner[p]]
        if inner[p].min() < -edge_margin:
            x, y = 1e3 * point
            raise ValueError(f"point ({x:g}, {y:g}) mm is off the sheet; move it inside")
    return owner, inner


def _fits(
    places: Floats, part: Part, owner: Ints, points: Floats
) -> tuple[sparse.csr_array, sparse.csr_array, sparse.csr_array]:
    """Return the value (p, e q) at each point and its derivatives along x and y of the polynomial
    fitted to values at the quadrature points of the triangles around it.
    """
    barycentric, _ = triangle_rule(2)
    N = shape_functions(barycentric, part.nodes.shape[1])
    samples = np.einsum("qa,eai->eqi", N, places[part.nodes])
    many, corners = samples.shape[1], part.nodes[:, :3]
    rows, columns, fits = [], [], []
    for p, point in enumerate(points):
        core = np.isin(corners, corners[owner[p]]).any(axis=1)
        patch = np.flatnonzero(np.isin(corners, corners[core]).any(axis=1))
        size = np.ptp(places[corners[patch]], axis=1).mean()
        away = ((samples[patch] - point) / size).reshape(-1, 2)
        fit, _ = fitted_polynomial(away)
        fits.append(fit[:3] / np.array([[1.0], [size], [size]]))
        columns.append((many * patch[:, None] + np.arange(many)).ravel())
        rows.append(np.full(len(columns[-1]), p))
    at, shape = (np.concatenate(rows), np.concatenate(columns)), (len(points), samples[..., 0].size)
    values = np.concatenate(fits, axis=1)
    fit, along_x, along_y = (from_entries(each, *at, shape) for each in values)
    return fit, along_x, along_y
