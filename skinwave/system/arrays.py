"""Arrays as text in JSON: 64-bit floats, or 16-bit integers with a scale for each row."""

import base64
from typing import Any

import numpy as np

Packed = dict[str, Any]
LARGEST = 32767


def pack(values: np.ndarray) -> Packed:
    """Encode real or complex rows (n, m) as 64-bit floats in base 64."""
    rows = np.atleast_2d(values)
    found = {"shape": list(rows.shape), "f8": _text(_parts(rows).astype("<f8"))}
    return found if np.iscomplexobj(rows) else found | {"real": True}


def quantise(values: np.ndarray) -> Packed:
    """Encode real or complex rows (n, m) as 16-bit integers relative to the largest of each row."""
    parts = _parts(values)
    largest = np.maximum(np.abs(parts).reshape(len(values), -1).max(axis=1), 1e-300)
    scale = (largest / LARGEST).reshape(-1, *(1,) * (parts.ndim - 1))
    found = {
        "shape": list(values.shape), "scale": (largest / LARGEST).tolist(),
        "i2": _text(np.rint(parts / scale).astype("<i2")),
    }  # fmt: skip
    return found if np.iscomplexobj(values) else found | {"real": True}


def _parts(values: np.ndarray) -> np.ndarray:
    """Return real and imaginary parts of complex values along a new last axis."""
    return np.stack([values.real, values.imag], -1) if np.iscomplexobj(values) else values


def _text(values: np.ndarray) -> str:
    return base64.b64encode(values.tobytes()).decode()
