"""Extent of a body that a scene requires, its symmetry, its coat, and physics that is neglected."""

from dataclasses import replace

import numpy as np

from fem.coat import Coat
from simple_model.load.focus import spot_width
from skinwave.bodies.analytic import is_flat_layer
from skinwave.bodies.coat import AT, layer_name, thicknesses
from skinwave.bodies.coat import coat as coat_of
from skinwave.bodies.mounting import FRAME
from skinwave.bodies.sheet import air_mass
from skinwave.models.plate_modes import middle_compliance, relative_modulus
from skinwave.models.symmetry import mirrored_axes
from skinwave.planning.estimates import FAR, absorbed_returned, mean_gain, spot_scale
from skinwave.planning.records import PlanRow
from skinwave.scene.scene import Body, Scene

STIFF = 30.0  # times the modulus below, from where the error of a coat is stated
LOWEST = 20.0  # Hz at which air is estimated where no line is higher


def symmetry(scene: Scene) -> str:
    """Symmetry axes: across their middle planes the load is its own mirror image at all times."""
    if not isinstance(scene.pressure.profile, str):  # which may have no symmetry
        return ""
    path = scene.tacton.trajectory
    path_points = path.at_phase(np.zeros(1)) if path.is_static else path.outline
    return "".join(
        axis
        for axis, x in zip("xy", path_points.T, strict=True)
        if np.abs(x).max() < 1e-9 and axis in mirrored_axes(scene.body, scene.reading, scene.load)
    )


def within_reflections(
    scene: Scene, tolerance: float, highest: float
) -> tuple[Body, list[PlanRow]]:
    """Extent of the body out to where reflections are negligible.

    Only absorbing sides are moved inwards: reflections from others belong to the response.

    Parameters
    ----------
    scene : Scene
    tolerance : relative error that is asked for
    highest : Hz, of the lines that count

    Returns
    -------
    Body, and the reason if it is not all of the scene's
    """
    body = scene.body
    if not is_flat_layer(body) or (body.base, body.sides) != ("clamped", "absorbing"):
        return body, []
    half = np.array([body.width, body.height]) / 2
    cut = half.copy()
    for axis in (0, 1):
        alone = np.where(np.arange(2) == axis, half, FAR)
        for shorter in np.arange(0.03, min(0.8 * half[axis], FAR), 0.01):
            alone[axis] = shorter
            if absorbed_returned(scene, alone, highest) <= tolerance / 10:
                cut[axis] = shorter
                break
    if (cut == half).all():
        return body, []
    width, height = map(float, 2 * cut)
    row = PlanRow(
        what="extent",
        value=f"{1e3 * width:.0f} x {1e3 * height:.0f} mm",
        reason=f"reflections from further away are below {10 * tolerance:.2g} %; absorbing "
        f"sides there leave out {100 * (1 - cut.prod() / half.prod()):.0f} % of the body",
    )
    return replace(body, width=width, height=height), [row]


def coat_rows(body: Body, h: float) -> list[PlanRow]:
    """Top layers that are a coat, those that have elements, and why."""
    coat = coat_of(body, h)
    if coat is None:
        return _volume_rows(body, h, 0)
    return [
        PlanRow(
            what="coat",
            value=" and ".join(
                f"{layer_name(body, solid)} of {1e3 * thickness:g} mm"
                for solid, thickness in zip(coat.materials, coat.thicknesses, strict=True)
            ),
            reason=f"a Kirchhoff shell on the surface: thinner than half an element of "
            f"{1e3 * h:.3g} mm, and than a tenth of a shear wavelength at {AT:g} Hz"
            + _of_stiffness(body, coat),
        ),
        *_volume_rows(body, h, len(coat.materials)),
    ]


def _volume_rows(body: Body, h: float, coated: int) -> list[PlanRow]:
    """Layers below a coat of so many, which have elements, and why."""
    layers = list(zip(body.strata, thicknesses(body.strata), strict=True))[coated:-1]
    if not layers:
        return []
    why = "those of a slab are as flat as its layers are thin"
    return [
        PlanRow(
            what="layers",
            value=" and ".join(f"{layer_name(body, m)} of {1e3 * t:g} mm" for (_, m), t in layers),
            reason="elements of their own: "
            + (why if body.of_kind.conforming else f"half an element of {1e3 * h:.3g} mm or more"),
        )
    ]


def _of_stiffness(body: Body, coat: Coat) -> str:
    """Accuracy of a coat that is far stiffer than what it covers."""
    below = body.strata[len(coat.materials)][1].shear_modulus
    ratio = max(solid.shear_modulus for solid in coat.materials) / below
    if ratio < STIFF:
        return ""
    return (
        f"; it is {ratio:.0f} times as stiff as what it covers, and of 100 times the error is at "
        f"most 3 to 15 % up to {AT:g} Hz, the more the thicker (0.1 to 1 mm)"
    )


def left_out(scene: Scene, highest: float) -> list[PlanRow]:
    """Neglected physics of a sheet with an estimate of each: air, if it is in vacuum, and
    stretching; with air, its added mass.
    """
    body = scene.body
    if not body.of_kind.is_plate:
        return []
    middle = max(highest / 2, LOWEST)
    air = air_mass(body, middle) / body.mass_per_area
    sag = mean_sag(scene) / body.depth
    shift = 100 * (1 - 1 / np.sqrt(1 + air))
    lowered = f"resonances lower by {shift:.1f} %, by 2 rho_air/k at {middle:.0f} Hz"
    return [
        PlanRow(
            what="air" if body.air else "left out: air",
            value=f"+{100 * air:.0f} % mass",
            reason=f"{lowered}; each wavenumber has its own, as air = true asks"
            if body.air
            else f"{lowered}: take the response as that of a sheet in vacuum, or set air = true in "
            "[body]",
        ),
        PlanRow(
            what="left out: stretching",
            value=f"sag {sag:.1f} thicknesses",
            reason="a linear sheet; a real one stiffens beyond about half a thickness"
            if sag > 0.5
            else "the mean deflection is small",
        ),
    ]


def _mean_force(scene: Scene) -> float:
    """Mean force in N that presses on the middle of a flat body."""
    if scene.load.moving.is_plain:
        return float(2 * np.pi * spot_width(scene.pressure.height) ** 2 * mean_gain(scene))
    downwards = -scene.load.tractions(np.array([[0.0, 0.0, 1.0]]))[:, 0, 2]
    forces = [2 * np.pi * spot_scale(each) ** 2 * mean_gain(replace(scene, pressure=each))
              for each in scene.loads]  # fmt: skip
    return float(downwards @ forces)


def mean_sag(scene: Scene) -> float:
    """Linear deflection in metre of a held sheet's middle under its mean load, if applied there.

    0.0056 F a^2 / D of a clamped square (Timoshenko and Woinowsky-Krieger 1959, table 37); of other
    supports, and of orthotropic or stretched sheets, by the modes of the plate.
    """
    body = scene.body
    force = _mean_force(scene)
    if body.mounting == FRAME and body.solid.orthotropy is None:
        at_rest = relative_modulus(body, 0.0).real * body.bending_stiffness
        sag = 0.0056 * min(body.width, body.height) ** 2 / at_rest
    else:
        sag = middle_compliance(body)
    return float(force * sag)
