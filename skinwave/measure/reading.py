"""Measurements from files: text in columns, LabVIEW, .npz, .wav, .mat, Universal File Format 58,
and two published sets.
"""

import io
import re
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from meshes import reading
from skinwave.measure import arrays, labview, text, universal
from skinwave.measure.headers import Column
from skinwave.measure.measurement import Measurement
from skinwave.measure.recording import Given, Recording, completed, nowhere
from skinwave.measure.table import Table, recording
from skinwave.measure.units import length
from skinwave.typing import Floats

LARGEST_WAV = 500_000_000  # bytes
SAMPLES, SENSORS, AXES, RATE = 522, 72, 3, 1300.0
SKINSOURCE_BYTES = 4 * SAMPLES * SENSORS * AXES
NORMAL = 2  # of the axes
SKINSOURCE = "https://github.com/yonvisell/skinsource (public/data/impulse-responses)"
_NAME = re.compile(r"model-([1-4])-location-(0[1-9]|1\d|20)\.f32", re.IGNORECASE)


def read_wav(path: Path, given: Given) -> Recording:
    """The channels of a WAV, a place each; samples that are whole numbers are fractions of full
    scale. Raises a ValueError if it is none, or has fewer than two samples.
    """
    from scipy.io import wavfile

    content = reading.read_bytes(path, LARGEST_WAV)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", wavfile.WavFileWarning)  # of chunks beside the samples
            rate, data = wavfile.read(io.BytesIO(content))
    except Exception:  # whatever is made of spoilt bytes
        raise ValueError("the file is damaged or not a WAV file; export it anew as PCM") from None
    if len(data) < 2:
        raise ValueError(f"the WAV has {len(data)} samples; give two or more")
    middle, full = {"u": (128, 128), "f": (0, 1)}.get(
        data.dtype.kind, (0, 2.0 ** (8 * data.dtype.itemsize - 1))
    )  # 24 bits are the upper of 32
    with np.errstate(invalid="ignore"):  # of what is no number, which is refused later
        values = (data.reshape(len(data), -1).astype(np.float64) - middle) / full
    columns = tuple(Column(text=f"channel {k + 1}", role="") for k in range(values.shape[1]))
    return recording(
        Table(columns=columns, numbers=values, notes=(("rate", repr(float(rate))),)), given
    )


def read_skinsource(path: Path, given: Given) -> Recording:
    """SkinSource: acceleration normal to the skin of hand and forearm at 72 sensors after a unit
    impulse of force at one of 20 palmar places.

    Tummala et al., IEEE Haptics Symposium 2024, doi 10.1109/HAPTICS59260.2024.10520852; data of
    four people by doi 10.5281/zenodo.10547601: float32, column-major (522 times, 72 sensors, 3
    axes), the third axis normal to the skin. Raises a ValueError if the file is not one of the 80
    by name or size.
    """
    found = _NAME.fullmatch(path.name)
    if not found:
        raise ValueError(
            "the name is not that of a SkinSource file, model-1-location-01.f32 to "
            f"model-4-location-20.f32; take these of {SKINSOURCE}"
        )
    content = reading.read_bytes(path, SKINSOURCE_BYTES + 1)
    values = np.frombuffer(content[: len(content) // 4 * 4], "<f4")
    if len(content) != SKINSOURCE_BYTES or not np.isfinite(values).all():
        raise ValueError(
            f"it has {len(content):,} bytes where SkinSource has {SKINSOURCE_BYTES:,} of finite "
            f"numbers; download it anew from {SKINSOURCE}"
        )
    impulse = np.zeros(SAMPLES)
    impulse[0] = 1.0
    normal = values.reshape((SAMPLES, SENSORS, AXES), order="F")[None, :, :, NORMAL]
    return Recording(
        values=normal.astype(np.float64), rate=RATE, quantity="acceleration",
        unit="m/s2", places=nowhere(SENSORS), drive=impulse,
        name=f"SkinSource model {found[1]}, location {int(found[2])}",
        remarks=(
            "acceleration after a force of 1 for one sample; the unit is not in the file, m/s2 per "
            "N is plausible",
        ),
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Reader:
    """A format of files: its `words`, the `suffixes` of its names, what reads it, and which options
    choose in it.
    """

    words: str
    suffixes: tuple[str, ...]
    read: Callable[[Path, Given], Recording]
    choose: tuple[str, ...] = ("columns",)


READERS = (
    Reader(
        words="text in columns", suffixes=(".csv", ".tsv", ".txt", ".asc", ".dat"), read=text.read
    ),
    Reader(words="LabVIEW's measurement", suffixes=(".lvm",), read=labview.read_lvm),
    Reader(words="TDMS", suffixes=(".tdms",), read=labview.read_tdms),
    Reader(words="numpy", suffixes=(".npz",), read=arrays.read_npz, choose=("variable",)),
    Reader(words="sound", suffixes=(".wav",), read=read_wav),
    Reader(words="MATLAB", suffixes=(".mat",), read=arrays.read_mat, choose=("variable",)),
    Reader(
        words="Universal File Format 58", suffixes=(".uff", ".unv", ".uf", ".58"),
        read=universal.read, choose=("direction",),
    ),
    Reader(
        words="SkinSource impulse responses", suffixes=(".f32",), read=read_skinsource, choose=()
    ),
)  # fmt: skip


def read(
    path: str | Path,
    *,
    quantity: str = "",
    unit: str = "",
    places: ArrayLike | None = None,
    sign: int | None = None,
    rate: float | None = None,
    variable: str = "",
    columns: Sequence[str] = (),
    direction: str = "",
) -> Measurement:
    """Measurement in a file, in SI and positive into the body.

    What the file does not say, or says otherwise than it should, is given.

    Parameters
    ----------
    path : of a file whose suffix is one of those in `READERS`
    quantity : "displacement", "velocity", "acceleration" or another of `QUANTITIES`
    unit : "mm/s", "um", "g", ...; "20 mm/s" if 1 in the file stands for 20 mm/s
    places : (p, 2) float, metre
    sign : 1 if positive values are into the body, -1 if out of it, as of a vibrometer that counts
        motion towards itself as positive
    rate : Hz, replaces the steps of the file's times; its first sample stays as many steps from
        zero
    variable : name of the array in a file of several
    columns : headings or numbers from 1 of the columns or channels of motion
    direction : "x", "y" or "z", of the motion in a Universal File with several

    Raises
    ------
    ValueError
        In one sentence, if the file is of no known kind, cannot be read, is malformed, or does not
        say what is needed; with the option of the command line that says it.
    """
    path = Path(path)
    reader = reader_of(path)
    known = None if places is None else np.asarray(places, np.float64)
    given = Given(
        quantity=quantity, unit=unit, places=known, sign=sign, rate=rate, variable=variable,
        columns=tuple(columns), direction=direction,
    )  # fmt: skip
    for option in ("variable", "columns", "direction"):
        if getattr(given, option) and option not in reader.choose:
            raise ValueError(
                f"{path}: --{option} chooses nothing in a file of {reader.words}; leave it out"
            )
    try:
        return completed(reader.read(path, given), given, path)
    except ValueError as error:
        said = " ".join(str(error).split())
        raise ValueError(said if said.startswith(str(path)) else f"{path}: {said}") from None
    except (ArithmeticError, AttributeError, LookupError, TypeError) as error:
        raise ValueError(
            f"{path}: the content does not fit the format, {reader.words}; export it anew"
        ) from error


def read_alone(path: str | Path) -> Measurement:
    """Measurement in a file that says all, for commands without options of what it does not say;
    raises what `read` does, with the command that makes such a file of another.
    """
    try:
        return read(path)
    except ValueError as error:
        raise ValueError(
            f"{error}; `skinwave fit --inspect {path} --out DIR` takes such options, and writes "
            "DIR/measurement.npz, which says all"
        ) from None


def reader_of(path: Path) -> Reader:
    """Reader of a file of such a name; raises a ValueError if nothing does."""
    for reader in READERS:
        if path.suffix.lower() in reader.suffixes:
            return reader
    known = ", ".join(suffix for reader in READERS for suffix in reader.suffixes)
    raise ValueError(f"{path}: '{path.suffix}' is no known kind of file, use one of {known}")


def places_of(words: str) -> Floats:
    """Places (p, 2) in metre of words such as "0,0 5,0" in mm, or of a text file with the columns
    x and y; raises a ValueError if there are none.
    """
    if Path(words).is_file():
        return text.places(Path(words))
    found = []
    for word in words.split():
        pair = word.strip("()").split(",")
        if len(pair) != 2:
            raise ValueError(f"--places has '{word[:40]}', no x,y in mm; write 0,0 5,0, or a file")
        found.append([length(part, "mm") for part in pair])
    if not found or not np.isfinite(found).all():
        raise ValueError("--places must be pairs of finite numbers in mm; write 0,0 5,0")
    return np.array(found)
