"""A view that can be turned in a browser: one page that asks no network for anything (vtk.js).

The exporter starts a server of its own, and so it runs in a process of its own.
"""

import asyncio
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from meshes import subprocess_call
from skinwave.pictures.maps import SIGNED
from skinwave.pictures.render import add_marks, look, place, prepared, scale
from skinwave.pictures.views import View, load, save

PATIENCE = 120.0  # s
ICON = "https://kitware.github.io/vtk-js/icon/favicon-"  # which the page would load of the network
EXTRA = "the extra [web], trame-pyvista, is not installed"


def turntable(view: View, frame: int) -> str | None:
    """The page of a view at a frame; None if what exports it is not installed, or fails."""
    with tempfile.TemporaryDirectory() as folder:
        kept = Path(folder, "view.npz")
        save(kept, view)
        return exported(Path(__file__), kept, frame)


def exported(script: Path, *given: object) -> str | None:
    """The page that a script exports to the last of its arguments, after those given; None if
    what exports it is not installed, or fails.
    """
    if find_spec("trame_pyvista") is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder, "page.html")
        # An existing folder keeps the exporter from asking a network for what it does not need.
        quiet = {"VTK_WASM_DIR_OVERRIDE": folder}
        try:
            subprocess_call.run(
                script, *given, page, folder=folder, timeout=PATIENCE, environment=quiet
            )
        except (ValueError, TimeoutError):
            return None
        return page.read_text(encoding="utf-8").replace(ICON, "data:,")


def export(plotter: Any, path: str) -> None:
    """Write the page of a plotter, which it closes; in a process of its own."""
    import pyvista as pv
    from trame_pyvista.jupyter import launch_server

    async def ready() -> None:
        await launch_server(pv.global_theme.trame.jupyter_server_name).ready

    asyncio.run(ready())
    plotter.trame.export_html(path)
    plotter.close()


def _drawn(view: View, frame: int) -> Any:
    import pyvista as pv

    plotter = pv.Plotter(off_screen=True, lighting="none", window_size=(800, 500))
    plotter.set_background("white")
    (_, limit), _ = scale([view])
    panel = prepared(view)
    place([panel], frame, limit)
    plotter.add_mesh(
        panel.skin, scalars="motion", cmap=SIGNED, clim=(-limit, limit), show_scalar_bar=False
    )
    add_marks(plotter, panel, "black")
    look(plotter, "tilted", [panel])
    plotter.camera.parallel_projection = False  # which the page does not take over
    plotter.reset_camera()
    plotter.camera.zoom(1.3)
    return plotter


if __name__ == "__main__":
    export(_drawn(load(Path(sys.argv[1])), int(sys.argv[2])), sys.argv[3])
