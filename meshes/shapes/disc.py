"""Cylinder on its base, of triangles in rings that are extruded."""

from collections.abc import Iterable

import numpy as np

from meshes.facets import tag_boundary
from meshes.shapes.structured import check_size, extruded, round_up, with_planes
from meshes.tetmesh import Floats, Ints, MeshError, TetMesh

SECTORS = 8  # so that no element crosses x = 0 or y = 0


def disc(diameter: float, thickness: float, h: float, planes: Iterable[float] = ()) -> TetMesh:
    """Ten-node tetrahedra of a cylinder below the plane z = 0, about the z axis: a prism on a
    polygon of 8 sides for each ring of elements.

    Parameters
    ----------
    diameter, thickness : float, metre
    h : float, metre, largest edge along a radius and downwards
    planes : depths in metre that elements do not cross

    Returns
    -------
    TetMesh with the facet sets `top`, `bottom`, `sides` and `surface`

    Raises
    ------
    MeshError
        If a length is not above 0, or there would be too many elements.
    """
    for name, length in (("diameter", diameter), ("thickness", thickness), ("h", h)):
        if not 0 < length < np.inf:
            raise MeshError(f"{name} = {length} m of a disc must be finite and above 0")
    rings, layers = (max(2, round_up(length / h)) for length in (diameter / 2, thickness))
    down = with_planes(np.linspace(0.0, thickness, layers + 1), planes)
    check_size((2 * rings, 2 * rings, len(down) - 1), order=2)
    plane, triangles = _rings(rings)
    mesh = extruded(plane * diameter / 2, triangles, -down[::-1])
    return tag_boundary(
        mesh,
        bottom=lambda centroids, normals: normals[:, 2] < -0.9,
        sides=lambda centroids, normals: np.abs(normals[:, 2]) < 0.1,
    )


def _rings(rings: int) -> tuple[Floats, Ints]:
    """Points (n, 2) on rings of a unit disc, 8 k on ring k, and triangles (8 r^2, 3) of them."""
    start = np.cumsum([0, 1, *(SECTORS * np.arange(1, rings))])
    points, triangles = [np.zeros((1, 2))], []
    for k in range(1, rings + 1):
        angle = 2 * np.pi * np.arange(SECTORS * k) / (SECTORS * k)
        points.append(k / rings * np.column_stack([np.cos(angle), np.sin(angle)]))
        sector, i = np.divmod(np.arange(SECTORS * k), k)
        outer = start[k] + np.arange(SECTORS * k)
        following = start[k] + np.arange(1, SECTORS * k + 1) % (SECTORS * k)
        around = max(1, SECTORS * (k - 1))
        inner = start[k - 1] + (sector * (k - 1) + i) % around
        triangles.append(np.column_stack([outer, following, inner]))
        between = i < k - 1
        beside = start[k - 1] + (sector * (k - 1) + i + 1) % around
        triangles.append(np.column_stack([inner, following, beside])[between])
    return np.vstack(points), np.vstack(triangles)
