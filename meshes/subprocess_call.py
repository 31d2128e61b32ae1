"""Calls of Python functions in separate processes, with limits of time and memory.

For work that may crash, print or never end: file readers, the mesher, the probe of OpenGL.
"""

import gc
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

T = TypeVar("T")


class Crashed(MeshError):
    """Raised when the process ends without a result or an exception."""


def call(function: Callable[..., T], *args: object, timeout: float, memory: int = 0) -> T:
    """Call a function in a new process, in an empty temporary folder.

    Parameters
    ----------
    function : defined at the top level of an importable module
    args : its arguments; these and the result are pickled
    timeout : float, s; the process ends even if the caller is gone
    memory : int, bytes, where the platform supports it; 0 for no limit

    Raises
    ------
    TimeoutError
        If it takes longer than `timeout`.
    Crashed
        If the process dies, with its exit code and last line.
    Exception
        What the function raises.
    """
    home = str(Path(__file__).parents[1])
    paths = os.pathsep.join(filter(None, [home, os.environ.get("PYTHONPATH")]))
    begin = "from meshes.subprocess_call import _serve; _serve()"
    with tempfile.TemporaryDirectory(prefix="skinwave-") as folder:
        request, answer = Path(folder, "call"), Path(folder, "answer")
        request.write_bytes(pickle.dumps((function, args)))
        work = Path(folder, "work")
        work.mkdir()
        try:
            ended = subprocess.run(
                [sys.executable, "-P", "-c", begin, str(int(timeout) + 2), str(memory), folder],
                cwd=work, timeout=timeout, text=True, errors="replace", check=False,
                stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
                env={**os.environ, "PYTHONPATH": paths},
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            raise TimeoutError(f"{function.__name__} was stopped after {timeout:g} s") from None
        if ended.returncode != 0:
            last = ended.stderr.strip().splitlines()[-1:] or ["no message"]
            raise Crashed(f"its process ended with code {ended.returncode}: {last[0][:200]}")
        result, error = pickle.loads(answer.read_bytes())
    if error is not None:
        raise error
    value: T = result
    return value


def call_reader(
    function: Callable[[Path], T],
    path: Path,
    *,
    largest: int = 2_000_000_000,
    least_seconds: float = 60.0,
    seconds_per_mb: float = 1.0,
) -> T:
    """Call a function that reads a file of at most `largest` bytes in a new process, with limits of
    time and memory that grow with its size.
    """
    size = path.stat().st_size
    if size > largest:
        raise MeshError(
            f"{path} has {size / 1e6:,.0f} MB, more than the limit of {largest / 1e6:,.0f} MB"
        )
    seconds, memory = least_seconds + seconds_per_mb * size / 1e6, 800_000_000 + 20 * size
    try:
        return call(function, path.resolve(), timeout=seconds, memory=memory)
    except TimeoutError:
        raise MeshError(
            f"reading {path} took longer than {seconds:.0f} s, the limit for its size; try again "
            "when the machine is less busy, or save it in another format"
        ) from None


def _serve() -> None:
    """In the new process: set the limits, call the function, and write its result or error."""
    seconds, memory = map(int, sys.argv[1:3])
    folder = Path(sys.argv[3])
    if hasattr(signal, "alarm"):
        signal.alarm(seconds)
    with suppress(ImportError, ValueError, OSError):
        import resource

        if memory:  # data, not address space, because VTK maps more memory than it uses
            resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))
    gc.disable()  # it would take most of the time of readers that make many lists
    function, args = pickle.loads((folder / "call").read_bytes())
    try:
        answer = pickle.dumps((function(*args), None), pickle.HIGHEST_PROTOCOL)
    except Exception as error:
        answer = pickle.dumps((None, error))
    (folder / "answer").write_bytes(answer)
