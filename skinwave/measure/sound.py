"""WAV: each channel a place, full scale the unit that is given."""

import io
import warnings
from pathlib import Path

import numpy as np
from scipy.io import wavfile

from meshes import reading
from skinwave.measure.headers import Column
from skinwave.measure.layouts import recording
from skinwave.measure.recording import Given, Recording
from skinwave.measure.table import Table

LARGEST = 500_000_000  # bytes


def read(path: Path, given: Given) -> Recording:
    """The samples of a WAV; those that are whole numbers are fractions of full scale.

    Raises
    ------
    ValueError
        If it is none, or has fewer than two samples.
    """
    content = reading.content(path, LARGEST)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", wavfile.WavFileWarning)  # of chunks beside the samples
            rate, data = wavfile.read(io.BytesIO(content))
    except Exception:  # whatever is made of spoilt bytes
        raise ValueError("the file is damaged or not a WAV file; export it anew as PCM") from None
    if len(data) < 2:
        raise ValueError(f"the WAV has {len(data)} samples; give two or more")
    values = _of_full_scale(data.reshape(len(data), -1))
    columns = tuple(Column(text=f"channel {k + 1}", role="") for k in range(values.shape[1]))
    return recording(
        Table(columns=columns, numbers=values, notes=(("rate", repr(float(rate))),)), given
    )


def _of_full_scale(data: np.ndarray) -> np.ndarray:
    if data.dtype == np.uint8:
        return (data.astype(np.float64) - 128) / 128
    if data.dtype.kind == "i":  # 24 bits are the upper ones of 32
        return data / float(2 ** (8 * data.dtype.itemsize - 1))
    with np.errstate(invalid="ignore"):  # of what is no number, which is refused later
        return data.astype(np.float64)
