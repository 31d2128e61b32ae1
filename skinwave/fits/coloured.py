"""Errors that are not independent along their axis: by how much they widen intervals.

Least squares moves an estimate by d = P e with the errors e of variance s^2, where P is the
pseudo-inverse of the slopes. Where e is stationary along the axis with the spectral density S, the
variance of d is that of a sandwich covariance,

    var d = sum over series of 1/N sum_f S(f) |F P(f)|^2,     F the transform of N = 2 n samples

instead of s^2 |P|^2 (White, Econometrica 48:817 (1980); Newey and West, Econometrica 55:703
(1987)). S is the transform of the residuals' autocovariances under a flat-top window, as wide as
these are significant (Politis, J Nonparametric Statistics 15:517 (2003)). For a mean, whose P is
constant, the ratio is that of the samples to the effective samples of Bayley and Hammersley (J Roy
Stat Soc Suppl 8:184 (1946)).
"""

import numpy as np

from meshes.tetmesh import Floats

CLEAR = 2.0  # standard errors from which an autocorrelation is no chance
IN_A_ROW = 5  # lags that are not, after which none is taken to be
LONGEST = 1 / 6  # of the samples: the last lag that is looked at


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
    n = len(residual)
    covariances = autocovariances(residual)
    window = flat_top(significant_lags(covariances), n)[:, None]
    density = np.maximum(np.fft.rfft(_even(window * covariances), axis=0).real, 0.0)
    density[1:-1] *= 2  # for the frequencies of the other sign
    power = (np.abs(np.fft.rfft(row, 2 * n, axis=0)) ** 2 for row in rows)
    sandwich = np.array([(density * each).sum() for each in power]) / (2 * n)
    independent = (residual**2).mean() * (rows**2).sum(axis=(1, 2))
    return np.asarray(np.sqrt(np.maximum(sandwich / np.maximum(independent, 1e-300), 1.0)))


def autocovariances(residual: Floats) -> Floats:
    """Autocovariances (n, s) at lags from 0, each the sum of products over n."""
    n = len(residual)
    power = np.abs(np.fft.rfft(residual, 2 * n, axis=0)) ** 2
    return np.asarray(np.fft.irfft(power, 2 * n, axis=0)[:n] / n)


def significant_lags(covariances: Floats) -> int:
    """The last lag before several in a row at which the mean autocorrelation is no more than
    chance.
    """
    n, series = covariances.shape
    each = (covariances / np.maximum(covariances[0], 1e-300)).mean(axis=1)
    limit = CLEAR * np.sqrt(np.log10(max(n, 10)) / (n * series))
    last = max(int(LONGEST * n), 1)
    quiet = 0
    for lag in range(1, last + 1):
        quiet = quiet + 1 if abs(each[lag]) < limit else 0
        if quiet == IN_A_ROW:
            return lag - IN_A_ROW
    return last - quiet


def flat_top(lags: int, n: int) -> Floats:
    """Lag window (n,): 1 up to so many lags, and from there down to 0 at twice as many."""
    x = np.arange(n) / max(lags, 1)
    return np.asarray(np.clip(2 - x, 0, 1)) if lags else (x == 0).astype(float)


def _even(half: Floats) -> Floats:
    """Values (2 n, s) at lags from 0 up, and then from the most negative one."""
    return np.concatenate([half, np.zeros((1, half.shape[1])), half[:0:-1]])
