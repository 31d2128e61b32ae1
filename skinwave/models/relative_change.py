"""Relative change of waveforms: the error measure of all models and plans."""

import numpy as np

from skinwave.typing import Array, Floats

NO_MOTION = 1e-9  # of the probe that moves most: weaker motion is round-off


def relative_changes(change: Array, values: Array) -> Floats:
    """Return the norm of a change (k, p) over that of values (k, p), for each of p probes."""
    sizes = np.linalg.norm(values, axis=0)
    floor = max(NO_MOTION * float(sizes.max()), 1e-300)
    return np.asarray(np.linalg.norm(change, axis=0) / np.maximum(sizes, floor))
