"""Run by `mesh_files` in a process of its own: meshio's readers, and what they make of a file.

    python mesh_child.py FILE UNIT OUTPUT.npz

They take whatever time and memory a file asks for. What is wrong with the file is the last line
of standard error.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np

from meshes import subprocess_call
from meshes.files import mesh_files
from meshes.tetmesh import MeshError


def main() -> int:
    """Write the mesh in FILE to OUTPUT.npz; 1 if there is none."""
    source, unit, target = sys.argv[1:]
    try:
        mesh = mesh_files.read_here(Path(source), mesh_files.scale_of(unit))
    except MeshError as error:
        print(error, file=sys.stderr)
        return subprocess_call.REFUSED
    names = sorted(mesh.facets)
    facets: dict[str, Any] = {f"facets{k}": mesh.facets[name] for k, name in enumerate(names)}
    np.savez(
        target, points=mesh.points, tets=mesh.tets, region=mesh.region,
        names=np.array(names, np.str_), numbers=np.array(list(mesh.region_names), np.int64),
        titles=np.array(list(mesh.region_names.values()), np.str_), **facets,
    )  # fmt: skip
    return 0


if __name__ == "__main__":
    sys.exit(main())
