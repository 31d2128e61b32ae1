"""Polynomials on the pieces of a line that meet the supports of its ends, for Ritz's method.

On one piece they are orthonormal combinations of Legendre polynomials P_n(2 x / a), of which n / (a
/ 2) resolves a wavenumber k. On several pieces, functions and slopes are continuous. Each function
is nonzero on one or two pieces only, so that a piece at rest excludes some of them: Hermite
functions of value and slope at each break, and bubbles within each piece (Babuska, Szabo and Katz,
SIAM J Numer Anal 18:515 (1981)).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre
from scipy.linalg import null_space

from simple_model.typing import Bools, Floats, Ints

# Derivatives that are zero at an end.
FIXED: Mapping[str, tuple[int, ...]] = {"clamped": (0, 1), "simply": (0,), "free": ()}


@dataclass(frozen=True, kw_only=True, eq=False)
class LineBasis:
    """Functions u_i on the pieces of a line, all with the same symmetry or all with none.

    `breaks` (e + 1,) in m from the middle: the ends of the pieces. `legendre` (e, n, i):
    coefficients in the orthonormal Legendre polynomials of each piece. Integrals (i, i): `mass` of
    u_i u_k, `slope` of u_i' u_k', `curvature` of u_i'' u_k'', `mixed` of u_i'' u_k.
    """

    breaks: Floats
    legendre: Floats
    mass: Floats
    slope: Floats
    curvature: Floats
    mixed: Floats

    @property
    def size(self) -> int:
        """Number of functions."""
        return self.legendre.shape[2]

    @property
    def length(self) -> float:
        """Length of the line, m."""
        return float(np.ptp(self.breaks))

    def __call__(self, x: Floats) -> Floats:
        """Values (p, i) in m^-1/2 at x (p,) in m from the middle."""
        return self._values(x, self.legendre)

    def slopes(self, x: Floats) -> Floats:
        """First derivatives (p, i) in m^-3/2 at x (p,) in m from the middle."""
        per_piece = (2 / np.diff(self.breaks))[:, None, None]
        d = _derivative(self.legendre.shape[1] - 1)
        return self._values(x, per_piece * (d @ self.legendre))

    def _values(self, x: Floats, legendre_coefficients: Floats) -> Floats:
        """Values (p, i) at x (p,) of functions with coefficients (e, n, i)."""
        x = np.asarray(x, np.float64)
        piece = np.searchsorted(self.breaks[1:-1], x)
        low, size = self.breaks[piece], np.diff(self.breaks)[piece]
        n = np.arange(self.legendre.shape[1])
        polynomials = legendre.legvander(2 * (x - low) / size - 1, len(n) - 1)
        polynomials *= np.sqrt((2 * n + 1) / size[:, None])
        values = np.empty((len(x), self.size))
        for e, coefficients in enumerate(legendre_coefficients):
            values[piece == e] = polynomials[piece == e] @ coefficients
        return values

    def nonzero_within(self, low: float, high: float) -> Bools:
        """Whether each function (i,) is nonzero between two breaks, in m."""
        middles = (self.breaks[1:] + self.breaks[:-1]) / 2
        within = (low < middles) & (middles < high)
        return np.asarray((self.legendre[within] != 0).any(axis=(0, 1)))


def gauss_points(breaks: Floats, counts: Sequence[int]) -> tuple[Floats, Floats]:
    """Gauss points and weights in m, `counts` on each piece of a line between breaks."""
    points, weights = [], []
    for low, high, count in zip(breaks[:-1], breaks[1:], counts, strict=True):
        nodes, each = legendre.leggauss(count)
        points.append((low + high) / 2 + (high - low) / 2 * nodes)
        weights.append((high - low) / 2 * each)
    return np.concatenate(points), np.concatenate(weights)


def line_basis(
    length: float, ends: Sequence[str], degree: int, split: bool
) -> tuple[LineBasis, ...]:
    """Orthonormal functions up to a degree, on one piece of a length in m, that meet the supports
    of both ends: one basis or, with `split`, one of even and one of odd functions.
    """
    n = np.arange(degree + 1)
    breaks = np.array([-length / 2, length / 2])
    return tuple(
        _basis(breaks, _bubbles(degree, part, ends)[None])
        for part in ([n[::2], n[1::2]] if split else [n])
    )


def piecewise_basis(
    breaks: Floats, ends: Sequence[str], degrees: Sequence[int], split: bool, inner: str = "clamped"
) -> tuple[LineBasis, ...]:
    """Functions up to `degrees` (e,) on the pieces between breaks (e + 1,) of a line, in m from the
    middle; with `split`, even and odd functions in two bases.

    At breaks they are continuous in what the support `inner` fixes: value and slope if "clamped",
    with degrees of 3 or more, the value alone if "simply".
    """
    if len(breaks) == 2:
        return line_basis(float(np.ptp(breaks)), ends, degrees[0], split)
    nodal = _at_breaks(breaks, ends, degrees, FIXED[inner])
    functions = np.stack([*nodal, *_inner(degrees, (inner, inner))], axis=2)
    parts = _symmetric(functions) if split else (functions,)
    return tuple(_basis(breaks, part) for part in parts)


def _basis(breaks: Floats, coefficients: Floats) -> LineBasis:
    """Basis of functions with coefficients (e, n, i), and their integrals."""
    d = _derivative(coefficients.shape[1] - 1)
    per_piece = (2 / np.diff(breaks))[:, None, None]
    first = per_piece * (d @ coefficients)
    second = per_piece * (d @ first)

    def integral(u: Floats, v: Floats) -> Floats:
        return np.asarray(np.einsum("eni,enj->ij", u, v, optimize=True))

    return LineBasis(
        breaks=breaks, legendre=coefficients, mass=integral(coefficients, coefficients),
        slope=integral(first, first), curvature=integral(second, second),
        mixed=integral(second, coefficients),
    )  # fmt: skip


def _at_breaks(
    breaks: Floats, ends: Sequence[str], degrees: Sequence[int], derivatives: Sequence[int]
) -> Iterator[Floats]:
    """Coefficients (e, n) of one function per free value or slope at a break, orthogonal to the
    bubbles.
    """
    last, count = len(breaks) - 1, len(derivatives)
    of_piece = [
        _end_functions(*each, derivatives) for each in zip(degrees, np.diff(breaks), strict=True)
    ]
    for k in range(last + 1):
        end = ends[0] if k == 0 else ends[1] if k == last else "free"
        for derivative in sorted({*derivatives} - {*FIXED[end]}):
            function = np.zeros((last, max(degrees) + 1))
            for piece, side in ((k - 1, 1), (k, 0)):
                if 0 <= piece < last:
                    own = of_piece[piece][count * side + derivative]
                    function[piece, : len(own)] = own
            yield function / np.linalg.norm(function)


def _end_functions(degree: int, size: float, derivatives: Sequence[int]) -> Floats:
    """Coefficients (2 d, n) of the smallest polynomials with one derivative of 1 at the low end of
    a piece, then at the high end, and the other derivatives 0.
    """
    n = np.arange(degree + 1)
    rows = np.array(
        [_at_end(n, derivative, side) for side in (-1, 1) for derivative in derivatives]
    )
    scale = np.tile([np.sqrt(1 / size) * (2 / size) ** each for each in derivatives], 2)
    strength = np.linalg.norm(rows, axis=1)
    return np.asarray(np.linalg.pinv(rows / strength[:, None]) / strength / scale).T


def _inner(degrees: Sequence[int], ends: Sequence[str]) -> Iterator[Floats]:
    """Coefficients (e, n) of orthonormal bubbles on each piece, even or odd about its middle."""
    for piece, degree in enumerate(degrees):
        n = np.arange(degree + 1)
        for orders in (n[::2], n[1::2]):
            for bubble in _bubbles(max(degrees), orders, ends).T:
                function = np.zeros((len(degrees), max(degrees) + 1))
                function[piece] = bubble
                yield function


def _symmetric(functions: Floats) -> tuple[Floats, Floats]:
    """Even and odd combinations (e, n, i) of functions (e, n, k) and their mirror images."""
    sign = np.where(np.arange(functions.shape[1]) % 2, -1.0, 1.0)
    mirrored = functions[::-1] * sign[:, None]
    overlap = np.einsum("eni,enj->ij", mirrored, functions, optimize=True)
    image = np.argmax(np.abs(overlap), axis=0)
    first = np.flatnonzero(image >= np.arange(len(image)))
    both = [(functions + mirrored)[..., first], (functions - mirrored)[..., first]]
    even, odd = (part[..., np.abs(part).max(axis=(0, 1)) > 1e-6] for part in both)
    return even, odd


def _bubbles(degree: int, orders: Ints, ends: Sequence[str]) -> Floats:
    """Coefficients (n, i) of orthonormal polynomials that meet the supports of both ends."""
    rows = [
        _at_end(orders, derivative, side)
        for end, side in zip(ends, (-1, 1), strict=True)
        for derivative in FIXED[end]
    ]
    coefficients = np.zeros((degree + 1, len(orders)))
    coefficients[orders, np.arange(len(orders))] = 1
    null_ratio = 1e-10  # of the largest singular value, below which a condition depends on others
    if rows:
        unit = [row / np.linalg.norm(row) for row in rows]
        coefficients = coefficients @ null_space(np.array(unit), rcond=null_ratio)
    return np.asarray(coefficients)


def _at_end(orders: Ints, derivative: int, side: int) -> Floats:
    """sqrt(2 n + 1) P_n or P_n' at -1 or 1."""
    n = orders.astype(float)
    value = np.sqrt(2 * n + 1) * float(side) ** (orders + derivative)
    return np.asarray(value * (n * (n + 1) / 2) ** derivative)


def _derivative(degree: int) -> Floats:
    """Derivative (n, n) of orthonormal Legendre polynomials in themselves: P_n' = sum (2 k + 1) P_k
    over k = n - 1, n - 3, ..., as (2 k + 1) P_k = P_(k+1)' - P_(k-1)'.
    """
    n = np.arange(degree + 1)
    below = (n[:, None] < n) & ((n[:, None] + n) % 2 == 1)
    return np.where(below, np.sqrt(np.outer(2 * n + 1, 2 * n + 1)), 0.0)
