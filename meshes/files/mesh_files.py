"""Mesh and surface files: their contents, and meshes written with meshio.

Files are read in a separate process, because readers crash on damaged files, print, and may use any
amount of time and memory. `read` restores a written mesh with its regions and facet sets. In
`.vtu`, the cell array `region` numbers the tetrahedra, `region:<name>` is 1 in a named region, and
each facet set is a block of triangles with 1 in the cell array `facets:<name>`. In `.msh` 2.2 they
are physical groups.
"""

import contextlib
import io
import os
import warnings
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from meshes import subprocess_call
from meshes.files.cells import FACETS, NAMED, REGION, Contents
from meshes.files.readers import BY_MESHIO, OWN, SAVE_OTHERWISE, read_file
from meshes.tetmesh import MeshError, TetMesh

FORMATS = (
    ".vtu", ".pvtu", ".vtk", ".vtm", ".vtkhdf", ".xdmf", ".xmf", ".exo", ".e", ".vtp", ".stl",
    ".ply", ".obj", ".glb", ".gltf", *BY_MESHIO, *OWN,
)  # fmt: skip
UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 25.4e-3}
WRITTEN = {".vtu": "vtu", ".msh": "gmsh22"}  # gmsh cannot read the version 4.1 of meshio


def read_contents(path: str | os.PathLike[str]) -> Contents:
    """Return the parts of a file that a body can be made of.

    Raises a MeshError if the file is missing, damaged, of an unknown kind, or has no suitable
    cells.
    """
    path = Path(path)
    if path.suffix.lower() not in FORMATS:
        raise MeshError(f"{path} has an unknown file format; give one of {', '.join(FORMATS)}")
    if not path.is_file():
        raise MeshError(f"{path} does not exist; check its name")
    written = path.stat()
    several_files = (".pvtu", ".vtm", ".xdmf", ".xmf", ".gltf", *OWN)  # which name other files
    read = _read.__wrapped__ if path.suffix.lower() in several_files else _read
    try:
        return read(path, written.st_mtime_ns, written.st_size)
    except subprocess_call.Crashed:
        raise MeshError(
            f"{path} ended its reader: it is cut short, or of a variant that is not read; "
            f"{SAVE_OTHERWISE}"
        ) from None
    except MeshError as error:
        raise MeshError(str(error).replace(str(path.resolve()), str(path))) from None


@lru_cache(maxsize=2)  # a plan, a response, a map and a picture of a body mesh the same file
def _read(path: Path, modified: int, size: int) -> Contents:
    """Return the parts of a file that was modified at a time in ns and has a size in bytes."""
    return subprocess_call.call_reader(read_file, path)


def scale_of(unit: str) -> float:
    """Return the size of a unit in m."""
    if unit not in UNITS:
        raise MeshError(f"unit '{unit}' is unknown; use one of {', '.join(UNITS)}")
    return UNITS[unit]


def read(path: str | os.PathLike[str], *, unit: str = "m") -> TetMesh:
    """Read the tetrahedra of a mesh file, with regions and facet sets.

    Regions are the cell array `region` or `material`, Medit references, physical groups, Abaqus
    element sets, or blocks. Hexahedra, prisms and pyramids are split into tetrahedra. Coinciding
    nodes are merged and duplicate elements dropped.

    Parameters
    ----------
    path : file in one of `FORMATS`
    unit : unit of the coordinates in the file: m, cm, mm, um or in

    Raises a MeshError if the file cannot be read, has no solid elements, or has an unknown node
    order.

    >>> from meshes import block
    >>> write("block.vtu", block((0.02, 0.02, 0.01), 0.01))
    >>> sorted(read("block.vtu").facets)[:3]
    ['absorbing', 'back', 'bottom']
    """
    scale, contents = scale_of(unit), read_contents(path)
    if not len(contents.tets):
        raise MeshError(
            f"{path} is a surface; fill it with skinwave mesh or `meshes.body_from_file`"
        )
    return mesh_of(contents, scale)


def mesh_of(contents: Contents, scale: float) -> TetMesh:
    """Return the mesh in a file in m; `scale` is the size of its unit."""
    return TetMesh(
        points=contents.points * scale, tets=contents.tets, region=contents.region,
        region_names=contents.names, facets=contents.facets,
    )  # fmt: skip


def write(path: str | os.PathLike[str], mesh: TetMesh) -> None:
    """Write a mesh with its regions and facet sets as `.vtu`, or as `.msh` 2.2 for gmsh.

    The file is replaced only when complete. Raises a MeshError for another suffix.
    """
    import meshio

    path = Path(path)
    kind = WRITTEN.get(path.suffix.lower())
    if kind is None:
        raise MeshError(
            f"{path} has an unknown format; name a file that ends in {' or '.join(WRITTEN)}"
        )
    names = sorted(mesh.facets)
    facets = [(("triangle", "triangle6")[mesh.order - 1], mesh.facets[name]) for name in names]
    cells = [(("tetra", "tetra10")[mesh.order - 1], mesh.tets), *facets]
    tags, groups = (_vtu_tags if kind == "vtu" else _gmsh_tags)(mesh, names)
    # Empty blocks are left out, but the names of their sets stay.
    keep = [i for i, (_, nodes) in enumerate(cells) if len(nodes)]
    raw = meshio.Mesh(
        mesh.points,
        [cells[i] for i in keep],
        cell_data={name: [values[i] for i in keep] for name, values in tags.items()},
        field_data=groups,
    )
    aside = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
            warnings.simplefilter("ignore")
            meshio.write(aside, raw, file_format=kind)
        os.replace(aside, path)
    finally:
        aside.unlink(missing_ok=True)


def _vtu_tags(mesh: TetMesh, names: list[str]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Cell arrays by block: regions, 1 in each named region, and 1 for the facets of each set."""
    sizes = [len(mesh.facets[name]) for name in names]
    tags = {"region": [mesh.region, *(np.full(n, -1) for n in sizes)]}
    for number, title in mesh.region_names.items():
        own = (mesh.region == number).astype(np.int8)
        tags[NAMED + title] = [own, *(np.zeros(n, np.int8) for n in sizes)]
    for name in names:
        flags = [np.full(n, other == name, np.int8) for n, other in zip(sizes, names, strict=True)]
        tags[FACETS + name] = [np.zeros(len(mesh.tets), np.int8), *flags]
    return tags, {}


def _gmsh_tags(mesh: TetMesh, names: list[str]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Physical groups of each block, from 1 because gmsh has no group 0, and their dimensions."""
    tags = [mesh.region + 1, *(np.full(len(mesh.facets[n]), i + 1) for i, n in enumerate(names))]
    tags = [tag.astype(np.int32) for tag in tags]
    regions = np.unique(mesh.region).tolist()
    titles = {r: f"{REGION}{r} {mesh.region_names.get(r, '')}".strip() for r in regions}
    groups = {title: np.array([r + 1, 3]) for r, title in titles.items()}
    groups |= {name: np.array([i + 1, 2]) for i, name in enumerate(names)}
    return {"gmsh:physical": tags, "gmsh:geometrical": tags}, groups
