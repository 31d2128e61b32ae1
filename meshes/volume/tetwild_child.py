"""Run by `tetrahedralise` in a process of its own: arrays in, arrays out.

    python tetwild_child.py INPUT.npz OUTPUT.npz

The mesher may crash or never end, and writes into the current folder.
"""

import sys

import numpy as np
from pytetwild import tetrahedralize

source, target = sys.argv[1:]
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
