"""From a body to its mesh: element sizes, the material that the mesh is made of, its ends."""

from dataclasses import dataclass, replace
from math import isfinite

import numpy as np

from fem.materials import Material
from meshes import Grading, TetMesh, block, graded_axis, half, sheet
from meshes.structured import check_size, round_up
from meshes.tetmesh import Ints
from simple_model.flat_body import Compliance, half_space, slab, thin_sheet
from skinwave.scene import Body

SLAB_CELL = 3e-3  # m: two thirds of the spot's standard deviation
FINE_RADIUS, GROWTH, COARSEST = 30e-3, 1.25, 2.0  # m: the palm-sized paths; cells; of h
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
    symmetry: str = ""


def build(
    body: Body, h: float | None = None, symmetry: str = "", thickness: float | None = None
) -> Build:
    """Mesh a flat body with cells of h in metre, or as fine as the scene set needs.

    Parameters
    ----------
    symmetry : axes, of "xy", across whose middle plane the load is its own mirror image: only the
        part with positive coordinates is meshed, and slides along these planes
    thickness : of the equivalent of a sheet in metre, `SHEET_THICKNESS` of its shorter side if not
        given, and no less than the sheet's own

    Raises
    ------
    ValueError
        If the body is "none", or would have too many unknowns.
    """
    size = _checked(body, h or default_size(body))
    if body.kind == "sheet":
        thickness = thickness or SHEET_THICKNESS * min(body.width, body.height)
        thickness = max(body.depth, thickness)
        mesh = sheet(body.width, body.height, thickness, size)
        material = bending_equivalent(body.solid, body.depth / thickness)
    else:
        mesh = block((body.width, body.height, body.depth), size, grading=_grading(size))
        material = body.solid
    ends = {"bottom": body.base, "sides": body.sides}
    fixed = {name: "xyz" for name, end in ends.items() if end == "clamped"}
    for axis in symmetry:
        mesh = half(mesh, axis)
        fixed[f"mirror_{axis}"] = axis
    leaky = [mesh.facets[name] for name, end in ends.items() if end == "absorbing"]
    return Build(
        mesh=mesh,
        material=material,
        fixed=fixed,
        absorbing=np.vstack(leaky) if leaky else None,
        symmetry=symmetry,
    )


def cells(body: Body, h: float, symmetry: str = "") -> tuple[int, int, int]:
    """How many cells of h in metre `build` makes along x, y and downwards.

    Raises
    ------
    ValueError
        If there are none, they are larger than the body or more than can be solved for.
    """
    sides, h = (body.width, body.height), _checked(body, h)
    if body.kind == "sheet":
        halves = [max(1, round_up(side / (2 * h))) for side in sides]
        layers = 1
    else:
        halves = [len(graded_axis(side / 2, h, _grading(h))) - 1 for side in sides]
        layers = len(graded_axis(body.depth, h, replace(_grading(h), radius=0.0))) - 1
    check_size((2 * halves[0], 2 * halves[1], layers))
    x, y = (n if axis in symmetry else 2 * n for axis, n in zip("xy", halves, strict=True))
    return x, y, layers


def _checked(body: Body, h: float) -> float:
    if body.kind == "none":
        raise ValueError("body kind 'none' has nothing to mesh; choose a sheet or a slab")
    if not isfinite(body.depth):
        raise ValueError("depth_mm = inf has no mesh; use --model flat-body or a finite depth")
    longest = max(body.width, body.height, body.depth)
    if h > longest:
        raise ValueError(
            f"elements of {1e3 * h:g} mm are larger than the body, whose longest side is "
            f"{1e3 * longest:g} mm; take smaller ones"
        )
    return h


def _grading(h: float) -> Grading:
    return Grading(radius=FINE_RADIUS, growth=GROWTH, coarsest=COARSEST * h)


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
