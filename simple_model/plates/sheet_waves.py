"""Bending modes of an infinite thin sheet, with the air on both sides or in vacuum.

The poles of `compliance.thin_sheet`, D k^5 + T k^3 - m w^2 k - 2 rho_air w^2 = 0 with Re k >= 0:
the bending wave, and its near field, which is evanescent.
"""

import numpy as np
from numpy.typing import ArrayLike

from simple_model.layers.compliance import AIR_DENSITY
from simple_model.layers.dispersion import (
    DispersionCurves,
    checked_frequencies,
    curves,
    modulus_and_slope,
)
from simple_model.layers.material import Material
from simple_model.layers.mode_tracking import Found
from simple_model.layers.stack import Stack
from simple_model.typing import Complex, Floats

NAMES = ("bending wave", "bending near field")


def sheet_curves(
    material: Material,
    thickness: float,
    frequencies: ArrayLike,
    *,
    air_density: float = AIR_DENSITY,
    tension: float = 0.0,
) -> DispersionCurves:
    """Dispersion curves of the bending wave of an infinite Kirchhoff plate, and of its near field.

    The shapes are at both faces, along x by the rotation of the section, U = k W z from the middle.

    Parameters
    ----------
    material, thickness : Material, and metre
    frequencies : (f,) float, Hz, above 0 and ascending, otherwise a ValueError
    air_density : kg/m3; 0 for vacuum
    tension : N/m, the same in all directions
    """
    f = checked_frequencies(frequencies)
    omega = 2 * np.pi * f
    sheet = Stack(materials=(material,), thicknesses=(thickness,), base="free")
    mu, slope = (x[:, 0] for x in modulus_and_slope(sheet, omega))
    bending = thickness**3 / (6 * (1 - material.poisson)) * mu
    mass, air = material.density * thickness, 2 * air_density
    k = _roots(bending, tension, mass * omega**2, air * omega**2)
    D, w = bending[:, None], omega[:, None]
    by_k = 5 * D * k**4 + 3 * tension * k**2 - mass * w**2
    by_frequency = (slope / mu)[:, None] * D * k**5 - 2 * w * (mass * k + air)
    tilt = k * thickness / 2  # of the upper face, z downwards
    upper, lower = (np.stack([sign * tilt, np.ones_like(k)], axis=-1) for sign in (-1, 1))
    found = Found(
        squared=k**2, slope=-2 * k * by_frequency / by_k, wavenumbers=k,
        residues=2 * k**2 / by_k, energy_speed=np.full(k.shape, np.inf),
        shapes=np.stack([upper, lower], axis=2),
    )  # fmt: skip
    return curves(f, np.array([0.0, thickness]), found, NAMES)


def _roots(bending: Complex, tension: float, inertia: Floats, air: Floats) -> Complex:
    """The propagating and the evanescent root (f, 2) of D k^5 + T k^3 - a k - b = 0, by Newton's
    method.
    """
    D, a, b = bending[:, None], inertia[:, None], air[:, None]
    half = tension / 2 / D
    mean = np.sqrt(half**2 + a / D + 0j)
    k = np.sqrt(np.hstack([mean - half, mean + half])) * np.array([1, -1j])
    for _ in range(50):
        k = k - (D * k**5 + tension * k**3 - a * k - b) / (5 * D * k**4 + 3 * tension * k**2 - a)
    return np.asarray(k)
