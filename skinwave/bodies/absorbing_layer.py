"""Absorbing (sponge) layer around a slab: its grid lines and its damping profile."""

import numpy as np

from meshes import Grading, TetMesh, graded_axis
from meshes.tetmesh import Floats
from skinwave.bodies.body import Body

# An absorbing (sponge) layer around absorbing sides; its mass-proportional damping rises with the
# square of the distance: dashpots alone reflect a quarter of a shear wave at 30 degrees. Near the
# cut-on of a slab on a rigid base, c_s/(4 depth), waves are long, and only a wide layer absorbs
# them. Its cells may grow fast. The reflection of a plane slab of 50 mm is at most 1.4 % of the
# motion at the focus at any line, that of dashpots alone 17 % (`skinwave.verify.sides`).
LAYER_WIDTH, LAYER_DRAG = 7.0, 0.35  # of the depth; of the angular frequency of cut-on
LAYER_GROWTH, LAYER_COARSEST = 1.4, 2.0  # from cell to cell; of the depth
LOWEST_CUT_ON = 80.0  # Hz: what deeper slabs carry below it is still near field at their sides


def has_layer(body: Body) -> bool:
    """Whether an absorbing layer is meshed around a body."""
    return body.of_kind.is_layer and "absorbing" in body.conditions


def layer_scale(body: Body) -> float:
    """Reference length of an absorbing layer, metre: the depth, at most that of `LOWEST_CUT_ON`."""
    return min(body.depth, body.solid.shear_speed / (4 * LOWEST_CUT_ON))


def layer_line(body: Body, half: Floats) -> Floats:
    """Grid lines of the absorbing layer, from where the body ends."""
    scale = layer_scale(body)
    grading = Grading(radius=0.0, growth=LAYER_GROWTH, coarsest=LAYER_COARSEST * scale)
    first = min(LAYER_GROWTH * (half[-1] - half[-2]), grading.coarsest)
    return graded_axis(LAYER_WIDTH * scale, first, grading)[1:]


def layer_drag(body: Body, mesh: TetMesh) -> Floats:
    """Damping profile (m,) in 1/s of the absorbing layer: 0 in the body, quadratic beyond it."""
    scale, ends = layer_scale(body), np.array([body.width, body.height]) / 2
    middles = np.abs(mesh.points[mesh.tets[:, :4], :2].mean(axis=1))
    beyond = np.clip(middles - ends, 0.0, None).max(axis=1) / (LAYER_WIDTH * scale)
    return LAYER_DRAG * 2 * np.pi * body.solid.shear_speed / (4 * scale) * beyond**2
