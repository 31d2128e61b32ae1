"""Edge lengths that spread the error of a tetrahedral mesh evenly over its elements.

Of an error density C(x) h^r that elements leave, edge lengths h ~ C^(-1 / (r + 3)) leave the least
error, int C h^r dV, for their number, int 6 sqrt(2) h^-3 dV of regular tetrahedra. The greatest
lengths below them that grow by a slope of s at most are min over y of h(y) + s |x - y|.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from meshes.shapes.equidistributed import LEAST, ORDER, Lines
from meshes.tetmesh import Floats, Ints, TetMesh, corner_volumes

REGULAR = 6 * np.sqrt(2)  # cubes of the edge of a regular tetrahedron in its volume
AVERAGED = 2  # times that an error density is, over neighbours: those of single elements scatter
GRID_CELLS = 48  # of the grid of a size field, along its longest side
STEPS = 10  # towards an error: each is off by less than what limits of the sizes take from it
PAD = 0.05  # of its longest side, around what is meshed
BLOCK = 1000  # points whose distances from all others are held at a time


@dataclass(frozen=True, kw_only=True, eq=False)
class ErrorDensity:
    """Error density of a mesh at its corner nodes, `points` (n, 3) in metre: elements of an edge
    length h leave `density` (n,) h^`order` per volume. Its elements have the nodes `corners` (e, 4)
    and the `volumes` (e,).
    """

    points: Floats
    density: Floats
    corners: Ints
    volumes: Floats
    order: float = ORDER

    def error(self, sizes: Floats) -> float:
        """Error that elements of sizes (n,) in metre leave, in the unit of the elements' own."""
        return self._integral(self.density * sizes**self.order)

    def elements(self, sizes: Floats) -> float:
        """Number of regular tetrahedra of sizes (n,) in metre."""
        return float(REGULAR * self._integral(sizes**-3.0))

    def _integral(self, values: Floats) -> float:
        return float(values[self.corners].mean(axis=1) @ self.volumes)


@dataclass(frozen=True, kw_only=True, eq=False)
class SizeField:
    """Edge lengths `sizes` (n_x, n_y, n_z) in metre on three grid `lines` (n_a,) in metre, and
    trilinear between them.
    """

    lines: Lines
    sizes: Floats

    def __call__(self, points: Floats) -> Floats:
        """Edge lengths (n,) in metre at points (n, 3) in metre."""
        from scipy.interpolate import RegularGridInterpolator

        low, high = ([line[end] for line in self.lines] for end in (0, -1))
        between = RegularGridInterpolator(self.lines, self.sizes)
        return np.asarray(between(np.clip(points, low, high)))


def error_density(mesh: TetMesh, error: Floats, *, order: float = ORDER) -> ErrorDensity:
    """Error density of a mesh by what its elements leave, averaged over neighbours.

    Parameters
    ----------
    mesh : TetMesh
    error : (e,) float, that each of its elements leaves, in any unit
    order : float, r, of convergence

    Returns
    -------
    ErrorDensity
    """
    used, corners = np.unique(mesh.tets[:, :4], return_inverse=True)
    corners = corners.reshape(-1, 4)
    volumes = corner_volumes(mesh.points, mesh.tets)
    around = np.bincount(corners.ravel())

    def at_nodes(values: Floats) -> Floats:
        return np.bincount(corners.ravel(), np.repeat(values, 4)) / around

    # Both parts of the quotient, so that large errors and large elements count as such.
    left, of_one = error, volumes * (REGULAR * volumes) ** (order / 3)
    for _ in range(AVERAGED - 1):
        left, of_one = (at_nodes(part)[corners].mean(axis=1) for part in (left, of_one))
    density = at_nodes(left) / at_nodes(of_one)
    return ErrorDensity(
        points=mesh.points[used], density=np.maximum(density, LEAST * density.max()),
        corners=corners, volumes=volumes, order=order,
    )  # fmt: skip


def equidistributed_sizes(
    known: ErrorDensity,
    error: float,
    *,
    slope: float,
    coarsest: Floats | float = np.inf,
    most: float = np.inf,
) -> Floats:
    """Edge lengths of the fewest elements that leave an error.

    Parameters
    ----------
    known : ErrorDensity
    error : float, in the unit of the density's
    coarsest : (n,) float, metre, largest at each node
    slope : float, of an edge length along the way, at most
    most : float, number of elements, above which they leave more than the error

    Returns
    -------
    (n,) float, metre, at the nodes
    """
    wanted = known.density ** (-1 / (known.order + 3))
    factor = (error / known.error(wanted)) ** (1 / known.order)
    for _ in range(STEPS):
        sizes = _limited(known.points, np.minimum(factor * wanted, coarsest), known.points, slope)
        factor *= max(
            (error / known.error(sizes)) ** (1 / known.order),
            (known.elements(sizes) / most) ** (1 / 3),
        )
    return sizes


def size_field(points: Floats, sizes: Floats, slope: float) -> SizeField:
    """Size field around points, which grows away from them.

    Parameters
    ----------
    points : (n, 3) float, metre
    sizes : (n,) float, metre, edge lengths there
    slope : float, of an edge length along the way

    Returns
    -------
    SizeField, on a grid that reaches beyond them as far as that of `tetrahedralise`
    """
    low, high = points.min(axis=0), points.max(axis=0)
    longest = (high - low).max()
    cells = np.maximum(2, np.ceil(GRID_CELLS * (high - low) / longest)).astype(int)
    ends = zip(low - PAD * longest, high + PAD * longest, cells, strict=True)
    x, y, z = (np.linspace(a, b, n + 1) for a, b, n in ends)
    grid = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1)
    found = _limited(points, sizes, grid.reshape(-1, 3), slope)
    return SizeField(lines=(x, y, z), sizes=found.reshape(grid.shape[:3]))


def _limited(points: Floats, sizes: Floats, at: Floats, slope: float) -> Floats:
    """Greatest lengths (k,) in metre at places (k, 3) that are nowhere above the sizes (n,) at
    points (n, 3) and grow by a slope away from them.
    """
    from scipy.spatial.distance import cdist

    blocks = np.array_split(at, -(-len(at) // BLOCK))
    return np.concatenate([(sizes + slope * cdist(x, points)).min(axis=1) for x in blocks])
