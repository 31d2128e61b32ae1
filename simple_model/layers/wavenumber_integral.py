"""Wavenumber integrals: the field about a focal spot at rest, at each frequency.

A pressure q exp(i w t) moves a body by u = G q at each wavenumber k. A focal spot S of unit
pressure makes, at a distance r,

    g(r, w) = 1/(2 pi) int_0^inf S(k) G(k, w) J_n(kr)/r^n k dk

with n = 0 for vertical displacement and pressures. A horizontal displacement varies as J_1 in the
direction of (x, y), so its components are x and y times an integral with n = 1. Second derivatives
have n = 2. In this form all are as smooth as the focal spot.

The frequencies of a transient are close to each other and lie below the real axis, by its damping,
far from the poles, which lie above it, by the loss of the body. The integrals are smooth there.
Each batch of frequencies is interpolated by a polynomial through Chebyshev points, whose error
falls geometrically with their number (Berrut and Trefethen, SIAM Rev 46:501 (2004)).

The path of integration over k runs above the real axis: above the poles of forward waves, which lie
below the axis for any loss, and below those of backward waves, which lie above it.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache, partial
from math import factorial

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import jv

from simple_model.layers.compliance import Compliance
from simple_model.typing import Bools, Complex, Floats

INTEGRATION_ERROR = 1e-5  # relative change at which the wavenumber grid is fine enough
FEWEST_NODES, MOST_NODES = 128, 2**16  # of the wavenumber grid
AT_ONCE = 2**12  # pairs of frequency and wavenumber, so that arrays stay in cache
UNRESOLVED = "the wavenumber integral does not converge; add loss, or give a free slab a base"


@dataclass(frozen=True, kw_only=True)
class Field:
    """Field of a surface pressure: m components made of c integrals.

    Parameters
    ----------
    answer : (k (k,) in 1/m, w (f, 1) in rad/s) -> (c, f, k), per pressure
    orders : (c,) order n of each integral
    clearance : see `Compliance`
    weights : horizontal offsets (..., 2) in m from the focus -> (m, c, ...); components are sums
        over c of weights times integrals
    """

    answer: Callable[[Complex, Complex], Complex]
    orders: tuple[int, ...]
    clearance: Callable[[Complex], float]
    weights: Callable[[Floats], Floats]

    @property
    def uses(self) -> Bools:
        """Whether each component uses each integral (m, c)."""
        without_symmetry = np.array([[1.0, 0.3], [0.2, 1.0], [-0.7, 0.4]])
        return np.asarray(self.weights(without_symmetry).any(axis=-1))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Grid:
    """Nodes `k` (n,) of the path of integration, and kernels (n, r) for each order: integrals at
    all distances are values at the nodes times kernels.
    """

    k: Complex
    kernels: dict[int, Complex]


@lru_cache(maxsize=16)
def normal_field(compliance: Compliance) -> Field:
    """Displacement of the surface into the body, m; the same record for the same body."""
    return Field(
        answer=lambda k, w: compliance(k, w)[None],
        orders=(0,),
        clearance=compliance.clearance,
        weights=lambda away: np.ones((1, 1, *away.shape[:-1])),
    )


def point_response(
    compliance: Compliance, distances: ArrayLike, frequencies: ArrayLike, width: float
) -> Complex:
    """Response g(r, w) (f, r) in m/Pa to a Gaussian focal spot of 1 Pa, see `point_integrals`."""
    return point_integrals(normal_field(compliance), distances, frequencies, width)[0]


def point_integrals(
    field: Field,
    distances: ArrayLike,
    frequencies: ArrayLike,
    width: float,
    *,
    negligible: float = 0.0,
) -> Complex:
    """Compute the integrals (c, f, r) of a field about a Gaussian focal spot of 1 Pa.

    They are those at distances (r,) in m from a spot of standard deviation `width` in m, and at
    real or complex frequencies (f,) in rad/s with imaginary part <= 0. Integration over ascending
    frequencies ends after the batch in which each integral is below the fraction `negligible` of
    its largest value. Raises an ArithmeticError if the wavenumber grid cannot be made fine enough.
    """
    r = np.atleast_1d(np.asarray(distances, np.float64))
    w = np.atleast_1d(np.asarray(frequencies, np.complex128))
    integrals = np.zeros((len(field.orders), len(w), len(r)), np.complex128)

    grid = partial(_grid, field.orders, tuple(r.tolist()), width)
    n, before = FEWEST_NODES, 0.0
    check_interval = 2048  # frequencies between two checks of the grid
    for part in _batches(w):
        lift = _lift(field, r, w[part], width)
        if lift != before or part.start % check_interval == 0:
            least = n if lift == before else FEWEST_NODES
            n, integrals[:, part] = _resolve(field, w[part], partial(grid, lift), least)
        else:
            integrals[:, part] = _batch(field, w[part], grid(lift, n))
        before = lift
        largest = np.abs(integrals[:, : part.stop]).max(axis=(1, 2))
        if (np.abs(integrals[:, part]).max(axis=(1, 2)) < negligible * largest).all():
            break
    return integrals


def _batches(w: Complex, first: int = 64, constant: int = 256) -> Iterator[slice]:
    """Batches of frequencies: those of a transient are as long as all before, others `constant`."""
    start = 0
    while start < len(w):
        stop = start + (max(first, start) if _is_damped(w) else constant)
        yield slice(start, stop)
        start = stop


def _lift(field: Field, r: Floats, w: Complex, width: float) -> float:
    """Height of the path of integration above the real axis, 1/m."""
    highest = 1.5 / max(float(r.max()), 5 * width)  # J_n grows by e^1.5 at most
    lift = min(highest, field.clearance(w))
    if not lift > 0:
        raise ArithmeticError(UNRESOLVED)
    return lift


def _resolve(field: Field, w: Complex, grid: Callable[[int], _Grid], n: int) -> tuple[int, Complex]:
    """Double the number of wavenumbers, from n, until the integrals converge. Return both."""
    compared = 16  # frequencies of a smooth batch at which two grids are compared
    some = w[:: -(-len(w) // compared)] if _is_damped(w) else w
    coarse = _integrate(field, some, grid(n))
    while n < MOST_NODES:
        fine = _integrate(field, some, grid(2 * n))
        largest = np.abs(fine).max(axis=(1, 2))
        if (np.abs(fine - coarse).max(axis=(1, 2)) <= INTEGRATION_ERROR * largest).all():
            return n, fine if some is w else _batch(field, w, grid(2 * n))
        coarse, n = fine, 2 * n
    raise ArithmeticError(UNRESOLVED)


def _is_damped(w: Complex) -> bool:
    """Whether there are many frequencies on a line below the real axis, as for a transient."""
    return bool(len(w) > 32 and w.imag.max() < 0 and np.ptp(w.imag) == 0)


def _batch(
    field: Field, w: Complex, grid: _Grid, n: int = 8, interpolation_error: float = 1e-7
) -> Complex:
    """Integrals (c, f, r) at the frequencies of a batch.

    On a line below the real axis they are interpolated by a polynomial, from `n` intervals on,
    unless that takes more than half as many evaluations. The relative error is small, so that weak
    lines are accurate too.
    """
    if not _is_damped(w):
        return _integrate(field, w, grid)
    middle, half = (w.real.max() + w.real.min()) / 2, np.ptp(w.real) / 2

    def at(x: Floats) -> Complex:
        return _integrate(field, middle + half * x + 1j * w.imag[0], grid)

    values, error = at(_chebyshev(n)), np.nan
    while 4 * n <= len(w):
        between = _chebyshev(2 * n)[1::2]
        finer = np.repeat(values, 2, axis=1)[:, :-1]
        finer[:, 1::2] = at(between)
        before, errors = error, np.abs(_through(values, between) - finer[:, 1::2]).max(axis=(1, 2))
        error = (errors / np.abs(finer).max(axis=(1, 2))).max()
        values, n = finer, 2 * n
        predicted = error * (error / before) ** 2  # as it falls geometrically
        if np.fmin(error, predicted) <= interpolation_error:
            return _through(values, (w.real - middle) / half)
        if error ** (len(w) / n) > interpolation_error**0.5:  # at the largest number allowed
            break
    return _integrate(field, w, grid)


def _chebyshev(n: int) -> Floats:
    """Chebyshev points (n + 1,) of the second kind on [-1, 1]."""
    return np.asarray(np.cos(np.pi * np.arange(n + 1) / n))


def _through(values: Complex, x: Floats) -> Complex:
    """Barycentric interpolation (c, f, r) at x (f,) of values (c, j, r) at Chebyshev points."""
    n = values.shape[1] - 1
    away = x[:, None] - _chebyshev(n)
    weights = (-1.0) ** np.arange(n + 1)
    weights[[0, -1]] /= 2
    shares = weights / np.where(away, away, 1e-300)  # at a point itself
    shares /= shares.sum(axis=1, keepdims=True)
    return np.asarray(shares @ values)


def _integrate(field: Field, w: Complex, grid: _Grid) -> Complex:
    """Integrals (c, f, r), some frequencies at a time."""
    parts = []
    for some in np.array_split(w[:, None], max(1, len(w) * len(grid.k) // AT_ONCE)):
        values = field.answer(grid.k, some)
        parts.append([v @ grid.kernels[n] for v, n in zip(values, field.orders, strict=True)])
    return np.concatenate(parts, axis=1)


@lru_cache(maxsize=4)
def _grid(
    orders: tuple[int, ...], distances: tuple[float, ...], width: float, lift: float, n: int
) -> _Grid:
    """Return a grid of n nodes along the raised path. Loads of a sweep share it."""
    r = np.array(distances)
    k, dk = _raised_path(width, lift, n)
    spot = 2 * np.pi * width**2 * np.exp(-((k * width) ** 2) / 2)
    weight = spot * k * dk / (2 * np.pi)
    kernels = {order: weight[:, None] * _bessel(order, k[:, None], r) for order in set(orders)}
    return _Grid(k=k, kernels=kernels)


def integration_path(
    field: Field, distances: Floats, frequencies: Floats, width: float, *, fewest: int = 256,
    checked: int = 16,
) -> tuple[Complex, Complex]:  # fmt: skip
    """Return nodes k (n,) in 1/m and weights (n,) of a path of integration that is fine enough.

    Convergence is checked at every `checked`-th frequency in rad/s and distance in m, from `fewest`
    nodes on. Raises an ArithmeticError if no path is fine enough.
    """
    w, some = frequencies.astype(np.complex128), tuple(distances[::checked].tolist())
    lift = _lift(field, distances, w[::checked], width)
    n, _ = _resolve(field, w[::checked], partial(_grid, field.orders, some, width, lift), fewest)
    return _raised_path(width, _lift(field, distances, w, width), n)


def _raised_path(width: float, lift: float, n: int) -> tuple[Complex, Complex]:
    """Gauss-Legendre nodes k (n,) and weights dk (n,) on panels along the raised path, 1/m."""
    nodes, weights = np.polynomial.legendre.leggauss(16)
    # Panels grow away from k = 0, near which the waves of low frequencies have their poles.
    edges = 6.5 / width * np.linspace(0, 1, n // 16 + 1) ** 2
    half, middle = np.diff(edges) / 2, (edges[1:] + edges[:-1]) / 2
    x = (middle[:, None] + half[:, None] * nodes).ravel()
    dx = (half[:, None] * weights).ravel()
    ramp = np.tanh(x / lift)
    return x + 1j * lift * ramp, dx * (1 + 1j * (1 - ramp**2))


def _bessel(n: int, k: Complex, r: Floats) -> Complex:
    """J_n(k r) / r^n."""
    away = np.where(r > 0, r, 1.0) ** n
    return np.where(r > 0, jv(n, k * r) / away, (k / 2) ** n / factorial(n))
