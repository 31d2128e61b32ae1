"""Rows of a plan: symmetry, mesh, layers, reduction, neglected physics of a sheet, and cost."""

import numpy as np

from simple_model import Effort
from simple_model.numbers import EN_DASH, change_text, percent, significant
from skinwave.bodies.sheet import air_mass
from skinwave.bodies.sizes import COAT_FREQUENCY, coat, layer_name, stratum_thicknesses
from skinwave.models import Cost
from skinwave.models.reduced import reduction_tolerance
from skinwave.models.symmetry import axes_of_probes, mirrored_axes
from skinwave.planning.deflection import is_small, mean_sag
from skinwave.planning.record import PlanRow
from skinwave.planning.refinement import Refined
from skinwave.scene.scene import Body, Scene


def element_rows(
    scene: Scene, tolerance: float, axes: str, mesh: Refined, highest: float, h: float | None,
    band: float,
) -> list[PlanRow]:  # fmt: skip
    """Return the rows of elements: symmetry `axes`, size h, and a `band` and a line in Hz."""
    effort = mesh.prepared.effort
    return [
        _symmetry_row(scene, axes),
        _size_row(mesh, tolerance, h),
        *coat_rows(scene.body, mesh.h),
        PlanRow(
            what="reduction",
            value=f"{effort.reduced_dofs} dofs, error {effort.estimate:.0e} up to {band:.0f} Hz",
            reason=f"reduced to an error of {reduction_tolerance(tolerance):.1g}, which costs "
            "little",
        ),
        *neglected_rows(scene, highest),
    ]


def cost_row(cost: Cost, effort: Effort | None) -> PlanRow:
    """Return the row of the cost of a response, with the effort of the body if it is reduced."""
    reason = "predicted for the first response, to within a factor of 2"
    if effort:
        spent = sum(effort.seconds.values())
        cached = "" if "factorise and reduce" in effort.seconds else " (read from the cache)"
        reason = (
            f"for the last mesh{cached}; each further Tacton on this body takes "
            f"{significant(cost.seconds - spent, 1)} s"
        )
    if cost.cure:
        reason += f"; to shorten it, {cost.cure}"
    value = f"{significant(cost.seconds, 2)} s, {cost.memory / 2**30:.1f} GiB"
    return PlanRow(what="cost", value=value, reason=reason)


def _symmetry_row(scene: Scene, axes: str) -> PlanRow:
    among = mirrored_axes(scene.body, scene.reading, scene.load)
    on_plane = [a for a in axes_of_probes(scene.probe_points, among) if a not in axes]
    reasons = [f"the load is symmetric across {' and '.join(axes)} = 0"] if axes else []
    if on_plane:
        places = f"all probes lie on {' = '.join(on_plane)} = 0"
        reasons.append(f"{places}, where only the symmetric part of the motion counts")
    value = ("none", "half", "a quarter")[len(axes) + len(on_plane)]
    reason = "; ".join(reasons) or "the whole body is modelled"
    return PlanRow(what="symmetry", value=value, reason=reason)


def _size_row(mesh: Refined, tolerance: float, h: float | None) -> PlanRow:
    why = "the finest size that is tried"
    if h:
        why = "as requested"
    elif mesh.error <= tolerance:
        why = f"refined until the error is below {100 * tolerance:g} %"
    other = f"by comparison with elements of {1e3 * mesh.compared:.2f} mm"
    reason = f"{why}; mesh error {change_text(mesh.error)}, {other}"
    if np.isinf(mesh.error):
        reason = "the only mesh of the file, so its error is unknown"
    size = f"{1e3 * mesh.h:.2f} mm, {mesh.prepared.effort.dofs:,} dofs"
    return PlanRow(what="element size", value=size, reason=reason)


def coat_rows(body: Body, h: float, stiff: float = 30.0) -> list[PlanRow]:
    """Return the rows of the top layers: those in a coat, and those with elements. The error of a
    coat is stated if it is `stiff` times as stiff as the layer below.
    """
    shell = coat(body, h)
    coated = len(shell.materials) if shell else 0
    layers = list(zip(body.strata, stratum_thicknesses(body.strata), strict=True))[:-1]
    names = [f"{layer_name(body, solid)} of {1e3 * t:g} mm" for (_, solid), t in layers]
    rows = []
    if shell:
        reason = (
            f"a Kirchhoff shell on the surface, because it is thinner than half an element of "
            f"{1e3 * h:.3g} mm and than a tenth of a shear wavelength at {COAT_FREQUENCY:g} Hz"
        )
        below = body.strata[coated][1].shear_modulus
        ratio = max(solid.shear_modulus for solid in shell.materials) / below
        if ratio >= stiff:
            reason += (
                f"; it is {significant(ratio, 2)} times as stiff as the layer below: at 100 times, "
                f"the error is at most 3{EN_DASH}15 % up to {COAT_FREQUENCY:g} Hz for thicknesses "
                f"of 0.1{EN_DASH}1 mm"
            )
        rows.append(PlanRow(what="coat", value=" and ".join(names[:coated]), reason=reason))
    if names[coated:]:
        reason = "meshed with their own elements; elements may be as flat as layers"
        if not body.of_kind.conforming:
            thick = f"they are at least half an element of {1e3 * h:.3g} mm thick"
            reason = f"meshed with their own elements; {thick}"
        rows.append(PlanRow(what="layers", value=" and ".join(names[coated:]), reason=reason))
    return rows


def neglected_rows(
    scene: Scene, highest: float, stretches: bool = False, lowest: float = 20.0
) -> list[PlanRow]:
    """Return the row of air around a sheet, and that of stretching if the model leaves it out.

    Air is estimated at half the `highest` line in Hz of the load, and at `lowest` or above.
    """
    body = scene.body
    if not body.of_kind.is_plate:
        return []
    middle = max(highest / 2, lowest)
    air = air_mass(body, middle) / body.mass_per_area
    sag = mean_sag(scene) / body.depth
    lower = f"resonances are {percent(1 - 1 / np.sqrt(1 + air))} lower near {middle:.0f} Hz"
    rows = [
        PlanRow(
            what="air" if body.air else "left out: air",
            value=f"added mass {significant(air, 2)} times the mass of the sheet",
            reason=f"{lower}; the model uses the added mass of each wavenumber"
            if body.air
            else f'{lower} in air; set air = "free" in [body] to include it',
        ),
        PlanRow(
            what="left out: stretching",
            value=f"sag of {significant(sag, 2)} thicknesses",
            reason="a linear sheet; a real one stiffens above about half a thickness"
            if not is_small(sag)
            else "the mean deflection is small",
        ),
    ]
    return rows[: 1 if stretches else 2]
