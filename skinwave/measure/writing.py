"""Measurements as files that `reading.read` reads back to the last bit: .npz and CSV, in SI."""

import io
from decimal import Decimal
from pathlib import Path

import numpy as np

from simple_model.choices import choose
from skinwave.measure.arrays import FORMAT
from skinwave.measure.measurement import Measurement
from skinwave.results.outputs import output_file
from skinwave.system.plain_text import csv_table


def to_npz(measured: Measurement) -> bytes:
    """Return an .npz file with all fields."""
    file = io.BytesIO()
    np.savez(
        file, format=FORMAT, quantity=measured.quantity, unit=measured.record.unit,
        positive="into the body", places=measured.places, times=measured.times,
        frequencies=measured.frequencies, values=measured.values, drive=measured.drive,
        name=measured.name, source=measured.source,
        remarks=np.array(measured.remarks, dtype=str),
    )  # fmt: skip
    return file.getvalue()


def to_csv(measured: Measurement) -> bytes:
    """Return a CSV file with a column (two for complex values) per place and repetition."""
    unit, is_spectrum = measured.record.unit, measured.is_spectrum
    series = [
        (f"{measured.quantity}{_place(x, y)}{f'#{r + 1}' * (r > 0)} [{unit}]", run[:, p])
        for r, run in enumerate(measured.values)
        for p, (x, y) in enumerate(measured.places)
    ]
    series += [("drive", measured.drive)] if len(measured.drive) else []
    header, columns = ["f [Hz]" if is_spectrum else "t [s]"], [measured.axis]
    for name, values in series:
        header += [f"re {name}", f"im {name}"] if is_spectrum else [name]
        columns += [values.real, values.imag] if is_spectrum else [values]
    rows = zip(*(map(repr, column.tolist()) for column in columns), strict=True)
    notes = [("name", measured.name), ("positive", "into the body")]
    notes += [("remark", remark) for remark in measured.remarks]
    above = "".join(f"# {key}: {' '.join(text.split())}\r\n" for key, text in notes if text)
    return above.encode() + csv_table(header, rows)


def _place(x: float, y: float) -> str:
    """Return a place in mm, exactly: (5,0)."""
    return "({:f},{:f})".format(*((Decimal(repr(float(v))) * 1000).normalize() for v in (x, y)))


WRITERS = {".npz": to_npz, ".csv": to_csv}


def write(measured: Measurement, path: str | Path, *, overwrite: bool = False) -> None:
    """Write a measurement as .npz or .csv."""
    path = Path(path)
    writer = WRITERS[choose("kind of file", path.suffix.lower(), WRITERS)]
    with output_file(path, overwrite=overwrite) as file:
        file.write(writer(measured))
