"""Thin sheet, which bends: paper in a frame. Its waves, its air and its mesh."""

from dataclasses import replace
from functools import partial
from math import inf, pi
from typing import Any

import numpy as np
from scipy import sparse

from fem.air import Air, air_around
from fem.finite_strain import Membrane, shell_stiffness
from fem.plane_stiffness import Tension
from meshes import TetMesh, middle_plane, sheet
from meshes.shapes.structured import check_cell_count, round_up
from simple_model.layers.compliance import AIR_DENSITY, Compliance, thin_sheet
from simple_model.layers.dispersion import DispersionCurves, bending_wavenumbers, sheet_curves
from simple_model.layers.material import Material
from skinwave.bodies.body import Body, BodyKind, register
from skinwave.bodies.build import Build
from skinwave.bodies.discretised import Discretised
from skinwave.bodies.supports import Mounting, clip_lines, supported_components
from skinwave.typing import Bools, Floats, Ints

PAPER = {"depth": 1e-4, "base": "free", "sides": "clamped"}
PAPER_SIZE = {"material": "paper-grain", "air": "free", **PAPER}


def discretise(body: Body, h: float, thickness: float | None = None) -> Discretised:
    """Return the mesh of a thicker sheet of the same bending stiffness and mass per area."""
    thickness = max(body.depth, thickness or equivalent(body))
    planes = [clip_lines(body.mounting, *each) for each in enumerate((body.width, body.height))]
    return Discretised(
        mesh=sheet(body.width, body.height, thickness, h, planes=planes),
        materials=[bending_equivalent(body.solid, body.depth / thickness)],
        held=partial(_fixed_nodes, body) if body.sides == "clamped" else None,
        tension=tension(body),
        stiffener=partial(_curl, body) if body.mounting.is_curled else None,
    )


def _fixed_nodes(body: Body, mesh: TetMesh) -> Bools:
    """Fixed components (n, 3) of nodes; a tilted sheet is clamped in all components."""
    components = supported_components(body.mounting, mesh)
    return components | (components.any(axis=1, keepdims=True) & body.placement.is_tilted)


def equivalent(body: Body) -> float:
    """Return the thickness in m of the mesh, small compared with the sheet and its clips.

    A sheet of equal bending stiffness and mass per area bends alike, and thick elements are far
    more accurate because thin ones lock. With a tenth of the radius of clips, frequencies are
    within 0.15 % of those of a thin plate.
    """
    least = 0.01 * min(body.width, body.height)
    reach = body.mounting.clip_radius if body.mounting.clips else 0.0
    return min(least, 0.1 * reach) if reach else least


def _curl(body: Body, mesh: TetMesh) -> sparse.csr_array:
    """Membrane stiffness of a sheet that is curved at rest."""
    middle = Membrane(triangles=middle_plane(mesh), thickness=body.depth, material=body.solid)
    rise = np.array([body.mounting.curl_x, body.mounting.curl_y])
    curvature = -8 * rise / np.array([body.width, body.height]) ** 2
    meshed = (body.depth / float(np.ptp(mesh.points[:, 2]))) ** 2  # as for `bending_equivalent`
    return shell_stiffness(mesh, middle, lambda at: curvature * at, meshed=meshed)


def tension(body: Body) -> Tension | None:
    """Return the tension of a sheet, or None."""
    if not body.mounting.is_stretched:
        return None
    return Tension(x=body.mounting.tension_x, y=body.mounting.tension_y)


def bending_equivalent(material: Material, ratio: float) -> Material:
    """Return the material of a thicker sheet of the same bending stiffness and mass per area.

    `ratio` is the original thickness over the equivalent one. Bending stiffness scales with E d^3,
    mass per area with rho d. Valid for linear bending only.
    """
    return replace(material.scaled(modulus=ratio**3), density=material.density * ratio)


def check_isotropic(body: Body) -> None:
    """Refuse a sheet whose waves depend on their direction."""
    x, y = body.mounting.tension_x, body.mounting.tension_y
    if body.solid.orthotropy is not None or x != y or body.mounting.is_curled:
        reason = "orthotropic" if x == y else f"stretched by {x:g} and {y:g} N/m along x and y"
        reason = "curled" if body.mounting.is_curled else reason
        raise ValueError(
            "the wavenumber integral needs equal waves in all directions, but this sheet is "
            f"{reason}; use a flat sheet of an isotropic material with equal tensions"
        )


def compliance(body: Body, **correction: Any) -> Compliance:
    """Return the compliance of an infinite sheet, with properties averaged over directions, and
    with the `correction` of `thin_sheet`, if one is given.
    """
    return thin_sheet(
        body.solid, body.depth, air_density=AIR_DENSITY if body.air else 0.0,
        tension=body.mounting.mean_tension, **correction,
    )  # fmt: skip


def dispersion(body: Body, frequencies: Floats, most: int) -> DispersionCurves:
    """Return the dispersion curves of an infinite sheet: its bending wave and near field."""
    check_isotropic(body)
    return sheet_curves(
        body.solid, body.depth, frequencies, air_density=AIR_DENSITY if body.air else 0.0,
        tension=body.mounting.mean_tension,
    )  # fmt: skip


def bending_wavenumber(body: Body, frequency: float) -> float:
    """Return the bending wavenumber in rad/m of an infinite sheet at a frequency in Hz above 0,
    with stiffness and tension averaged over the directions of an orthotropic sheet.
    """
    w, air = 2 * pi * frequency, 2 * AIR_DENSITY if body.air else 0.0
    D, mass, air = np.array([[body.bending_stiffness], [body.mass_per_area * w**2], [air * w**2]])
    return float(bending_wavenumbers(D + 0j, body.mounting.mean_tension, mass, air)[0, 0].real)


def air_mass(body: Body, frequency: float) -> float:
    """Return the added mass 2 rho / k, kg/m2, of the air on both sides at a frequency in Hz.

    Junger and Feit, Sound, Structures, and Their Interaction (1986), section 5.11.
    """
    return 2 * AIR_DENSITY / bending_wavenumber(body, frequency)


def frame_in_air(body: Body) -> float:
    """Return the width in m of what separates the air on both sides around a sheet."""
    if body.air == "baffle":
        return inf
    return body.mounting.frame_width if body.mounting.is_frame else 0.0


def refuse_unheld_air(body: Body) -> None:
    """Refuse air around a sheet that is not held by its edges."""
    if body.air and body.sides != "clamped":
        raise ValueError(
            f"finite elements model air around a sheet that is held, not with {body.sides} sides; "
            "remove its air"
        )


def air(body: Body, build: Build, free: Ints) -> Air | None:
    """Return the air around a meshed sheet, or None in vacuum."""
    if not body.air:
        return None
    refuse_unheld_air(body)
    return air_around(
        build.mesh, free, AIR_DENSITY, frame=frame_in_air(body),
        axes=body.placement.rotation.T[:2], mirrored=build.symmetry,
    )  # fmt: skip


register(
    BodyKind(
        name="sheet",
        keys=("air", "mounting"),
        # The first supplies missing keys of scenes. A sizes have air and their grain along x.
        # docs/sheets.md explains the numbers of "paper-sheet".
        presets={
            "paper-sheet-loose": {"material": "paper", **PAPER},
            "paper-sheet": {
                "width": 0.148, "height": 0.105, **PAPER_SIZE, "depth": 107e-3 / 800.0,
                "mounting": Mounting(tension_x=49.0, tension_y=15.0),
            },
            "a4-sheet": {"width": 0.297, "height": 0.210, **PAPER_SIZE},
            "a5-sheet": {"width": 0.210, "height": 0.148, **PAPER_SIZE},
            "a6-sheet": {"width": 0.148, "height": 0.105, **PAPER_SIZE},
        },
        discretise=discretise,
        equivalent=equivalent,
        check_size=lambda body, h: check_cell_count(
            2 * max(1, round_up(side / (2 * h))) for side in (body.width, body.height)
        ),
        # The first natural frequency is within 0.1 %, the deflection within 0.6 %.
        default_size=lambda body: min(body.width, body.height) / 60,
        interactive_size=2.5e-3,
        compliance=compliance,
        dispersion=dispersion,
        wave_speed=lambda body, frequency: 2 * pi * frequency / bending_wavenumber(body, frequency),
        is_plate=True,
        is_symmetric=True,
        may_be_layered=False,
        conforming=True,
    )
)  # fmt: skip
