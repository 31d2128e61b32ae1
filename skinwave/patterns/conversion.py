"""Conversion between pattern files; their suffixes define the formats."""

from dataclasses import replace
from pathlib import Path

from meshes import reading
from skinwave.patterns import adaptics, adaptics_out, autd3, focal_points, waveform
from skinwave.patterns.pattern import Options, onto, resize, wide_enough
from skinwave.scene import file as scene_file
from skinwave.scene.scene import Body, Scene, check_load

READERS = (".toml", ".adaptics", ".csv", ".wav")
WRITERS = (".toml", ".adaptics", ".csv", ".py")
LARGEST = {".adaptics": 16_000_000, ".csv": 128_000_000, ".wav": 32_000_000}  # bytes


def convert(
    source: Path, target: Path, options: Options, base: Scene | None = None
) -> tuple[bytes, tuple[str, ...]]:
    """Convert a pattern file to another format.

    Parameters
    ----------
    source, target : Path, with a suffix of `READERS` and of `WRITERS`
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
    if (suffix := target.suffix.lower()) not in WRITERS:
        raise ValueError(f"{target}: cannot write '{suffix}'; use {', '.join(WRITERS)}")
    if suffix != ".toml":
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
    if (suffix := path.suffix.lower()) not in READERS:
        raise ValueError(f"{path}: cannot read '{suffix}'; use {', '.join(READERS)}")
    if suffix == ".toml":
        scene = scene_file.read(path)
        tacton = resize(scene.tacton, options.resize)
        return replace(scene, pressure=replace(scene.pressure, tacton=tacton)), ()
    receiver = base or scene_file.loads("")
    content = reading.read_bytes(path, LARGEST[suffix])
    try:
        if suffix == ".wav":
            pattern = waveform.read(content, options, receiver)
        else:
            pattern = {".adaptics": adaptics, ".csv": focal_points}[suffix].read(content, options)
        tacton = resize(pattern.tacton, options.resize)
        notes = list(pattern.notes)
        receiver = base or wide_enough(receiver, tacton, notes)
        return onto(receiver, replace(pattern, tacton=tacton), path.stem), tuple(notes)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def write_pattern(scene: Scene, suffix: str, options: Options) -> tuple[bytes, tuple[str, ...]]:
    """Return a scene in the format of a suffix, and notes; see `convert` for errors."""
    if suffix == ".toml":
        return scene_file.dumps(scene).encode(), ()
    check_load(scene, "a pattern of a device")
    modules = {".adaptics": adaptics_out, ".csv": focal_points, ".py": autd3}
    return modules[suffix].write(scene, options)
