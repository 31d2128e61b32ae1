"""Whether pictures in three dimensions can be drawn here, asked of a child process.

Without GL libraries VTK ends the process that makes its first window, and no exception tells.
"""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from meshes import subprocess_call

PROBE = Path(__file__).with_name("renderer_child.py")
PACKAGES = "libegl1 libgl1-mesa-dri"
PATIENCE = 60.0  # s


@dataclass(frozen=True, kw_only=True)
class Renderer:
    """Whether there is one, and which; if there is none, why, in a sentence with its cure."""

    found: bool
    said: str


@cache
def renderer() -> Renderer:
    """Renderer of this environment, probed once a process."""
    try:
        with TemporaryDirectory() as folder:
            said = subprocess_call.run(PROBE, folder=folder, timeout=PATIENCE).split()
    except TimeoutError:
        return Renderer(found=False, said=f"a window is not made within {PATIENCE:g} s")
    except ValueError as error:
        if "No module named" in str(error):
            missing = str(error).split("No module named")[-1].strip()
            cure = f"the Python package {missing} is missing; install it"
            return Renderer(found=False, said=cure)
        said = []
    if said:
        return Renderer(found=True, said=said[-1])
    missing = "no picture in three dimensions can be drawn here: the GL libraries are missing"
    return Renderer(found=False, said=f"{missing}; on Debian, apt install {PACKAGES}")
