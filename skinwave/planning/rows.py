"""Rows of a plan: which mesh it takes, what is left out, and why."""

import numpy as np

from fem.coat import Coat
from skinwave.bodies.sheet import air_mass
from skinwave.bodies.sizes import AT, layer_name, thicknesses
from skinwave.bodies.sizes import coat as coat_of
from skinwave.models.meshed import axes_of_probes, mirrored_axes
from skinwave.models.reduced import BAND, reduction_tolerance
from skinwave.planning.left_out import mean_sag
from skinwave.planning.records import PlanRow
from skinwave.planning.refinement import Convergence, Refined
from skinwave.scene.scene import Body, Scene

STIFF = 30.0  # times the modulus below, from where the error of a coat is stated
LOWEST = 20.0  # Hz at which air is estimated where no line is higher


def element_rows(
    scene: Scene, tolerance: float, axes: str, found: Refined, highest: float, h: float | None
) -> list[PlanRow]:
    """Rows of symmetry, mesh, layers, reduction, neglected physics and cost: of a load that is its
    own mirror image across `axes`, lines up to the `highest` in Hz, and an element size h in metre
    if it was asked for.
    """
    effort = found.prepared.effort
    kept = "" if "factorise and reduce" in effort.seconds else ", which is cached"
    return [
        _symmetry_row(scene, axes),
        _size_row(found, tolerance, h),
        *coat_rows(scene.body, found.h),
        PlanRow(
            what="reduction",
            value=f"{effort.reduced_dofs} dofs, {effort.estimate:.0e} up to {BAND:.0f} Hz",
            reason=f"asked for {reduction_tolerance(tolerance):.1g}: it costs little",
        ),
        *left_out(scene, highest),
        PlanRow(
            what="cost",
            value=f"{sum(effort.seconds.values()):.1f} s, {effort.peak_memory / 2**30:.1f} GiB",
            reason=f"the last mesh{kept}; 0.05 s for each further Tacton on the same body",
        ),
    ]


def _symmetry_row(scene: Scene, axes: str) -> PlanRow:
    """Row of the part that symmetry of the load, and the places of probes, leave to be modelled."""
    among = mirrored_axes(scene.body, scene.reading, scene.load)
    seen = [a for a in axes_of_probes(scene.probe_points, among) if a not in axes]
    reasons = []
    if axes:
        reasons.append(f"the load is its own mirror image across {' and '.join(axes)} = 0")
    if seen:
        reasons.append(
            f"probes at {' = '.join(seen)} = 0 see the even part of the motion across it alone"
        )
    return PlanRow(
        what="symmetry",
        value=("none", "half", "a quarter")[len(axes) + len(seen)],
        reason="; ".join(reasons) or "all of the body is modelled",
    )


def _size_row(found: Refined, tolerance: float, h: float | None) -> PlanRow:
    return PlanRow(
        what="element size",
        value=f"{1e3 * found.h:.2f} mm, {found.prepared.effort.dofs:,} dofs",
        reason=f"{_why_size(found, tolerance, h)}: those of "
        f"{1e3 * found.compared:.2f} mm differ by so much that an error of "
        f"{100 * found.error:.2g} % is left"
        if found.convergence is not Convergence.SINGLE_MESH
        else "the file's own, without another to compare it with",
    )


def _why_size(found: Refined, tolerance: float, h: float | None) -> str:
    if h:
        return "as asked"
    if found.convergence is not Convergence.REACHED:
        return "the finest that is tried"
    return f"refined until less than {100 * tolerance:g} % is left"


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
