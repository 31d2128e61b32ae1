"""From one pattern file to another, by what their names end with."""

from pathlib import Path

from meshes import reading
from skinwave import scene_file
from skinwave.patterns import adaptics, adaptics_out, autd3, focal_points, waveform
from skinwave.patterns.pattern import Options, Pattern, onto
from skinwave.scene import Scene, check_load

READERS = (".toml", ".adaptics", ".csv", ".wav")
WRITERS = (".toml", ".adaptics", ".csv", ".wav", ".py")
LARGEST = {".adaptics": 16_000_000, ".csv": 128_000_000, ".wav": 32_000_000}  # bytes


def convert(
    source: Path, target: Path, options: Options, base: Scene | None = None
) -> tuple[bytes, tuple[str, ...]]:
    """Contents of the target file, and notes on what was decided, left out or approximated.

    Parameters
    ----------
    base : Scene, which the pattern is put on: its body, probes, drive; a slab of palm by default

    Raises
    ------
    ValueError
        If a file is of no known kind or malformed, or the pattern cannot be expressed.
    """
    _known(target, WRITERS)
    scene, notes = read_pattern(source, options, base)
    content, more = write_pattern(scene, target.suffix.lower(), options)
    return content, (*notes, *more)


def read_pattern(
    path: Path, options: Options, base: Scene | None = None
) -> tuple[Scene, tuple[str, ...]]:
    """The scene of a pattern file, and notes.

    Raises
    ------
    ValueError
        If it is of no known kind, cannot be read or is malformed, in one sentence.
    """
    suffix = _known(path, READERS)
    if suffix == ".toml":
        return scene_file.read(path), ()
    base = base or scene_file.loads("")
    content = reading.content(path, LARGEST[suffix])
    try:
        pattern = _read(suffix, content, options, base)
        return onto(base, pattern, path.stem), pattern.notes
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def write_pattern(scene: Scene, suffix: str, options: Options) -> tuple[bytes, tuple[str, ...]]:
    """A scene in the format of a suffix, and notes.

    Raises
    ------
    ValueError
        If the format cannot express it.
    """
    if suffix == ".toml":
        return scene_file.dumps(scene).encode(), ()
    check_load(scene, "a pattern of a device")
    modules = {".adaptics": adaptics_out, ".csv": focal_points, ".wav": waveform, ".py": autd3}
    return modules[suffix].write(scene, options)


def _read(suffix: str, content: bytes, options: Options, base: Scene) -> Pattern:
    if suffix == ".wav":
        return waveform.read(content, options, base)
    return (adaptics.read if suffix == ".adaptics" else focal_points.read)(content, options)


def _known(path: Path, suffixes: tuple[str, ...]) -> str:
    suffix = path.suffix.lower()
    if suffix not in suffixes:
        raise ValueError(f"{path}: '{suffix}' is no known kind of file, use {', '.join(suffixes)}")
    return suffix
