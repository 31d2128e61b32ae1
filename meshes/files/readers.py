"""Readers of mesh files: VTK for its own and surface formats, meshio for those of mesh generators.

They crash on damaged files and print, so `read_contents` calls them in a separate process.
"""

import contextlib
import io
import re
import tempfile
import warnings
from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from meshes.files.abaqus import SAVE_AGAIN, full_text, include, read_abaqus
from meshes.files.cells import Contents, contents
from meshes.files.nastran import read_nastran
from meshes.tetmesh import MeshError
from meshes.typing import Floats

BY_MESHIO = {".msh": "gmsh", ".mesh": "medit", ".med": "med", ".off": "off"}
SAVE_OTHERWISE = "save it as .vtu (ParaView, meshio convert) or .msh (gmsh)"


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
                raise MeshError(f"{path} is damaged or cut short; {SAVE_AGAIN}")
            return contents(path, raw)
    except MeshError:
        raise
    except ImportError as error:  # MED files need h5py
        raise MeshError(
            f"{path} needs {error.name}, which is not installed; pip install "
            '"skinwave[measure]", or save it as .vtu'
        ) from None
    except (Exception, SystemExit) as error:
        if "parametric" in str(error):
            raise MeshError(
                f"{path} has parametric nodes; save it without (Mesh.SaveParametric = 0 in gmsh)"
            ) from None
        why = "is cut short, or of a variant that is not read"
        if isinstance(error, MemoryError):
            why = "needs more memory than a mesh of its size should"
        cure = (
            "save it as version 2.2 (gmsh -format msh22)"
            if path.suffix == ".msh"
            else SAVE_OTHERWISE
        )
        raise MeshError(f"{path} cannot be read: it {why}; {cure}") from None


def _read(path: Path) -> Any:
    """Read a file as a meshio.Mesh, whose `info` has `notes` and the `names` of regions."""
    suffix = path.suffix.lower()
    if own := OWN.get(suffix):
        return own(path)
    if suffix not in BY_MESHIO:
        return _read_vtk(path)
    import meshio

    if suffix == ".msh":
        _check_gmsh(path)
    with contextlib.redirect_stderr(io.StringIO()):
        raw = getattr(meshio, BY_MESHIO[suffix]).read(str(path))
    families = getattr(raw, "cell_tags", {})  # of MED
    raw.info = {"notes": [], "names": {n: ", ".join(names) for n, names in families.items()}}
    return raw


def _check_gmsh(path: Path) -> None:
    """Refuse what meshio ignores."""
    content = path.read_bytes()
    if b"$EndElements" not in content:
        raise MeshError(
            f"{path} is cut short or not a gmsh mesh, because it has no $EndElements; {SAVE_AGAIN}"
        )
    if b"$PartitionedEntities" in content:
        raise MeshError(f"{path} is partitioned; save it without partitions, or as version 2.2")
    if b"$ParametricNodes" in content:
        raise ValueError("parametric nodes")


def _read_tetgen(path: Path) -> Any:
    """Nodes and tetrahedra of 4 or 10 nodes; the last attribute of a tetrahedron is its region."""
    import meshio

    (_, nodes), (most, cells) = _numbers(path, ".node", 4), _numbers(path, ".ele", 3)
    tets = cells[:, 1 : 1 + most].astype(int) - int(nodes[0, 0])
    return meshio.Mesh(
        nodes[:, 1:4], [("tetra" if most == 4 else f"tetra{most}", tets)],
        cell_data={"region": [cells[:, -1].astype(int)]} if cells.shape[1] > 1 + most else {},
        info={"notes": [], "names": {}},
    )  # fmt: skip


def _numbers(path: Path, end: str, head: int) -> tuple[int, Floats]:
    """The second of `head` numbers in the first line of one of TetGen's files, and its rows."""
    words = re.sub(r"#.*", "", full_text(include(path, path.with_suffix(end).name))).split()
    return int(words[1]), np.array(words[head:], np.float64).reshape(int(words[0]), -1)


def _read_vtk(path: Path) -> Any:
    """The cells of all data sets of a VTK file. If several have solid cells, each is a region."""
    import meshio
    import pyvista

    is_xdmf = path.suffix.lower() in (".xdmf", ".xmf")
    data, shared = _read_xdmf(path) if is_xdmf else (pyvista.read(path), dict[str, bool]())
    parts = [(name, _grid(path, part)) for name, part in _leaves(data, "") if part.n_points]
    kinds = {
        k: pyvista.CellType(k) for _, grid in parts for k in np.unique(grid.celltypes).tolist()
    }
    solid_dimension = 3  # dimension
    solids = [k for k, kind in kinds.items() if kind.dimension == solid_dimension]
    names = dict.fromkeys(name for name, grid in parts if np.isin(grid.celltypes, solids).any())
    tagged = [grid.n_cells for name, grid in parts if name in shared and name in names]
    solid = [name for name in names if name not in shared]
    notes, first = [f"read {len(parts)} parts"] * (len(parts) > 1), 0
    blocks: list[tuple[str, np.ndarray, dict[str, np.ndarray]]] = []
    vtk_cells = {
        1: "vertex", 3: "line", 5: "triangle", 9: "quad", 10: "tetra", 11: "hexahedron",
        12: "hexahedron", 13: "wedge", 14: "pyramid", 21: "line3", 22: "triangle6", 23: "quad8",
        24: "tetra10",
    }  # fmt: skip
    voxel, brick = 11, [0, 1, 3, 2, 4, 5, 7, 6]  # corners of a voxel in the order of a hexahedron
    for part, grid in parts:
        has_tags = part not in shared and grid.n_cells in tagged  # in another grid
        for kind in [] if has_tags else np.unique(grid.celltypes).tolist():
            own, name = grid.celltypes == kind, kinds[kind].name.lower().replace("_", " ")
            if kind not in vtk_cells and kind not in solids:
                notes.append(f"left out {own.sum():,} cells of type {name}")
                continue
            arrays = {name: np.asarray(grid.cell_data[name])[own] for name in grid.cell_data}
            if shared.get(part) and arrays:
                arrays = {"region": next(iter(arrays.values()))}
            elif len(solid) > 1 and part in solid:
                arrays.setdefault("region", np.full(own.sum(), solid.index(part) + 1))
            nodes = np.asarray(grid.cells_dict[kind]) + first
            nodes = nodes[:, brick] if kind == voxel else nodes
            blocks.append((vtk_cells.get(kind, name), nodes, arrays))
        first += grid.n_points
    flat = (name for _, _, arrays in blocks for name, x in arrays.items() if x.dtype.kind in "biuf")
    return meshio.Mesh(
        np.vstack([np.zeros((0, 3)), *(np.asarray(grid.points, np.float64) for _, grid in parts)]),
        [(kind, nodes) for kind, nodes, _ in blocks],
        cell_data={
            tag: [arrays.get(tag, np.zeros(len(nodes), int)) for _, nodes, arrays in blocks]
            for tag in dict.fromkeys(flat)
        },
        info={"notes": notes, "names": {n: name for n, name in enumerate(solid, 1) if solid[1:]}},
    )  # fmt: skip


def _read_xdmf(path: Path) -> tuple[Any, dict[str, bool]]:
    """The content of a file, and the grids that have the points of another one, by name: whether
    they have their own cells, as tags do. VTK's reader crashes on included elements.
    """
    import pyvista
    from vtkmodules.vtkIOXdmf2 import vtkXdmfReader

    root, shared = ElementTree.fromstring(path.read_bytes()), dict[str, bool]()
    own = [grid for grid in root.iter("Grid") if grid.find("Geometry") is not None]
    for outer in root.iter("Grid"):
        for step, grid in enumerate((outer, *outer.findall("Grid"))):  # of a collection, or none
            for link in [part for part in grid if part.tag.endswith("}include")]:
                target = link.get("xpointer", "")
                title = re.search(r"@Name=[\"'](.+?)[\"']", target)
                named = (g for g in own if title and g.get("Name") == title[1])
                parts = [part for part in next(named, own[0]) if part.tag in target]
                grid.extend(map(deepcopy, parts))
                grid.remove(link)
                if step < 2:  # VTK reads the first of a collection
                    names = (each.get("Name", "") for each in (outer, grid))
                    shared |= dict.fromkeys(names, len(parts) == 1)
    xdmf_kinds = {"Tetrahedron_10": "Tet_10", "Triangle_6": "Tri_6"}  # of dolfinx, and of VTK
    for cells in root.iter("Topology"):
        kind = cells.get("TopologyType", "")
        cells.set("TopologyType", xdmf_kinds.get(kind, kind))
    for item in root.iter("DataItem"):
        if item.get("Format", "XML").upper() != "XML":  # but HDF or Binary, in another file
            name, colon, inside = (item.text or "").strip().partition(":/")
            item.text = f"{include(path.absolute(), name)}{colon}{inside}"
    with tempfile.TemporaryDirectory() as folder:
        reader = vtkXdmfReader()  # pyvista's reader requires time steps
        reader.SetFileName(str(Path(folder, path.name)))
        Path(folder, path.name).write_bytes(ElementTree.tostring(root))
        reader.Update()
        return pyvista.wrap(reader.GetOutputDataObject(0)), shared


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


def _grid(path: Path, part: Any) -> Any:
    """A data set as an unstructured grid: polygons and strips as triangles, Lagrange cells as those
    of their number of nodes, and of an image the voxels whose label is not 0.
    """
    import pyvista

    if isinstance(part, pyvista.ImageData):
        return _labelled(path, part)
    flat = part.triangulate() if isinstance(part, pyvista.PolyData) else part
    grid = flat.cast_to_unstructured_grid()
    lagrange = {69: {3: 5, 6: 22}, 71: {4: 10, 10: 24}}  # triangles and tetrahedra by nodes
    for kind, by_nodes in lagrange.items():
        own, nodes = grid.celltypes == kind, np.diff(grid.offset)
        for count in np.unique(nodes[own]).tolist():
            grid.celltypes[own & (nodes == count)] = by_nodes.get(count, kind)
    return grid


def _labelled(path: Path, image: Any) -> Any:
    """The voxels of a label image whose label is not 0."""
    cells = image if len(image.cell_data) else image.points_to_cells()
    for name in cells.cell_data:
        labels = cells.cell_data[name]
        if labels.dtype.kind in "iu" and not labels.all():
            return cells.threshold(1, scalars=name)
    raise MeshError(
        f"{path} is an image of {image.n_cells:,} voxels, not a body; segment it, and save a "
        "surface, or a label image: whole numbers, 0 outside the body"
    )


OWN = {
    ".inp": read_abaqus, ".bdf": read_nastran, ".nas": read_nastran, ".fem": read_nastran,
    ".ele": _read_tetgen, ".node": _read_tetgen,
}  # fmt: skip
