"""Work that may crash or never end, in a process of its own."""

import os
import subprocess
import sys
from pathlib import Path

from meshes.tetmesh import MeshError


def run(script: str, *arguments: object, folder: str | os.PathLike[str], timeout: float) -> None:
    """Run a script of this package in a folder; it ends with this process, however that ends.

    Raises
    ------
    MeshError
        If it fails; with the last line that it wrote.
    TimeoutError
        If it takes longer than `timeout` in second.
    """
    scripts = [str(Path(__file__).with_name(name)) for name in ("watched.py", script)]
    command = [sys.executable, "-P", *scripts, *map(str, arguments)]
    watched, held = os.pipe()  # `watched.py` ends when this process no longer holds its other end
    try:
        ended = subprocess.run(
            command, cwd=folder, timeout=timeout, capture_output=True, text=True,
            errors="replace", check=False, stdin=watched,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise TimeoutError(f"{script} was stopped after {timeout:g} s") from None
    finally:
        os.close(watched)
        os.close(held)
    if ended.returncode != 0:
        said = ended.stderr.strip().splitlines()[-1:] or ["it said nothing"]
        raise MeshError(f"it ended with code {ended.returncode}, {said[0][:200]}")
