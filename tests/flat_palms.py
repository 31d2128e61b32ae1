"""Palms without relief: their grids, and the volume and area of a rounded slab."""

import numpy as np
from scipy.integrate import quad

import fem
import meshes
from meshes import Palm

FLAT = Palm(
    cup_depth=0, thenar_height=0, hypothenar_height=0, pad_height=0, thickness=0.015,
    edge_radius=0.007,
)  # fmt: skip


def grid(palm, cell):
    """Equal cells, an even number along x and y."""
    return (
        np.linspace(-palm.breadth / 2, palm.breadth / 2, 2 * round(palm.breadth / 2 / cell) + 1),
        np.linspace(-palm.length / 2, palm.length / 2, 2 * round(palm.length / 2 / cell) + 1),
        np.linspace(-palm.thickness, 0, round(palm.thickness / cell) + 1),
    )


def measures(mesh):
    """Volume and area within curved boundary facets; the volume is exact for ten-node elements."""
    facets = meshes.boundary_facets(mesh.tets)
    _, normals = fem.load_and_probe.facet_geometry(mesh, facets)
    at = fem.facet_points(mesh, facets).reshape(normals.shape)
    return np.einsum("eqi,eqi->", at, normals) / 3, np.linalg.norm(normals, axis=2).sum()


def rounded_slab(palm):
    """Volume and area of a palm without relief, by the insets of its outline."""
    half, r, e = np.array([palm.breadth, palm.length]) / 2, palm.corner_radius, palm.edge_radius

    def inset(d):
        return 4 * np.prod(half - d) - (4 - np.pi) * (r - d) ** 2

    def around(d):
        return 4 * (half - d).sum() - (8 - 2 * np.pi) * (r - d)

    wall = palm.thickness - 2 * e
    rim = quad(lambda a: inset(e * (1 - np.cos(a))) * e * np.cos(a), 0, np.pi / 2)[0]
    curved = quad(lambda a: around(e * (1 - np.cos(a))) * e, 0, np.pi / 2)[0]
    return inset(0) * wall + 2 * rim, around(0) * wall + 2 * (curved + inset(e))
