"""Places measured one after the other, brought into step by the reference recorded with each."""

import numpy as np
from scipy.signal import correlate

from simple_model.typing import Floats

LEAST_LEFT = 0.5  # of the samples, after what is not common to all places is cut off
ALIKE = 0.8  # correlation of references that are of one signal
WHOLE = 0.01  # samples: smaller fractions of a delay are round-off
ONE_AFTER_ANOTHER = (
    "no reference was recorded with each place: they are taken as simultaneous, and phases between "
    "places are wrong unless one trigger started all"
)


def aligned(values: Floats, references: Floats) -> tuple[Floats, Floats, str]:
    """Values from where the reference of each begins, that reference, and a sentence.

    Parameters
    ----------
    values, references : (r, t, p) float, of each repetition and place

    Returns
    -------
    values (r, m, p), reference (m,); as they were and none if the references are not alike
    """
    lags = delays(references)
    count = values.shape[1]
    begin = lags - lags.min()
    left = count - int(np.ceil(begin.max()))
    if left < LEAST_LEFT * count:
        return values, np.empty(0), (
            f"places are not aligned in time: their references lie {begin.max():.0f} samples apart"
        )  # fmt: skip
    moved, drives = _shifted(values, begin, left), _shifted(references, begin, left)
    centred = drives - drives.mean(axis=1, keepdims=True)
    centred /= np.linalg.norm(centred, axis=1, keepdims=True) + np.finfo(float).tiny
    alike = np.einsum("t,rtp->rp", centred[0, :, 0], centred)
    if alike.min() < ALIKE:
        return values, np.empty(0), (
            f"places are not aligned in time: their references differ, with a correlation of "
            f"{alike.min():.2g}; phases between places are unknown"
        )  # fmt: skip
    said = f"places aligned in time by their references, by up to {np.ptp(lags):.4g} samples"
    return moved, drives[0, :, 0], said


def delays(references: Floats) -> Floats:
    """Delay (r, p) in samples of each reference (r, t, p) behind the first.

    Whole samples are where the cross-correlation is largest; the fraction is the slope of the
    phase over frequency of what overlaps.
    """
    centred = references - references.mean(axis=1, keepdims=True)
    n = centred.shape[1]
    first = centred[0, :, 0]
    found = np.zeros((centred.shape[0], centred.shape[2]))
    for r, p in np.ndindex(*found.shape):
        one = centred[r, :, p]
        lag = int(np.argmax(correlate(one, first, method="fft"))) - (n - 1)
        fraction = _fraction(
            first[max(-lag, 0) : n - max(lag, 0)], one[max(lag, 0) :][: n - abs(lag)]
        )
        found[r, p] = lag + (fraction if WHOLE < abs(fraction) < 1 else 0.0)
    return found


def _fraction(first: Floats, other: Floats) -> float:
    """Delay in samples of a signal behind another that it nearly overlaps."""
    window = np.hanning(len(first))
    cross = np.fft.rfft(window * other) * np.fft.rfft(window * first).conj()
    omega = 2 * np.pi * np.fft.rfftfreq(len(first))
    weights = np.abs(cross) * (np.abs(cross) > 1e-3 * np.abs(cross).max(initial=0.0))
    size = float((weights * omega**2).sum())
    return -float((weights * omega * np.angle(cross)).sum()) / size if size > 0 else 0.0


def _shifted(values: Floats, begin: Floats, left: int) -> Floats:
    """Values (r, m, p) from `begin` (r, p) on, between samples by cubic splines."""
    from scipy.interpolate import CubicSpline  # only where it is needed: it takes a while

    found = np.empty((values.shape[0], left, values.shape[2]))
    for r, p in np.ndindex(*begin.shape):
        whole = int(begin[r, p])
        at = begin[r, p] + np.arange(left)
        found[r, :, p] = (
            values[r, whole : whole + left, p] if whole == begin[r, p]
            else CubicSpline(np.arange(values.shape[1]), values[r, :, p])(at)
        )  # fmt: skip
    return found
