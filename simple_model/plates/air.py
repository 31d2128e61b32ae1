"""The air on both sides of a rectangular plate, for Ritz's method: its mass, and the sound and
friction that damp the plate.

For bending waves much slower than sound the air is incompressible. In a baffle its mass per area at
a wavenumber k is 2 rho / k (Junger and Feit, Sound, Structures, and Their Interaction (1986),
5.11). In open air the difference p of the pressures on both sides is zero beyond the plate and its
frame, and

    k p(k) / 2 rho = transform of an acceleration that is given on the plate, and 0 on the frame.

Galerkin's method finds p in the functions sqrt(1 - s^2) U_n(s), with Chebyshev's polynomials U_n of
the second kind. With

    1/k = 2/sqrt(pi) int_0^inf exp(-k^2 t^2) dt

each t gives a product of an integral along x and one along y. Few t are needed: the trapezoidal
rule in log t converges exponentially. The integrands are Fourier transforms, of Legendre
polynomials 2 (-i)^n j_n(k a / 2), of the other functions pi (n + 1) (-i)^n J_(n+1)(k a / 2) / (k a
/ 2).

A plate of velocity v in a baffle radiates from both sides by Rayleigh's integral, and one in open
air by the force i w G v on the air, at k0 = w / c:

    baffle  w^2 rho / (2 pi c) <|V(k0 n)|^2> in W, averaged over directions n; V, transform of v
    free    k0^2 |w G v|^2 / (24 pi rho c) in W (Pierce, Acoustics (1981), section 4.3)

Moments of v give V. Layers of viscous air, in which the air along the plate is as fast as v, resist
with sqrt(2 w eta rho) per area (Landau and Lifshitz, Fluid Mechanics (1987), section 24); eddies at
edges are left out.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from math import factorial, pi

import numpy as np
from scipy import linalg
from scipy.special import factorial2, j0, j1, jv, spherical_jn

from simple_model.layers.compliance import AIR_VISCOSITY
from simple_model.load.focus import SPEED_OF_SOUND
from simple_model.plates.polynomials import LineBasis, gauss_points
from simple_model.typing import Floats, Ints

STEP = 0.6  # in log t: 1/k within 8e-4
ZERO = 1e-9  # of the largest integral, of functions that another symmetry excludes


@dataclass(frozen=True, kw_only=True, eq=False)
class AirLoss:
    """What the air takes from m motions of a plate, such as modes of unit modal mass.

    In a baffle, `patterns` (q, m) are the integrals of their deflections times x^a y^b, with the
    exponents `orders` (q, 2). In open air there are no orders, and the pattern, if there is one, is
    the force of the air per acceleration. `areas` (m,) are the integrals of the squared
    deflections; `density` is that of the air in kg/m3; `reach` is half the diagonal of the plate in
    m. At wavelengths below about the diagonal, resistance to sound grows no further: the moments
    would diverge.
    """

    patterns: Floats
    orders: Ints
    areas: Floats
    density: float
    reach: float

    def scaled(self, factors: Floats) -> "AirLoss":
        """Loss of the motions times factors (m,)."""
        return replace(self, patterns=self.patterns * factors, areas=self.areas * factors**2)

    def radiation(self, omega: Floats) -> Floats:
        """Matrices R (f, q, q) at angular frequencies (f,) in rad/s: sound resists velocities v
        (m,) with the forces patterns^T R patterns v.
        """
        k0 = np.asarray(omega, np.float64)[:, None, None] / SPEED_OF_SOUND
        shortest = 3.0  # rad: the resistance of shorter sound is that of this k0
        k0 = np.minimum(k0, shortest / self.reach)
        if not len(self.orders):
            each = np.eye(len(self.patterns))
            return np.asarray(k0**4 * SPEED_OF_SOUND / (12 * pi * self.density) * each)
        a, b = self.orders.T
        x, y = np.add.outer(a, a), np.add.outer(b, b)
        sizes = [1 / (factorial(i) * factorial(j)) for i, j in self.orders.tolist()]
        # The mean of n_x^x n_y^y over all directions, zero if an exponent is odd.
        mean = factorial2(np.abs(x - 1)) * factorial2(np.abs(y - 1)) / factorial2(x + y + 1)
        mean[(x % 2 == 1) | (y % 2 == 1)] = 0.0
        turn = np.cos(pi / 2 * np.subtract.outer(a + b, a + b))
        rate = self.density * SPEED_OF_SOUND / pi * turn * mean * np.outer(sizes, sizes)
        return np.asarray(rate * k0 ** (2 + x + y))

    def friction(self, omega: Floats) -> Floats:
        """Resistance (..., m) of viscous air at angular frequencies (..., m or 1) in rad/s."""
        return np.asarray(np.sqrt(2 * omega * AIR_VISCOSITY * self.density) * self.areas)

    def of_each(self, omega: Floats) -> Floats:
        """Resistance (f, m) of each motion at angular frequencies (f,) in rad/s."""
        sound = ((self.radiation(omega) @ self.patterns) * self.patterns).sum(axis=1)
        return np.asarray(sound + self.friction(np.asarray(omega)[:, None]))

    def at_own(self, omega: Floats) -> Floats:
        """Resistance (m,) of each motion at its own angular frequency (m,) in rad/s."""
        each = self.patterns.T[:, None]
        sound = (each @ self.radiation(omega) @ each.transpose(0, 2, 1))[:, 0, 0]
        return np.asarray(sound + self.friction(omega))


def air_of(
    x: LineBasis, y: LineBasis, density: float, frame: float = np.inf, order: int = 6
) -> tuple[Floats, Floats, Ints]:
    """Added mass (x y, x y) in kg/m2, y fastest, of products of functions, and their `patterns` and
    `orders` for `AirLoss`.

    The density is in kg/m3, the width of a rigid frame around the plate in m, inf for a baffle,
    whose sound follows from moments up to an `order`.
    """
    if frame < np.inf:
        couplings = [_edge_coupling(line, frame) for line in (x, y)]
        orders = [np.flatnonzero(np.abs(each).max(axis=1) > ZERO) for each in couplings]
        sizes = [line.length + 2 * frame for line in (x, y)]
        names = tuple(tuple(each.tolist()) for each in orders)
        inverse, whole = open_air(tuple(sizes), names, density)
        of_x, of_y = (each[n] for each, n in zip(couplings, orders, strict=True))
        pairs = inverse.reshape(len(of_x), len(of_y), len(of_x), len(of_y))
        mass = np.einsum("abcd,ai,bj,ck,dl->ijkl", pairs, of_x, of_y, of_x, of_y, optimize=True)
        forces = [np.kron(of_x, of_y).T @ (inverse @ whole)] if whole.any() else []
        patterns = np.reshape(forces, (len(forces), x.size * y.size))
        return mass.reshape(2 * (x.size * y.size,)), patterns, np.zeros((0, 2), np.int64)
    detail = min(line.length / (2 * line.legendre[..., 0].size) for line in (x, y))
    distances = _distances(detail, max(x.length, y.length))
    along, across = (
        np.stack([_gaussian_products(partial(_transforms, line), line.length, t)[0]
                  for t in distances])
        for line in (x, y)
    )  # fmt: skip
    mass = _sum_over_distances(distances, [(along, across)])
    # The rest of the rule below its first node, whose weight includes half a step.
    mass += STEP * distances[0] / (np.exp(STEP) - 1) * np.kron(x.mass, y.mass)
    moments_x, moments_y = _moments(x, order), _moments(y, order)
    exponents = [(a, b) for a in moments_x for b in moments_y if a + b <= order]
    patterns = np.stack([np.kron(moments_x[a], moments_y[b]) for a, b in exponents])
    return 4 / np.sqrt(pi) * density * mass, patterns, np.array(exponents)


@lru_cache(maxsize=4)  # sheets of one size share their air
def open_air(
    sizes: tuple[float, ...], orders: tuple[tuple[int, ...], ...], density: float
) -> tuple[Floats, Floats]:
    """Pressure of incompressible air around a rectangle of two sizes in m, as a sum of products, y
    fastest, of `edge_functions` with orders (i,) along x and (j,) along y; density in kg/m3.

    Returns the coefficients (k, k) in kg/m6 per integral of the acceleration with each product, and
    the integrals (k,) in m2 of the products.
    """
    lines = [(size, np.array(n)) for size, n in zip(sizes, orders, strict=True)]
    # Where k is large, transforms decay as k^(-3/2) beyond the square of the order only.
    detail = min(size / (1 + n.max()) ** 2 for size, n in lines)
    distances = _distances(detail, max(sizes))
    (x, slope_x), (y, slope_y) = (
        map(np.stack, zip(*(
            _gaussian_products(partial(_edge_transforms, n, size), size, t) for t in distances
        ), strict=True))
        for size, n in lines
    )  # fmt: skip
    pairs = [(slope_x, y), (x, slope_y)]
    inertia = _sum_over_distances(distances, pairs)
    # Below the first node, terms fall by a constant in each step, as integrals of 1/k do.
    first, second = (sum(np.kron(a[t], b[t]) for a, b in pairs) for t in (0, 1))
    ratio = np.exp(-STEP)
    rest = first / (1 - ratio) + (first - second) / (1 - ratio) ** 2
    inertia += STEP * distances[0] * ratio * rest
    # int sqrt(1 - s^2) ds = pi / 2 for order 0
    of_x, of_y = (np.where(n == 0, pi / 4 * size, 0.0) for size, n in lines)
    whole = np.asarray(np.kron(of_x, of_y), np.float64)
    inverse: Floats = linalg.inv(inertia / (np.sqrt(pi) * density), check_finite=False)
    for kept in (inverse, whole):
        kept.setflags(write=False)
    return inverse, whole


def edge_functions(orders: Ints, length: float, x: Floats) -> Floats:
    """Functions sqrt(1 - s^2) U_n(s) (p, n) of orders (n,), s = 2 x / length, at x (p,) in m."""
    angle = np.arccos(np.clip(2 * np.asarray(x) / length, -1.0, 1.0))
    return np.asarray(np.sin(np.multiply.outer(angle, orders + 1)))


def _edge_coupling(line: LineBasis, frame: float) -> Floats:
    """Integrals (n, i) of the edge functions of a line and its frame with the line's functions."""
    length = line.length + 2 * frame
    count = int(np.ceil(line.legendre.shape[1] * length / line.length))
    # By the angle of cos = 2 x / length, in which edge functions are sines.
    angles = np.arccos(np.clip(-2 * line.breaks / length, -1.0, 1.0))
    angle, weights = gauss_points(angles, [2 * count] * (len(line.breaks) - 1))
    x = -length / 2 * np.cos(angle)
    weighted = (length / 2 * weights * np.sin(angle))[:, None] * line(x)
    return np.asarray(edge_functions(np.arange(count), length, x).T @ weighted)


def _edge_transforms(orders: Ints, length: float, kappa: Floats) -> tuple[Floats, Floats]:
    """Real and imaginary parts (n, k) of the transforms of edge functions, as in `_transforms`."""
    n = orders[:, None]
    size = np.where(n // 2 % 2, -1.0, 1.0) * (n + 1) * _bessel(orders + 1, kappa) / kappa
    size *= pi / 2 * np.sqrt(length)
    return np.where(n % 2, 0.0, size), np.where(n % 2, size, 0.0)


def _bessel(orders: Ints, kappa: Floats) -> Floats:
    """J_n (n, k) at ascending kappa (k,): by recurrence, which is stable and fast above n."""
    n = int(orders.max())
    few = int(np.searchsorted(kappa, n))
    each = [j0(kappa[few:]), j1(kappa[few:])]
    for k in range(1, n):
        each.append(2 * k / kappa[few:] * each[k] - each[k - 1])
    rest = np.stack(each)[orders]
    return np.hstack([jv(orders[:, None], kappa[:few]), rest])


def _moments(line: LineBasis, order: int) -> dict[int, Floats]:
    """Integrals (i,) of the functions of a line times powers of x up to an order, by power; those
    that are zero are left out.
    """
    counts = [line.legendre.shape[1] + order] * (len(line.breaks) - 1)
    x, weights = gauss_points(line.breaks, counts)
    values, half = line(x), line.length / 2
    each = {a: (weights * (x / half) ** a) @ values for a in range(order + 1)}
    least = ZERO * max(np.abs(moment).max() for moment in each.values())
    return {a: half**a * moment for a, moment in each.items() if np.abs(moment).max() > least}


def _distances(detail: float, side: float) -> Floats:
    """Nodes t in m: for smaller ones all Gaussians are 1, larger ones add 1e-3 of the mass."""
    return np.exp(np.arange(np.log(0.3 * detail), np.log(100 * side), STEP))


def _sum_over_distances(distances: Floats, pairs: Sequence[tuple[Floats, Floats]]) -> Floats:
    """Integral over t of products (t, i, i), (t, j, j) along x and y, as (i j, i j)."""
    along, across = (np.concatenate(each) for each in zip(*pairs, strict=True))
    weights = np.tile(STEP * distances, len(pairs))
    products = np.tensordot(weights[:, None, None] * along, across, axes=(0, 0))
    n = along.shape[1] * across.shape[1]
    return np.asarray(products.transpose(0, 2, 1, 3).reshape(n, n))


def _gaussian_products(
    transforms: Callable[[Floats], tuple[Floats, Floats]], length: float, t: float
) -> tuple[Floats, Floats]:
    """Integrals (i, i) of u_i(k) u_j(k)* exp(-k^2 t^2) dk / 2 pi over all wavenumbers, and those
    times k^2, of the transforms at 2 kappa / length over sqrt(length).
    """
    tau = 2 * t / length
    decayed = 6.0  # exp(-36) is negligible
    # Products of the transforms have no part beyond twice the line's length.
    spacing = pi / (1 + decayed * tau)
    kappa = (np.arange(int(np.ceil(decayed / tau / spacing)) + 1) + 0.5) * spacing
    weight = 2 / pi * spacing * np.exp(-((kappa * tau) ** 2))
    parts = transforms(np.asarray(kappa, np.float64))
    values, slopes = (
        np.asarray(sum((part * each) @ part.T for part in parts))
        for each in (weight, weight * (2 * kappa / length) ** 2)
    )
    return values, slopes


def _transforms(line: LineBasis, kappa: Floats) -> tuple[Floats, Floats]:
    """Real and imaginary parts (i, k) of the Fourier transforms at wavenumbers 2 kappa / a (k,),
    over sqrt(a), for a line of length a.
    """
    real, imaginary = np.zeros((2, line.size, len(kappa)))
    parts, middles = np.diff(line.breaks) / line.length, (line.breaks[1:] + line.breaks[:-1]) / 2
    used = [1 + int(np.flatnonzero(piece.any(axis=1)).max(initial=0)) for piece in line.legendre]
    known: dict[tuple[float, int], Floats] = {}  # of pieces of equal length
    for coefficients, part, middle, n in zip(line.legendre, parts, middles, used, strict=True):
        key = round(float(part), 9), n
        if key not in known:
            known[key] = _legendre_transforms(n, part, kappa)
        # (-i)^n is real for even n, imaginary for odd n.
        even, odd = (coefficients[k:n:2].T @ known[key][k::2] for k in (0, 1))
        turn = 2 * middle / line.length * kappa
        real += even * np.cos(turn) - odd * np.sin(turn)
        imaginary -= even * np.sin(turn) + odd * np.cos(turn)
    return real, imaginary


def _legendre_transforms(count: int, part: float, kappa: Floats) -> Floats:
    """Fourier transforms (n, k) of the first orthonormal Legendre polynomials of a part of a line
    about its middle, without the factor -i of odd ones.
    """
    n = np.arange(count)
    sign = np.where(n // 2 % 2, -1.0, 1.0) * np.sqrt((2 * n + 1) * part)
    return np.asarray(sign[:, None] * spherical_jn(n[:, None], part * kappa))
