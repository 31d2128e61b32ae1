"""Meshes whose elements may be small where the error is: on grid lines, or of any size anywhere."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from meshes import TetMesh
from meshes.shapes.equidistributed import Lines
from meshes.tetmesh import Floats, Ints
from meshes.volume.tetrahedralise import Sizing
from skinwave.bodies.discretised import Discretise, Discretised


@dataclass(frozen=True, kw_only=True, eq=False)
class Grid:
    """Grid of a kind of body.

    Parameters
    ----------
    lines : lines (n,) in metre along x, y and z, through the body as it lies before it is placed,
        of a mesh with elements of a size in metre
    discretise : mesh of a body on such lines
    cells : cell (e, 3) along each axis that every element of that mesh, or of a part of it, is in
    coarsest : largest cell in metre that a body's shape allows
    has : whether a body has such a mesh
    """

    lines: Callable[[Any, float], Lines]
    discretise: Callable[[Any, Lines], Discretised]
    cells: Callable[[Lines, TetMesh], Ints]
    coarsest: Callable[[Any], float] = lambda body: np.inf
    has: Callable[[Any], bool] = lambda body: True

    def on(self, lines: Lines) -> Discretise:
        """Mesh on lines, whatever the size that is asked for."""
        return lambda body, h: self.discretise(body, lines)


@dataclass(frozen=True, kw_only=True, eq=False)
class Sized:
    """Unstructured mesh of a kind of body.

    Parameters
    ----------
    discretise : mesh of a body as it lies before it is placed, as near to its surface as elements
        of a size in metre are, with edge lengths as a function of points
    has : whether a body has such a mesh
    """

    discretise: Callable[[Any, float, Sizing], Discretised]
    has: Callable[[Any], bool] = lambda body: True

    def by(self, sizing: Sizing) -> Discretise:
        """Mesh with these edge lengths."""
        return lambda body, h: self.discretise(body, h, sizing)


def mirrored(line: Floats) -> Floats:
    """A line (2 n - 1,) from its half (n,) that begins at 0."""
    return np.concatenate([-line[:0:-1], line])


def halves(lines: Lines, axes: str) -> Lines:
    """Lines through the part of a body where its coordinates along some axes, of "xy", are 0 or
    above, of lines that are their own mirror image.
    """
    x, y, z = (
        line[len(line) // 2 :] if axis in axes else line
        for axis, line in zip("xyz", lines, strict=True)
    )
    return x, y, z


def wholes(lines: Lines, axes: str) -> Lines:
    """Lines through all of a body, from those of `halves`."""
    x, y, z = (
        mirrored(line) if axis in axes else line for axis, line in zip("xyz", lines, strict=True)
    )
    return x, y, z
