"""Surface compliance (Green's function) of laterally infinite bodies: u = G q at each wavenumber.

Frequencies w are complex, in rad/s; time goes as exp(+i w t).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import inf
from typing import Any

import numpy as np

from simple_model.layers.layered import clearance, surface_compliance
from simple_model.layers.material import Material
from simple_model.layers.stack import Stack
from simple_model.load.focus import SPEED_OF_SOUND
from simple_model.typing import Complex


@dataclass(frozen=True)
class Compliance:
    """Compliance G: (k, w) -> displacement into the body per pressure, m/Pa; k (k,) in 1/m, w
    (f, 1) in rad/s. No pole lies between the real axis of k and `clearance` (f,) in 1/m.
    """

    answer: Callable[[Complex, Complex], Complex]
    clearance: Callable[[Complex], float] = lambda w: inf

    def __call__(self, k: Complex, w: Complex) -> Complex:
        """Compliance G at each k and w."""
        return self.answer(k, w)


AIR_DENSITY, AIR_VISCOSITY = 1.2, 1.82e-5  # kg/m3, Pa s


def layered(stack: Stack) -> Compliance:
    """Return the compliance of a stack of layers, in closed form for a half-space."""
    if stack.thicknesses == (inf,):
        return half_space(stack.materials[0])
    return Compliance(partial(surface_compliance, stack), partial(clearance, stack))


def slab(material: Material, depth: float) -> Compliance:
    """Return the compliance of a laterally infinite layer of `depth` m bonded to a rigid base."""
    return layered(Stack(materials=(material,), thicknesses=(depth,)))


def half_space(material: Material, *, poisson: float | None = None) -> Compliance:
    """Return the compliance of a half-space, G = -b_p k_s^2 / (mu R), R = (2 k^2 - k_s^2)^2 - 4 k^2
    b_p b_s.

    b_p^2 = k^2 - k_p^2 and b_s^2 = k^2 - k_s^2 with the wavenumbers k_p and k_s of both waves. Both
    sides of the fraction are divided by k_s^2, so that G is finite at 0 Hz. `poisson` replaces the
    ratio of the material and may be 0.5.
    """
    nu = material.poisson if poisson is None else poisson
    kappa = (0.5 - nu) / (1 - nu)

    def compliance(k: Complex, w: Complex) -> Complex:
        mu = material.complex_modulus(w)
        k2, ks2 = k**2, material.density * w**2 / mu
        bp, bs = np.sqrt(k2 - kappa * ks2), np.sqrt(k2 - ks2)
        apart = (k2 * (1 + kappa) - kappa * ks2) / (k2 + bp * bs)  # (k^2 - b_p b_s) / k_s^2
        return np.asarray(bp / (mu * (4 * k2 * (1 - apart) - ks2)))

    return Compliance(compliance)


def thick_plate(kd: Any, poisson: float) -> tuple[Any, Any]:
    """Return factors of the bending stiffness and of the mass of a thin plate, for shear and rotary
    inertia at wavenumbers times thickness `kd` (...).

        1 / (1 + a), 1 + b / (1 + a),  a = (k d)^2 / (6 kappa (1 - nu)),  b = (k d)^2 / 12

    with the shear factor kappa = 5/6: the first branch of Mindlin's plate (Mindlin, J Appl Mech
    18:31 (1951)).
    """
    shear = 1 + kd**2 / (5 * (1 - poisson))
    return 1 / shear, 1 + kd**2 / 12 / shear


def thin_sheet(
    material: Material,
    thickness: float,
    *,
    air_density: float = AIR_DENSITY,
    tension: float = 0.0,
    correction: Callable[[Complex, float], tuple[Any, Any]] = lambda kd, poisson: (1.0, 1.0),
) -> Compliance:
    """Return the compliance of an infinite thin sheet with air on both sides.

        G = 1 / [D* k^4 + T k^2 - (m + 2 rho/sqrt(k^2 - w^2/c^2) + 2 sqrt(eta rho / i w)) w^2]

    with m = rho_solid d and D* = mu* d^3 / 6 (1 - nu) for a thickness d in m, a tension T in N/m,
    an air density rho in kg/m3, its speed of sound c and viscosity eta: sound, and the layer of
    viscous air beside the sheet as in `plates.air`. The static deflection is unbounded, so G = 0 at
    w = 0. The `correction` returns factors of D* and m, as `thick_plate`.
    """
    mass_per_area = material.density * thickness

    def bending(w: Complex) -> Complex:
        return np.asarray(material.complex_modulus(w) * thickness**3 / (6 * (1 - material.poisson)))

    def friction(w: Complex) -> Complex:
        """Mass per area that stands for the resistance of viscous air."""
        return np.asarray(2 * np.sqrt(air_density * AIR_VISCOSITY / (1j * np.where(w, w, 1.0))))

    def compliance(k: Complex, w: Complex) -> Complex:
        softer, heavier = correction(k * thickness, material.poisson)
        air = 2 * air_density / np.sqrt(k**2 - (w / SPEED_OF_SOUND) ** 2) + friction(w)
        inertia = (heavier * mass_per_area + air) * w**2
        stiffness = softer * bending(w) * k**4 + tension * k**2
        return np.where(w == 0, 0, 1 / (stiffness - inertia))

    def clearance(w: Complex) -> float:
        companion = np.zeros((len(w), 5, 5), np.complex128)
        companion[:, range(1, 5), range(4)] = 1
        companion[:, 0, 1] = -tension / bending(w)
        companion[:, 0, 3] = (mass_per_area + friction(w)) * w**2 / bending(w)
        companion[:, 0, 4] = 2 * air_density * w**2 / bending(w)
        k = np.linalg.eigvals(companion)
        decaying = (k.real > 0) & (k.imag > 0.1 * np.abs(k))
        return float(k.imag[decaying].min(initial=inf))

    return Compliance(compliance, clearance)
