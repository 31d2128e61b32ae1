"""Arrays as text in JSON: 64-bit floats, or integers of 16 or 12 bits with a scale for each row."""

import base64
from string import ascii_lowercase, ascii_uppercase, digits
from typing import Any

import numpy as np

Packed = dict[str, Any]


def pack(values: np.ndarray) -> Packed:
    """Encode real or complex rows (n, m) as 64-bit floats in base 64."""
    rows = np.atleast_2d(values)
    found = {"shape": list(rows.shape), "f8": base64_text(_parts(rows), "<f8")}
    return found if np.iscomplexobj(rows) else found | {"real": True}


def quantise(values: np.ndarray, bits: int = 16) -> Packed:
    """Encode real or complex rows (n, m) as integers of 16 or 12 bits, relative to each row's peak.

    An integer of 12 bits takes two letters of base 64, with 2048 added.
    """
    parts = _parts(values)
    largest = np.maximum(np.abs(parts).reshape(len(values), -1).max(axis=1), 1e-300)
    steps = largest / (2 ** (bits - 1) - 1)
    whole = np.rint(parts / steps.reshape(-1, *(1,) * (parts.ndim - 1))).astype("<i2")
    encoded = {"i2": base64_text(whole, "<i2")} if bits == 16 else {"i12": _letters(whole)}
    found = {"shape": list(values.shape), "scale": steps.tolist()} | encoded
    return found if np.iscomplexobj(values) else found | {"real": True}


def _parts(values: np.ndarray) -> np.ndarray:
    """Return real and imaginary parts of complex values along a new last axis."""
    return np.stack([values.real, values.imag], -1) if np.iscomplexobj(values) else values


def base64_text(values: np.ndarray, kind: str) -> str:
    """Return the bytes of an array of a kind, such as "<f8", in base 64."""
    return base64.b64encode(values.astype(kind).tobytes()).decode()


def _letters(whole: np.ndarray) -> str:
    """Return integers of 12 bits as two letters of base 64 each."""
    alphabet = np.frombuffer(f"{ascii_uppercase}{ascii_lowercase}{digits}+/".encode(), np.uint8)
    positive = whole.ravel() + 2048
    return alphabet[np.column_stack([positive >> 6, positive & 63])].tobytes().decode()
