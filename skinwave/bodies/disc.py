"""Disc: a cylinder on its base, such as silicone that represents skin."""

from dataclasses import replace

import numpy as np

from meshes import TetMesh
from meshes.shapes.structured import disc
from skinwave.bodies.body import Body, BodyKind, register
from skinwave.bodies.discretised import Discretise, Discretised, in_layers
from skinwave.bodies.slab import THIN_CELL


def check(body: Body) -> None:
    """Refuse a disc that is not round."""
    if body.width != body.height:
        raise ValueError(
            f"a disc is {1e3 * body.width:g} mm wide along x but {1e3 * body.height:g} mm along "
            "y; give the same diameter as size_x_mm and size_y_mm"
        )


def discretise(body: Body, h: float) -> Discretised:
    """Return ten-node tetrahedra of h in m at most, in equal rings and in the body's layers."""
    return _in_strata(body, disc(body.width, body.depth, h, body.interfaces[1:-1]))


def morph(thinnest: Body, thickest: Body, h: float) -> Discretise:
    """Return a function that meshes another disc by stretching the layers of the thickest one."""
    mesh = discretise(thickest, h).mesh

    def moved(body: Body, h: float) -> Discretised:
        points = mesh.points.copy()
        points[:, 2] = -np.interp(-points[:, 2], thickest.interfaces, body.interfaces)
        return _in_strata(body, replace(mesh, points=points, unmoved=mesh.points))

    return moved


def _in_strata(body: Body, mesh: TetMesh) -> Discretised:
    depths = -mesh.points[mesh.tets[:, :4], 2].mean(axis=1)
    mesh, materials = in_layers(mesh, body.strata, depths)
    return Discretised(mesh=mesh, materials=materials)


register(
    BodyKind(
        name="disc",
        presets={
            "silicone-disc": {
                "material": "ecoflex", "width": 0.08, "height": 0.08, "depth": 0.02,
                "sides": "free",
            }
        },
        check=check,
        words=lambda body: f"disc of {1e3 * body.width:g} x {1e3 * body.depth:g} mm",
        discretise=discretise,
        morph=morph,
        # Thin discs have two layers of wider elements.
        default_size=lambda body: min(body.width / 20, max(body.depth / 4, THIN_CELL)),
        is_symmetric=True,
        conforming=True,
    )
)  # fmt: skip
