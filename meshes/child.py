"""Work that may crash or never end, in a process of its own."""

import math
import os
import subprocess
import sys
from pathlib import Path

from meshes.reading import on_disk
from meshes.tetmesh import MeshError

# Limits of what reads a file: of every megabyte that it takes on the disk, beside those of any.
LEAST_SECONDS, SECONDS = 8.0, 1.0
LEAST_BYTES, BYTES = 800_000_000, 20
LARGEST = 2_000_000_000  # bytes of a file
REFUSED = 3  # code of a script that said what is wrong with a file


class Refused(MeshError):
    """What a script said of a file that it refused, and ended with `REFUSED`."""


def read(script: str, path: Path, *arguments: object, folder: str | os.PathLike[str]) -> None:
    """Run a script that reads a file, with time and memory by the file's size; raises what `run`
    does, and MeshError where it takes too long or the file is too large.
    """
    if (size := path.stat().st_size) > LARGEST:
        raise MeshError(
            f"it is larger ({size / 1e6:,.0f} MB) than the limit of {LARGEST / 1e6:,.0f} MB"
        )
    seconds = LEAST_SECONDS + SECONDS * on_disk(path) / 1e6
    memory = LEAST_BYTES + BYTES * on_disk(path)
    try:
        run(script, path.resolve(), *arguments, folder=folder, timeout=seconds, memory=memory)
    except TimeoutError:
        raise MeshError(f"reading it took longer than {seconds:.0f} s") from None


def run(
    script: str,
    *arguments: object,
    folder: str | os.PathLike[str],
    timeout: float,
    memory: float = math.inf,
) -> None:
    """Run a script of this package in a folder; it is killed if this process is interrupted.

    Raises
    ------
    MeshError
        If it fails; with the last line that it wrote.
    TimeoutError
        If it takes longer than `timeout` in second.

    Where the platform knows such limits, it gets no more than `memory` in bytes.
    """
    command = [sys.executable, "-P", str(Path(__file__).parent / script), *map(str, arguments)]
    try:
        ended = subprocess.run(
            _limited(command, memory), cwd=folder, timeout=timeout, capture_output=True, text=True,
            errors="replace", check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise TimeoutError(f"{script} was stopped after {timeout:g} s") from None
    if ended.returncode == REFUSED:
        raise Refused(ended.stderr.strip().splitlines()[-1])
    if ended.returncode != 0:
        said = ended.stderr.strip().splitlines()[-1:] or ["it said nothing"]
        raise MeshError(f"it ended with code {ended.returncode}, {said[0][:200]}")


def _limited(command: list[str], memory: float) -> list[str]:
    """The command with a limit on what it may allocate, which is set before anything is read."""
    if not math.isfinite(memory):
        return command
    python, *rest = command
    return [python, "-P", "-c", LIMITED, str(int(memory)), *rest[1:]]


# Data, not address space: libraries of VTK map more than a gigabyte that they never touch.
LIMITED = """
import runpy, sys
try:
    import resource
    resource.setrlimit(resource.RLIMIT_DATA, 2 * (int(sys.argv[1]),))
except (ImportError, ValueError, OSError):
    pass
del sys.argv[:2]
runpy.run_path(sys.argv[0], run_name="__main__")
"""
