"""Clipping: waveforms cut off at the end of a range."""

import numpy as np

from simple_model.typing import Floats
from skinwave.measure.measurement import Measurement

RUN = 3  # samples in a row at the same extreme,
RUNS = 2  # and so many of these, or
LONG = 20  # one as long
BELOW = 0.005  # of the half range: the band next to the extreme that is compared with it
EXCESS = 6.0  # times the samples in the band; a sinusoid that is rounded has 2.4 at most


def clipped(waveform: Floats) -> int:
    """How many samples of a waveform (t,) are cut off at its largest or its smallest value.

    A peak that rounding makes flat has as many samples in the next step below it; one that is cut
    off has not.
    """
    if np.ptp(waveform) == 0:
        return 0
    return _cut_off(waveform) + _cut_off(-waveform)


def clipped_samples(measured: Measurement) -> np.ndarray:
    """Samples (r, p) that are cut off, by repetition and place; none of spectra."""
    if measured.is_spectrum:
        return np.zeros((len(measured.values), measured.values.shape[2]), int)
    return np.array([[clipped(waveform) for waveform in run.T] for run in measured.values])


def _cut_off(x: Floats) -> int:
    top = x.max()
    at_top = x == top
    edges = np.diff(np.r_[False, at_top, False].astype(int))
    lengths = np.flatnonzero(edges < 0) - np.flatnonzero(edges > 0)
    if (lengths >= RUN).sum() < RUNS and lengths.max() < LONG:
        return 0
    next_step = x[x < top].max()
    band = min(top - BELOW * np.ptp(x) / 2, next_step)
    below = int(((x < top) & (x >= band)).sum())
    count = int(at_top.sum())
    return count if count > EXCESS * below else 0
