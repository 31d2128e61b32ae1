"""Measurements as files that `reading.read` gives back to the last bit: .npz and CSV, in SI."""

import io
from decimal import Decimal
from pathlib import Path

import numpy as np

from simple_model.choices import choose
from skinwave.measure.arrays import FORMAT
from skinwave.measure.measurement import Measurement
from skinwave.results.outputs import output_file
from skinwave.system.plain_text import csv_table


def npz(measured: Measurement) -> bytes:
    """A measurement as an .npz file: times in s, places in m, values (r, t or f, p) in SI."""
    file = io.BytesIO()
    np.savez(
        file, format=FORMAT, quantity=measured.quantity, unit=measured.record.unit,
        positive="into the body", places=measured.places, times=measured.times,
        frequencies=measured.frequencies, values=measured.values, drive=measured.drive,
        name=measured.name, source=measured.source,
        remarks=np.array(measured.remarks, dtype=str),
    )  # fmt: skip
    return file.getvalue()


def table(measured: Measurement) -> bytes:
    """A measurement as CSV, a column a place and repetition, two of them for complex amplitudes;
    above it lines that begin with # have its name and remarks.
    """
    unit, spectrum = measured.record.unit, measured.is_spectrum
    header = ["f [Hz]" if spectrum else "t [s]"]
    columns = [measured.axis]
    for name, values in (
        *(((_place(x, y) + f"#{r + 1}" * (r > 0)), measured.values[r, :, p])
          for r in range(len(measured.values)) for p, (x, y) in enumerate(measured.places)),
        *((("drive", measured.drive),) if len(measured.drive) else ()),
    ):  # fmt: skip
        said = name if name == "drive" else f"{measured.quantity}{name} [{unit}]"
        header += [f"re {said}", f"im {said}"] if spectrum else [said]
        columns += [values.real, values.imag] if spectrum else [values]
    rows = zip(*(map(repr, column.tolist()) for column in columns), strict=True)
    notes = [("name", measured.name), ("positive", "into the body")]
    notes += [("remark", remark) for remark in measured.remarks]
    above = "".join(f"# {key}: {' '.join(said.split())}\r\n" for key, said in notes if said)
    return above.encode() + csv_table(header, rows)


def _place(x: float, y: float) -> str:
    """Place in mm, exact: (5,0)."""
    return "({:f},{:f})".format(*((Decimal(repr(float(v))) * 1000).normalize() for v in (x, y)))


WRITERS = {".npz": npz, ".csv": table}


def write(measured: Measurement, path: str | Path, *, overwrite: bool = False) -> None:
    """Write a measurement as .npz or .csv; raises a ValueError if the suffix is another one, or the
    file is there and may not be replaced.
    """
    path = Path(path)
    writer = WRITERS[choose("kind of file", path.suffix.lower(), WRITERS)]
    with output_file(path, overwrite=overwrite) as file:
        file.write(writer(measured))
