"""Mesh files, read and written with meshio.

A mesh is written with its regions and facet sets, and is read as it was. In `.vtu`, the cell array
`region` numbers the tetrahedra, `region:<name>` is 1 for those of a region with a name, and each
facet set is a block of triangles for which the cell array `facets:<name>` is 1. In `.msh` 2.2 they
are physical groups.
"""

from __future__ import annotations

import contextlib
import io
import os
import tempfile
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from meshes import subprocess_call
from meshes.files.cells import (
    facet_sets,
    gmsh_names,
    gmsh_tags,
    joined,
    node_order,
    outward,
    placed,
    regions,
    vtu_tags,
)
from meshes.tetmesh import MeshError, TetMesh

VOLUME_FORMATS = (".vtu", ".msh", ".inp", ".vtk", ".mesh")
WRITTEN = {".vtu": "vtu", ".msh": "gmsh22"}  # version 4.1 of meshio is refused by gmsh itself
VTK_CHILD, MESH_CHILD = (Path(__file__).parent / f"{name}_child.py" for name in ("vtk", "mesh"))
UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 25.4e-3}


def read(path: str | os.PathLike[str], *, unit: str = "m") -> TetMesh:
    """The tetrahedra of a `.vtu`, `.msh`, `.inp`, `.vtk` or `.mesh` (medit) file, with regions and
    facet sets.

    Regions are the cell array `region` or `material`, medit's references, physical groups, or
    element sets in their order from 1. Groups and sets have names, and so has a region whose
    elements have 1 in a cell array `region:<name>`.

    Parameters
    ----------
    unit : of the coordinates in the file: m, cm, mm, um or in.

    Raises
    ------
    MeshError
        If the file cannot be read, holds no tetrahedra, or numbers nodes in an unknown order.
    """
    path = existing(path, VOLUME_FORMATS)
    scale_of(unit)
    with tempfile.TemporaryDirectory(prefix="skinwave-") as folder:
        source, target = path, Path(folder, "mesh.npz")
        try:
            if path.suffix.lower() == ".vtk":  # of whose newer versions meshio knows nothing
                source = Path(folder, "mesh.vtu")
                subprocess_call.read(VTK_CHILD, path, source, folder=folder)
            subprocess_call.read(MESH_CHILD, source, unit, target, folder=folder)
        except subprocess_call.Refused as error:
            raise MeshError(str(error).replace(str(source.resolve()), str(path))) from None
        except MeshError as error:
            raise _unreadable(path, error) from None
        with np.load(target) as found:
            facets = {str(name): found[f"facets{k}"] for k, name in enumerate(found["names"])}
            titles = dict(zip(found["numbers"].tolist(), found["titles"].tolist(), strict=True))
            return TetMesh(
                points=found["points"], tets=found["tets"], region=found["region"], facets=facets,
                region_names=titles,
            )  # fmt: skip


def read_here(path: Path, scale: float) -> TetMesh:
    """Read a mesh in this process: only for `mesh_child.py`, which has limits."""
    raw = _meshio_read(path)
    try:
        return _mesh(path, raw, scale)
    except MeshError:
        raise
    except (ValueError, IndexError, KeyError, TypeError) as error:  # arrays that do not fit
        raise _unreadable(path, error) from None


def _mesh(path: Path, raw: Any, scale: float) -> TetMesh:
    """The mesh of what meshio has read."""
    blocks = {"tetra": 4, "tetra10": 10}
    kinds = [block.type for block in raw.cells]
    found = sorted({kind for kind in kinds if kind in blocks})
    if len(found) != 1:
        held = ", ".join(sorted(set(kinds))) or "no cells"
        raise MeshError(
            f"{path} holds {held}; give a mesh of either 4-node or 10-node tetrahedra only"
        )
    points = np.zeros((len(raw.points), 3))
    points[:, : raw.points.shape[1]] = raw.points
    tets = joined(raw.cells, found[0])
    if tets.min() < 0 or tets.max() >= len(points):
        raise MeshError(f"{path} has cells of points that it does not have; save it again")
    tets = tets[:, node_order(path, points, tets)] if blocks[found[0]] == 10 else tets
    sets = facet_sets(raw, "triangle" if blocks[found[0]] == 4 else "triangle6")
    used, numbers = np.unique(tets, return_inverse=True)
    new = np.full(len(points), -1)
    new[used] = np.arange(len(used))
    region, titles = regions(raw, found[0])
    return TetMesh(
        points=points[used] * scale if scale != 1 else points[used],
        tets=numbers.reshape(tets.shape),
        region=region,
        region_names=titles,
        facets=outward(numbers.reshape(tets.shape), {n: new[nodes] for n, nodes in sets.items()}),
    )


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


def existing(path: str | os.PathLike[str], formats: tuple[str, ...]) -> Path:
    """The path, if there is a file of one of these kinds.

    Raises
    ------
    MeshError
        If there is none.
    """
    path = Path(path)
    if path.suffix.lower() not in formats:
        raise MeshError(f"{path} is of no kind that is read here; give one of {', '.join(formats)}")
    if not path.is_file():
        raise MeshError(f"{path} is no file that is there; check its name")
    return path


def scale_of(unit: str) -> float:
    """Size in metre of a unit, by its name.

    Raises
    ------
    MeshError
        If it is unknown.
    """
    if unit not in UNITS:
        raise MeshError(f"unit '{unit}' is unknown; use one of {', '.join(UNITS)}")
    return UNITS[unit]


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _meshio_read(path: Path) -> Any:
    """Read a file with meshio, which prints, warns, and ends the process on what it cannot read."""
    import meshio

    kind = {".vtu": "vtu", ".msh": "gmsh", ".inp": "abaqus", ".mesh": "medit"}[path.suffix.lower()]
    said = io.StringIO()
    try:
        with (
            warnings.catch_warnings(),
            contextlib.redirect_stdout(said),
            contextlib.redirect_stderr(said),
        ):
            warnings.simplefilter("ignore")
            return meshio.read(path, file_format=kind)
    except (Exception, SystemExit) as error:
        raise _unreadable(path, error, said.getvalue()) from None


def _unreadable(path: Path, error: BaseException, said: str = "") -> MeshError:
    cure = {".msh": "save it as version 2.2 (gmsh -format msh22)", ".vtk": "save it as .vtu"}.get(
        path.suffix.lower(), "save it again from the program that it comes from"
    )
    if isinstance(error, MemoryError):
        error = ValueError("it asks for more memory than a mesh of its size needs")
    reason = " ".join((str(error) if str(error) not in ("", "1") else said).split())
    return MeshError(f"{path} cannot be read ({reason[:200] or type(error).__name__}); {cure}")
