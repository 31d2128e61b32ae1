"""Closed form of the stress in a half-space under a focus at rest."""

import numpy as np
from scipy.integrate import quad
from scipy.special import j0, j1

WIDTH = 4.5e-3  # m, standard deviation of the pressure


def boussinesq(poisson, r, z, width=WIDTH):
    """Stresses rr, tt, zz, rz below a Gaussian of 1 Pa; Johnson, Contact Mechanics, section 3.2."""

    def hankel(kernel):
        def integrand(k):
            return width**2 * np.exp(-((k * width) ** 2) / 2 - k * z) * k * kernel(k)

        return quad(integrand, 0, 9 / width, limit=200)[0]

    def ring(k):
        return j1(k * r) / (k * r) if r else 0.5

    free = 1 - 2 * poisson
    return (
        -hankel(lambda k: (1 - k * z) * j0(k * r) - (free - k * z) * ring(k)),
        -hankel(lambda k: 2 * poisson * j0(k * r) + (free - k * z) * ring(k)),
        -hankel(lambda k: (1 + k * z) * j0(k * r)),
        hankel(lambda k: k * z * j1(k * r)),
    )
