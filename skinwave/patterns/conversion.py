"""From one pattern file to another, by what their names end with."""

from dataclasses import replace
from pathlib import Path

from meshes import reading
from skinwave.patterns import adaptics, adaptics_out, autd3, focal_points, waveform
from skinwave.patterns.pattern import Options, onto, resized, wide_enough
from skinwave.scene import file as scene_file
from skinwave.scene.scene import Body, Scene, check_load

READERS = (".toml", ".adaptics", ".csv", ".wav")
WRITERS = (".toml", ".adaptics", ".csv", ".py")
LARGEST = {".adaptics": 16_000_000, ".csv": 128_000_000, ".wav": 32_000_000}  # bytes


def convert(
    source: Path, target: Path, options: Options, base: Scene | None = None
) -> tuple[bytes, tuple[str, ...]]:
    """Contents of the target file, and notes on what was decided, left out or approximated.

    Parameters
    ----------
    source, target : Path, of `READERS` and `WRITERS`
    options : Options
    base : Scene, which the pattern is put on: its body, probes, drive; a slab of palm by default

    Returns
    -------
    bytes, and tuple of str

    Raises
    ------
    ValueError
        If a file is of no known kind or malformed, or the pattern cannot be expressed.
    """
    if (suffix := target.suffix.lower()) not in WRITERS:
        raise ValueError(f"{target}: '{suffix}' cannot be written, use {', '.join(WRITERS)}")
    if suffix != ".toml":
        base = replace(base or scene_file.loads(""), body=Body(kind="none"))
    scene, notes = read_pattern(source, options, base)
    content, more = write_pattern(scene, suffix, options)
    return content, (*notes, *more)


def read_pattern(
    path: Path, options: Options, base: Scene | None = None
) -> tuple[Scene, tuple[str, ...]]:
    """The scene of a pattern file on a base, by default a slab that the path lies on, and notes;
    errors as of `convert`.
    """
    if (suffix := path.suffix.lower()) not in READERS:
        raise ValueError(f"{path}: '{suffix}' is no known kind of file, use {', '.join(READERS)}")
    if suffix == ".toml":
        scene = scene_file.read(path)
        tacton = resized(scene.tacton, options.resize)
        return replace(scene, pressure=replace(scene.pressure, tacton=tacton)), ()
    given = base or scene_file.loads("")
    content = reading.read_bytes(path, LARGEST[suffix])
    try:
        pattern = (
            waveform.read(content, options, given) if suffix == ".wav"
            else {".adaptics": adaptics, ".csv": focal_points}[suffix].read(content, options)
        )  # fmt: skip
        tacton = resized(pattern.tacton, options.resize)
        notes = list(pattern.notes)
        given = base or wide_enough(given, tacton, notes)
        return onto(given, replace(pattern, tacton=tacton), path.stem), tuple(notes)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def write_pattern(scene: Scene, suffix: str, options: Options) -> tuple[bytes, tuple[str, ...]]:
    """A scene in the format of a suffix, and notes; a ValueError if it has no words for it."""
    if suffix == ".toml":
        return scene_file.dumps(scene).encode(), ()
    check_load(scene, "a pattern of a device")
    modules = {".adaptics": adaptics_out, ".csv": focal_points, ".py": autd3}
    return modules[suffix].write(scene, options)
