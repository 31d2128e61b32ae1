"""Mesh and surface files: what they hold, and meshes written with meshio.

Files are read in a process of their own, because readers crash on damaged files, print, and take
whatever time and memory a file asks for. A mesh is written with its regions and facet sets, and
`read` gives it as it was. In `.vtu`, the cell array `region` numbers the tetrahedra,
`region:<name>` is 1 for those of a region with a name, and each facet set is a block of triangles
for which the cell array `facets:<name>` is 1. In `.msh` 2.2 they are physical groups.
"""

import contextlib
import io
import os
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from meshes import subprocess_call
from meshes.files.cells import FACETS, NAMED, REGION, Contents
from meshes.files.readers import BY_MESHIO, read_file
from meshes.tetmesh import MeshError, TetMesh

BY_VTK = (
    ".vtu", ".pvtu", ".vtk", ".vtm", ".vtkhdf", ".xdmf", ".xmf", ".exo", ".e", ".vtp", ".stl",
    ".ply", ".obj", ".glb", ".gltf",
)  # fmt: skip
FORMATS = (*BY_VTK, *BY_MESHIO, ".inp")
UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 25.4e-3}
WRITTEN = {".vtu": "vtu", ".msh": "gmsh22"}  # version 4.1 of meshio is refused by gmsh itself


def read_contents(path: str | os.PathLike[str]) -> Contents:
    """Everything in a file that a body can be made of, by its suffix.

    Raises a MeshError if the file does not exist, is of an unknown kind or damaged, or holds
    neither triangles nor solid elements that can be split into tetrahedra.
    """
    path = Path(path)
    if path.suffix.lower() not in FORMATS:
        raise MeshError(f"{path} is of no kind that is read here; give one of {', '.join(FORMATS)}")
    if not path.is_file():
        raise MeshError(f"{path} is no file that is there; check its name")
    try:
        return subprocess_call.call_reader(read_file, path)
    except subprocess_call.Crashed:
        raise MeshError(f"{path} is damaged or cut short; save it again") from None
    except MeshError as error:
        raise MeshError(str(error).replace(str(path.resolve()), str(path))) from None


def scale_of(unit: str) -> float:
    """Size in metre of a unit, by its name; a MeshError if it is unknown."""
    if unit not in UNITS:
        raise MeshError(f"unit '{unit}' is unknown; use one of {', '.join(UNITS)}")
    return UNITS[unit]


def read(path: str | os.PathLike[str], *, unit: str = "m") -> TetMesh:
    """The tetrahedra of a mesh file, with regions and facet sets.

    Regions are the cell array `region` or `material`, medit's references, physical groups, the
    element sets of Abaqus's sections, or blocks. Hexahedra, prisms and pyramids are split into
    tetrahedra, coinciding nodes are merged, and elements that are listed twice are taken once.

    Parameters
    ----------
    path : file of one of `FORMATS`
    unit : of the coordinates in the file: m, cm, mm, um or in

    Returns
    -------
    TetMesh

    Raises a MeshError if the file cannot be read, holds no solid elements, or numbers nodes in an
    unknown order.
    """
    scale, found = scale_of(unit), read_contents(path)
    if not len(found.tets):
        raise MeshError(
            f"{path} is a surface without solid elements; fill it: skinwave mesh, or "
            "`meshes.body_from_file`"
        )
    return mesh_of(found, scale)


def mesh_of(found: Contents, scale: float) -> TetMesh:
    """The mesh in a file, metre, with `scale` the size of its unit."""
    return TetMesh(
        points=found.points * scale if scale != 1 else found.points, tets=found.tets,
        region=found.region, region_names=found.names, facets=found.facets,
    )  # fmt: skip


def write(path: str | os.PathLike[str], mesh: TetMesh) -> None:
    """Write a mesh with its regions and facet sets to `.vtu`, or `.msh` 2.2 for gmsh, aside and
    renamed; a MeshError if the kind of file is unknown.
    """
    import meshio

    path = Path(path)
    kind = WRITTEN.get(path.suffix.lower())
    if kind is None:
        raise MeshError(
            f"{path} cannot be written; name a file that ends in {' or '.join(WRITTEN)}"
        )
    names = sorted(mesh.facets)
    facets = [(("triangle", "triangle6")[mesh.order - 1], mesh.facets[name]) for name in names]
    cells = [(("tetra", "tetra10")[mesh.order - 1], mesh.tets), *facets]
    tags, groups = (_vtu_tags if kind == "vtu" else _gmsh_tags)(mesh, names)
    # Blocks without cells are left out; what names them is not.
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
    """Cell arrays by block: regions, 1 for the elements of each region with a name, and 1 for the
    facets of each set; no groups.
    """
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
    """Physical groups of each block, from 1 as 0 is no group in gmsh, and the number and dimension
    of each group by its name.
    """
    tags = [mesh.region + 1, *(np.full(len(mesh.facets[n]), i + 1) for i, n in enumerate(names))]
    tags = [tag.astype(np.int32) for tag in tags]
    regions = np.unique(mesh.region).tolist()
    titles = {r: f"{REGION}{r} {mesh.region_names.get(r, '')}".strip() for r in regions}
    groups = {title: np.array([r + 1, 3]) for r, title in titles.items()}
    groups |= {name: np.array([i + 1, 2]) for i, name in enumerate(names)}
    return {"gmsh:physical": tags, "gmsh:geometrical": tags}, groups
