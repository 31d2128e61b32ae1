"""From a body to its mesh: element sizes, the material that the mesh is made of, its ends."""

from dataclasses import dataclass, replace
from math import isfinite

import numpy as np

from fem.materials import Material
from meshes import Grading, TetMesh, block, sheet
from meshes.tetmesh import Ints
from simple_model.flat_body import Compliance, half_space, slab, thin_sheet
from skinwave.scene import Body

SLAB_CELL = 3e-3  # m: two thirds of the spot's standard deviation
SLAB_GRADING = Grading(radius=30e-3, growth=1.25, coarsest=6e-3)  # the palm-sized paths
SHEET_CELLS = 60  # along the shorter side: f1 within 0.3 %, deflection within 0.6 %
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
    size = h or default_size(body)
    if body.kind == "sheet":
        thickness = max(body.depth, SHEET_THICKNESS * min(body.width, body.height))
        mesh = sheet(body.width, body.height, thickness, size)
        material = bending_equivalent(body.solid, body.depth / thickness)
    else:
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


def default_size(body: Body) -> float:
    """Element size in metre of a body whose user asks for none."""
    if body.kind == "sheet":
        return min(body.width, body.height) / SHEET_CELLS
    return min(SLAB_CELL, body.depth / 2)


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


def compliance(body: Body) -> Compliance:
    """How an endless body of the same section gives way; a sheet vibrates in vacuum.

    Raises
    ------
    ValueError
        If there is no body, or none that has exact waves.
    """
    solid = body.solid
    if body.kind == "sheet":
        return thin_sheet(
            bending_stiffness=solid.young * body.depth**3 / 12 / (1 - solid.poisson**2),
            mass_per_area=solid.density * body.depth,
            loss_factor=solid.loss_factor,
            viscous_lag=solid.viscosity / solid.shear_modulus,
            air_density=0.0,
        )
    if body.kind == "none" or (body.base != "clamped" and isfinite(body.depth)):
        raise ValueError(
            "flat-body answers a sheet, a slab on a clamped base, or depth_mm = inf; use fem"
        )
    values = {
        "density": solid.density,
        "shear_modulus": solid.shear_modulus,
        "poisson": solid.poisson,
        "viscosity": solid.viscosity,
        "loss_factor": solid.loss_factor,
    }
    return slab(**values, depth=body.depth) if isfinite(body.depth) else half_space(**values)
