"""Programs in a process of their own, with limits of time and memory, for work that may crash,
never end or change its process: readers of files, the mesher, what draws.
"""

import os
import runpy
import signal
import subprocess
import sys
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from meshes.tetmesh import MeshError

# Limits of what reads a file: those of any file, and more for every megabyte or byte of it.
LEAST_SECONDS, SECONDS = 60.0, 1.0
LEAST_BYTES, BYTES = 800_000_000, 20
LARGEST = 2_000_000_000  # bytes of a file
REFUSED = 3  # code of a script that said what is wrong with a file
BEGIN = "from meshes.subprocess_call import begin; begin()"


class Refused(MeshError):
    """Refusal of a file by a script that ended with `REFUSED`, with its message."""


class Crashed(MeshError):
    """End of a script with an error that it does not expect."""


def read(script: Path, path: Path, *arguments: object, folder: str | os.PathLike[str]) -> None:
    """Run a script that reads a file, with time and memory by the file's size.

    Parameters
    ----------
    script : file of Python
    path : file that it reads, its first argument
    arguments : its further arguments
    folder : in which it runs

    Raises
    ------
    MeshError
        If it takes too long or the file is too large, or as `run` does.
    """
    size = path.stat().st_size
    if size > LARGEST:
        raise MeshError(f"{size / 1e6:,.0f} MB exceed the limit of {LARGEST / 1e6:,.0f} MB")
    seconds, memory = LEAST_SECONDS + SECONDS * size / 1e6, LEAST_BYTES + BYTES * size
    try:
        run(script, path.resolve(), *arguments, folder=folder, timeout=seconds, memory=memory)
    except TimeoutError:
        raise MeshError(
            f"reading it took longer than {seconds:.0f} s, the limit for its size; try again when "
            "less else is running, or write it in another format"
        ) from None


def run(
    script: Path,
    *arguments: object,
    folder: str | os.PathLike[str],
    timeout: float,
    memory: int = 0,
    environment: Mapping[str, str] | None = None,
) -> str:
    """Run a script in a folder, from which it imports nothing; it finds these packages.

    Parameters
    ----------
    script : file of Python
    arguments : those of the script
    folder : in which it runs
    timeout : float, second; it ends then even if this process is gone
    memory : int, byte, where the platform knows such limits; 0 for no limit
    environment : variables that it has beside those of this process

    Returns
    -------
    all that it printed

    Raises
    ------
    MeshError
        If it fails; with the last line that it wrote.
    TimeoutError
        If it takes longer than `timeout`.
    """
    home = str(Path(__file__).parents[1])
    paths = os.pathsep.join(filter(None, [home, os.environ.get("PYTHONPATH")]))
    limits = [str(int(timeout) + 2), str(memory)]
    try:
        ended = subprocess.run(
            [sys.executable, "-P", "-c", BEGIN, *limits, str(script), *map(str, arguments)],
            cwd=folder, timeout=timeout, capture_output=True, text=True, errors="replace",
            check=False, stdin=subprocess.DEVNULL,
            env={**os.environ, "PYTHONPATH": paths, **(environment or {})},
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise TimeoutError(f"{script.name} was stopped after {timeout:g} s") from None
    if ended.returncode == REFUSED:
        raise Refused(ended.stderr.strip().splitlines()[-1])
    if ended.returncode != 0:
        said = ended.stderr.strip().splitlines()[-1:] or ["it said nothing"]
        raise Crashed(f"it ended with code {ended.returncode}, {said[0][:200]}")
    return ended.stdout


def begin() -> None:
    """Set the limits in the arguments of this process, and run its script."""
    seconds, memory = map(int, sys.argv[1:3])
    if hasattr(signal, "alarm"):
        signal.alarm(seconds)
    with suppress(ImportError, ValueError, OSError):
        import resource

        if memory:  # of data, not of address space: VTK maps more than it ever touches
            resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))
    sys.argv = sys.argv[3:]
    runpy.run_path(sys.argv[0], run_name="__main__")
