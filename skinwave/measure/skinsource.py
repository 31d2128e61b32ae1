"""SkinSource: acceleration of hand and forearm after a unit impulse of force at 20 palmar places.

Tummala et al., IEEE Haptics Symposium 2024, doi 10.1109/HAPTICS59260.2024.10520852; data of four
people by doi 10.5281/zenodo.10547601, as 80 files model-{1..4}-location-{01..20}.f32 in
https://github.com/yonvisell/skinsource, public/data/impulse-responses: float32, column-major
(522 times, 72 sensors, 3 axes), 1300 Hz, the third axis normal to the skin.
"""

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
SOURCE = "https://github.com/yonvisell/skinsource (public/data/impulse-responses)"
HAND_LENGTHS = (0.175, 0.165, 0.185, 0.165)  # m, by model
DRAWN_HAND = 398.1017  # pixels of the drawing that the sensors' places are of
_NAME = re.compile(r"model-([1-4])-location-(0[1-9]|1\d|20)\.f32", re.IGNORECASE)


def read(path: Path, given: Given) -> Recording:
    """Normal acceleration at the 72 sensors after a unit impulse of force.

    Raises
    ------
    ValueError
        If the file is not one of the 80 by name or size.
    """
    found = _NAME.fullmatch(path.name)
    if not found:
        raise ValueError(
            "the name is not that of a SkinSource file, model-1-location-01.f32 to "
            f"model-4-location-20.f32; take these of {SOURCE}"
        )
    content = reading.content(path, BYTES + 1)
    values = np.frombuffer(content[: len(content) // 4 * 4], "<f4")
    if len(content) != BYTES or not np.isfinite(values).all():
        raise ValueError(
            f"it has {len(content):,} bytes where SkinSource has {BYTES:,} of finite numbers; "
            f"download it anew from {SOURCE}"
        )
    places, placed = _places(path, int(found[1]))
    impulse = np.zeros(SAMPLES)
    impulse[0] = 1.0
    normal = values.reshape((SAMPLES, SENSORS, AXES), order="F")[None, :, :, NORMAL]
    return Recording(
        values=normal.astype(np.float64), rate=RATE, quantity="acceleration",
        unit="m/s2", places=places, drive=impulse,
        name=f"SkinSource model {found[1]}, location {int(found[2])}",
        remarks=(
            "acceleration after a force of 1 for one sample; the unit is not in the file, m/s2 per "
            "N is plausible", *placed,
        ),
    )  # fmt: skip


def _places(path: Path, model: int) -> tuple[Floats, list[str]]:
    """Places (72, 2) in metre of the drawing in the download, two folders above, if it is there."""
    drawing = path.parent.parent / "visualization.json"
    if not drawing.is_file():
        return nowhere(SENSORS), []
    try:
        found = json.loads(reading.text(drawing))["outputLocations"]
        pixels = np.array([[np.nan if v is None else v for v in pair] for pair in found], float)
        if pixels.shape != (SENSORS, 2):
            raise ValueError
    except (ValueError, KeyError, TypeError):
        raise ValueError(f"{drawing} is not SkinSource's; download it anew or remove it") from None
    scale = HAND_LENGTHS[model - 1] / DRAWN_HAND
    return scale * pixels, ["places are those of SkinSource's drawing of the arm, spread flat"]
