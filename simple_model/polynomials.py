"""Orthonormal polynomials on a line that meet the supports of its ends, for Ritz's method.

Combinations of Legendre polynomials P_n(2 x / a), of which n / (a / 2) resolves a wavenumber k.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre

from simple_model.trajectory import Floats

# Derivatives that are zero at an end.
FIXED: Mapping[str, tuple[int, ...]] = {"clamped": (0, 1), "simply": (0,), "free": ()}


@dataclass(frozen=True, kw_only=True, eq=False)
class LineBasis:
    """Orthonormal functions u_i on a line of a `length` in metre, of one symmetry or of none.

    `legendre` (n, i): their coefficients in orthonormal Legendre polynomials. Integrals (i, i):
    `slope` of u_i' u_k', `curvature` of u_i'' u_k'', `mixed` of u_i'' u_k.
    """

    length: float
    legendre: Floats
    slope: Floats
    curvature: Floats
    mixed: Floats

    @property
    def size(self) -> int:
        """How many functions there are."""
        return self.legendre.shape[1]

    def __call__(self, x: Floats) -> Floats:
        """Values (p, i) in m^-1/2 at x (p,) in metre from the middle."""
        n = np.arange(len(self.legendre))
        polynomials = legendre.legvander(2 * np.asarray(x) / self.length, len(n) - 1)
        return np.asarray(polynomials * np.sqrt((2 * n + 1) / self.length) @ self.legendre)


def line_basis(
    length: float, ends: Sequence[str], degree: int, split: bool
) -> tuple[LineBasis, ...]:
    """Functions of a degree at most that meet the supports of both ends.

    Parameters
    ----------
    length : metre
    ends : two of "clamped", "simply", "free"
    degree : the highest
    split : whether even and odd functions are apart, where both ends are alike

    Returns
    -------
    One basis, or that of even and that of odd functions
    """
    n = np.arange(degree + 1)
    parts = [n[::2], n[1::2]] if split else [n]
    return tuple(_basis(length, ends, degree, part) for part in parts)


def _basis(length: float, ends: Sequence[str], degree: int, orders: np.ndarray) -> LineBasis:
    rows = [
        _at_end(orders, derivative, side)
        for end, side in zip(ends, (-1, 1), strict=True)
        for derivative in FIXED[end]
    ]
    coefficients = np.zeros((degree + 1, len(orders)))
    coefficients[orders, np.arange(len(orders))] = 1
    coefficients = coefficients @ _null_space(np.array(rows).reshape(-1, len(orders)))
    d = _derivative(degree)
    first = 2 / length * d @ coefficients
    second = (2 / length) ** 2 * d @ d @ coefficients
    return LineBasis(
        length=length, legendre=coefficients, slope=first.T @ first,
        curvature=second.T @ second, mixed=second.T @ coefficients,
    )  # fmt: skip


def _at_end(orders: np.ndarray, derivative: int, side: int) -> Floats:
    """P_n or P_n' at -1 or 1, scaled alike."""
    n = orders.astype(float)
    value = np.sqrt(2 * n + 1) * float(side) ** (orders + derivative)
    row = value * (n * (n + 1) / 2) ** derivative
    return np.asarray(row / np.linalg.norm(row))


def _null_space(rows: Floats) -> Floats:
    """Orthonormal columns (n, r) that are orthogonal to all rows (c, n)."""
    if not len(rows):
        return np.eye(rows.shape[1])
    _, strength, known = np.linalg.svd(rows)
    rank = int((strength > 1e-10 * strength[0]).sum())
    return np.asarray(known[rank:].T)


def _derivative(degree: int) -> Floats:
    """Derivative (n, n) of orthonormal Legendre polynomials in themselves:
    P_n' = sum (2 k + 1) P_k over k = n - 1, n - 3, ..., as (2 k + 1) P_k = P_(k+1)' - P_(k-1)'.
    """
    n = np.arange(degree + 1)
    below = (n[:, None] < n) & ((n[:, None] + n) % 2 == 1)
    return np.where(below, np.sqrt(np.outer(2 * n + 1, 2 * n + 1)), 0.0)
