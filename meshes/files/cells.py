"""Cells of mesh files: tetrahedra, regions, facet sets and the node order of elements.

`raw` is a mesh as meshio represents it, `kind` one of its cell types.
"""

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from meshes.surface.repair import first_coincident
from meshes.tetmesh import EDGES, FACES, MeshError, corner_volumes, facet_keys
from meshes.typing import Floats, Ints

FACETS, REGION, NAMED = "facets:", "region ", "region:"

# Corners of the faces of the solid elements that are split into tetrahedra.
SPLIT = {
    "hexahedron": [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6],
                   [3, 0, 4, 7]],
    "wedge": [[0, 2, 1], [3, 4, 5], [0, 1, 4, 3], [1, 2, 5, 4], [2, 0, 3, 5]],
    "pyramid": [[0, 3, 2, 1], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]],
}  # fmt: skip
SOLID = ("tetra", "tetra10", *SPLIT)
GMSH_GROUPS = "gmsh:physical"  # cell array of meshio
PLANE = {"triangle": 3, "triangle6": 3, "quad": 4, "quad8": 4, "quad9": 4}  # corners


Arrays = dict[str, dict[str, np.ndarray]]  # by name and kind of cell


@dataclass(frozen=True, kw_only=True, eq=False)
class Contents:
    """Tetrahedra in a file, or triangles if it has no solid elements.

    Parameters
    ----------
    points : (n, 3) float, in the unit of the file
    tets : (m, 4) or (m, 10) int, m = 0 for a surface
    triangles : (k, 3) int of a surface; empty for a mesh, whose facets are in its sets
    region : (m,) int; `names` has the names of regions that have one
    facets : name -> (j, 3) or (j, 6) int
    notes : a sentence on everything that was left out, merged or split
    """

    points: Floats
    tets: Ints = field(default_factory=lambda: np.zeros((0, 4), int))
    triangles: Ints = field(default_factory=lambda: np.zeros((0, 3), int))
    region: Ints = field(default_factory=lambda: np.zeros(0, int))
    names: dict[int, str] = field(default_factory=dict)
    facets: dict[str, Ints] = field(default_factory=dict)
    notes: list[str]


def contents(path: Path, raw: Any) -> Contents:
    """Return the contents of a mesh that meshio read; its `info` has `notes` and region `names`."""
    cells = {kind: nodes.astype(np.int64) for kind, nodes in raw.cells_dict.items() if len(nodes)}
    for nodes in cells.values():
        if nodes.min() < 0 or nodes.max() >= len(raw.points):
            raise MeshError(f"{path} has cells that refer to missing points; save it again")
    solid = [kind for kind in SOLID if kind in cells]
    smaller = ("vertex", "line", "line3")
    unknown = [kind for kind in cells if kind not in (*SOLID, *PLANE, *smaller)]
    if unknown or ("tetra10" in solid and len(solid) > 1):
        listed = ", ".join(f"{len(cells[kind]):,} of type {kind}" for kind in unknown or solid)
        raise MeshError(
            f"{path} has unsupported cells ({listed}); save only 4- or 10-node tetrahedra"
        )
    if not solid and cells.keys().isdisjoint(PLANE):
        what = "no triangles and no solid elements; give a file with a body"
        if len(raw.points) and cells.keys() <= {"vertex"}:
            what = (
                f"{len(raw.points):,} points without triangles; make a closed surface of them, as "
                "by screened Poisson reconstruction in MeshLab"
            )
        raise MeshError(f"{path} has {what}")
    left_out = {kind: len(cells[kind]) for kind in smaller if kind in cells}
    notes = [f"left out {count:,} cells of type {kind}" for kind, count in left_out.items()]
    notes = [*raw.info["notes"], *notes]
    points = np.zeros((len(raw.points), 3))
    points[:, : raw.points.shape[1]] = raw.points
    if solid:
        return _tetrahedra(path, raw, cells, points, notes)
    fans = [_triangles_of(cells[kind], PLANE[kind])[0] for kind in PLANE if kind in cells]
    return Contents(points=points, triangles=np.vstack(fans), notes=notes)


def _tetrahedra(
    path: Path, raw: Any, cells: dict[str, Ints], points: Floats, notes: list[str]
) -> Contents:
    """Tetrahedra and used nodes, each once, with their regions and facet sets."""
    solid = [kind for kind in SOLID if kind in cells]
    used = np.unique(
        np.concatenate([cells[kind].ravel() for kind in (*solid, *PLANE) if kind in cells])
    )
    if bad := int((~np.isfinite(points[used])).any(axis=1).sum()):
        raise MeshError(f"{path} has {bad:,} nodes whose coordinates are not finite; correct them")
    merged = np.arange(len(points))
    merged[used] = used[first_coincident(points[used])]
    used = np.unique(np.concatenate([cells[kind].ravel() for kind in solid]))
    if count := len(used) - len(np.unique(merged[used])):
        notes.append(f"merged {count:,} nodes that coincide with others, as where bodies touch")
    names = {abs(number): name for number, name in raw.info["names"].items()}
    tag = _region_array(raw.cell_data_dict, solid, notes)
    parts: list[tuple[Ints, Ints]] = []
    for kind in solid:
        nodes, (own, titles) = merged[cells[kind]], _regions(raw, kind, tag)
        names |= titles
        if kind == "tetra10":
            nodes = nodes[:, _node_order(path, points, nodes)]
        if kind in SPLIT:
            count = len(nodes)
            nodes, cell = _split(path, points, nodes, kind)
            notes.append(f"split {count:,} cells of type {kind} into {len(nodes):,} tetrahedra")
            own = own[cell]
        parts.append((nodes, own))
    tets, region = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    proper = (np.diff(np.sort(tets[:, :4], axis=1), axis=1) > 0).all(axis=1)
    if not proper.all():
        notes.append(f"left out {(~proper).sum():,} tetrahedra with a repeated node")
    tets, region = tets[proper], region[proper]
    once = _first_of_duplicates(tets, region)
    if len(once) < len(tets):
        several = len(np.unique(region)) > 1
        notes.append(
            f"left out {len(tets) - len(once):,} duplicate tetrahedra"
            + ("; their region is the smaller of their groups" if several else "")
        )
        tets, region = tets[once], region[once]
    used, numbers = np.unique(tets, return_inverse=True)
    new = np.full(len(points), -1)
    new[used] = np.arange(len(used))
    tets = numbers.reshape(tets.shape)
    if inverted := int((corner_volumes(points[used], tets) < 0).sum()):
        notes.append(f"reordered {inverted:,} inverted tetrahedra of {len(tets):,}")
    sets = _facet_sets(raw, {k: new[merged[nodes]] for k, nodes in cells.items()}, tets, tag, notes)
    names = {number: name for number, name in names.items() if number in region}
    return Contents(
        points=points[used], tets=tets, region=region, names=names, facets=sets, notes=notes
    )


def _first_of_duplicates(tets: Ints, region: Ints) -> Ints:
    """Ascending numbers of distinct tetrahedra. Duplicates keep the smallest of their regions."""
    _, place, count = np.unique(region, return_inverse=True, return_counts=True)
    order = np.argsort(count[place], kind="stable")
    _, first = np.unique(np.sort(tets[order, :4], axis=1), axis=0, return_index=True)
    return np.sort(order[first])


def _triangles_of(nodes: Ints, corners: int) -> tuple[Ints, Ints]:
    """Triangles (k, 3) of plane cells, split at their lowest node number, and their cell (k,)."""
    if corners == 3:
        return nodes[:, :3], np.arange(len(nodes))
    turn = (nodes[:, :4].argmin(axis=1)[:, None] + np.arange(4)) % 4
    a, b, c, d = np.take_along_axis(nodes[:, :4], turn, axis=1).T
    both = np.stack([np.column_stack([a, b, c]), np.column_stack([a, c, d])], axis=1)
    return both.reshape(-1, 3), np.repeat(np.arange(len(nodes)), 2)


def _split(path: Path, points: Floats, nodes: Ints, kind: str) -> tuple[Ints, Ints]:
    """Tetrahedra (m, 4) of solid cells, and the cell (m,) of each.

    The lowest node of a cell is joined to the triangles of its opposite faces. Each face is split
    at its own lowest node, so that neighbours split a common face alike (Dompierre et al, 8th
    International Meshing Roundtable (1999)).
    """
    least, tets, cells = nodes.min(axis=1), [], []
    for face in SPLIT[kind]:
        triangles, cell = _triangles_of(nodes[:, face], len(face))
        away = (nodes[cell][:, face] != least[cell, None]).all(axis=1)
        tets.append(np.column_stack([least[cell], triangles])[away])
        cells.append(cell[away])
    parts, cell = np.vstack(tets), np.concatenate(cells)
    volumes = corner_volumes(points, parts)
    size = np.bincount(cell, np.abs(volumes), len(nodes))
    flat = 1e-9  # of the volume of its cell: smaller tetrahedra come from a collapsed cell
    warped = np.abs(np.bincount(cell, volumes, len(nodes))) < (1 - flat) * size
    if warped.any():
        raise MeshError(
            f"{path} has {warped.sum():,} cells of type {kind} that are too warped to split into "
            "tetrahedra; save it as tetrahedra"
        )
    solid = np.abs(volumes) > flat * size[cell]
    return parts[solid], cell[solid]


def _region_array(arrays: Arrays, solid: list[str], notes: list[str]) -> str:
    """Name of the cell array with the regions of solid cells, or "": one of the usual names, or the
    first with a few whole numbers.
    """
    every = {name: np.concatenate([own[kind] for kind in solid]) for name, own in arrays.items()}
    numbers = {
        name: x for name, x in every.items()
        if x.ndim == 1 and (np.floor(x) == x).all() and np.abs(x).max() < 2**31
    }  # fmt: skip
    # Of this package, of others, and of meshio's readers.
    usual = ("region", "material", "medit:ref", "cell_tags", GMSH_GROUPS)
    known = next((name for name in usual if name in numbers), "")
    if known and (known != GMSH_GROUPS or numbers[known].any()):
        return known
    others = rf"(?i){FACETS}|{NAMED}|.*(ghost|rank|partition|process)"
    several = [
        name for name, x in numbers.items()
        if not re.match(others, name) and 1 < len(np.unique(x)) <= len(x) / 2
    ]  # fmt: skip
    found = next((name for name in several if numbers[name].min() >= 0), "")
    if found:
        notes.append(f"regions are the numbers in the cell array {found}")
    if unused := [name for name in several if name != found]:
        notes.append(f"left out the cell arrays {', '.join(unused)}")
    return found


def _regions(raw: Any, kind: str, tag: str) -> tuple[Ints, dict[int, str]]:
    """Region (e,) of each element from an array or physical groups, and its names."""
    arrays = raw.cell_data_dict
    if tag == GMSH_GROUPS:
        return _physical_groups(raw, arrays[tag][kind])
    if not tag:
        return np.zeros(len(raw.cells_dict[kind]), np.int64), {}
    region = arrays[tag][kind].astype(np.int64)
    region = -region if tag == "cell_tags" else region  # MED's are negative
    names = {}
    for title, own in arrays.items():
        if title.startswith(NAMED) and (own[kind] == 1).any():
            names[int(region[own[kind] == 1][0])] = title.removeprefix(NAMED)
    return region, names


def _physical_groups(raw: Any, groups: Ints) -> tuple[Ints, dict[int, str]]:
    """Physical group (e,) of each element, or the region number in its title, and group names."""
    tags, place = np.unique(groups, return_inverse=True)
    numbers, names = {}, {}
    for title, (tag, dimension) in raw.field_data.items():
        if dimension == 3:
            ours = re.fullmatch(REGION + r"(\d+)(?: (.+))?", title)
            number = numbers[int(tag)] = int(ours[1]) if ours else int(tag)
            if name := ours[2] if ours else title:
                names[number] = name
    return np.array([numbers.get(tag, tag) for tag in tags.tolist()], np.int64)[place], names


def _facet_sets(
    raw: Any, cells: dict[str, Ints], tets: Ints, tag: str, notes: list[str]
) -> dict[str, Ints]:
    """Facets (k, 3) or (k, 6) by name, from arrays `facets:<name>`, physical groups or numbers.

    `cells` have the node numbers of the tetrahedra (m, 4 or 10), or -1.
    """
    arrays = raw.cell_data_dict
    titles = [name for name in arrays if name.startswith(FACETS)]
    groups = {title: group for title, (group, d) in raw.field_data.items() if d == 2}
    empty = np.zeros((0, 3 if tets.shape[1] == 4 else 6), np.int64)
    sets = {title.removeprefix(FACETS): empty for title in (*titles, *groups)}
    lost = 0
    for kind in [kind for kind in PLANE if kind in cells]:
        facets, is_face, cell = _faces_of(cells[kind], PLANE[kind], tets, empty.shape[1])
        lost += int((~is_face).sum())
        marked = {title.removeprefix(FACETS): arrays[title][kind] == 1 for title in titles}
        if tag:
            tags = arrays[tag][kind].astype(np.int64)
            other = set(tags[tags > 0].tolist()) - set(groups.values())
            every = groups | {f"group {number}": number for number in other}
            marked |= {title: tags == number for title, number in every.items()}
        for title, own in marked.items():
            sets[title] = np.vstack([sets.get(title, empty), facets[own[cell] & is_face]])
    if lost:
        notes.append(f"left out {lost:,} triangles that are not faces of tetrahedra")
    return sets


def _faces_of(nodes: Ints, corners: int, tets: Ints, width: int) -> tuple[Ints, np.ndarray, Ints]:
    """Faces (k, width) of tetrahedra that match plane cells, a mask of matches, and their cells."""
    triangles, cell = _triangles_of(nodes, corners)
    n = int(tets.max()) + 1
    faces = tets[:, FACES[:, :width]].reshape(-1, width)
    keys, place, count = np.unique(facet_keys(faces, n), return_index=True, return_counts=True)
    own = np.where((triangles >= 0).all(axis=1), facet_keys(triangles, n), -1)
    at = np.searchsorted(keys, own).clip(max=len(keys) - 1)
    face, is_face = faces[place[at]], keys[at] == own
    given = nodes[cell][:, :width] if corners == 3 and nodes.shape[1] == width else face
    turns = [np.roll(face[:, :3], turn, axis=1) == given[:, :3] for turn in range(3)]
    alike = np.any([turn.all(axis=1) for turn in turns], axis=0)
    return np.where((alike | (count[at] > 1))[:, None], given, face), is_face, cell


def _node_order(path: Path, points: Floats, tets: Ints) -> list[int]:
    """Column for each node of 10-node tetrahedra (e, 10) in VTK's order, by the node positions."""
    nodes = points[tets]
    middles = nodes[:, EDGES].mean(axis=2)
    length = np.linalg.norm(nodes[:, EDGES[:, 1]] - nodes[:, EDGES[:, 0]], axis=2)
    away = np.linalg.norm(nodes[:, 4:, None] - middles[:, None], axis=3)
    away /= np.maximum(length[:, None], 1e-300)
    own = np.einsum("ejj->ej", away).max(axis=1)
    off_middle = 0.25  # of the length of an edge: how far its mid-side node may lie from the middle
    if (own <= off_middle).all():
        return list(range(10))
    column = np.median(away, axis=0).argmin(axis=0)  # the node on each edge
    off = away[:, column, range(6)].max(axis=1) > off_middle
    if sorted(column) == list(range(6)) and not off.any():
        return [*range(4), *(4 + column).tolist()]
    count = int(min(off.sum(), (own > off_middle).sum()))
    raise MeshError(
        f"{path} has {count:,} of {len(tets):,} tetrahedra with a mid-side node more than "
        f"{off_middle:.0%} of its edge away from the middle; save it with straight edges, or in "
        "VTK's node order"
    )
