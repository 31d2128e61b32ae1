"""Measurements in files of any registered format; readers of .wav and of a published set."""

import re
from pathlib import Path
from typing import Any

import numpy as np

from meshes import reading
from skinwave.measure import text
from skinwave.measure.headers import Column
from skinwave.measure.measurement import Measurement
from skinwave.measure.recording import FACTOR, Given, Recording, complete, unknown_places
from skinwave.measure.table import Table, recording_of
from skinwave.measure.units import metres
from skinwave.system.formats import MEASUREMENTS, format_of, register
from skinwave.typing import Floats

LARGEST_WAV = 500_000_000  # bytes
SAMPLES, SENSORS, AXES, RATE = 522, 72, 3, 1300.0  # of SkinSource
SKINSOURCE_BYTES = 4 * SAMPLES * SENSORS * AXES
NORMAL_AXIS = 2
DOWNLOAD = "download SkinSource from https://github.com/yonvisell/skinsource"
_SKINSOURCE_NAME = re.compile(r"model-([1-4])-location-(0[1-9]|1\d|20)\.f32", re.IGNORECASE)


def read_wav(path: Path, given: Given) -> Recording:
    """Return the channels of a WAV, one per place; integer samples are fractions of full scale."""
    from skinwave.patterns.waveform import decode  # slow to import

    content = reading.read_bytes(path, LARGEST_WAV)
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
    match = _SKINSOURCE_NAME.fullmatch(path.name)
    if not match:
        raise ValueError(f"the name is not model-1-location-01.f32 to ...; {DOWNLOAD}")
    content = reading.read_bytes(path, SKINSOURCE_BYTES + 1)
    values = np.frombuffer(content[: len(content) // 4 * 4], "<f4")
    if len(content) != SKINSOURCE_BYTES or not np.isfinite(values).all():
        expected = f"{SKINSOURCE_BYTES:,} bytes of finite numbers"
        raise ValueError(f"the file has {len(content):,} bytes, not {expected}; {DOWNLOAD}")
    impulse = np.zeros(SAMPLES)
    impulse[0] = 1.0
    normal = values.reshape((SAMPLES, SENSORS, AXES), order="F")[None, :, :, NORMAL_AXIS]
    return Recording(
        values=normal.astype(np.float64), rate=RATE, quantity="acceleration", unit="m/s2",
        places=unknown_places(SENSORS), drive=impulse,
        name=f"SkinSource model {match[1]}, location {int(match[2])}",
        remarks=("the file gives no unit; m/s² after a force of 1 N for one sample is assumed",),
    )  # fmt: skip


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
        return complete(reader.function(path, given), given, path)
    except ValueError as error:
        message = " ".join(str(error).split())
        prefix = "" if message.startswith(str(path)) else f"{path}: "
        raise ValueError(prefix + message) from None
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
        return text.read_places(Path(words))
    places = []
    for word in words.split():
        pair = word.strip("()").split(",")
        if len(pair) != 2:
            raise ValueError(f"--places has '{word[:40]}'; give pairs x,y in mm, or a file")
        places.append([metres(part, "mm") for part in pair])
    if not places or not np.isfinite(places).all():
        raise ValueError("--places must be pairs of finite numbers in mm, such as 0,0 5,0")
    return np.array(places)
