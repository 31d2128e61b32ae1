"""Checks of a body's tetrahedra, as of a surface that is to be filled."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from meshes.surface.repair import check_crossings, check_manifold, in_mm
from meshes.surface.triangulation import compact
from meshes.tetmesh import (
    FACES,
    Ints,
    MeshError,
    TetMesh,
    boundary_facets,
    corner_volumes,
    neighbours,
    part,
)


def one_body(
    mesh: TetMesh, *, keep_largest: bool = False, say: Callable[[str], None] = print
) -> TetMesh:
    """The mesh, or the largest of its bodies on request; a MeshError if tetrahedra overlap, they
    are several bodies, or their boundary is not closed, touches or crosses itself.
    """
    _check_overlaps(mesh)
    body, volumes = _bodies(mesh)
    if len(volumes) > 1 and not keep_largest:
        listed = ", ".join(f"{1e6 * volume:.3g}" for volume in np.sort(volumes)[::-1][:5])
        raise MeshError(
            f"the mesh is {len(volumes)} separate bodies ({listed} cm3); join them, or keep the "
            "largest: skinwave mesh FILE --keep largest"
        )
    if len(volumes) > 1:
        share = volumes.max() / volumes.sum()
        say(f"kept the largest of {len(volumes)} bodies, {100 * share:.1f} % of the volume")
        mesh = part(mesh, body == volumes.argmax())[0]
    boundary = compact(mesh.points, boundary_facets(mesh.tets)[:, :3])
    check_manifold(boundary)
    check_crossings(boundary)
    return mesh


def _check_overlaps(mesh: TetMesh) -> None:
    """Check that at most two tetrahedra have a facet, which lie on either side of it."""
    faces = mesh.tets[:, FACES[:, :3]].reshape(-1, 3)
    low = faces.argmin(axis=1)[:, None]
    turned = np.take_along_axis(faces, (low + np.arange(3)) % 3, axis=1)  # seen from outside
    _, place, count = np.unique(turned, axis=0, return_index=True, return_counts=True)
    twice = place[count > 1]
    if len(twice):
        middle = in_mm(mesh.points[faces[twice[0]]].mean(axis=0))
        raise MeshError(
            f"tetrahedra of the mesh overlap at {len(twice):,} of their faces, first near "
            f"{middle}; mesh the body anew"
        )


def _bodies(mesh: TetMesh) -> tuple[Ints, np.ndarray]:
    """The body (m,) of each tetrahedron, and the volume of each body in cubic metre."""
    from scipy import sparse

    beyond, m = neighbours(mesh.tets), len(mesh.tets)
    one, face = np.nonzero(beyond >= 0)
    graph = sparse.coo_array((np.ones(len(one), bool), (one, beyond[one, face])), shape=(m, m))
    body = sparse.csgraph.connected_components(graph, directed=False)[1]
    return body, np.bincount(body, corner_volumes(mesh.points, mesh.tets))
