"""Flaws of a record that falsify the lines of its load: clipping, and mains hum on one of them."""

import numpy as np

from simple_model import MovingPressure
from simple_model.load.line_names import line_names
from skinwave.measure.clipping import clipped_samples
from skinwave.measure.mains import MAINS, WANDER, mains_in
from skinwave.measure.measurement import Measurement

STRONG = 1e-2  # of the strongest line of the load: what hum may be mistaken for
MULTIPLES = 7  # of the mains frequency, which a hum may have


def flaws(measurement: Measurement, pressure: MovingPressure) -> list[str]:
    """Sentences, without a full stop, on what falsifies the lines of a load in waveforms.

    Parameters
    ----------
    measurement : Measurement
    pressure : MovingPressure, whose lines are looked for

    Returns
    -------
    sentences; none of spectra, in which neither can be seen
    """
    return (
        [] if measurement.is_spectrum else [*_clipping(measurement), *_hum(measurement, pressure)]
    )


def _clipping(measurement: Measurement) -> list[str]:
    cut = clipped_samples(measurement)
    if not cut.any():
        return []
    from skinwave.measure.summary import places_words  # which loads statistics

    return [
        f"the record is clipped: {int(cut.sum()):,} samples in runs at the same extreme, at "
        f"{places_words(measurement, np.flatnonzero(cut.sum(axis=0)))}, which makes lines weaker "
        "and adds others; measure with a larger range"
    ]


def _hum(measurement: Measurement, pressure: MovingPressure) -> list[str]:
    """Sentence on lines of the load that are no further from a multiple of a mains frequency, of
    which there is hum, than the record resolves.
    """
    load = line_names(pressure)
    strong = load.strengths >= STRONG * load.strengths.max(initial=0.0)
    f, names = load.frequencies[strong], np.array(load.names)[strong]
    apart = 1 / float(np.ptp(measurement.times))
    multiples = np.multiply.outer(np.arange(1, MULTIPLES + 1), MAINS).ravel()
    near = np.abs(f[:, None] - multiples) <= apart + WANDER * multiples
    if not near.any():
        return []
    from skinwave.measure.inspection import kept_lines  # likewise

    found = kept_lines(measurement)
    driven = [k for k, x in enumerate(found) if (np.abs(f - x.frequency) <= apart).any()]
    return [
        f"there is mains hum of {base:.4g} Hz, and {', '.join(names[on])} of the load "
        f"{'is' if on.sum() == 1 else 'are'} no further from a multiple of it than the record "
        "resolves: what is measured there may be hum"
        for base in mains_in(found, driven)
        if (on := _on_multiples(f, base, apart)).any()
    ]  # fmt: skip


def _on_multiples(f: np.ndarray, base: float, apart: float) -> np.ndarray:
    """Mask (f,) of frequencies that a record does not resolve from the multiples of a base."""
    n = np.round(f / base)
    return np.asarray((n >= 1) & (n <= MULTIPLES) & (np.abs(f - n * base) <= apart))
