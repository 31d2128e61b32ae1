"""Surfaces in files, read with VTK."""

import os
from collections.abc import Iterator
from typing import Any

import numpy as np

from meshes.by_vtk import read_by_vtk
from meshes.files import existing, scale_of
from meshes.placing import turned
from meshes.surface import Surface
from meshes.tetmesh import MeshError

SURFACE_FORMATS = (".stl", ".ply", ".obj", ".glb", ".vtp")


def read_surface(path: str | os.PathLike[str], *, unit: str = "m", up: str = "+z") -> Surface:
    """The triangles of a `.stl`, `.ply`, `.obj`, `.glb` or `.vtp` file, as they are in it.

    Parameters
    ----------
    unit : of the coordinates in the file: m, cm, mm, um or in.
    up : which axis of the file points away from the palm, towards the device: +x, -x, ... -z.

    Raises
    ------
    MeshError
        If the file cannot be read or holds no triangles, or unit or axis are unknown.
    """
    path = existing(path, SURFACE_FORMATS)
    scale = scale_of(unit)
    parts = list(_leaves(read_by_vtk(path)))
    points = [np.asarray(part.points, np.float64) for part in parts]
    first = np.cumsum([0, *(len(p) for p in points)])
    triangles = [
        np.asarray(part.faces).reshape(-1, 4)[:, 1:] + n
        for part, n in zip(parts, first, strict=False)
    ]
    if not sum(map(len, triangles)):
        raise MeshError(
            f"{path} holds no triangles; give a surface of {', '.join(SURFACE_FORMATS)}"
        )
    surface = Surface(points=np.vstack(points) * scale, triangles=np.vstack(triangles))
    return turned(surface, up)


def _leaves(data: Any) -> Iterator[Any]:
    """The triangulated parts of what VTK read, which may be nested."""
    import pyvista

    if isinstance(data, pyvista.MultiBlock):
        for part in data:
            yield from _leaves(part)
    elif data is not None and data.n_cells:
        faces = data if isinstance(data, pyvista.PolyData) else data.extract_geometry()
        if len(faces.faces):
            flat = pyvista.PolyData(faces.points, faces=faces.faces).triangulate()
            if flat.n_cells:
                yield flat
