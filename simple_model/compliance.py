"""Surface compliance (Green's function) of laterally infinite bodies: u = G q at each wavenumber.

Frequencies w are complex, in rad/s; time goes as exp(+i w t).
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf

import numpy as np

from simple_model.material import Complex, Material


@dataclass(frozen=True)
class Compliance:
    """Compliance G: (k, w) -> displacement into the body per pressure, m/Pa; k (k,) in 1/m, w
    (f, 1) in rad/s.

    At frequencies w (f,) no pole (wave) lies between the real axis of k and `clearance`, 1/m,
    above it.
    """

    answer: Callable[[Complex, Complex], Complex]
    clearance: Callable[[Complex], float] = lambda w: inf

    def __call__(self, k: Complex, w: Complex) -> Complex:
        """Compliance G at each k and w."""
        return self.answer(k, w)


AIR_DENSITY = 1.2  # kg/m3
LEAST_FREQUENCY = 2 * np.pi * 0.05  # rad/s that stands for 0 in a slab
BACKWARD = 0.5  # of a layer's second resonance: where some of its modes become backward waves


def half_space(material: Material, *, poisson: float | None = None) -> Compliance:
    """Half-space: G = -b_p k_s^2 / (mu R), R = (2 k^2 - k_s^2)^2 - 4 k^2 b_p b_s.

    `poisson` stands in for the material's: here it may be 0.5, incompressible.
    """
    nu = material.poisson if poisson is None else poisson

    def compliance(k: Complex, w: Complex) -> Complex:
        mu = material.complex_modulus(w)
        ks2, kp2 = _squared_wavenumbers(material.density, mu, nu, w)
        bp, bs = np.sqrt(k**2 - kp2), np.sqrt(k**2 - ks2)
        still = np.abs(ks2) < 1e-9 * np.abs(k) ** 2  # the closed form cancels towards rest
        rayleigh = (2 * k**2 - ks2) ** 2 - 4 * k**2 * bp * bs
        dynamic = -bp * ks2 / (mu * np.where(still, 1.0, rayleigh))
        return np.where(still, (1 - nu) / (mu * k), dynamic)

    return Compliance(compliance)


def slab(material: Material, depth: float) -> Compliance:
    """Laterally infinite layer of `depth` metre bonded to a rigid base.

    Potentials phi = A e^{bp z} + B e^{-bp (z + H)} and psi likewise meet zero displacement at
    the base and unit pressure without shear at the top: four equations for each k and w, whose
    exponentials all decay, so that no thickness overflows.
    """
    density, poisson = material.density, material.poisson

    def compliance(k: Complex, w: Complex) -> Complex:
        mu = material.complex_modulus(w)  # at rest itself, which slow relaxation is far from
        w = np.where(np.abs(w) < LEAST_FREQUENCY, LEAST_FREQUENCY, w)
        ks2, kp2 = _squared_wavenumbers(density, mu, poisson, w)
        k, ks2, kp2 = np.broadcast_arrays(k, ks2, kp2)
        p, s = np.sqrt(k**2 - kp2), np.sqrt(k**2 - ks2)
        ep, es, one, t = np.exp(-p * depth), np.exp(-s * depth), np.ones_like(p), 2 * k**2 - ks2
        # Rows: normal stress and shear stress at the top, both displacements at the base.
        rows = [
            [t, t * ep, -2 * k * s, 2 * k * s * es],
            [2 * k * p, -2 * k * p * ep, -t, -t * es],
            [k * ep, k, -s * es, s],
            [p * ep, -p, -k * es, -k],
        ]
        matrix = np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
        load = np.stack([one, 0 * one, 0 * one, 0 * one], axis=-1)[..., None]
        a, b, c, d = np.moveaxis(np.linalg.solve(matrix, load)[..., 0], -1, 0)
        return (p * (a - b * ep) - k * (c + d * es)) / mu

    def clearance(w: Complex) -> float:
        """Height above the real axis below which there is no pole. Backward waves, which occur from
        somewhat below the layer's second resonance, have theirs above it by more than a shear
        wave's decay, as they carry energy more slowly (Tolstoy and Usdin, J Acoust Soc Am 29:37
        (1957)). Evanescent waves have theirs above 1 / depth.
        """
        ks2, kp2 = _squared_wavenumbers(density, material.complex_modulus(w), poisson, w)
        turns = np.maximum(np.sqrt(ks2).real / 3, np.sqrt(kp2).real) * depth / (np.pi / 2)
        decay = np.abs(np.sqrt(ks2).imag)
        return float(decay[turns > BACKWARD].min(initial=1 / depth))

    return Compliance(compliance, clearance)


def thin_sheet(
    material: Material, thickness: float, *, air_density: float = AIR_DENSITY
) -> Compliance:
    """Infinite thin sheet: G = 1 / [D* k^4 - (m + 2 rho_air/k) w^2].

    m = rho d, D* = mu* d^3 / 6 (1 - nu). The deflection of an infinite sheet under a static load
    has no bound: motion is given about a mean that is left out, G = 0 at w = 0.

    Parameters
    ----------
    material : Material
    thickness : metre
    air_density : kg/m3; 0 for vacuum

    Returns
    -------
    Compliance, m/Pa
    """
    mass_per_area = material.density * thickness

    def bending(w: Complex) -> Complex:
        return np.asarray(material.complex_modulus(w) * thickness**3 / (6 * (1 - material.poisson)))

    def compliance(k: Complex, w: Complex) -> Complex:
        inertia = (mass_per_area + 2 * air_density / k) * w**2
        return np.where(w == 0, 0, 1 / (bending(w) * k**4 - inertia))

    def clearance(w: Complex) -> float:
        """Height above the real axis of the evanescent pole: D* k^5 - m w^2 k - 2 rho_air w^2 = 0
        in the first quadrant, at 90 degrees for a real w, but at 45 in vacuum and 36 in air for a w
        that is purely imaginary.
        """
        companion = np.zeros((len(w), 5, 5), np.complex128)
        companion[:, range(1, 5), range(4)] = 1
        companion[:, 0, 3] = mass_per_area * w**2 / bending(w)
        companion[:, 0, 4] = 2 * air_density * w**2 / bending(w)
        k = np.linalg.eigvals(companion)
        still = (k.real > 0) & (k.imag > 0.1 * np.abs(k))
        return float(k.imag[still].min(initial=inf))

    return Compliance(compliance, clearance)


def _squared_wavenumbers(
    density: float, mu: Complex, poisson: float, w: Complex
) -> tuple[Complex, Complex]:
    """Squared wavenumbers k_s^2 and k_p^2 of shear and pressure waves."""
    ks2 = density * w**2 / mu
    return ks2, ks2 * (1 - 2 * poisson) / (2 - 2 * poisson)
