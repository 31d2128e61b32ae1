"""Run by `surface_files` and `mesh_files` in a process of its own: VTK's readers.

    python vtk_child.py FILE OUTPUT

They crash on some damaged files, and print. The triangles of FILE are written to OUTPUT.npz, or
all of its cells to OUTPUT.vtu.
"""

import sys
from collections.abc import Iterator
from typing import Any

import numpy as np


def main() -> None:
    """Read FILE and write OUTPUT."""
    import pyvista

    source, target = sys.argv[1:]
    data = pyvista.read(source)
    if target.endswith(".vtu"):
        data.cast_to_unstructured_grid().save(target)
        return
    parts = list(leaves(data))
    first = np.cumsum([0, *(part.n_points for part in parts)])
    triangles = [
        np.asarray(part.faces).reshape(-1, 4)[:, 1:] + n
        for part, n in zip(parts, first, strict=False)
    ]
    points = [np.asarray(part.points, np.float64) for part in parts]
    np.savez(
        target,
        points=np.vstack([np.zeros((0, 3)), *points]),
        triangles=np.vstack([np.zeros((0, 3), np.int64), *triangles]),
    )


def leaves(data: Any) -> Iterator[Any]:
    """The triangulated parts of what VTK read, which may be nested."""
    import pyvista

    if isinstance(data, pyvista.MultiBlock):
        for part in data:
            yield from leaves(part)
    elif data is not None and data.n_cells:
        faces = data if isinstance(data, pyvista.PolyData) else data.extract_geometry()
        if len(faces.faces):
            flat = pyvista.PolyData(faces.points, faces=faces.faces).triangulate()
            if flat.n_cells:
                yield flat


if __name__ == "__main__":
    main()
