"""Abaqus input files: nodes, elements and sections of parts, placed by their instances.

Keywords follow the Abaqus Keywords Reference Guide. The reader of meshio ignores parts and
instances, and keeps only the last of several node blocks.
"""

import re
from collections import Counter
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from meshes.reading import read_exported_text
from meshes.tetmesh import MeshError
from meshes.typing import Floats

INCLUDED = (
    r"(?im)^[ \t]*\*(?:INCLUDE|NODE|ELEMENT|ELSET)\b[^\n]*,\s*INPUT\s*=\s*\"?(?P<file>[^\",\n]+).*"
)
SAVE_AGAIN = "save it again from the program that made it"

Rows = list[list[str]]


@dataclass
class Part:
    """Nodes and elements by number, element sets, and the sets that *ELEMENT and sections name."""

    name: str
    nodes: dict[int, list[float]] = field(default_factory=dict)
    elements: dict[int, tuple[str, list[int]]] = field(default_factory=dict)
    sets: dict[str, set[int]] = field(default_factory=dict)
    blocks: list[str] = field(default_factory=list)
    sections: list[str] = field(default_factory=list)


def read_abaqus(path: Path) -> Any:
    """Return all instances of the parts in a file, or its loose elements, as a meshio.Mesh."""
    loose = current = Part("")
    parts: dict[str, Part] = {}
    instances: list[tuple[Part, Rows]] = []
    generating = ("NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY", "SYSTEM")
    for keyword, options, rows in _blocks(path):
        if keyword in generating or (keyword == "NODE" and options.get("SYSTEM", "R") != "R"):
            raise MeshError(
                f"{path} has *{keyword}, which generates nodes or elements; save it from "
                "Abaqus/CAE or as .vtu with all of them written out"
            )
        if keyword == "PART":
            current = parts[options.get("NAME", "").upper()] = Part(options.get("NAME", ""))
        elif keyword == "INSTANCE":
            name = options.get("PART", "")
            if name.upper() not in parts:
                raise MeshError(f"{path} has an instance of a missing part '{name}'; {SAVE_AGAIN}")
            current = deepcopy(parts[name.upper()])  # an instance may add nodes and elements
            instances.append((current, rows))
        elif keyword in ("END PART", "END INSTANCE"):
            current = loose
        else:
            try:
                _add(current, keyword, options, rows)
            except (ValueError, IndexError):
                raise MeshError(f"{path}: wrong numbers below *{keyword}; {SAVE_AGAIN}") from None
    placed = [(loose, []), *instances] if instances else [(p, []) for p in (loose, *parts.values())]
    return join_parts(path, [(part, rows) for part, rows in placed if part.elements])


def full_text(path: Path, pattern: str = "(?!)", level: int = 0) -> str:
    """Return the text of a file with the files that a pattern includes, by its group `file`."""

    def other(match: re.Match[str]) -> str:
        before = "" if "INCLUDE" in match[0].upper() else match[0] + "\n"
        return before + full_text(include(path, match["file"].strip(), level), pattern, level + 1)

    largest = 500_000_000  # bytes
    try:
        return re.sub(pattern, other, read_exported_text(path, largest))
    except ValueError as error:
        raise MeshError(str(error)) from None


def include(path: Path, name: str, level: int = 0) -> Path:
    """Return the path of a file that another one includes at a level of nesting."""
    other = path.parent / name
    most_included = 20  # levels of nested *INCLUDE
    if level == most_included or not other.is_file():
        raise MeshError(f"{path} includes '{name}', which is missing; copy it there")
    return other


def _blocks(path: Path) -> Iterator[tuple[str, dict[str, str], Rows]]:
    """Each keyword with its options and the data lines below it."""
    text = re.sub(r"(?m)^[ \t]*\*\*.*", "", full_text(path, INCLUDED))  # comments
    for block in re.split(r"(?m)^[ \t]*\*", text):
        head, *lines = [line.strip() for line in block.splitlines() if line.strip()] or [""]
        while head.endswith(",") and lines:  # a keyword line continues after a comma
            head += lines.pop(0)
        name, *pairs = head.split(",")
        options = dict(pair.partition("=")[::2] for pair in pairs)
        yield (
            " ".join(name.upper().split()),
            {key.strip().upper(): value.strip(' \t"') for key, value in options.items()},
            [[word.strip() for word in line.split(",")] for line in lines],  # "" after a comma
        )


def _add(part: Part, keyword: str, options: dict[str, str], rows: Rows) -> None:
    if keyword == "NODE":
        for row in rows:
            place = [float(word or 0) for word in row[1:4]]
            part.nodes[int(row[0])] = (place + [0.0, 0.0])[:3]
    elif keyword == "ELEMENT":
        numbers: list[int] = []
        part.blocks.append(options.get("ELSET", "").upper())
        members = part.sets.setdefault(part.blocks[-1], set())
        most = _solid_nodes(options.get("TYPE", "").upper())
        for row in rows:
            numbers += [int(word) for word in row if word]
            if row[-1] or len(numbers) == most + 1:
                part.elements[numbers[0]] = (options.get("TYPE", "").upper(), numbers[1:])
                members.add(numbers[0])
                numbers = []
    elif keyword == "ELSET":
        members = part.sets.setdefault(options.get("ELSET", "").upper(), set())
        for row in rows:
            words = [word for word in row if word]
            if "GENERATE" in options:
                first, last, *step = map(int, words)
                members.update(range(first, last + 1, *step))
            else:
                for word in words:
                    members |= {int(word)} if word.isdigit() else part.sets.get(word.upper(), set())
    elif keyword == "SOLID SECTION":
        part.sections.append(options.get("ELSET", "").upper())


def join_parts(path: Path, placed: list[tuple[Part, Rows]]) -> Any:
    """All parts, in their places, as one mesh."""
    import meshio

    points: list[Floats] = [np.zeros((0, 3))]
    cells: dict[str, list[list[int]]] = {}
    regions: dict[str, list[int]] = {}
    names: dict[str, int] = {}
    left_out: list[str] = []
    notes: list[str] = []
    for part, rows in placed:
        number = dict(zip(part.nodes, count(sum(map(len, points))), strict=False))
        points.append(_place(path, np.array(list(part.nodes.values())).reshape(-1, 3), rows))
        region = _regions(part, names, notes)
        for element, (kind, nodes) in part.elements.items():
            name = _meshio_kind(kind, len(nodes))
            if name is None:
                left_out.append(kind)
                continue
            try:
                cells.setdefault(name, []).append([number[node] for node in nodes])
            except KeyError as error:
                raise MeshError(
                    f"{path} has an element {element} with a missing node {error}; {SAVE_AGAIN}"
                ) from None
            regions.setdefault(name, []).append(region.get(element, 0))
    notes = list(dict.fromkeys(notes))  # instances of one part have the same notes
    notes += [f"left out {n:,} elements of type {kind}" for kind, n in Counter(left_out).items()]
    if len(placed) > 1:
        notes.append(f"read {len(placed)} parts or instances of parts")
    return meshio.Mesh(
        np.vstack(points),
        [(name, np.array(nodes)) for name, nodes in cells.items()],
        cell_data={"region": [np.array(regions[name]) for name in cells]},
        info={"names": {n: name for name, n in names.items() if name != str(n)}, "notes": notes},
    )


def _meshio_kind(kind: str, nodes: int) -> str | None:
    """meshio's name of an element type with this number of nodes; None if unknown."""
    solids = {4: "tetra", 5: "pyramid", 6: "wedge", 8: "hexahedron", 10: "tetra10"}  # by nodes
    if expected := _solid_nodes(kind):
        return solids.get(nodes, kind) if nodes == expected else kind
    faces = {3: "triangle", 4: "quad"}
    return faces.get(nodes) if re.match(r"(?:S|STRI|M3D|R3D|SFM3D)[34]", kind) else None


def _solid_nodes(kind: str) -> int:
    """Number of nodes of a solid element type; 0 for other types."""
    match = re.match(r"(?:C|DC|AC|DCC|Q)3D(\d+)", kind)
    return int(match[1]) if match else 0


def _regions(part: Part, names: dict[str, int], notes: list[str]) -> dict[int, int]:
    """Region number, from 1, of each element; `names` collects those of all parts.

    Regions are the sets of sections; otherwise *ELSET sets or *ELEMENT sets that contain each
    element once; otherwise *ELEMENT sets, or the part.
    """
    sets = {title: members for title, members in part.sets.items() if title and members}
    sections, blocks = ([t for t in titles if t in sets] for titles in (part.sections, part.blocks))
    others = [title for title in sets if title not in blocks]
    families = [
        titles for titles in (others, blocks)
        if sorted(e for title in titles for e in sets[title]) == sorted(part.elements)
    ]  # fmt: skip
    chosen = list(dict.fromkeys(sections or (families or [blocks])[0]))
    if unused := [title for title in sets if title not in chosen]:
        notes.append(f"element sets that are not regions: {', '.join(unused)}")
    regions = {title: sets[title] for title in chosen} or {part.name: set(part.elements)}
    for title in (title for title in regions if title not in names):
        number = int(title) if title.isdigit() else 1
        names[title] = next(n for n in count(number) if n not in names.values())
    return {element: names[title] for title, members in regions.items() for element in members}


def _place(path: Path, points: Floats, rows: Rows) -> Floats:
    """Points after the translation and the rotation (axis and degrees) of an instance."""
    from scipy.spatial.transform import Rotation

    try:
        values = [[float(word) for word in row if word] for row in rows]
        if values:
            points = points + np.array(values[0])
        if len(values) > 1:
            a, b, angle = np.array(values[1][:3]), np.array(values[1][3:6]), values[1][6]
            axis = (b - a) / np.linalg.norm(b - a)
            points = a + Rotation.from_rotvec(np.radians(angle) * axis).apply(points - a)
    except (ValueError, IndexError):
        raise MeshError(
            f"{path} has an instance whose translation or rotation is not valid; {SAVE_AGAIN}"
        ) from None
    return np.asarray(points)
