"""Run by `tetrahedralise` in a process of its own: arrays in, arrays out.

    python tetwild_child.py INPUT.npz OUTPUT.npz SECONDS

The mesher may crash or never end, and writes into the current folder. It is killed after so many
seconds even if the process that started it is gone.
"""

import signal
import sys

import numpy as np


def main() -> None:
    """Fill the surface of INPUT with tetrahedra."""
    source, target, seconds = sys.argv[1:]
    if hasattr(signal, "alarm"):
        signal.alarm(int(float(seconds)) + 2)
    from pytetwild import tetrahedralize

    given = np.load(source)
    points, tets = tetrahedralize(
        given["points"],
        given["triangles"].astype(np.int32),
        edge_length_abs=float(given["h"]),
        epsilon=float(given["epsilon"]),
        vtk_ordering=True,
        bg_vertices=given["grid_points"],
        bg_tets=given["grid_tets"].astype(np.int32),
        bg_values=given["grid_sizes"],
    )
    np.savez(target, points=points, tets=tets)


if __name__ == "__main__":
    main()
