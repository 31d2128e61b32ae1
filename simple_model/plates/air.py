"""Added mass of the air on both sides of a rectangular plate in a baffle, for Ritz's method.

For bending waves much slower than sound the air is incompressible. Its mass per area at a
wavenumber k is 2 rho / k (Junger and Feit, Sound, Structures, and Their Interaction (1986), 5.11).
With

    1/k = 2/sqrt(pi) int_0^inf exp(-k^2 t^2) dt

each t gives a product of an integral along x and one along y. Few t are needed: the trapezoidal
rule in log t converges exponentially. The integrands are transforms of Legendre polynomials, 2
(-i)^n j_n(k a / 2).

Without a baffle air flows around the edges, and the mass is too large within about 1/k of them: by
a factor of 2 for a rigid disc, slightly for a mode with many half waves.
"""

import numpy as np
from scipy.special import spherical_jn

from simple_model.plates.polynomials import LineBasis
from simple_model.typing import Floats

STEP = 0.6  # in log t: 1/k within 8e-4
NEAREST = 0.3  # over the highest wavenumber: for smaller t all Gaussians are 1
FARTHEST = 100.0  # sides: larger t contribute 1e-3 of the mass
DECAYED = 6.0  # exp(-36) is negligible


def air_mass(x: LineBasis, y: LineBasis, density: float) -> Floats:
    """Added mass (x y, x y) in kg/m2, y fastest, of products of functions; density in kg/m3."""
    highest = max(2 * line.legendre[..., 0].size / line.length for line in (x, y))
    nearest, farthest = NEAREST / highest, FARTHEST * max(x.length, y.length)
    distances = np.exp(np.arange(np.log(nearest), np.log(farthest), STEP))
    weights = 2 / np.sqrt(np.pi) * STEP * distances
    along = np.stack([gaussian_products(x, t) for t in distances])
    across = np.stack([gaussian_products(y, t) for t in distances])
    n = x.size * y.size
    products = np.tensordot(weights[:, None, None] * along, across, axes=(0, 0))
    mass = products.transpose(0, 2, 1, 3).reshape(n, n)
    # The rest of the rule below its first node, whose weight includes half a step.
    below = 2 / np.sqrt(np.pi) * nearest * (1 / (np.exp(STEP) - 1)) * STEP
    mass += below * np.kron(x.mass, y.mass)
    return np.asarray(2 * density * mass)


def gaussian_products(line: LineBasis, t: float) -> Floats:
    """Integrals (i, i) of u_i(k) u_j(k)* exp(-k^2 t^2) dk / 2 pi over all wavenumbers."""
    tau = 2 * t / line.length
    # Products of the transforms have no part beyond twice the line's length.
    spacing = np.pi / (1 + DECAYED * tau)
    kappa = (np.arange(int(np.ceil(DECAYED / tau / spacing)) + 1) + 0.5) * spacing
    weight = 2 / np.pi * spacing * np.exp(-((kappa * tau) ** 2))
    return np.asarray(
        sum((part * weight) @ part.T for part in _transforms(line, np.asarray(kappa, np.float64)))
    )


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
