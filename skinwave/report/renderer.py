"""Whether pictures in three dimensions can be drawn here, asked of a child process.

Without GL libraries VTK ends the process that makes its first window, and no exception tells.
"""

from dataclasses import dataclass
from functools import cache

from meshes import subprocess_call

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
        return Renderer(found=True, said=subprocess_call.call(draw_a_ball, timeout=PATIENCE))
    except TimeoutError:
        return Renderer(found=False, said=f"a window is not made within {PATIENCE:g} s")
    except ModuleNotFoundError as error:
        cure = f"the Python package {error.name} is missing; install it"
        return Renderer(found=False, said=cure)
    except Exception:
        missing = "no picture in three dimensions can be drawn here: the GL libraries are missing"
        return Renderer(found=False, said=f"{missing}; on Debian, apt install {PACKAGES}")


def draw_a_ball() -> str:
    """Draw in a small window, and return the name of its class."""
    import pyvista as pv

    plotter = pv.Plotter(off_screen=True, window_size=(32, 32))
    plotter.add_mesh(pv.Sphere())
    plotter.screenshot(None, return_img=True)
    name = type(plotter.render_window).__name__
    plotter.close()
    return name
