"""Call Python functions in processes of their own, with limits of time and memory, for work that
may crash, never end or print: readers of files, the mesher, the probe of OpenGL.
"""

import os
import pickle
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TypeVar

from meshes.tetmesh import MeshError

# Limits for reading a file: those of any file, and more for every megabyte or byte of it.
LEAST_SECONDS, SECONDS = 60.0, 1.0
LEAST_BYTES, BYTES = 800_000_000, 20
LARGEST = 2_000_000_000  # bytes of a file
BEGIN = "from meshes.subprocess_call import _answer; _answer()"
T = TypeVar("T")


class Crashed(MeshError):
    """The process ended without returning or raising anything."""


def call(function: Callable[..., T], *args: object, timeout: float, memory: int = 0) -> T:
    """Call a function in a new process, whose working folder is empty and temporary.

    Parameters
    ----------
    function : defined at the top of a module that can be imported, not of a script
    args : its arguments; these and what it returns are pickled
    timeout : float, second; the process ends then even if this one is gone
    memory : int, byte, where the platform knows such limits; 0 for no limit

    Raises
    ------
    TimeoutError
        If it takes longer than `timeout`.
    Crashed
        If the process dies; with its code and the last line that it wrote.
    Exception
        What the function raises.
    """
    home = str(Path(__file__).parents[1])
    paths = os.pathsep.join(filter(None, [home, os.environ.get("PYTHONPATH")]))
    with tempfile.TemporaryDirectory(prefix="skinwave-") as folder:
        question, answer = Path(folder, "question"), Path(folder, "answer")
        question.write_bytes(pickle.dumps((function, args)))
        work = Path(folder, "work")
        work.mkdir()
        try:
            ended = subprocess.run(
                [sys.executable, "-P", "-c", BEGIN, str(int(timeout) + 2), str(memory), folder],
                cwd=work, timeout=timeout, text=True, errors="replace", check=False,
                stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
                env={**os.environ, "PYTHONPATH": paths},
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            raise TimeoutError(f"{function.__name__} was stopped after {timeout:g} s") from None
        if ended.returncode != 0:
            last = ended.stderr.strip().splitlines()[-1:] or ["it wrote nothing"]
            raise Crashed(f"its process ended with code {ended.returncode}: {last[0][:200]}")
        result, error = pickle.loads(answer.read_bytes())
    if error is not None:
        raise error
    found: T = result
    return found


def call_reader(function: Callable[[Path], T], path: Path) -> T:
    """Call a function that reads a file as `call` does, with limits by the file's size.

    Raises
    ------
    MeshError
        If the file is too large or reading it takes too long or crashes.
    Exception
        What the function raises.
    """
    size = path.stat().st_size
    if size > LARGEST:
        raise MeshError(f"{path} has {size / 1e6:,.0f} MB; the limit is {LARGEST / 1e6:,.0f} MB")
    seconds, memory = LEAST_SECONDS + SECONDS * size / 1e6, LEAST_BYTES + BYTES * size
    try:
        return call(function, path.resolve(), timeout=seconds, memory=memory)
    except TimeoutError:
        raise MeshError(
            f"reading {path} took longer than {seconds:.0f} s, the limit for its size; try again "
            "when less else is running, or save it in another format"
        ) from None


def _answer() -> None:
    """In the new process: set the limits, call the function, and write its result or error."""
    seconds, memory = map(int, sys.argv[1:3])
    folder = Path(sys.argv[3])
    if hasattr(signal, "alarm"):
        signal.alarm(seconds)
    with suppress(ImportError, ValueError, OSError):
        import resource

        if memory:  # of data, not of address space: VTK maps more than it ever touches
            resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))
    function, args = pickle.loads((folder / "question").read_bytes())
    try:
        answer = pickle.dumps((function(*args), None), pickle.HIGHEST_PROTOCOL)
    except Exception as error:
        answer = pickle.dumps((None, error))
    (folder / "answer").write_bytes(answer)
