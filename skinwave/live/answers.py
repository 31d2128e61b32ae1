"""Answers to the requests of a served page: a changed body, a scene, a measurement."""

import json
from collections.abc import Iterator
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


def body_lines(content: bytes, progress: Progress) -> Iterator[dict[str, Any]]:
    """Yield the record of a changed body, then its dispersion curves.

    Parameters
    ----------
    content : JSON {"toml", "changes", "name", "title"}; the last two are optional
    progress : told of the phases

    Yields
    ------
    {"body": record} without dispersion curves, then {"dispersion": curves}

    Raises
    ------
    ValueError
        If the content is malformed, or the body cannot be.
    """
    given = _object(content)
    body = changed(body_of(_text(given, "toml")), _table(given, "changes"))
    pack = pack_of(body, progress)
    name, title = _text(given, "name"), _text(given, "title")
    if title and given.get("changes"):
        title = f"{title.partition(',')[0]}, changed"  # whatever size it has named
    yield {"body": record_of(body, pack, name, title, waves=False)}
    yield {"dispersion": dispersion_of(body)}


def scene_answer(name: str, content: bytes, progress: Progress = silent) -> dict[str, Any]:
    """Return the values of a scene file and the record of its body.

    Raises
    ------
    ValueError
        If the file is no scene, or the page cannot show it.
    """
    from skinwave.scene.file import loads

    try:
        scene = loads(content.decode("utf-8"))
    except UnicodeDecodeError:
        raise ValueError(f"{name or 'The file'} is not UTF-8 text. Give a scene file.") from None
    known = (name for name, body in BODIES.items() if body == scene.body)
    own = next(known, f"own-{scene.body.kind}")
    values = values_of(scene, own)
    return {"values": values, "body": record_of(scene.body, pack_of(scene.body, progress), own)}


def measurement_answer(name: str, content: bytes) -> dict[str, Any]:
    """Return the curves of a measurement by place, the mean of all repetitions.

    Returns
    -------
    {"name", "quantity", "remarks", "places": [[x, y] in metre or null], "times": [s] and "values":
    [[SI by time] by place], or "frequencies": [Hz] and "amplitudes": [[SI by frequency] by place]}

    Raises
    ------
    ValueError
        If the file is of no known kind or malformed.
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


def _object(content: bytes) -> dict[str, Any]:
    try:
        given = json.loads(content)
    except ValueError:
        given = None
    if not isinstance(given, dict):
        raise ValueError('The request is malformed. Send JSON {"toml": ..., "changes": {...}}.')
    return given


def _text(given: dict[str, Any], key: str) -> str:
    value = given.get(key, "")
    if not isinstance(value, str):
        raise ValueError(f"{key} of the request must be text.")
    return value


def _table(given: dict[str, Any], key: str) -> dict[str, Any]:
    value = given.get(key, {})
    if not isinstance(value, dict):
        raise ValueError(f"{key} of the request must be an object.")
    return value
