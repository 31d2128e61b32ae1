"""Columns own_crest_factor and own_mean_part of a sweep: peak over RMS, and mean over peak."""

import numpy as np

from skinwave.results.run import Run
from skinwave.sweeps.measures import Column, register


def crest_factor(run: Run) -> np.ndarray:
    """Return the largest motion about its mean over its RMS at each probe, √2 of a sinusoid."""
    motion = run.response.values - run.response.values.mean(axis=0)  # (times, probes)
    return np.abs(motion).max(axis=0) / np.sqrt(np.mean(motion**2, axis=0))


def mean_part(run: Run) -> float:
    """Return the mean over the largest value at the first probe."""
    values = run.response.values[:, 0]
    return float(values.mean() / np.abs(values).max())


register(Column(name="crest_factor", value=crest_factor, per_probe=True))
register(Column(name="mean_part", value=mean_part))
