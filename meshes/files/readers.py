"""Readers of mesh files: VTK for its own and surface formats, meshio for those of mesh generators.

They crash on damaged files and print, so `read_contents` calls them in a separate process.
"""

import contextlib
import io
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from meshes.files.abaqus import AGAIN, read_abaqus
from meshes.files.cells import Contents, contents
from meshes.tetmesh import MeshError

BY_MESHIO = {
    ".msh": "gmsh", ".mesh": "medit", ".bdf": "nastran", ".nas": "nastran", ".fem": "nastran",
    ".med": "med", ".ele": "tetgen", ".node": "tetgen", ".off": "off",
}  # fmt: skip
VTK_CELLS = {
    1: "vertex", 3: "line", 5: "triangle", 9: "quad", 10: "tetra", 11: "hexahedron",
    12: "hexahedron", 13: "wedge", 14: "pyramid", 21: "line3", 22: "triangle6", 23: "quad8",
    24: "tetra10", 25: "hexahedron20", 26: "wedge15", 27: "pyramid13",
}  # fmt: skip
SOLID = 3  # dimension
VOXEL, BRICK = 11, [0, 1, 3, 2, 4, 5, 7, 6]  # corners of a voxel in the order of a hexahedron


def read_file(path: Path) -> Contents:
    """Return the contents of a file, or raise a MeshError that says what is wrong with it."""
    try:
        with (
            contextlib.redirect_stdout(io.StringIO()),
            warnings.catch_warnings(record=True) as caught,
        ):
            warnings.simplefilter("always")
            raw = _read(path)
            if any("error while reading" in str(one.message) for one in caught):
                raise MeshError(f"{path} is damaged or cut short; {AGAIN}")
            return contents(path, raw)
    except MeshError:
        raise
    except ImportError as error:  # MED files need h5py
        raise MeshError(
            f"{path} needs {error.name}, which is not installed; pip install "
            '"skinwave[measure]", or save it as .vtu'
        ) from None
    except (Exception, SystemExit) as error:
        why = "is damaged or has unsupported contents"
        if isinstance(error, MemoryError):
            why = "needs more memory than a mesh of its size should"
        cure = "save it as version 2.2 (gmsh -format msh22)" if path.suffix == ".msh" else AGAIN
        raise MeshError(f"{path} cannot be read: it {why}; {cure}") from None


def _read(path: Path) -> Any:
    """Read a file as a meshio.Mesh, whose `info` has `notes` and the `names` of regions."""
    suffix = path.suffix.lower()
    if suffix == ".inp":
        return read_abaqus(path)
    if suffix in BY_MESHIO:
        import meshio

        _check_unread(path, BY_MESHIO[suffix])
        with contextlib.redirect_stderr(io.StringIO()):
            raw = meshio.read(path, file_format=BY_MESHIO[suffix])
        families = getattr(raw, "cell_tags", {})  # of MED
        raw.info = {
            "notes": [],
            "names": {int(n): ", ".join(names) for n, names in families.items()},
        }
        return raw
    return _read_vtk(path)


def _read_vtk(path: Path) -> Any:
    """The cells of all data sets of a VTK file. If several have solid cells, each is a region."""
    import meshio
    import pyvista

    parts = [(name, _grid(part)) for name, part in _leaves(_data(path), "") if part.n_cells]
    solid = list(dict.fromkeys(name for name, grid in parts if _kinds(grid, SOLID)))
    points, first = [np.zeros((0, 3))], 0
    blocks: list[tuple[str, np.ndarray, dict[str, np.ndarray]]] = []
    notes = [f"read {len(parts)} parts"] * (len(parts) > 1)
    for part, grid in parts:
        for kind in _kinds(grid):
            own = grid.celltypes == kind
            if kind not in VTK_CELLS:
                name = pyvista.CellType(kind).name.lower().replace("_", " ")
                if pyvista.CellType(kind).dimension == SOLID:
                    raise MeshError(
                        f"{path} has {own.sum():,} cells of type {name}, which cannot be split "
                        "into tetrahedra; save it as tetrahedra"
                    )
                notes.append(f"left out {own.sum():,} cells of type {name}")
                continue
            arrays = {name: np.asarray(grid.cell_data[name])[own] for name in grid.cell_data}
            if len(solid) > 1 and part in solid:
                arrays.setdefault("region", np.full(own.sum(), solid.index(part) + 1))
            nodes = np.asarray(grid.cells_dict[kind]) + first
            blocks.append((VTK_CELLS[kind], nodes[:, BRICK] if kind == VOXEL else nodes, arrays))
        points.append(np.asarray(grid.points, np.float64))
        first += grid.n_points
    tags = {name for _, _, arrays in blocks for name, array in arrays.items() if array.ndim == 1}
    names = dict(enumerate(solid, start=1)) if len(solid) > 1 else {}
    return meshio.Mesh(
        np.vstack(points),
        [(kind, nodes) for kind, nodes, _ in blocks],
        cell_data={
            tag: [arrays.get(tag, np.zeros(len(nodes), int)) for _, nodes, arrays in blocks]
            for tag in tags
        },
        info={"notes": notes, "names": names},
    )


def _data(path: Path) -> Any:
    """The content of a file as VTK reads it."""
    import pyvista

    if path.suffix.lower() not in (".xdmf", ".xmf"):
        return pyvista.read(path)
    from vtkmodules.vtkIOXdmf2 import vtkXdmfReader

    reader = vtkXdmfReader()  # pyvista's reader requires time steps
    reader.SetFileName(str(path))
    reader.Update()
    return pyvista.wrap(reader.GetOutputDataObject(0))


def _leaves(data: Any, name: str) -> Iterator[tuple[str, Any]]:
    """The data sets in nested blocks, with their names."""
    import pyvista

    if isinstance(data, pyvista.PartitionedDataSet):  # parts of one grid
        for number in range(data.n_partitions):
            yield from _leaves(data[number], name)
        return
    if isinstance(data, pyvista.MultiBlock):
        for number in range(data.n_blocks):
            yield from _leaves(data[number], data.get_block_name(number) or f"part {number + 1}")
    elif data is not None:
        yield name, data


def _grid(part: Any) -> Any:
    """A data set as an unstructured grid, with polygons and strips as triangles."""
    import pyvista

    flat = part.triangulate() if isinstance(part, pyvista.PolyData) else part
    return flat.cast_to_unstructured_grid()


def _kinds(grid: Any, dimension: int | None = None) -> list[int]:
    """VTK's numbers of the cell types of a grid, all or those of one dimension."""
    import pyvista

    kinds = [int(kind) for kind in np.unique(grid.celltypes)]
    return [k for k in kinds if dimension in (None, pyvista.CellType(k).dimension)]


def _check_unread(path: Path, kind: str) -> None:
    """Refuse what meshio ignores: coordinate systems of Nastran, partitions of gmsh."""
    content = path.read_bytes()
    if kind == "gmsh" and b"$EndElements" not in content:
        raise MeshError(
            f"{path} is cut short or not a gmsh mesh, because it has no $EndElements; {AGAIN}"
        )
    if kind == "gmsh" and b"$PartitionedEntities" in content:
        raise MeshError(f"{path} is partitioned; save it without partitions, or as version 2.2")
    if kind != "nastran":
        return
    for line in content.decode(errors="replace").splitlines():
        name, width = line[:8].partition(",")[0].strip().upper(), 16 if "*" in line[:8] else 8
        if name.rstrip("*") == "GRID":
            words = line.split(",")
            system = words[2] if len(words) > 2 else line[8 + width : 8 + 2 * width]
            if system.strip() not in ("", "0"):
                raise MeshError(
                    f"{path} gives nodes in coordinate system {system.strip()}; save it with all "
                    "nodes in the basic system"
                )
