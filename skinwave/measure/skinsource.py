"""SkinSource: acceleration of hand and forearm after a unit impulse of force at 20 palmar places.

Tummala et al., IEEE Haptics Symposium 2024, doi 10.1109/HAPTICS59260.2024.10520852; data of four
people by doi 10.5281/zenodo.10547601, as 80 files model-{1..4}-location-{01..20}.f32 in
https://github.com/yonvisell/skinsource, public/data/impulse-responses: float32, column-major
(522 times, 72 sensors, 3 axes), 1300 Hz, the third axis normal to the skin.
"""

import hashlib
import json
import re
from pathlib import Path

import numpy as np

from meshes import reading
from simple_model.typing import Floats
from skinwave.measure.recording import Given, Recording, nowhere

SAMPLES, SENSORS, AXES, RATE = 522, 72, 3, 1300.0
BYTES = 4 * SAMPLES * SENSORS * AXES
NORMAL = 2  # of the axes
TABLE_BYTES = 69_367_862  # of dataset/impulseResponses.mat
SOURCE = "https://github.com/yonvisell/skinsource (public/data/impulse-responses)"
HAND_LENGTHS = (0.175, 0.165, 0.185, 0.165)  # m, by model
DRAWN_HAND = 398.1017  # pixels of the drawing that the sensors' places are of
# The first eight digits of MD5 of each file, by model and location.
MD5 = (
    "b90858a6 44ed7b1e 960be0ff 6febe92a 2164b8b1 ec20d634 78861b40 47c0170c bebabd89 2a7f1df9 "
    "5574c2c6 fc461766 eeb555d6 a9939484 69a644b4 554e6316 29a0b469 fb7d2c76 aebdd7fd d2b9bf1a",
    "d8df79fc b150d831 8fb457ad 733688ff 5e190074 0bcbe0f3 f7fef977 6a51d486 1a45cf18 4f1fc87d "
    "4751c00b c1e2f880 c0c0665b 71a0aa85 38b18096 20ab5997 a1ae5e8e a2be90ae 9a2aef9b 36659b8e",
    "770e5812 aea38a01 9d9d27a3 62a0417b 1cbf2814 553e73d4 358fb980 3e287e9c aaf768a2 598f0cb8 "
    "bee40280 95df4df7 0aeac72d 928c3b12 1ec28aaa 809442e5 2b6bf11b 9cc2e76c c75c042e 2bd5f08c",
    "44eab323 8108c894 09500b7b 7951dd63 6a6d2c69 6ddd7a8d b7253633 59c578ba d6354789 e23cf851 "
    "c8342800 9bf53b69 f80d5b30 f4f0cfa4 d9f3017d acd26aa6 f840152b c010fa14 d88f296a 71690823",
)
_NAME = re.compile(r"model-([1-4])-location-(\d\d)\.f32", re.IGNORECASE)


def read(path: Path, given: Given) -> Recording:
    """Normal acceleration at the 72 sensors after a unit impulse of force.

    Raises
    ------
    ValueError
        If the file is not one of the 80 by name, size or checksum.
    """
    model, location = _which(path)
    content = reading.content(path, BYTES + 1)
    if len(content) != BYTES:
        raise ValueError(
            f"it has {len(content):,} bytes where SkinSource has {BYTES:,}; download it anew from "
            f"{SOURCE}"
        )
    if not _is_intact(content, model, location):
        raise ValueError(f"its MD5 is not that of SkinSource; download it anew from {SOURCE}")
    values = np.frombuffer(content, "<f4").reshape((SAMPLES, SENSORS, AXES), order="F")
    places, placed = _places(path, model)
    impulse = np.zeros(SAMPLES)
    impulse[0] = 1.0
    return Recording(
        values=values[None, :, :, NORMAL].astype(np.float64), rate=RATE, quantity="acceleration",
        unit="m/s2", places=places, drive=impulse,
        name=f"SkinSource model {model}, location {location}",
        remarks=(
            "acceleration after a force of 1 for one sample; the unit is not in the file, m/s2 per "
            "N is plausible", *placed,
        ),
    )  # fmt: skip


def refuse_table(path: Path) -> None:
    """Refuse the data set as it is published: a MATLAB table, which only MATLAB reads.

    Raises
    ------
    ValueError
        If a file has its name or size.
    """
    if path.name.lower() == "impulseresponses.mat" or path.stat().st_size == TABLE_BYTES:
        raise ValueError(
            f"it is SkinSource's MATLAB table, which only MATLAB reads; take the .f32 files of "
            f"{SOURCE}"
        )


def _which(path: Path) -> tuple[int, int]:
    found = _NAME.fullmatch(path.name)
    if not found or not 1 <= int(found[2]) <= 20:
        raise ValueError(
            "the name is not that of a SkinSource file, model-1-location-01.f32 to "
            f"model-4-location-20.f32; take these of {SOURCE}"
        )
    return int(found[1]), int(found[2])


def _is_intact(content: bytes, model: int, location: int) -> bool:
    """Whether the checksum is the published one."""
    digest = hashlib.md5(content, usedforsecurity=False).hexdigest()
    return digest.startswith(MD5[model - 1].split()[location - 1])


def _places(path: Path, model: int) -> tuple[Floats, list[str]]:
    """Places (72, 2) in metre of the drawing in the download, two folders above, if it is there."""
    drawing = path.parent.parent / "visualization.json"
    if not drawing.is_file():
        return nowhere(SENSORS), []
    try:
        found = json.loads(reading.text(drawing))["outputLocations"]
        pixels = np.array([[np.nan if v is None else v for v in pair] for pair in found], float)
    except (ValueError, KeyError, TypeError):
        raise ValueError(f"{drawing} is not SkinSource's; download it anew or remove it") from None
    if pixels.shape != (SENSORS, 2):
        raise ValueError(
            f"{drawing} has places of shape {pixels.shape}, not ({SENSORS}, 2); download it anew"
        )
    scale = HAND_LENGTHS[model - 1] / DRAWN_HAND
    return scale * pixels, ["places are those of SkinSource's drawing of the arm, spread flat"]
