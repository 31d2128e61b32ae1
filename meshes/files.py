"""Meshes in files: the only place that knows meshio.

A mesh is written with its regions and facet sets, and is read as it was. In `.vtu`, the cell array
`region` numbers the tetrahedra, and each facet set is a block of triangles for which the cell array
`facets:<name>` is 1. In `.msh` 2.2 they are physical groups.
"""

import contextlib
import io
import os
import re
import tempfile
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from meshes import child
from meshes.tetmesh import EDGES, FACES, Floats, Ints, MeshError, TetMesh

VOLUME_FORMATS = (".vtu", ".msh", ".inp", ".vtk")
WRITTEN = {".vtu": "vtu", ".msh": "gmsh22"}  # version 4.1 of meshio is refused by gmsh itself
UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 25.4e-3}
FACETS, REGION = "facets:", "region "
LONGEST_READ = 300.0  # s that VTK may take for a file
OFF_MIDDLE = 0.25  # of an edge: how far a mid-side node may lie from its middle


def read(path: str | os.PathLike[str], *, unit: str = "m") -> TetMesh:
    """The tetrahedra of a `.vtu`, `.msh`, `.inp` or `.vtk` file, with regions and facet sets.

    Regions are the cell array `region`, physical groups, or element sets in their order from 1.

    Parameters
    ----------
    unit : of the coordinates in the file: m, cm, mm, um or in.

    Raises
    ------
    MeshError
        If the file cannot be read, holds no tetrahedra, or numbers nodes in an unknown order.
    """
    path = existing(path, VOLUME_FORMATS)
    scale = scale_of(unit)
    raw = _by_vtk(path) if path.suffix.lower() == ".vtk" else _meshio_read(path)
    try:
        return _mesh(path, raw, scale)
    except MeshError:
        raise
    except (ValueError, IndexError, KeyError, TypeError) as error:  # arrays that do not fit
        raise _unreadable(path, error) from None


def _mesh(path: Path, raw: Any, scale: float) -> TetMesh:
    """The mesh in what meshio has read."""
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
    tets = _joined(raw.cells, found[0])
    if tets.min() < 0 or tets.max() >= len(points):
        raise MeshError(f"{path} has cells of points that it does not have; save it again")
    tets = tets[:, _node_order(path, points, tets)] if blocks[found[0]] == 10 else tets
    sets = _facet_sets(raw, "triangle" if blocks[found[0]] == 4 else "triangle6")
    used, numbers = np.unique(tets, return_inverse=True)
    new = np.full(len(points), -1)
    new[used] = np.arange(len(used))
    return TetMesh(
        points=points[used] * scale if scale != 1 else points[used],
        tets=numbers.reshape(tets.shape),
        region=_regions(raw, found[0]),
        facets=_outward(numbers.reshape(tets.shape), {n: new[nodes] for n, nodes in sets.items()}),
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
    tags = _vtu_tags(mesh, names) if kind == "vtu" else _gmsh_tags(mesh, names)
    at_points, at_cells = _fields(mesh, [len(nodes) for _, nodes in facets], fields)
    # Blocks without cells are left out; what names them is not.
    keep = [i for i, (_, nodes) in enumerate(cells) if len(nodes)]
    raw = meshio.Mesh(
        mesh.points,
        [cells[i] for i in keep],
        point_data=at_points,
        cell_data={n: [v[i] for i in keep] for n, v in (tags | at_cells).items()},
        field_data={} if kind == "vtu" else _gmsh_names(mesh, names),
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
    """Metre of a unit's name.

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
    """What meshio makes of a file; it prints, warns, and ends the process on what it cannot."""
    import meshio

    kind = {".vtu": "vtu", ".msh": "gmsh", ".inp": "abaqus"}[path.suffix.lower()]
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


def _by_vtk(path: Path) -> Any:
    """A legacy VTK file, of whose newer versions meshio knows nothing, by way of a `.vtu`."""
    with tempfile.TemporaryDirectory(prefix="skinwave-") as folder:
        target = Path(folder, "mesh.vtu")
        try:
            child.run("vtk_child.py", path.resolve(), target, folder=folder, timeout=LONGEST_READ)
        except MeshError as error:
            raise _unreadable(path, error) from None
        return _meshio_read(target)


def _unreadable(path: Path, error: BaseException, said: str = "") -> MeshError:
    cure = {".msh": "save it as version 2.2 (gmsh -format msh22)", ".vtk": "save it as .vtu"}.get(
        path.suffix.lower(), "save it again from the program that it comes from"
    )
    reason = " ".join((str(error) if str(error) not in ("", "1") else said).split())
    return MeshError(f"{path} cannot be read ({reason[:200] or type(error).__name__}); {cure}")


def _joined(cells: Any, kind: str) -> Ints:
    return np.vstack(
        [np.asarray(block.data).astype(np.int64) for block in cells if block.type == kind]
    )


def _values(raw: Any, name: str, kind: str) -> np.ndarray:
    """A cell array over all blocks of a kind, in native byte order."""
    found = [
        np.asarray(values) for block, values in zip(raw.cells, raw.cell_data[name], strict=True)
        if block.type == kind
    ]  # fmt: skip
    return np.concatenate(found).astype(np.int64)


def _regions(raw: Any, kind: str) -> Ints:
    for name in ("region", "material"):
        if name in raw.cell_data:
            return _values(raw, name, kind)
    if "gmsh:physical" in raw.cell_data:
        tags, place = np.unique(_values(raw, "gmsh:physical", kind), return_inverse=True)
        ours = {
            int(tag): int(title.removeprefix(REGION))
            for title, (tag, dimension) in raw.field_data.items()
            if dimension == 3 and re.fullmatch(REGION + r"\d+", title)
        }
        return np.array([ours.get(tag, tag) for tag in tags.tolist()], np.int64)[place]
    return _element_sets(raw, kind)


def _element_sets(raw: Any, kind: str) -> Ints:
    """The number, from 1, of the last set that has each element; 0 if none has."""
    blocks = [i for i, block in enumerate(raw.cells) if block.type == kind]
    regions = [np.zeros(len(raw.cells[i].data), np.int64) for i in blocks]
    members = [[np.asarray(of[i], np.int64) for i in blocks] for of in raw.cell_sets.values()]
    filled = [of for of in members if sum(map(len, of))]
    for number, of in enumerate(filled, start=1):
        for region, which in zip(regions, of, strict=True):
            region[which] = number
    return np.concatenate(regions)


def _facet_sets(raw: Any, kind: str) -> dict[str, Ints]:
    names = {n: n.removeprefix(FACETS) for n in raw.cell_data if n.startswith(FACETS)}
    groups = {title: tag for title, (tag, d) in raw.field_data.items() if d == 2}
    width = 3 if kind == "triangle" else 6
    if kind not in [block.type for block in raw.cells]:
        return {name: np.zeros((0, width), np.int64) for name in (*names.values(), *groups)}
    facets = _joined(raw.cells, kind)
    sets = {title: facets[_values(raw, name, kind) == 1] for name, title in names.items()}
    if "gmsh:physical" in raw.cell_data:
        tags = _values(raw, "gmsh:physical", kind)
        groups |= {f"group {tag}": tag for tag in set(tags.tolist()) - {0, *groups.values()}}
        sets |= {title: facets[tags == tag] for title, tag in groups.items()}
    return sets


def _outward(tets: Ints, sets: dict[str, Ints]) -> dict[str, Ints]:
    """Facets seen from outside: one that a tetrahedron has the other way round is exchanged."""
    if not any(len(nodes) for nodes in sets.values()):
        return sets
    width = 3 if tets.shape[1] == 4 else 6
    faces = tets[:, FACES[:, :width]].reshape(-1, width)
    _, place, count = np.unique(
        np.sort(faces[:, :3], axis=1), axis=0, return_index=True, return_counts=True
    )
    outer = faces[place[count == 1]]
    known = {tuple(sorted(facet[:3])): facet for facet in outer.tolist()}

    def seen(facet: list[int]) -> list[int]:
        own = known.get(tuple(sorted(facet[:3])), facet)
        turns = (own[:3], own[1:3] + own[:1], own[2:3] + own[:2])
        return facet if facet[:3] in turns else own

    return {
        name: np.array([seen(f) for f in nodes.tolist()], np.int64).reshape(-1, width)
        for name, nodes in sets.items()
    }


def _node_order(path: Path, points: Floats, tets: Ints) -> list[int]:
    """Which column of each element is which node: mid-side nodes are told by where they are."""
    nodes = points[tets]
    middles = nodes[:, EDGES].mean(axis=2)
    length = np.linalg.norm(nodes[:, EDGES[:, 1]] - nodes[:, EDGES[:, 0]], axis=2)
    away = np.linalg.norm(nodes[:, 4:, None] - middles[:, None], axis=3)
    away /= np.maximum(length[:, None], 1e-300)
    own = np.einsum("ejj->ej", away).max(axis=1)
    if (own <= OFF_MIDDLE).all():
        return list(range(10))
    column = np.median(away, axis=0).argmin(axis=0)  # which node lies on each edge
    off = away[:, column, range(6)].max(axis=1) > OFF_MIDDLE
    if sorted(column) == list(range(6)) and not off.any():
        return [*range(4), *(4 + column).tolist()]
    count = int(min(off.sum(), (own > OFF_MIDDLE).sum()))
    raise MeshError(
        f"{path} has {count:,} of {len(tets):,} tetrahedra with a node further than "
        f"{OFF_MIDDLE:.0%} of an edge from its middle; save it with straight edges, or in VTK's "
        "order of nodes"
    )


def _vtu_tags(mesh: TetMesh, names: list[str]) -> dict[str, list[np.ndarray]]:
    sizes = [len(mesh.facets[name]) for name in names]
    tags = {"region": [mesh.region, *(np.full(n, -1) for n in sizes)]}
    for name in names:
        flags = [np.full(n, other == name, np.int8) for n, other in zip(sizes, names, strict=True)]
        tags[FACETS + name] = [np.zeros(len(mesh.tets), np.int8), *flags]
    return tags


def _gmsh_tags(mesh: TetMesh, names: list[str]) -> dict[str, list[np.ndarray]]:
    """Physical groups from 1, as gmsh wants them: 0 is no group there."""
    groups = [mesh.region + 1, *(np.full(len(mesh.facets[n]), i + 1) for i, n in enumerate(names))]
    groups = [group.astype(np.int32) for group in groups]
    return {"gmsh:physical": groups, "gmsh:geometrical": groups}


def _gmsh_names(mesh: TetMesh, names: list[str]) -> dict[str, np.ndarray]:
    regions = {f"{REGION}{r}": np.array([r + 1, 3]) for r in np.unique(mesh.region).tolist()}
    return regions | {name: np.array([i + 1, 2]) for i, name in enumerate(names)}


def _fields(
    mesh: TetMesh, sizes: list[int], fields: dict[str, ArrayLike]
) -> tuple[dict[str, np.ndarray], dict[str, list[np.ndarray]]]:
    """Fields at points, and those of tetrahedra with nothing at the facets."""
    at_points, at_cells = {}, {}
    for name, given in fields.items():
        values = np.asarray(given)
        if name == "region" or name.startswith((FACETS, "gmsh:")):
            raise MeshError(f"a field cannot be called '{name}', which the mesh uses; rename it")
        if values.ndim and len(values) == len(mesh.points):
            at_points[name] = values
        elif values.ndim and len(values) == len(mesh.tets):
            none = np.nan if values.dtype.kind == "f" else 0
            empty = [np.full((n, *values.shape[1:]), none, values.dtype) for n in sizes]
            at_cells[name] = [values, *empty]
        else:
            raise MeshError(
                f"field '{name}' has shape {values.shape}; give one value for each of "
                f"{len(mesh.points)} points or {len(mesh.tets)} tetrahedra"
            )
    return at_points, at_cells
