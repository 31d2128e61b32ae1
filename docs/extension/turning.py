"""The scene of the page that can be turned: surfaces of kernel and skin side by side (vtk.js).

Run by itself it exports the scene at rest, whose points the page moves.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np

DEPTH, GAP = 6.0, 8.0  # mm: drawn under each surface, and between both
POINTER = 5.0  # mm, height of the cone over the focus


def _surface(x: Any, y: Any) -> Any:
    """Triangles of a plane with nodes at x (n,) and y (n,), x fastest, with room for what the
    page writes into them: motion and normals.
    """
    import pyvista as pv

    n = len(x)
    points = np.stack([np.tile(x, n), np.repeat(y, n), np.zeros(n * n)], axis=1)
    a = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    triangles = np.concatenate([np.stack(t, axis=1) for t in ((a, a + 1, a + n + 1),
                                                              (a, a + n + 1, a + n))])  # fmt: skip
    surface = pv.PolyData.from_regular_faces(points.astype(np.float32), triangles)
    surface["motion"] = np.zeros(n * n, dtype=np.float32)
    return surface.compute_normals(cell_normals=False, split_vertices=False)


def _walls(x: Any, y: Any) -> Any:
    """What is under the edge of a surface: its points all around, then those below them."""
    import pyvista as pv

    n = len(x)
    k, low, high = np.arange(n), np.zeros(n, int), np.full(n, n - 1)
    edge = np.concatenate([k, high, k[::-1], low]), np.concatenate([low, k, high, k[::-1]])
    top = np.stack([x[edge[0]], y[edge[1]], np.zeros(4 * n)], axis=1).astype(np.float32)
    a = np.arange(4 * n - 1)
    quads = np.stack([a, a + 1, a + 1 + 4 * n, a + 4 * n], axis=1)
    return pv.PolyData.from_regular_faces(np.vstack([top, top - [0, 0, DEPTH]]), quads)


def scene(side: int, reach: float, size: float) -> Any:
    """Plotter of both blocks at rest.

    Parameters
    ----------
    side, reach : nodes along a side of the grid, and half its width, metre
    size : diameter of the circle, metre

    Returns
    -------
    pyvista.Plotter
        Of kernel and skin five actors each: surface, walls, path, focus and title. Lengths in mm.
    """
    import pyvista as pv

    plotter = pv.Plotter(off_screen=True, window_size=(1000, 480))
    plotter.set_background("white")
    line, angle = 1e3 * np.linspace(-reach, reach, side), np.linspace(0, 2 * np.pi, 121)
    for title, sign in (("point kernel", -1), ("skin", 1)):
        middle = sign * (1e3 * reach + GAP / 2)
        circle = 500 * size * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
        plotter.add_mesh(
            _surface(line + middle, line), scalars="motion", cmap="RdBu_r", clim=(-1, 1),
            show_scalar_bar=False, smooth_shading=True, ambient=0.35, diffuse=0.75,
        )  # fmt: skip
        for mesh, colour in (
            (_walls(line + middle, line), "#e3d5cb"),
            (pv.lines_from_points((circle + [middle, 0, 0]).astype(np.float32)), "black"),
            (pv.Cone((0, 0, POINTER / 2), (0, 0, -1), POINTER, POINTER / 4), "black"),
            (pv.Text3D(title, 0.1, height=5, center=(middle, -1e3 * reach - 7, -DEPTH)), "black"),
        ):
            plotter.add_mesh(mesh, color=colour, line_width=2, ambient=0.5, diffuse=0.6)
    plotter.camera_position = [(0, -125, 90), (0, -2, -4), (0, 0, 1)]
    return plotter


def viewer(side: int, reach: float, size: float) -> str:
    """Scripts that draw the scene: vtk.js, and what it loads."""
    from skinwave.pictures.turntable import EXTRA, exported

    page = exported(Path(__file__), side, reach, size)
    if page is None:
        raise RuntimeError(f"{EXTRA}, or nothing draws here")
    return page[page.index("<script") : page.rindex("</script>") + len("</script>")]


if __name__ == "__main__":
    from skinwave.pictures.turntable import export

    export(scene(int(sys.argv[1]), *map(float, sys.argv[2:4])), sys.argv[4])
