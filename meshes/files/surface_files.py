"""Surface files, read with VTK in a process of its own."""

import os
import tempfile
from pathlib import Path

import numpy as np

from meshes import subprocess_call
from meshes.files.mesh_files import VTK_CHILD, existing, scale_of
from meshes.surface.alignment import turned
from meshes.surface.triangulation import Surface
from meshes.tetmesh import MeshError

SURFACE_FORMATS = (".stl", ".ply", ".obj", ".glb", ".vtp")


def read_surface(path: str | os.PathLike[str], *, unit: str = "m", up: str = "+z") -> Surface:
    """Triangles of a `.stl`, `.ply`, `.obj`, `.glb` or `.vtp` file, as they are in it.

    Parameters
    ----------
    path : the file
    unit : of the coordinates in the file: m, cm, mm, um or in.
    up : which axis of the file points away from the palm, towards the device: +x, -x, ... -z.

    Returns
    -------
    Surface, metre, turned so that `up` is +z

    Raises
    ------
    MeshError
        If the file cannot be read or holds no triangles, or unit or axis are unknown.
    """
    path = existing(path, SURFACE_FORMATS)
    scale = scale_of(unit)
    with tempfile.TemporaryDirectory(prefix="skinwave-") as folder:
        target = Path(folder, "surface.npz")
        try:
            subprocess_call.read(VTK_CHILD, path, target, folder=folder)
        except MeshError as error:
            raise MeshError(
                f"{path} cannot be read ({error}); save it again from the program that it is from"
            ) from None
        with np.load(target) as found:
            points, triangles = found["points"], found["triangles"]
    if not len(triangles):
        raise MeshError(
            f"{path} holds no triangles; give a surface of {', '.join(SURFACE_FORMATS)}"
        )
    return turned(Surface(points=points * scale, triangles=triangles), up)
