"""Whether pictures in three dimensions can be drawn here, asked of a child process.

Without GL libraries VTK ends the process that makes its first window, and no exception tells.
"""

import subprocess
import sys
from dataclasses import dataclass
from functools import cache

PROBE = """
import pyvista as pv
plotter = pv.Plotter(off_screen=True, window_size=(32, 32))
plotter.add_mesh(pv.Sphere())
plotter.screenshot(None, return_img=True)
print(type(plotter.render_window).__name__)
plotter.close()
"""
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
        done = subprocess.run(
            [sys.executable, "-P", "-c", PROBE], capture_output=True, text=True, timeout=PATIENCE
        )
    except subprocess.TimeoutExpired:
        return Renderer(found=False, said=f"a window is not made within {PATIENCE:g} s")
    if done.returncode == 0 and done.stdout.strip():
        return Renderer(found=True, said=done.stdout.split()[-1])
    if "No module named" in done.stderr:
        missing = done.stderr.strip().splitlines()[-1].split("No module named")[-1].strip()
        return Renderer(found=False, said=f"the Python package {missing} is missing; install it")
    return Renderer(
        found=False,
        said="no picture in three dimensions can be drawn here: the GL libraries are missing; on "
        f"Debian, apt install {PACKAGES}",
    )
