"""Errors that are not independent along their axis: by how much they widen intervals.

Least squares moves an estimate by d = P e with the errors e of variance s^2, where P is the
pseudo-inverse of the slopes. Where e is stationary along the axis, the variance of d is that of a
sandwich covariance, as in `skinwave.measure.lines`, instead of s^2 |P|^2, with the residuals'
periodogram, smoothed over the square root of their number (Daniell). For a mean the ratio is that
of the samples to the effective samples of Bayley and Hammersley (J Roy Stat Soc Suppl 8:184
(1946)).
"""

import numpy as np
from scipy.ndimage import uniform_filter1d

from meshes.tetmesh import Floats


def widening(residual: Floats, rows: Floats) -> Floats:
    """Factors (k,) >= 1 by which intervals of linear combinations of the errors are wider than for
    independent ones.

    Parameters
    ----------
    residual : (n, s) float
    rows : (k, n, s) float, combinations P of the errors

    Returns
    -------
    (k,) float
    """
    power = np.abs(np.fft.fft(residual, axis=0)) ** 2 / len(residual)
    power[0] = power[1:3].mean(axis=0)  # a fit may have taken the mean out
    density = uniform_filter1d(power, int(np.sqrt(len(residual))) | 1, axis=0, mode="wrap")
    sandwich = [(density * np.abs(np.fft.fft(row, axis=0)) ** 2).sum() for row in rows]
    independent = (residual**2).sum() * (rows**2).sum(axis=(1, 2)) / residual.shape[1]
    return np.asarray(np.sqrt(np.maximum(sandwich / np.maximum(independent, 1e-300), 1.0)))
