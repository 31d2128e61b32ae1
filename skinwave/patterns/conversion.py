"""Conversion between pattern files; their suffixes define the formats."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from meshes import reading
from simple_model.numbers import percent
from skinwave.patterns.pattern import Options, onto, resize, wide_enough
from skinwave.scene import file as scene_file
from skinwave.scene.scene import Body, Scene, check_load
from skinwave.system import extensions
from skinwave.system.formats import PATTERN_READERS, PATTERN_WRITERS, format_of

SCENE = ".toml"


def convert(
    source: Path, target: Path, options: Options, base: Scene | None = None
) -> tuple[bytes, tuple[str, ...]]:
    """Convert a pattern file to another format.

    Parameters
    ----------
    source, target : Path, with the suffix of a scene or of a registered format
    options : Options
    base : Scene that receives the pattern: its body, probes and drive; a slab of palm by default

    Returns
    -------
    bytes, the content of the target, and a tuple of str, notes on assumptions and approximations

    Raises
    ------
    ValueError
        If a file has an unknown suffix or is malformed, or the format cannot express the pattern.
    """
    if (suffix := target.suffix.lower()) != SCENE:
        format_of(PATTERN_WRITERS, target)
        base = replace(base or scene_file.loads(""), body=Body(kind="none"))
    scene, notes = read_pattern(source, options, base)
    content, more = write_pattern(scene, suffix, options)
    return content, (*notes, *more)


def read_pattern(
    path: Path, options: Options, base: Scene | None = None
) -> tuple[Scene, tuple[str, ...]]:
    """Read a pattern file onto a base scene, and return the scene and notes.

    Without a base, the body is a slab that contains the path. Raises the errors of `convert`.
    """
    if path.suffix.lower() == SCENE:
        scene = scene_file.read(path)
        tacton = resize(scene.tacton, options.resize)
        return replace(scene, pressure=replace(scene.pressure, tacton=tacton)), ()
    receiver = base or scene_file.loads("")
    source = format_of(PATTERN_READERS, path)
    content = reading.read_bytes(path, source.largest)
    with reading.naming(path):
        pattern = source.function(content, options, receiver)
        tacton = resize(pattern.tacton, options.resize)
        notes = list(pattern.notes)
        receiver = base or wide_enough(receiver, tacton, notes)
        return onto(receiver, replace(pattern, tacton=tacton), path.stem), tuple(notes)


def write_pattern(scene: Scene, suffix: str, options: Options) -> tuple[bytes, tuple[str, ...]]:
    """Return a scene in the format of a suffix, and notes; see `convert` for errors."""
    if suffix == SCENE:
        return scene_file.dumps(scene).encode(), ()
    check_load(scene, "a pattern of a device")
    content, notes = extensions.find(PATTERN_WRITERS, suffix).function(scene, options)
    return content, (*notes, *_change_notes(scene, content, suffix))


def _change_notes(scene: Scene, content: bytes, suffix: str, most: int = 5000) -> list[str]:
    """Return a note on the change of the load, if the file can be read back.

    Of a CSV only the first `most` samples are read.
    """
    if suffix not in extensions.names(PATTERN_READERS):
        return []
    read = extensions.find(PATTERN_READERS, suffix).function
    is_csv = suffix == ".csv"
    if is_csv:
        rows = 1 + most * len(scene.tacton.foci)
        content = b"".join(content.splitlines(keepends=True)[:rows])
    changes = []
    for way in ("", " with --hold")[: 1 + is_csv]:
        try:
            pattern = read(content, Options(hold=bool(way)), scene)
        except ValueError as error:
            return [f"the change of the load is unknown, because it cannot be read back: {error}"]
        change = load_change(scene, onto(scene, pattern, scene.name))
        changes.append(f"{percent(change) if change >= 1e-4 else 'less than 0.01 %'}{way}")
    return [f"read back, the load on the path changes by {', '.join(changes)} (root mean square)"]


def load_change(scene: Scene, other: Scene, places: int = 16, instants: int = 4000) -> float:
    """Return the relative RMS change of the pressure on the path, over the shorter Tacton."""
    golden = (5**0.5 - 1) / 2  # its multiples are spread evenly, and in step with no period
    duration = min(scene.tacton.duration, other.tacton.duration)
    times = duration * np.sort(np.arange(instants) * golden % 1)
    points = scene.tacton.trajectory.at_phase(np.arange(places) / places)
    before, after = (each.pressure(points, times) for each in (scene, other))
    size = float(np.linalg.norm(before))
    return float(np.linalg.norm(after - before)) / size if size else 0.0
