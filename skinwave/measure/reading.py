"""Measurements in files of any registered format; readers of text, .wav and a published set."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from meshes import reading
from skinwave.measure.labview import read_lvm
from skinwave.measure.measurement import Measurement
from skinwave.measure.recording import FACTOR, Given, Recording, complete, unknown_places
from skinwave.measure.table import EXAMPLE, coordinates, recording_of
from skinwave.system.formats import MEASUREMENTS, format_of, register
from skinwave.system.headings import Column, parse_heading
from skinwave.system.text_table import Table, parse_table
from skinwave.system.units import metres
from skinwave.typing import Floats


def read_text(path: Path, given: Given, largest: int = 256_000_000) -> Recording:
    """Return the recording in a text file of at most `largest` bytes.

    Raises a ValueError if it has no table of motion.
    """
    text = reading.read_exported_text(path, largest)
    is_lvm = text.startswith("LabVIEW Measurement")  # whatever the suffix of the file
    return read_lvm(text, given) if is_lvm else recording_of(parse_table(text, EXAMPLE), given)


def read_wav(path: Path, given: Given) -> Recording:
    """Return the channels of a WAV, one per place; integer samples are fractions of full scale."""
    from skinwave.patterns.waveform import decode  # slow to import

    content = reading.read_bytes(path, 500_000_000)
    rate, values, full = decode(content)
    columns = tuple(Column(text=f"channel {k + 1}", role="") for k in range(values.shape[1]))
    notes = [("rate", repr(float(rate)))]
    if full > 1:
        notes.append(("remark", f"1 is full scale, {full:,.0f} counts"))
    comment = re.search(rb"ICMT.{4}([^\0]+)", content[-4096:] + content[:4096], re.DOTALL)
    said = comment[1][:80].decode("latin-1").strip() if comment else ""
    notes.append(("remark", said and f"comment in the file: {said}"))
    if FACTOR.match(said) and full > 1 and not re.match(r"[\d.]", given.unit):
        cure = f'give that of full scale, {full:,.0f} counts: --unit "20 mm/s"'
        raise ValueError(f"the comment '{said}' seems to give the motion of a count; {cure}")
    return recording_of(Table(columns=columns, numbers=values, notes=tuple(notes)), given)


def read_skinsource(path: Path, given: Given) -> Recording:
    """Return SkinSource's acceleration of hand and forearm at 72 sensors after a unit impulse of
    force at one of 20 palmar places.

    Tummala et al., IEEE Haptics Symposium 2024, doi 10.1109/HAPTICS59260.2024.10520852; data of
    four people, doi 10.5281/zenodo.10547601: float32, column-major (522 times, 72 sensors, 3
    axes), the third axis normal to the skin.
    """
    download = "download SkinSource from https://github.com/yonvisell/skinsource"
    name = re.compile(r"model-([1-4])-location-(0[1-9]|1\d|20)\.f32", re.IGNORECASE)
    if not (match := name.fullmatch(path.name)):
        raise ValueError(f"the name is not model-1-location-01.f32 to ...; {download}")
    shape = samples, sensors, _ = 522, 72, 3
    size = 4 * int(np.prod(shape))
    content = reading.read_bytes(path, size + 1)
    values = np.frombuffer(content[: len(content) // 4 * 4], "<f4")
    if len(content) != size or not np.isfinite(values).all():
        expected = f"{size:,} bytes of finite numbers"
        raise ValueError(f"the file has {len(content):,} bytes, not {expected}; {download}")
    return Recording(
        values=values.reshape(shape, order="F")[None, :, :, 2].astype(np.float64), rate=1300.0,
        quantity="acceleration", unit="m/s2", places=unknown_places(sensors),
        drive=np.eye(1, samples)[0],
        name=f"SkinSource model {match[1]}, location {int(match[2])}",
        remarks=("the file gives no unit; m/s² after a force of 1 N for one sample is assumed",),
    )  # fmt: skip


register(MEASUREMENTS, ".csv", ".tsv", ".txt", ".asc", ".dat", ".lvm", function=read_text,
         name="text", choices=("columns",))  # fmt: skip
register(MEASUREMENTS, ".wav", function=read_wav, name="sound", choices=("columns",))
register(MEASUREMENTS, ".f32", function=read_skinsource, name="SkinSource")


def read(path: str | Path, **options: Any) -> Measurement:
    """Return the measurement in a file, in SI and positive into the body.

    Parameters
    ----------
    path : file with a suffix of a registered format
    **options : fields of `skinwave.measure.recording.Given` that replace what the file says:
        quantity, unit, places, sign, rate, variable, columns, direction

    Raises
    ------
    ValueError
        If the format is unknown, or the file cannot be read, is malformed or lacks information. The
        message names the option of `skinwave fit --inspect` that supplies it.
    """
    path, given = Path(path), Given(**options)
    reader = format_of(MEASUREMENTS, path)
    for option in ("variable", "columns", "direction"):
        if getattr(given, option) and option not in reader.choices:
            raise ValueError(f"{path}: --{option} has no effect on {reader.name} files")
    try:
        with reading.naming(path):
            return complete(reader.function(path, given), given, path)
    except (ArithmeticError, AttributeError, LookupError, TypeError) as error:
        raise ValueError(f"{path}: not a valid {reader.name} file; export it again") from error


def read_complete(path: str | Path) -> Measurement:
    """Return the measurement in a file; raise a ValueError if options are needed."""
    try:
        return read(path)
    except ValueError as error:
        raise ValueError(
            f"{error}; `skinwave fit --inspect {path} --out DIR` takes these options and writes a "
            "complete DIR/measurement.npz"
        ) from None


def parse_places(words: str) -> Floats:
    """Return places (p, 2) in m from "0,0 5,0" in mm, or from a text file."""
    if Path(words).is_file():
        return _places_in(Path(words))
    places = []
    for word in words.split():
        pair = word.strip("()").split(",")
        if len(pair) != 2:
            raise ValueError(f"--places has '{word[:40]}'; give pairs x,y in mm, or a file")
        places.append([metres(part, "mm") for part in pair])
    if not places or not np.isfinite(places).all():
        raise ValueError("--places must be pairs of finite numbers in mm, such as 0,0 5,0")
    return np.array(places)


def _places_in(path: Path) -> Floats:
    """Return places (p, 2) in m from the columns x and y of a file, or from two columns in mm."""
    table = parse_table(reading.read_exported_text(path), "x [mm], y [mm]")
    if len(table.columns) == 2 and not any(column.text for column in table.columns):
        table = replace(table, columns=(parse_heading("x [mm]"), parse_heading("y [mm]")))
    if not {"x", "y"} <= {column.role for column in table.columns}:
        raise ValueError(f"{path}: a file of places needs the columns x [mm] and y [mm]; add them")
    return coordinates(table)
