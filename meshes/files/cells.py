"""Cell arrays of mesh files: regions, facet sets, the order of an element's nodes.

`raw` is a mesh as meshio reads it, `kind` one of its cell types.
"""

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from meshes.tetmesh import EDGES, FACES, Floats, Ints, MeshError, TetMesh

FACETS, REGION, NAMED = "facets:", "region ", "region:"
OFF_MIDDLE = 0.25  # of an edge: how far a mid-side node may lie from its middle


def joined(cells: Any, kind: str) -> Ints:
    """Nodes (e, a) of all blocks of a kind."""
    return np.vstack(
        [np.asarray(block.data).astype(np.int64) for block in cells if block.type == kind]
    )


def values(raw: Any, name: str, kind: str) -> np.ndarray:
    """Cell array over all blocks of a kind, in native byte order.

    Parameters
    ----------
    raw : mesh as meshio reads it
    name : of the array
    kind : meshio's cell type

    Returns
    -------
    (e,) int
    """
    found = [
        np.asarray(values) for block, values in zip(raw.cells, raw.cell_data[name], strict=True)
        if block.type == kind
    ]  # fmt: skip
    return np.concatenate(found).astype(np.int64)


def regions(raw: Any, kind: str) -> tuple[Ints, dict[int, str]]:
    """Region (e,) of each element: an array called so, physical groups, or element sets; and the
    names of those that have one.
    """
    for name in ("region", "material", "medit:ref"):
        if name in raw.cell_data:
            region = values(raw, name, kind)
            flags = [title for title in raw.cell_data if title.startswith(NAMED)]
            marked = {title: region[values(raw, title, kind) == 1] for title in flags}
            return region, {
                int(of[0]): t.removeprefix(NAMED) for t, of in marked.items() if len(of)
            }
    if "gmsh:physical" in raw.cell_data:
        return physical_groups(raw, kind)
    return element_sets(raw, kind)


def physical_groups(raw: Any, kind: str) -> tuple[Ints, dict[int, str]]:
    """Physical group (e,) of each element, by the number in its title if it was written here, and
    the names of groups.
    """
    tags, place = np.unique(values(raw, "gmsh:physical", kind), return_inverse=True)
    numbers, names = {}, {}
    for title, (tag, dimension) in raw.field_data.items():
        if dimension == 3:
            ours = re.fullmatch(REGION + r"(\d+)(?: (.+))?", title)
            number = numbers[int(tag)] = int(ours[1]) if ours else int(tag)
            if name := ours[2] if ours else title:
                names[number] = name
    return np.array([numbers.get(tag, tag) for tag in tags.tolist()], np.int64)[place], names


def element_sets(raw: Any, kind: str) -> tuple[Ints, dict[int, str]]:
    """The number, from 1, of the last set that each element is in, or 0; and names of sets."""
    blocks = [i for i, block in enumerate(raw.cells) if block.type == kind]
    regions = [np.zeros(len(raw.cells[i].data), np.int64) for i in blocks]
    members = {
        str(name): [np.asarray(of[i], np.int64) for i in blocks]
        for name, of in raw.cell_sets.items()
    }
    filled = {name: of for name, of in members.items() if sum(map(len, of))}
    for number, of in enumerate(filled.values(), start=1):
        for region, which in zip(regions, of, strict=True):
            region[which] = number
    return np.concatenate(regions), dict(enumerate(filled, start=1))


def facet_sets(raw: Any, kind: str) -> dict[str, Ints]:
    """Facet sets by name, of arrays `facets:<name>` or physical groups."""
    names = {n: n.removeprefix(FACETS) for n in raw.cell_data if n.startswith(FACETS)}
    groups = {title: tag for title, (tag, d) in raw.field_data.items() if d == 2}
    width = 3 if kind == "triangle" else 6
    if kind not in [block.type for block in raw.cells]:
        return {name: np.zeros((0, width), np.int64) for name in (*names.values(), *groups)}
    facets = joined(raw.cells, kind)
    sets = {title: facets[values(raw, name, kind) == 1] for name, title in names.items()}
    if "gmsh:physical" in raw.cell_data:
        tags = values(raw, "gmsh:physical", kind)
        groups |= {f"group {tag}": tag for tag in set(tags.tolist()) - {0, *groups.values()}}
        sets |= {title: facets[tags == tag] for title, tag in groups.items()}
    return sets


def outward(tets: Ints, sets: dict[str, Ints]) -> dict[str, Ints]:
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


def node_order(path: Path, points: Floats, tets: Ints) -> list[int]:
    """Node order of ten-node tetrahedra; mid-side nodes are identified by their positions.

    Parameters
    ----------
    path : file that the message names
    points : (n, 3) float, metre
    tets : (e, 10) int

    Returns
    -------
    column of `tets` for each of the ten nodes

    Raises
    ------
    MeshError
        If nodes are too far from the middles of edges.
    """
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


def vtu_tags(mesh: TetMesh, names: list[str]) -> dict[str, list[np.ndarray]]:
    """Cell arrays of a mesh by block: regions, 1 for the elements of each that has a name, and 1
    for the facets of each set.
    """
    sizes = [len(mesh.facets[name]) for name in names]
    tags = {"region": [mesh.region, *(np.full(n, -1) for n in sizes)]}
    for number, title in mesh.region_names.items():
        own = (mesh.region == number).astype(np.int8)
        tags[NAMED + title] = [own, *(np.zeros(n, np.int8) for n in sizes)]
    for name in names:
        flags = [np.full(n, other == name, np.int8) for n, other in zip(sizes, names, strict=True)]
        tags[FACETS + name] = [np.zeros(len(mesh.tets), np.int8), *flags]
    return tags


def gmsh_tags(mesh: TetMesh, names: list[str]) -> dict[str, list[np.ndarray]]:
    """Physical groups from 1, as gmsh wants them: 0 is no group there."""
    groups = [mesh.region + 1, *(np.full(len(mesh.facets[n]), i + 1) for i, n in enumerate(names))]
    groups = [group.astype(np.int32) for group in groups]
    return {"gmsh:physical": groups, "gmsh:geometrical": groups}


def gmsh_names(mesh: TetMesh, names: list[str]) -> dict[str, np.ndarray]:
    """Number and dimension of each physical group by its name."""
    titles = {r: f"{REGION}{r} {mesh.region_names.get(r, '')}" for r in set(mesh.region.tolist())}
    regions = {title.strip(): np.array([r + 1, 3]) for r, title in sorted(titles.items())}
    return regions | {name: np.array([i + 1, 2]) for i, name in enumerate(names)}


def placed(
    mesh: TetMesh, sizes: list[int], fields: dict[str, ArrayLike]
) -> tuple[dict[str, np.ndarray], dict[str, list[np.ndarray]]]:
    """Fields at points, and those of tetrahedra with nothing at the facets.

    Parameters
    ----------
    mesh : TetMesh
    sizes : facets in each block of them
    fields : (n, ...) or (e, ...) by name

    Returns
    -------
    fields at points (n, ...), and fields by block (e, ...), each by name

    Raises
    ------
    MeshError
        If a name is one that the mesh uses, or a field is neither at points nor at tetrahedra.
    """
    at_points, at_cells = {}, {}
    for name, given in fields.items():
        values = np.asarray(given)
        if name == "region" or name.startswith((FACETS, NAMED, "gmsh:")):
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
