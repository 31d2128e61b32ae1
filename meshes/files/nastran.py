"""Nastran bulk data: grid points, solid elements and shells, with or without BEGIN BULK.

Cards follow the MSC Nastran Quick Reference Guide. The reader of meshio needs BEGIN BULK and
ENDDATA, and ignores coordinate systems and INCLUDE.
"""

import re
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

from meshes.files.abaqus import SAVE_AGAIN, Part, full_text, join_parts
from meshes.tetmesh import MeshError

# Corners of elements, and the most nodes of solid ones, 0 for shells.
ELEMENTS = {
    "CTETRA": (4, 10), "CPYRAM": (5, 13), "CPENTA": (6, 15), "CHEXA": (8, 20), "CTRIA3": (3, 0),
    "CTRIAR": (3, 0), "CTRIA6": (3, 0), "CQUAD4": (4, 0), "CQUADR": (4, 0), "CQUAD8": (4, 0),
}  # fmt: skip
INCLUDED = r"(?im)^INCLUDE\s+['\"]?(?P<file>[^'\"\n]+).*"


def read_nastran(path: Path) -> Any:
    """Return the elements of a file as a meshio.Mesh, with their property numbers as regions."""
    part = Part("")
    for name, fields in _cards(path):
        if name == "GRID" and fields[1] not in ("", "0"):
            raise MeshError(
                f"{path} gives nodes in coordinate system {fields[1]}; save it with all nodes in "
                "the basic system"
            )
        try:
            if name == "GRID":
                part.nodes[int(fields[0])] = [_number(word) for word in fields[2:5]]
            elif name[0] == "C" and not name.startswith("CORD"):
                part.elements[number := int(fields[0])] = _element(name, fields)
                if name in ELEMENTS:
                    part.sections.append(str(int(fields[1] or 0)))
                    part.sets.setdefault(part.sections[-1], set()).add(number)
        except (ValueError, IndexError):
            raise MeshError(
                f"{path}: a card {name} has numbers that cannot be read; {SAVE_AGAIN}"
            ) from None
    return join_parts(path, [(part, [])])


def _element(name: str, fields: list[str]) -> tuple[str, list[int]]:
    """Abaqus' name of an element, and its nodes; those on edges only if none is missing."""
    corners, most = ELEMENTS.get(name, (0, 0))
    nodes = [int(word or 0) for word in fields[2 : 2 + max(corners, most)]]
    nodes = nodes if len(nodes) == most and all(nodes) else nodes[:corners]
    return f"{'C3D' if most else 'S'}{len(nodes)}" if corners else name, nodes


def _cards(path: Path) -> Iterator[tuple[str, list[str]]]:
    """Name of each card, and its fields with those of continuations."""
    text = re.sub(r"[ ]*\$.*", "", full_text(path, INCLUDED))  # comments
    text = re.split(r"(?im)^ENDDATA", re.split(r"(?im)^BEGIN[^\n]*", text)[-1])[0]
    name, fields = "$", list[str]()
    for line in filter(str.strip, text.splitlines()):
        first, *words = _fields(line)
        if first[:1] in ("", "+", "*"):
            fields += words
            continue
        yield name, fields
        name, fields = first.rstrip("*").upper(), words
    yield name, fields


def _fields(line: str) -> list[str]:
    """First field of a line, and its eight data fields, or four large ones."""
    line = line.expandtabs(8) if " " in line else line.replace("\t", ",")
    count, width = (4, 16) if "*" in line[:8].partition(",")[0] else (8, 8)
    ends = [0, *range(8, 9 + width * count, width)]
    words = line.split(",") if "," in line else [line[a:b] for a, b in pairwise(ends)]
    words = [word.strip() for word in words[: count + 1]]
    return words + [""] * (count + 1 - len(words))


def _number(word: str) -> float:
    """A number whose exponent may have no letter, such as 1.5-3; 0 for an empty field."""
    return float(re.sub(r"(?<=[\d.])([+-])", r"e\1", word.lower().replace("d", "e")) or 0)
