"""What a mesh or surface file holds: the one door for all formats.

`read_contents` reads a file in a process of its own, because readers crash on damaged files, print,
and take whatever time and memory a file asks for.
"""

import os
from pathlib import Path

from meshes import subprocess_call
from meshes.files.cells import Contents
from meshes.files.readers import BY_MESHIO, read_file
from meshes.tetmesh import MeshError, TetMesh

BY_VTK = (
    ".vtu", ".pvtu", ".vtk", ".vtm", ".vtkhdf", ".xdmf", ".xmf", ".exo", ".e", ".vtp", ".stl",
    ".ply", ".obj", ".glb", ".gltf",
)  # fmt: skip
FORMATS = (*BY_VTK, *BY_MESHIO, ".inp")
UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 25.4e-3}


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
