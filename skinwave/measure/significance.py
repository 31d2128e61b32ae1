"""Significance of differences from measured lines, and their confidence regions."""

import numpy as np
from scipy.special import fdtri  # whose module is loaded anyway; `scipy.stats` takes a second

from meshes.tetmesh import Floats
from skinwave.measure.lines import MeasuredLines


def ellipses(lines: MeasuredLines, level: float = 0.95) -> tuple[Floats, Floats, Floats]:
    """Confidence ellipses of the means in the complex plane.

    From the covariance of real and imaginary parts over the repetitions, by Hotelling's T2; of less
    than four repetitions circles, by the circular statistic (Victor & Mast 1991,
    doi 10.1016/0013-4694(91)90099-P).

    Parameters
    ----------
    lines : MeasuredLines
    level : confidence, 0..1

    Returns
    -------
    semi-axes (f, p), the larger and the smaller, in the unit of the measurement, and the angle
    (f, p) in rad of the larger from the real axis
    """
    r = len(lines.each)
    if r < 4:
        radius = np.sqrt(lines.variance * fdtri(2, lines.freedom, level))
        return radius, radius, np.zeros_like(radius)
    away = lines.each - lines.mean
    parts = np.stack([away.real, away.imag])
    covariance = np.einsum("irfp,jrfp->fpij", parts, parts) / (r - 1) / r
    values, vectors = np.linalg.eigh(covariance)
    reach = 2 * (r - 1) / (r - 2) * fdtri(2, r - 2, level)
    minor, major = np.moveaxis(np.sqrt(np.maximum(reach * values, 0)), -1, 0)
    return major, minor, np.arctan2(vectors[..., 1, 1], vectors[..., 0, 1])


def significances(away: np.ndarray, lines: MeasuredLines) -> Floats:
    """P-values (f, p) that deviations (f, p) from the means are noise, which is taken as circular.

    |away|^2 over the variance of the mean is F distributed with 2 and 2 (r - 1) degrees of freedom
    (Victor & Mast 1991); nan where the noise is unknown.
    """
    half = lines.freedom / 2
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.abs(away) ** 2 / lines.variance
        found = (1 + ratio / half) ** -half
    return np.where(np.isnan(lines.variance), np.nan, np.where(np.abs(away) == 0, 1.0, found))


def radius(lines: MeasuredLines, level: float) -> Floats:
    """Radius (f, p) about the means within which the true amplitudes lie with a confidence."""
    half = lines.freedom / 2
    return np.sqrt(lines.variance * half * ((1 - level) ** (-1 / half) - 1))


def holm(p: Floats) -> Floats:
    """P-values adjusted for their number, so that with a threshold of a the chance of any false
    one among them is at most a (Holm 1979); nan stays.
    """
    known = np.flatnonzero(np.isfinite(p.ravel()))
    order = known[np.argsort(p.ravel()[known], kind="stable")]
    adjusted = np.full(p.size, np.nan)
    times = len(order) - np.arange(len(order))
    adjusted[order] = np.minimum(np.maximum.accumulate(times * p.ravel()[order]), 1.0)
    return adjusted.reshape(p.shape)
