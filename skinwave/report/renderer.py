"""Test whether three-dimensional pictures can be drawn, in a child process.

Without GL libraries VTK ends the process that opens its first window, and raises no exception.
"""

from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache

from meshes import subprocess_call


@dataclass(frozen=True, kw_only=True)
class Renderer:
    """Whether there is a renderer, and its name, or the reason why not and a cure."""

    is_available: bool
    detail: str


def renderer() -> Renderer:
    """Return the renderer of this environment, tested once per process."""
    return begin().result()


@cache
def begin() -> "Future[Renderer]":
    """Begin the test, which takes more than a second, beside other work."""
    thread = ThreadPoolExecutor(1)
    testing = thread.submit(_test)
    thread.shutdown(wait=False)
    return testing


def _test(timeout: float = 60.0) -> Renderer:
    """Draw in a child process, within a `timeout` in s."""
    try:
        name = subprocess_call.call(draw_sphere, timeout=timeout)
        return Renderer(is_available=True, detail=name)
    except TimeoutError:
        detail = f"opening a window takes more than {timeout:g} s"
    except ModuleNotFoundError as error:
        detail = f"the Python package {error.name} is missing; install it"
    except Exception:
        detail = "the GL libraries are missing; on Debian, run apt install libegl1 libgl1-mesa-dri"
    return Renderer(is_available=False, detail=detail)


def draw_sphere() -> str:
    """Draw in a small window and return the name of its class."""
    import pyvista as pv

    plotter = pv.Plotter(off_screen=True, window_size=(32, 32))
    plotter.add_mesh(pv.Sphere())
    plotter.screenshot(None, return_img=True)
    name = type(plotter.render_window).__name__
    plotter.close()
    return name
