"""Answers to the requests of a served page: a changed body, a scene, a measurement."""

import json
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from skinwave.live.packs import pack_of
from skinwave.live.records import body_of, changed, dispersion_of, record_of
from skinwave.live.values import values_of
from skinwave.scene.scene import BODIES
from skinwave.system.effort import Progress, silent

MOST_VALUES = 2_000_000  # of a measurement that is sent to a page


def body_answer(content: bytes, progress: Progress = silent) -> dict[str, Any]:
    """Return the record of a changed body, from JSON {"toml", "changes", "name", "title"}."""
    try:
        given = json.loads(content)
    except ValueError:
        given = None
    kinds = {"toml": str, "changes": dict, "name": str, "title": str}
    if not isinstance(given, dict) or not all(
        isinstance(given.setdefault(key, kind()), kind) for key, kind in kinds.items()
    ):
        raise ValueError('The request is malformed. Send JSON {"toml": ..., "changes": {...}}.')
    body, title = changed(body_of(given["toml"]), given["changes"]), given["title"]
    if title and given["changes"]:
        title = f"{title.partition(',')[0]}, changed"  # whatever size it has named
    pack = pack_of(body, progress)
    return {"body": record_of(body, pack, given["name"], title, waves=False)}


def dispersion_answer(content: bytes) -> dict[str, Any]:
    """Return the dispersion curves of the body in a TOML text, which may take a minute."""
    return {"dispersion": dispersion_of(body_of(content.decode("utf-8", "replace")))}


def scene_answer(name: str, content: bytes, progress: Progress = silent) -> dict[str, Any]:
    """Return the values of a scene file and the record of its body."""
    from skinwave.scene.file import loads

    try:
        scene = loads(content.decode("utf-8"))
    except UnicodeDecodeError:
        raise ValueError(f"{name or 'The file'} is not UTF-8 text. Give a scene file.") from None
    known = (name for name, body in BODIES.items() if body == scene.body)
    own = next(known, f"own-{scene.body.kind}")
    values = values_of(scene, own)
    pack = pack_of(scene.body, progress)
    return {"values": values, "body": record_of(scene.body, pack, own, waves=False)}


def measurement_answer(name: str, content: bytes) -> dict[str, Any]:
    """Return the curves of a measurement by place, the mean of all repetitions: name, quantity,
    remarks, `places` [[x, y] in metre or null], and `times` in s with `values` [[SI by time] by
    place], or `frequencies` in Hz with `amplitudes`.
    """
    from skinwave.measure.reading import read

    with TemporaryDirectory() as folder:
        file = Path(folder, f"measured{Path(name).suffix.lower()}")
        file.write_bytes(content)
        try:
            found = read(file)
        except ValueError as error:
            raise ValueError(str(error).replace(str(file), name or "the file")) from None
    mean = found.values.mean(axis=0)
    if mean.size > MOST_VALUES:
        raise ValueError(
            f"{name} has {mean.size:,} values, the limit is {MOST_VALUES:,}. Use skinwave compare."
        )
    places = [[*place] if np.isfinite(place).all() else None for place in found.places.tolist()]
    curves = {
        "name": name or found.name, "quantity": found.quantity, "remarks": list(found.remarks),
        "places": places,
    }  # fmt: skip
    if len(found.frequencies):
        amplitudes = np.abs(mean).T.tolist()
        return curves | {"frequencies": found.frequencies.tolist(), "amplitudes": amplitudes}
    times = found.times - found.times[0]
    return curves | {"times": times.tolist(), "values": mean.real.T.tolist()}
