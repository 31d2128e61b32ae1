"""Packs of laterally infinite bodies: their compliance over wavenumber and frequency."""

import base64
from typing import Any

import numpy as np

from skinwave.effort import Progress, silent
from skinwave.live.wavenumbers import FURTHEST, wavenumbers
from skinwave.scene import Body

LOWEST = 0.1  # m: height of the focus from which a pack serves every height


def radial_pack(body: Body, progress: Progress = silent) -> dict[str, Any]:
    """Pack of a laterally infinite body.

    Parameters
    ----------
    body : Body
    progress : is told of the phase

    Returns
    -------
    dict for JSON: `frequencies` (f,) in Hz, complex `k` (k,) in 1/m and `weights` of the path of
    integration, and the compliance `G` (f, k) in m/Pa, of 16 bits relative to the largest of a
    frequency
    """
    known = wavenumbers(body, LOWEST, progress)
    return {
        "kind": "radial",
        "frequencies": known.frequencies.tolist(),
        "furthest": FURTHEST,
        "n_distances": len(known.distances),
        "k": packed(known.k[None]),
        "weights": packed(known.weights[None]),
        "G": quantised(known.G),
    }


def packed(values: np.ndarray) -> dict[str, Any]:
    """Complex rows (n, m) as 64-bit floats in base 64."""
    pairs = np.stack([values.real, values.imag], axis=-1).astype("<f8")
    return {"shape": list(values.shape), "f8": base64.b64encode(pairs.tobytes()).decode()}


def quantised(values: np.ndarray) -> dict[str, Any]:
    """Complex rows (n, m) as whole numbers of 16 bits, each row relative to its largest."""
    pairs = np.stack([values.real, values.imag], axis=-1)
    largest = np.maximum(np.abs(pairs).max(axis=(1, 2)), 1e-300)
    whole = np.rint(pairs / largest[:, None, None] * 32767).astype("<i2")
    return {
        "shape": list(values.shape),
        "scale": (largest / 32767).tolist(),
        "i2": base64.b64encode(whole.tobytes()).decode(),
    }
