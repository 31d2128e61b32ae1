"""Thick slab: layers of uniform depth, or a half-space. Its mesh and its wavenumber integral."""

from functools import partial

import numpy as np

from meshes import Grading, extrude, graded_axis
from meshes.files.import_body import FINE_RADIUS
from meshes.shapes.structured import Lines, check_cell_count, mirror_line, with_planes
from simple_model.layers.compliance import layered
from skinwave.bodies.absorbing_layer import far_springs, has_layer, layer_drag, layer_line, layer_of
from skinwave.bodies.analytic import stack, stack_dispersion
from skinwave.bodies.body import Body, BodyKind, register
from skinwave.bodies.discretised import Discretise, Discretised, in_layers
from skinwave.bodies.parts import Layer
from skinwave.bodies.supports import EDGES
from skinwave.typing import Floats

THIN_CELL = 1.5e-3  # m, of bodies that are thinner than two of them


def discretise(body: Body, h: float, wider: float = 1.0) -> Discretised:
    """Return a structured mesh in layers, with an absorbing layer `wider` times the usual width."""
    return on_lines(body, grid_lines(body, h), wider)


def morph(thinnest: Body, thickest: Body, h: float) -> Discretise:
    """Return a function that meshes another slab by stretching the layers of the thickest one."""
    x, y, z = grid_lines(thickest, h)
    depths = thickest.interfaces
    return lambda body, h: on_lines(body, (x, y, -np.interp(-z, depths, body.interfaces)))


def on_lines(body: Body, lines: Lines, wider: float = 1.0) -> Discretised:
    """Return a structured mesh on grid lines, moved onto the planes between layers."""
    x, y, z = lines
    planes = [-start for start, _ in body.strata[1:]]
    mesh = extrude(*_extend(body, (x, y, with_planes(z, planes)), wider))
    depths = -mesh.points[mesh.tets[:, :4], 2].mean(axis=1)
    mesh, materials = in_layers(mesh, body.strata, depths)
    return Discretised(
        mesh=mesh, materials=materials,
        drag=partial(layer_drag, body, layer_of(body, wider)) if has_layer(body) else None,
        support=partial(far_springs, body) if body.is_on_half_space else None,
    )  # fmt: skip


def grid_lines(body: Body, h: float) -> Lines:
    """Return grid lines along x, y and z through a body, fine where the focus travels."""
    along = Grading(radius=FINE_RADIUS, growth=1.4, coarsest=3 * h)
    x, y = (mirror_line(graded_axis(side / 2, h, along)) for side in (body.width, body.height))
    return x, y, -_depth_line(body, h)[::-1]


def slab_grid_lines(body: Body, h: float) -> Lines:
    """Return the grid lines of a body with those of any absorbing layer."""
    return _extend(body, grid_lines(body, h))


def _extend(body: Body, lines: Lines, wider: float = 1.0) -> Lines:
    """Grid lines through a body, with an absorbing layer at its absorbing ends."""
    if not has_layer(body):
        return lines
    layer, (x, y, z) = layer_of(body, wider), lines

    def beyond(line: Floats, end: str) -> Floats:
        return line[-1] + layer_line(layer, line) if end == "absorbing" else line[:0]

    def extended(line: Floats, low: str, high: str) -> Floats:
        before, after = beyond(-line[::-1], body.side(low)), beyond(line, body.side(high))
        return np.concatenate([-before[::-1], line, after])

    below = beyond(-z[::-1], body.base)
    return (
        extended(x, "left", "right"),
        extended(y, "front", "back"),
        np.concatenate([-below[::-1], z]),
    )


def _depth_line(body: Body, h: float) -> Floats:
    """Grid lines of a slab from its top downwards."""
    if body.depth < 2 * THIN_CELL:  # it may bend, which one layer shows less well
        h = min(h, body.depth / 2)
    down = Grading(radius=0.0, growth=1.25, coarsest=2 * h)
    return with_planes(graded_axis(body.depth, h, down), [start for start, _ in body.strata[1:]])


def cell_layers(body: Body, h: float) -> int:
    """Return the number of cells of h in m through the depth of a slab."""
    return len(_depth_line(body, h)) - 1


register(
    BodyKind(
        name="slab",
        presets={
            "skin-slab": {},  # effective homogeneous soft tissue of the palm on bone
            # Layered skin on bone, fitted to published waves; bench/layered_skin.py has the range
            # of each number. Epidermis of a palm 265 +- 51 um (optical coherence tomography,
            # PMC11137746), all skin 0.8 to 1.4 mm, hypodermis 2 to 6 mm. The depth of the bone is
            # an assumption within 10 to 25 mm.
            "palm-layers": {
                "depth": 0.025,
                "material": "muscle",
                "layers": (
                    Layer(thickness=0.27e-3, material="epidermis"),
                    Layer(thickness=1.0e-3, material="dermis"),
                    Layer(thickness=2.0e-3, material="fat"),
                ),
            },
            # Epidermis with stratum corneum of a forearm 75 +- 13 um (Sandby-Moller et al., Acta
            # Derm Venereol 83:410 (2003)). Dermis (1 to 1.5 mm), hypodermis (2 to 10 mm) and muscle
            # (10 to 20 mm) vary between people and are assumptions.
            "forearm-layers": {
                "depth": 0.020,
                "material": "forearm-muscle",
                "layers": (
                    Layer(thickness=0.075e-3, material="forearm-epidermis"),
                    Layer(thickness=1.2e-3, material="forearm-dermis"),
                    Layer(thickness=4.0e-3, material="forearm-hypodermis"),
                ),
            },
        },
        discretise=discretise,
        morph=morph,
        check_size=lambda body, h: check_cell_count(
            len(line) - 1 for line in slab_grid_lines(body, h)
        ),
        # At most two thirds of the standard deviation of the focal spot.
        default_size=lambda body: min(3e-3, max(body.depth / 2, THIN_CELL)),
        compliance=lambda body: layered(stack(body)),
        dispersion=stack_dispersion,
        named_sides=tuple(EDGES),
        is_layer=True,
        is_symmetric=True,
        conforming=True,
    )
)
