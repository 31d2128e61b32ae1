"""Programs in a process of their own, with limits of time and memory, for work that may crash,
never end or change its process: readers of files, the mesher, what draws.

`skinwave.system.processes` calls Python functions in processes.
"""

import math
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

from meshes.reading import on_disk
from meshes.tetmesh import MeshError

# Limits of what reads a file: of every megabyte that it takes on the disk, beside those of any.
LEAST_SECONDS, SECONDS = 60.0, 1.0
LEAST_BYTES, BYTES = 800_000_000, 20
LARGEST = 2_000_000_000  # bytes of a file
REFUSED = 3  # code of a script that said what is wrong with a file


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
    if (size := path.stat().st_size) > LARGEST:
        raise MeshError(
            f"it is larger ({size / 1e6:,.0f} MB) than the limit of {LARGEST / 1e6:,.0f} MB"
        )
    seconds = LEAST_SECONDS + SECONDS * on_disk(path) / 1e6
    memory = LEAST_BYTES + BYTES * on_disk(path)
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
    memory: float = math.inf,
    environment: Mapping[str, str] | None = None,
) -> str:
    """Run a script in a folder. It ends with this process, however that ends, imports nothing from
    the folder, and finds these packages.

    Parameters
    ----------
    script : file of Python
    arguments : those of the script
    folder : in which it runs
    timeout : float, second.
    memory : float, byte, where the platform knows such limits.
    environment : variables that it has beside those of this process.

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
    watcher = str(Path(__file__).with_name("watched.py"))
    limit = str(int(memory)) if math.isfinite(memory) else "0"
    command = [sys.executable, "-P", watcher, limit, str(script), *map(str, arguments)]
    watched, held = os.pipe()  # `watched.py` ends when this process no longer holds its other end
    try:
        ended = subprocess.run(
            command, cwd=folder, timeout=timeout, capture_output=True, text=True,
            errors="replace", check=False, stdin=watched,
            env={**os.environ, **(environment or {})},
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise TimeoutError(f"{script.name} was stopped after {timeout:g} s") from None
    finally:
        os.close(watched)
        os.close(held)
    if ended.returncode == REFUSED:
        raise Refused(ended.stderr.strip().splitlines()[-1])
    if ended.returncode != 0:
        said = ended.stderr.strip().splitlines()[-1:] or ["it said nothing"]
        raise Crashed(f"it ended with code {ended.returncode}, {said[0][:200]}")
    return ended.stdout
