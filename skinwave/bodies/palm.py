"""Parametric palm: soft tissue on bone, meshed finely under the focus."""

from dataclasses import replace
from functools import partial

import numpy as np

import fem
from fem.load_and_probe import facet_points
from meshes import Grading, TetMesh, boundary_facets, graded_axis, mapped_palm
from meshes.files.import_body import GROWTH
from meshes.shapes.palm import gradient
from meshes.shapes.structured import Lines, check_cell_count, mirror_line
from skinwave.bodies.analytic import stack_dispersion
from skinwave.bodies.body import Body, BodyKind, register
from skinwave.bodies.discretised import Discretised
from skinwave.bodies.tissue import HAND_CELL, hand_size, in_tissue_layers, support


def discretise(body: Body, h: float) -> Discretised:
    """Return ten-node tetrahedra of h in m about the middle of the palm, growing away from it.

    The support below represents bone; those at both ends represent the tissue that was cut off.
    """
    mesh = mapped_palm(body.palm, *grid_lines(body, h))
    mesh = replace(mesh, facets={"top": mesh.facets["top"]})
    return in_tissue_layers(body, h, mesh, partial(_support, body))


def grid_lines(body: Body, h: float) -> Lines:
    """Return grid lines in m of the box around a palm, with cells that grow from its middle."""
    # Sides of boxes over the edges of their elements. Below the default size they grow by its third
    # root: rows of boxes are fine from side to side, and 2 mm would need 560,000 dofs where 230,000
    # are within 0.3 %.
    side = 0.85 * max(1.0, HAND_CELL / h) ** (1 / 3)
    surface = 0.8 * h  # motion at the surface has the scale of the focal spot
    # Larger elements do not follow the rim, where waves reflect.
    largest = max(surface, min(2 * h, 0.7 * body.palm.edge_radius))
    finest, coarsest = side * surface, side * largest
    along = Grading(radius=25e-3, growth=GROWTH, coarsest=coarsest)
    x, y = (mirror_line(graded_axis(side / 2, finest, along)) for side in (body.width, body.height))
    # No cell is higher than its target size. Two meshes that are compared then differ more often in
    # their number of layers, which affects the error most. Error and cost balance best if the first
    # cell is 0.8 times as high as wide.
    heights = [0.8 * finest]
    while (below := sum(heights)) < body.depth:
        heights.append(min(heights[-1] * GROWTH**0.6, coarsest))
    return x, y, -np.append(0.0, np.cumsum(heights))[::-1] * (body.depth / below)


def _support(body: Body, mesh: TetMesh) -> fem.Support:
    """Support below and at both ends, by the normals of the level set."""
    slope = gradient(body.palm, facet_points(mesh, boundary_facets(mesh.tets)))
    outward = np.asarray(slope / np.linalg.norm(slope, axis=1, keepdims=True))
    ends = [(body.side("front"), -outward[:, 1]), (body.side("back"), outward[:, 1])]
    return support(body, mesh, outward, ends)


register(
    BodyKind(
        name="palm",
        keys=("relief",),
        presets={"palm": {"width": 0.085}},  # of the effective homogeneous soft tissue of a palm
        check=lambda body: body.palm,
        check_size=lambda body, h: check_cell_count(len(line) - 1 for line in grid_lines(body, h)),
        discretise=discretise,
        default_size=lambda body: min(body.depth / 2, hand_size(body)),
        interactive_size=8e-3,
        named_sides=("front", "back"),
        is_smooth=True,
        may_be_coated=True,
        dispersion=stack_dispersion,  # of a slab as deep as the middle of the palm
    )
)
