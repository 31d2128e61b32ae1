"""In-plane displacement of a rectangular plate that relieves a strain, by Ritz's method.

    iint (A (e + sym grad (u, v))) : sym grad (du, dv) dA = 0

u and v are products of continuous Legendre polynomials, of one symmetry. They are zero at edges and
clips that hold the plate in its plane. At the other edges the energy makes the traction zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import linalg

from simple_model.plates.modes import Plate, outside_clips
from simple_model.plates.polynomials import LineBasis, continuous_basis, gauss_points
from simple_model.typing import Bools, Floats, Ints

# Whether a supported edge holds the in-plane displacement across and along the edge.
IN_PLANE = {"held": (True, True), "sliding": (True, False), "movable": (False, False)}


@dataclass(frozen=True, kw_only=True, eq=False)
class Grid:
    """Gauss points of a plate and the polynomials on it, along x and along y: `breaks` (e + 1,) in
    m, whether functions are `split` into even and odd, `degrees` (e,) on each piece, and `points`
    and `weights` in m.
    """

    breaks: tuple[Floats, Floats]
    split: tuple[bool, bool]
    degrees: tuple[list[int], list[int]]
    points: tuple[Floats, Floats]
    weights: tuple[Floats, Floats]

    @staticmethod
    def of(breaks: Sequence[Floats], split: Sequence[bool], degrees: Sequence[list[int]]) -> Grid:
        """The grid that integrates products of two polynomials of these degrees exactly. Products
        of functions that are split are even, so that half the points suffice.
        """
        (x, of_x), (y, of_y) = (
            gauss_points(ends, [n + 2 for n in each])
            for ends, each in zip(breaks, degrees, strict=True)
        )
        x, of_x = _half(x, of_x) if split[0] else (x, of_x)
        y, of_y = _half(y, of_y) if split[1] else (y, of_y)
        return Grid(
            breaks=(breaks[0], breaks[1]), split=(split[0], split[1]),
            degrees=(degrees[0], degrees[1]), points=(x, y), weights=(of_x, of_y),
        )  # fmt: skip

    @property
    def areas(self) -> Floats:
        """Areas (x, y) of the points, m2."""
        return np.outer(*self.weights)


def _half(points: Floats, weights: Floats) -> tuple[Floats, Floats]:
    """Points on one side of the middle of a symmetric rule, and weights of even functions there."""
    count = (len(points) + 1) // 2
    doubled = 2 * weights[-count:]
    doubled[0] /= 1 + len(points) % 2
    return points[-count:], doubled


@dataclass(frozen=True, kw_only=True, eq=False)
class InPlane:
    """In-plane displacement for strains of one symmetry.

    Parameters
    ----------
    A : (3, 3) N/m, stress resultants xx, yy, xy of strains xx, yy and 2 xy
    grid : Grid
    u, v : values and slopes of the functions of each component along x and along y
    free : (n,) products of functions that no clip holds
    factor : Cholesky factor of their stiffness
    """

    A: Floats
    grid: Grid
    u: tuple[_Line, _Line]
    v: tuple[_Line, _Line]
    free: Ints
    factor: Any

    @staticmethod
    def of(plate: Plate, A: Floats, grid: Grid, odd: tuple[int, int], in_plane: str) -> InPlane:
        """The problem of a plate with stiffness A (3, 3) in N/m and edges as in `IN_PLANE`. If
        functions are split, `odd` states the symmetry of the strain xx along x and y.
        """
        u, v = (
            tuple(
                _Line.of(grid, axis, _functions(plate, grid, axis, component, odd[axis], in_plane))
                for axis in (0, 1)
            )
            for component in (0, 1)
        )
        K = np.block([
            [_stiffness(u, A[0, 0], A[2, 2]), _coupling(u, v, A)],
            [_coupling(u, v, A).T, _stiffness(v, A[2, 2], A[1, 1])],
        ])  # fmt: skip
        M = linalg.block_diag(*(np.kron(x.basis.mass, y.basis.mass) for x, y in (u, v)))
        free = np.flatnonzero(np.concatenate([_free_of_clips(plate, *lines) for lines in (u, v)]))
        K, M = K[np.ix_(free, free)], M[np.ix_(free, free)]
        factor = None
        shift = 1e-10  # of the mean stiffness, so that a plate without support can be solved
        if len(free):
            factor = linalg.cho_factor(K + shift * np.trace(K) / np.trace(M) * M)
        return InPlane(A=A, grid=grid, u=(u[0], u[1]), v=(v[0], v[1]), free=free, factor=factor)

    def incompatible(self, strains: Floats) -> Floats:
        """Strains (3, p, x, y) minus those of the in-plane displacement that relieves them."""
        if not len(self.free):
            return strains
        xx, yy, xy = np.tensordot(self.A, strains, axes=1) * self.grid.areas
        (ux, uy), (vx, vy) = self.u, self.v
        gathers = "xi,yj,pxy->ijp"
        of_u = _sum(gathers, (ux.slopes, uy.values, xx), (ux.values, uy.slopes, xy))
        of_v = _sum(gathers, (vx.values, vy.slopes, yy), (vx.slopes, vy.values, xy))
        forces = np.concatenate([f.reshape(-1, f.shape[2]) for f in (of_u, of_v)])
        moved = np.zeros_like(forces)
        moved[self.free] = -linalg.cho_solve(self.factor, forces[self.free])
        size = of_u.shape[0] * of_u.shape[1]
        u, v = moved[:size].reshape(of_u.shape), moved[size:].reshape(of_v.shape)
        moves = "xi,yj,ijp->pxy"
        return strains + np.stack([
            _sum(moves, (ux.slopes, uy.values, u)), _sum(moves, (vx.values, vy.slopes, v)),
            _sum(moves, (ux.values, uy.slopes, u), (vx.slopes, vy.values, v)),
        ])  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class _Line:
    """Functions along x or y: values and slopes (points, i) on the grid; its weights (points,)."""

    basis: LineBasis
    values: Floats
    slopes: Floats
    weights: Floats

    @staticmethod
    def of(grid: Grid, axis: int, basis: LineBasis) -> _Line:
        at = grid.points[axis]
        return _Line(
            basis=basis, values=basis(at), slopes=basis.slopes(at), weights=grid.weights[axis]
        )


def _functions(
    plate: Plate, grid: Grid, axis: int, component: int, odd: int, in_plane: str
) -> LineBasis:
    names = (("left", "right"), ("front", "back"))[axis]
    holds = IN_PLANE[in_plane][axis != component]
    ends = ["simply" if holds and getattr(plate, name) != "free" else "free" for name in names]
    lines = continuous_basis(grid.breaks[axis], ends, grid.degrees[axis], grid.split[axis])
    # An even strain xx has a u that is odd along x and even along y.
    return lines[odd ^ (axis == component)] if len(lines) == 2 else lines[0]


def _free_of_clips(plate: Plate, x: _Line, y: _Line) -> Bools:
    """Products (n,) that no clip holds; a clip without a radius holds none."""
    if not (plate.clips and plate.clip_radius):
        return np.ones(x.basis.size * y.basis.size, bool)
    return outside_clips(plate, x.basis, y.basis)


def _stiffness(lines: Sequence[_Line], along_x: float, along_y: float) -> Floats:
    x, y = (line.basis for line in lines)
    return np.asarray(along_x * np.kron(x.slope, y.mass) + along_y * np.kron(x.mass, y.slope))


def _coupling(u: Sequence[_Line], v: Sequence[_Line], A: Floats) -> Floats:
    """Stiffness (u, v) of Poisson's contraction and of shear."""
    poisson, shear = (
        np.kron(_integral(u[0], v[0], flipped), _integral(u[1], v[1], not flipped))
        for flipped in (False, True)
    )
    return np.asarray(A[0, 1] * poisson + A[2, 2] * shear)


def _integral(first: _Line, second: _Line, flipped: bool) -> Floats:
    """Integrals (i, j) of the slopes of `first` with the values of `second`, or `flipped`."""
    a, b = (first.values, second.slopes) if flipped else (first.slopes, second.values)
    return np.asarray((a * first.weights[:, None]).T @ b)


def _sum(subscripts: str, *operands: tuple[Floats, Floats, Floats]) -> Floats:
    return np.asarray(sum(np.einsum(subscripts, *each, optimize=True) for each in operands))
