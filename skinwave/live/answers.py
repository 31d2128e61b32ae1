"""Answers to the requests of a served page: changed bodies, scenes and measurements."""

import json
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from skinwave.live.packs import pack_of
from skinwave.live.records import body_of, dispersion_of, record_of, with_changes
from skinwave.live.values import control_values, tacton_values
from skinwave.scene.scene import BODIES, Scene
from skinwave.system.effort import Progress, silent


def body_answer(content: bytes, progress: Progress = silent) -> dict[str, Any]:
    """Return the record of a changed body, from JSON {"toml", "changes", "name", "title"}."""
    try:
        request = json.loads(content)
        toml, changes, name, title = (request[key] for key in ("toml", "changes", "name", "title"))
        is_valid = {type(x) for x in (toml, name, title)} == {str} and isinstance(changes, dict)
    except (ValueError, KeyError, TypeError):
        is_valid = False
    if not is_valid:
        raise ValueError(
            'The request is malformed. Send JSON {"toml": "...", "changes": {...}, "name": "...", '
            '"title": "..."}.'
        )
    body = with_changes(body_of(toml), changes)
    if title and changes:
        title = f"{title.partition(',')[0]}, changed"  # without the size that follows a comma
    return {"body": record_of(body, pack_of(body, progress), name, title, waves=False)}


def dispersion_answer(content: bytes) -> dict[str, Any]:
    """Return the dispersion curves of the body in a TOML text. It may take a minute."""
    return {"dispersion": dispersion_of(body_of(content.decode("utf-8", "replace")))}


def scene_answer(name: str, content: bytes, progress: Progress = silent) -> dict[str, Any]:
    """Return the values of a scene file and the record of its body.

    Patterns have no body. For them, return the values of the Tacton only.
    """
    from skinwave.patterns import Options, read_pattern

    def read(file: Path) -> Scene:
        return read_pattern(file, Options())[0]

    if (suffix := Path(name).suffix.lower()) == ".adaptics":
        scene = _from_file(name, suffix, content, read)
        control_values(scene, "")  # refuses what the page cannot set
        return {"values": tacton_values(scene.tacton)}
    scene = _from_file(name or "The file", ".toml", content, read)
    known = (name for name, body in BODIES.items() if body == scene.body)
    own = next(known, f"own-{scene.body.kind}")
    values = control_values(scene, own)
    pack = pack_of(scene.body, progress)
    return {"values": values, "body": record_of(scene.body, pack, own, waves=False)}


def measurement_answer(name: str, content: bytes, *, most: int = 2_000_000) -> dict[str, Any]:
    """Return the curves of a measurement, averaged over its repetitions, as a dict for JSON.

    It has name, quantity, remarks and `places` [[x, y] in m or null]. Its curves are `times` in s
    and `values` in SI units by place and time, or `frequencies` in Hz and `amplitudes` by place and
    frequency. Raises ValueError if there are more than `most` values.
    """
    from skinwave.measure.reading import read

    measured = _from_file(name or "the file", Path(name).suffix.lower(), content, read)
    mean = measured.values.mean(axis=0)
    if mean.size > most:
        raise ValueError(
            f"{name} has {mean.size:,} values, more than {most:,}. Use skinwave compare."
        )
    places = [[*place] if np.isfinite(place).all() else None for place in measured.places.tolist()]
    curves = {
        "name": name or measured.name, "quantity": measured.quantity,
        "remarks": list(measured.remarks), "places": places,
    }  # fmt: skip
    if len(measured.frequencies):
        amplitudes = np.abs(mean).T.tolist()
        return curves | {"frequencies": measured.frequencies.tolist(), "amplitudes": amplitudes}
    times = measured.times - measured.times[0]
    return curves | {"times": times.tolist(), "values": mean.real.T.tolist()}


def _from_file(name: str, suffix: str, content: bytes, read: Callable[[Path], Any]) -> Any:
    """Return what `read` returns for a file with a content. Its errors name the file `name`."""
    with TemporaryDirectory() as folder:
        file = Path(folder, f"sent{suffix}")
        file.write_bytes(content)
        try:
            return read(file)
        except ValueError as error:
            raise ValueError(str(error).replace(str(file), name)) from None
