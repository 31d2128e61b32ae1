"""A measurement on a page: read from what the browser sends, drawn beside the models."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from meshes.tetmesh import Floats
from simple_model import Response
from simple_model import spectrum as model_spectrum
from simple_model.quantities import Quantity, quantity
from skinwave.measurements import Measurement

LARGEST_FILE = 20_000_000  # bytes of what a page sends


def read(name: str, content: bytes) -> Measurement:
    """Measurement in a file of this name and content.

    Raises
    ------
    ValueError
        In one sentence, if it is too large, of no known kind or malformed.
    """
    if len(content) > LARGEST_FILE:
        raise ValueError(
            f"a file of {len(content) / 1e6:.3g} MB exceeds {LARGEST_FILE / 1e6:g} MB, the most "
            "that a page takes; use skinwave compare --measured"
        )
    from skinwave.measurements.reading import read as read_file

    with TemporaryDirectory() as folder:
        file = Path(folder, f"measured{Path(name).suffix.lower()}")
        file.write_bytes(content)
        try:
            return read_file(file)
        except ValueError as error:
            raise ValueError(str(error).replace(f"{file}", name or "the file")) from None


def nearest(measured: Measurement, probe: Floats) -> int:
    """Index of the place nearest a probe (2,) in metre; the first if no place is known."""
    away = np.linalg.norm(measured.places - probe, axis=1)
    return 0 if np.isnan(away).all() else int(np.nanargmin(away))


def named(measured: Measurement, place: int) -> str:
    """Name of the curve of a place."""
    x, y = 1e3 * measured.places[place]
    where = f" at ({x:g}, {y:g}) mm" if np.isfinite([x, y]).all() else ""
    return f"measured{where}, {quantity(measured.quantity).shown}"


def waveform(measured: Measurement, place: int) -> tuple[Floats, Floats]:
    """Times (t,) in s from the first, and the mean (t,) of all repetitions; empty of spectra."""
    if not len(measured.times):
        return np.empty(0), np.empty(0)
    return measured.times - measured.times[0], measured.values[:, :, place].mean(axis=0).real


def spectrum(measured: Measurement, place: int) -> tuple[Floats, Floats]:
    """Frequencies (f,) in Hz and amplitudes (f,) of the mean of all repetitions, by the window that
    the models' spectra have.
    """
    if len(measured.frequencies):
        return measured.frequencies, np.abs(measured.values[:, :, place].mean(axis=0))
    t, values = waveform(measured, place)
    shown = Response(
        model="measured", times=t, probes=np.zeros((1, 2)), values=values[:, None],
        quantity=measured.quantity,
    )  # fmt: skip
    frequencies, amplitudes = model_spectrum(shown)
    return frequencies, amplitudes[:, 0]


def refusal(measured: Measurement, shown: Quantity) -> str:
    """Reason why it is not drawn beside a quantity; nothing if it is."""
    if measured.quantity == shown.name:
        return ""
    words = quantity(measured.quantity).words
    return f"The measurement is of {words}: choose it as the quantity at the point to see it."
