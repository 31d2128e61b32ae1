"""A kind of body from outside: a cylinder of silicone on a base, 80 mm wide and 20 mm high."""

import numpy as np
from scipy.spatial import Delaunay

import meshes
from meshes import TetMesh
from simple_model.layers.material import Material
from skinwave.bodies import Body, BodyKind, register
from skinwave.bodies.discretised import Discretised, in_layers

SILICONE = Material(density=1070, shear_modulus=25e3, poisson=0.4999, viscosity=4)
SHORT = 1e-9  # of the radius


def check(body: Body) -> None:
    if body.width != body.height:
        raise ValueError(
            f"a cylinder is {1e3 * body.width:g} mm wide along x and {1e3 * body.height:g} mm "
            "along y; give it one diameter"
        )


def disc(body: Body, h: float) -> TetMesh:
    rings = max(2, round(body.width / 2 / h))
    radii = np.repeat(np.arange(rings + 1), [1, *(6 * np.arange(1, rings + 1))]) / rings
    turns = np.concatenate([[0.0], *(np.arange(6 * k) / (6 * k) for k in range(1, rings + 1))])
    plane = body.width / 2 * radii[:, None] * np.column_stack(
        [np.cos(2 * np.pi * turns), np.sin(2 * np.pi * turns)]
    )  # fmt: skip
    triangles = Delaunay(plane).simplices
    p, q, r = np.moveaxis(plane[triangles], 1, 0)
    area = (q[:, 0] - p[:, 0]) * (r[:, 1] - p[:, 1]) - (q[:, 1] - p[:, 1]) * (r[:, 0] - p[:, 0])
    triangles = triangles[abs(area) > SHORT * body.width**2]
    z = np.linspace(-body.depth, 0.0, max(2, round(body.depth / h)) + 1)
    mesh = meshes.extrude_plane(plane, triangles, z)
    return meshes.tag_boundary(
        mesh,
        bottom=lambda centroids, normals: normals[:, 2] < -0.9,
        sides=lambda centroids, normals: abs(normals[:, 2]) < 0.1,
    )


def discretise(body: Body, h: float) -> Discretised:
    mesh = disc(body, h)
    depths = -mesh.points[mesh.tets[:, :4], 2].mean(axis=1)
    mesh, materials = in_layers(mesh, body.strata, depths)
    return Discretised(mesh=mesh, materials=materials)


CYLINDER = register(
    BodyKind(
        name="cylinder",
        presets={
            "silicone-cylinder": {
                "material": SILICONE,
                "width": 0.08,
                "height": 0.08,
                "depth": 0.02,
                "sides": "free",
            }
        },
        check=check,
        words=lambda body: f"cylinder of {1e3 * body.width:g} x {1e3 * body.depth:g} mm",
        discretise=discretise,
        default_size=lambda body: min(body.width / 20, body.depth / 4),
    )
)
