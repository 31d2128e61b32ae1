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

from simple_model.polynomials import LineBasis
from simple_model.trajectory import Floats

STEP = 0.6  # in log t: 1/k within 8e-4
NEAREST = 0.3  # over the highest wavenumber: below it all Gaussians are 1
FARTHEST = 100.0  # sides: beyond it 1e-3 of the volume's mass is left
DECAYED = 6.0  # exp(-36) is nothing


def air_mass(x: LineBasis, y: LineBasis, density: float) -> Floats:
    """Added mass of each pair of products of functions.

    Parameters
    ----------
    x, y : LineBasis along both sides
    density : kg/m3, of the air

    Returns
    -------
    (x y, x y) kg/m2, the index of y the faster
    """
    highest = max(2 * len(line.legendre) / line.length for line in (x, y))
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
    mass[np.diag_indices(n)] += below
    return np.asarray(2 * density * mass)


def smoothed(line: LineBasis, t: float) -> Floats:
    """Integrals (i, i) of u_i(k) u_j(k)* exp(-k^2 t^2) dk / 2 pi over all wavenumbers."""
    tau = 2 * t / line.length
    # Products of the transforms have no part beyond twice the line's length.
    spacing = np.pi / (1 + DECAYED * tau)
    kappa = (np.arange(int(np.ceil(DECAYED / tau / spacing)) + 1) + 0.5) * spacing
    n = np.arange(len(line.legendre))
    bessel = spherical_jn(n[:, None], kappa) * np.sqrt(2 * n + 1)[:, None]
    sign = np.where(n // 2 % 2, -1.0, 1.0)
    weight = 2 / np.pi * spacing * np.exp(-((kappa * tau) ** 2))
    total = np.zeros((line.size, line.size))
    for part in (slice(0, None, 2), slice(1, None, 2)):  # real and imaginary transforms
        transform = (line.legendre[part] * sign[part, None]).T @ bessel[part]
        total += (transform * weight) @ transform.T
    return total
