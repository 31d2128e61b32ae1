"""In-plane displacement of a rectangular plate that relieves a strain, by Ritz's method.

    iint (A (e + sym grad (u, v))) : sym grad (du, dv) dA = 0

u and v are products of continuous Legendre polynomials, of one symmetry. They are zero at edges and
clips that hold the plate in its plane. At the other edges the energy makes the traction zero.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from simple_model.plates.modes import Plate, outside_clips
from simple_model.plates.polynomials import LineBasis, gauss_points, piecewise_basis
from simple_model.typing import Floats

# Whether a supported edge holds the in-plane displacement across and along the edge.
IN_PLANE = {"held": (True, True), "sliding": (True, False), "movable": (False, False)}


@dataclass(frozen=True, kw_only=True, eq=False)
class Grid:
    """Gauss points of a plate and the polynomials on it, along x and along y: `breaks` (e + 1,) in
    m, whether functions are `split` into even and odd, `degrees` (e,) on each piece, and `points`
    and `weights` in m.
    """

    breaks: Sequence[Floats]
    split: Sequence[bool]
    degrees: Sequence[list[int]]
    points: Sequence[Floats]
    weights: Sequence[Floats]

    @property
    def areas(self) -> Floats:
        """Areas (x, y) of the points, m2."""
        return np.outer(*self.weights)


def exact_grid(
    breaks: Sequence[Floats], split: Sequence[bool], degrees: Sequence[list[int]]
) -> Grid:
    """Return the grid that integrates products of two polynomials of these degrees exactly."""
    points, weights = [], []
    for ends, is_split, each in zip(breaks, split, degrees, strict=True):
        at, weight = gauss_points(ends, [n + 2 for n in each])
        if is_split:  # products are even, so half the points are enough
            is_odd, half = len(at) % 2, len(at) // 2
            at, weight = at[half:], 2 * weight[half:]
            weight[0] /= 1 + is_odd
        points.append(at)
        weights.append(weight)
    return Grid(breaks=breaks, split=split, degrees=degrees, points=points, weights=weights)


def in_plane_relief(
    plate: Plate, A: Floats, grid: Grid, odd: Sequence[int], in_plane: str, shift: float = 1e-10
) -> Callable[[Floats], Floats]:
    """Return the function that subtracts from strains (3, p, x, y), xx, yy and 2 xy, those of the
    in-plane displacement that relieves them.

    `A` (3, 3) in N/m is the stiffness of the plate to these strains, `in_plane` a key of
    `IN_PLANE`. If functions are split, `odd` states the symmetry of the strain xx along x and y. A
    `shift` of the stiffness by a fraction of its mean permits a plate without support.
    """
    u, v = (
        [_Line.of(plate, grid, axis, component, odd[axis], in_plane) for axis in (0, 1)]
        for component in (0, 1)
    )
    K = np.block([
        [_stiffness(u, A[0, 0], A[2, 2]), _coupling(u, v, A)],
        [_coupling(u, v, A).T, _stiffness(v, A[2, 2], A[1, 1])],
    ])  # fmt: skip
    M = linalg.block_diag(*(np.kron(x.basis.mass, y.basis.mass) for x, y in (u, v)))
    free = np.arange(len(K))
    if plate.clips and plate.clip_radius:  # a clip without a radius holds no in-plane motion
        outside = [outside_clips(plate, x.basis, y.basis) for x, y in (u, v)]
        free = np.flatnonzero(np.concatenate(outside))
    if not len(free):
        return lambda strains: strains
    K, M = K[np.ix_(free, free)], M[np.ix_(free, free)]
    factor = linalg.cho_factor(K + shift * np.trace(K) / np.trace(M) * M)
    (ux, uy), (vx, vy) = u, v

    def relieve(strains: Floats) -> Floats:
        xx, yy, xy = np.tensordot(A, strains, axes=1) * grid.areas
        gathers, moves = "xi,yj,pxy->ijp", "xi,yj,ijp->pxy"
        of_u = _sum(gathers, (ux.slopes, uy.values, xx), (ux.values, uy.slopes, xy))
        of_v = _sum(gathers, (vx.values, vy.slopes, yy), (vx.slopes, vy.values, xy))
        forces = np.concatenate([f.reshape(-1, f.shape[2]) for f in (of_u, of_v)])
        moved = np.zeros_like(forces)
        moved[free] = -linalg.cho_solve(factor, forces[free])
        size = of_u.shape[0] * of_u.shape[1]
        at_u, at_v = moved[:size].reshape(of_u.shape), moved[size:].reshape(of_v.shape)
        return strains + np.stack([
            _sum(moves, (ux.slopes, uy.values, at_u)), _sum(moves, (vx.values, vy.slopes, at_v)),
            _sum(moves, (ux.values, uy.slopes, at_u), (vx.slopes, vy.values, at_v)),
        ])  # fmt: skip

    return relieve


@dataclass(frozen=True, kw_only=True, eq=False)
class _Line:
    """Functions along x or y: values and slopes (points, i) on the grid; its weights (points,)."""

    basis: LineBasis
    values: Floats
    slopes: Floats
    weights: Floats

    @staticmethod
    def of(plate: Plate, grid: Grid, axis: int, component: int, odd: int, in_plane: str) -> _Line:
        names = (("left", "right"), ("front", "back"))[axis]
        holds = IN_PLANE[in_plane][axis != component]
        ends = ["simply" if holds and getattr(plate, name) != "free" else "free" for name in names]
        bases = piecewise_basis(
            grid.breaks[axis], ends, grid.degrees[axis], grid.split[axis], inner="simply"
        )
        # An even strain xx has a u that is odd along x and even along y.
        basis, at = bases[odd ^ (axis == component) if len(bases) == 2 else 0], grid.points[axis]
        return _Line(
            basis=basis, values=basis(at), slopes=basis.slopes(at), weights=grid.weights[axis]
        )


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
