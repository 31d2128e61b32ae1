"""Misfit of a model beyond the noise, and the error that it leaves in estimates.

The residual of a wrong model is systematic: more samples, lines or places do not average it out.
It therefore counts as one complex value. Its two real parts estimate one variance, which is taken
as equal along the slopes of the parameters and across them, with two degrees of freedom.
"""

from math import sqrt

import numpy as np
from scipy.special import fdtri, stdtrit

LARGEST_MISFIT = 0.2  # of the motion, beyond the noise, with which a model describes a record
NOT_DESCRIBED = "the model does not describe this record"


def beyond_noise(chi_squared: float, dof: float, freedom: float = np.inf) -> float:
    """Return the part of chi squared above its largest value from noise alone.

    `freedom` are the degrees of freedom of the errors. If the errors are unknown, it is 0, and the
    whole residual is taken as misfit.
    """
    if not freedom > 0:
        return chi_squared
    chance = 1e-3  # that noise alone leaves a misfit
    return max(chi_squared - dof * float(fdtri(dof, min(freedom, 1e6), 1 - chance)), 0.0)


def systematic(beyond: float) -> float:
    """Return half the 95 % interval, along a slope of length 1, from chi squared beyond noise."""
    return float(stdtrit(2, 0.975)) * sqrt(beyond / 2)


def unexplained(misfit: float, beyond: float, chi_squared: float) -> float:
    """Return the part of a misfit that noise does not explain."""
    return misfit * sqrt(beyond / chi_squared) if beyond > 0 else 0.0
