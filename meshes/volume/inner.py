"""Regions of a mesh by the closed surfaces inside its body."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from meshes.surface.triangulation import Surface, volume
from meshes.surface.winding import winding_number
from meshes.tetmesh import MeshError, TetMesh, corner_volumes

REST = "tissue"  # name of the region that is in no inner surface
VOLUME_ERROR = 0.02  # of the volume within an inner surface


def with_regions(mesh: TetMesh, inner: Mapping[str, Surface]) -> TetMesh:
    """Mesh with a region for each inner surface, from 1, and 0 for the rest.

    A tetrahedron is in the smallest surface whose winding number about its middle is above 1/2.

    Raises
    ------
    MeshError
        If a region has not the volume within its surface.
    """
    if not inner:
        return mesh
    middles = mesh.points[mesh.tets[:, :4]].mean(axis=1)
    region = np.zeros(len(mesh.tets), np.int64)
    volumes, enclosed = corner_volumes(mesh.points, mesh.tets), [volume(s) for s in inner.values()]
    for k in np.argsort(enclosed)[::-1].tolist():
        name, surface = list(inner.items())[k]
        inside = winding_number(surface, middles) > 0.5
        region[inside] = k + 1
        if not abs(volumes[inside].sum() / enclosed[k] - 1) <= VOLUME_ERROR:
            raise MeshError(
                f"the region {name} has {100 * volumes[inside].sum() / enclosed[k]:.3g} % of the "
                f"volume within its surface, and may differ by {100 * VOLUME_ERROR:g} %; take "
                "smaller elements"
            )
    names = dict(enumerate([REST, *inner]))
    return replace(mesh, region=region, region_names=names)
