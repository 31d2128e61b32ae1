"""What a scene requires: the mesh, the material that the mesh is made of, and the time step."""

from dataclasses import dataclass, replace

import numpy as np

from fem.materials import Material
from meshes import Grading, TetMesh, block, sheet
from meshes.tetmesh import Ints
from skinwave.scene import Body

SAMPLE_RATE = 10_000.0  # Hz of every response: five times the highest line that matters
# Hz of the load given to the reduced model: linear between two samples, its lines at 200 Hz
# come out 0.03 % low, at 600 Hz 0.3 %.
LOAD_RATE = 20_000.0
TRANSIENT_RATE = 20_000.0  # Hz of the full time stepping: 0.3 % at 600 Hz
BAND = 1000.0  # Hz up to which the reduced model must be right
REDUCTION_TOLERANCE = 1e-3

SLAB_CELL = 3e-3  # m: two thirds of the spot's standard deviation
SLAB_GRADING = Grading(radius=30e-3, growth=1.25, coarsest=6e-3)  # the palm-sized paths
SHEET_CELLS = 44  # along the shorter side: f1 within 0.5 %, deflection within 1 %
# A sheet bends like one of this relative thickness with the same bending stiffness and mass per
# area, and the fatter elements are far more accurate: thin ones lock.
SHEET_THICKNESS = 0.01


@dataclass(frozen=True, kw_only=True, eq=False)
class Build:
    """How a body is meshed: arguments of `fem.assemble`."""

    mesh: TetMesh
    material: Material
    fixed: dict[str, str]
    absorbing: Ints | None


def build(body: Body, h: float | None = None) -> Build:
    """Mesh a flat body with cells of h in metre, or as fine as the scene set needs.

    Raises
    ------
    ValueError
        If the body is "none".
    """
    if body.kind == "none":
        raise ValueError("body kind 'none' has nothing to mesh; choose a sheet or a slab")
    if not np.isfinite(body.depth):
        raise ValueError("depth_mm = inf has no mesh; use --model flat-body or a finite depth")
    if body.kind == "sheet":
        shorter = min(body.width, body.height)
        thickness = max(body.depth, SHEET_THICKNESS * shorter)
        mesh = sheet(body.width, body.height, thickness, h or shorter / SHEET_CELLS)
        material = bending_equivalent(body.solid, body.depth / thickness)
    else:
        size = h or min(SLAB_CELL, body.depth / 2)
        mesh = block((body.width, body.height, body.depth), size, grading=SLAB_GRADING)
        material = body.solid
    ends = {"bottom": body.base, "sides": body.sides}
    leaky = [mesh.facets[name] for name, end in ends.items() if end == "absorbing"]
    return Build(
        mesh=mesh,
        material=material,
        fixed={name: "xyz" for name, end in ends.items() if end == "clamped"},
        absorbing=np.vstack(leaky) if leaky else None,
    )


def bending_equivalent(material: Material, ratio: float) -> Material:
    """The material of a thicker sheet that bends and weighs the same; ratio of the thicknesses.

    Bending stiffness goes with E d^3, mass per area with rho d. Right for linear bending only.
    """
    return replace(
        material,
        density=material.density * ratio,
        shear_modulus=material.shear_modulus * ratio**3,
        viscosity=material.viscosity * ratio**3,
    )
