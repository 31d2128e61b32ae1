"""Mesh files, written with meshio.

A mesh is written with its regions and facet sets, and `read` gives it as it was. In `.vtu`, the
cell array `region` numbers the tetrahedra, `region:<name>` is 1 for those of a region with a name,
and each facet set is a block of triangles for which the cell array `facets:<name>` is 1. In `.msh`
2.2 they are physical groups.
"""

from __future__ import annotations

import contextlib
import io
import os
import tempfile
import warnings
from pathlib import Path

from numpy.typing import ArrayLike

from meshes.files.cells import gmsh_names, gmsh_tags, placed, vtu_tags
from meshes.tetmesh import MeshError, TetMesh

WRITTEN = {".vtu": "vtu", ".msh": "gmsh22"}  # version 4.1 of meshio is refused by gmsh itself


def write(path: str | os.PathLike[str], mesh: TetMesh, **fields: ArrayLike) -> None:
    """Write a mesh with its regions, facet sets and fields to `.vtu`, or `.msh` 2.2 for gmsh.

    It is written aside and renamed, so that no half of it can be found.

    Parameters
    ----------
    fields : name -> (n, ...) per point or (m, ...) per tetrahedron.

    Raises
    ------
    MeshError
        If the kind of file is unknown, or a field fits neither points nor tetrahedra.
    """
    import meshio

    path = Path(path)
    if path.suffix.lower() not in WRITTEN:
        raise MeshError(
            f"{path} cannot be written; choose one of the kinds {', '.join(sorted(WRITTEN))}"
        )
    kind = WRITTEN[path.suffix.lower()]
    names = sorted(mesh.facets)
    facets = [(("triangle", "triangle6")[mesh.order - 1], mesh.facets[name]) for name in names]
    cells = [(("tetra", "tetra10")[mesh.order - 1], mesh.tets), *facets]
    tags = vtu_tags(mesh, names) if kind == "vtu" else gmsh_tags(mesh, names)
    at_points, at_cells = placed(mesh, [len(nodes) for _, nodes in facets], fields)
    # Blocks without cells are left out; what names them is not.
    keep = [i for i, (_, nodes) in enumerate(cells) if len(nodes)]
    raw = meshio.Mesh(
        mesh.points,
        [cells[i] for i in keep],
        point_data=at_points,
        cell_data={n: [v[i] for i in keep] for n, v in (tags | at_cells).items()},
        field_data={} if kind == "vtu" else gmsh_names(mesh, names),
    )
    handle, aside = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".part")
    os.close(handle)
    try:
        with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
            warnings.simplefilter("ignore")
            meshio.write(aside, raw, file_format=kind)
        os.chmod(aside, 0o666 & ~_umask())
        os.replace(aside, path)
    except BaseException:
        os.unlink(aside)
        raise


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
