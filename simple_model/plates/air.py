"""Added mass of the air on both sides of a rectangular plate in a baffle, for Ritz's method.

To bending waves much slower than sound the air is incompressible, and has the mass 2 rho / k per
area of wavenumber k (Junger and Feit, Sound, Structures, and Their Interaction (1986), 5.11). With

    1/k = 2/sqrt(pi) int_0^inf exp(-k^2 t^2) dt

each t makes a product of an integral along x and one along y, of which few are needed: the
trapezoidal rule in log t converges exponentially. The integrals are those of the transforms of
Legendre polynomials, 2 (-i)^n j_n(k a / 2).

Without a baffle air flows around the edges. The mass is then too large within about 1/k of them: of
a rigid disc by a factor of 2, of a mode with many half waves by little.
"""

import numpy as np
from scipy.special import spherical_jn

from simple_model.plates.polynomials import LineBasis
from simple_model.typing import Floats

STEP = 0.6  # in log t: 1/k within 8e-4
NEAREST = 0.3  # over the highest wavenumber: below it all Gaussians are 1
FARTHEST = 100.0  # sides: beyond it 1e-3 of the volume's mass is left
DECAYED = 6.0  # exp(-36) is nothing


def air_mass(x: LineBasis, y: LineBasis, density: float) -> Floats:
    """Added mass (x y, x y) in kg/m2, y the faster, of each pair of products of functions; density
    in kg/m3.
    """
    highest = max(2 * line.legendre[..., 0].size / line.length for line in (x, y))
    nearest, farthest = NEAREST / highest, FARTHEST * max(x.length, y.length)
    distances = np.exp(np.arange(np.log(nearest), np.log(farthest), STEP))
    weights = 2 / np.sqrt(np.pi) * STEP * distances
    along = np.stack([smoothed(x, t) for t in distances])
    across = np.stack([smoothed(y, t) for t in distances])
    n = x.size * y.size
    products = np.tensordot(weights[:, None, None] * along, across, axes=(0, 0))
    mass = products.transpose(0, 2, 1, 3).reshape(n, n)
    # What the rule has below its first node: half of a step is in its weight.
    below = 2 / np.sqrt(np.pi) * nearest * (1 / (np.exp(STEP) - 1)) * STEP
    mass += below * np.kron(x.mass, y.mass)
    return np.asarray(2 * density * mass)


def smoothed(line: LineBasis, t: float) -> Floats:
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
    over sqrt(a) of the line's length a.
    """
    real, imaginary = np.zeros((2, line.size, len(kappa)))
    parts, middles = np.diff(line.breaks) / line.length, (line.breaks[1:] + line.breaks[:-1]) / 2
    used = [1 + int(np.flatnonzero(piece.any(axis=1)).max(initial=0)) for piece in line.legendre]
    known: dict[tuple[float, int], Floats] = {}  # pieces are alike
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
    about its middle, over the factor -i of odd ones.
    """
    n = np.arange(count)
    sign = np.where(n // 2 % 2, -1.0, 1.0) * np.sqrt((2 * n + 1) * part)
    return np.asarray(sign[:, None] * spherical_jn(n[:, None], part * kappa))
