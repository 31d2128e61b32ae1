"""A plan: its choices, each with a reason, what it leaves out, and warnings where a request is not
met, each with its number and its cure.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from fem.coat import Coat
from simple_model import Response
from simple_model.load.line_names import line_names
from simple_model.load.sampling import step
from skinwave.bodies.sheet import air_mass
from skinwave.bodies.sizes import AT, layer_name, thicknesses
from skinwave.bodies.sizes import coat as coat_of
from skinwave.models import Model, named
from skinwave.models.limits import cures_for, in_words
from skinwave.models.meshed import axes_of_probes, mirrored_axes
from skinwave.models.options import DEFAULT, SolveOptions
from skinwave.models.reduced import BAND, ReducedBody, reduction_tolerance
from skinwave.planning.estimates import mean_gain, spot_scale
from skinwave.planning.left_out import LINEAR, bent, mean_sag, stretching_left_out
from skinwave.planning.refinement import Convergence, Refined, enough
from skinwave.scene.scene import Body, Scene
from skinwave.system.drawn import drawn

STIFF = 30.0  # times the modulus below, from where the error of a coat is stated
LOWEST = 20.0  # Hz at which air is estimated where no line is higher
NONLINEAR = "plate-modes-nonlinear", "fem-nonlinear"  # the cheaper first
DENSITIES = 20.0, 23_000.0  # kg/m3 of solids, from foam to osmium
LEFT_OUT = 0.05  # of the strongest line of a load: weaker ones are left out without a warning


@dataclass(frozen=True, kw_only=True)
class PlanRow:
    """One decision of a plan, and its reason."""

    what: str
    value: str
    reason: str


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Plan of a simulation.

    `model`; the `body` that is modelled, and the axes of `symmetry` that it is halved across;
    element size `h` in metre (None without a mesh); the `highest` line in Hz that matters; the
    expected relative `error`; predicted `seconds` and bytes of `memory` of the first response;
    a reason for each; `warnings` where a request is not met; the reduced body, `prepared`, on the
    mesh that was found; and the `options` that it is for.
    """

    model: str
    body: Body
    symmetry: str = ""
    h: float | None = None
    highest: float = 0.0
    error: float = 0.0
    seconds: float = 0.1
    memory: float = 1e8
    rows: tuple[PlanRow, ...] = ()
    warnings: tuple[str, ...] = ()
    prepared: ReducedBody | None = field(default=None, repr=False)
    options: SolveOptions = field(default=DEFAULT, repr=False)

    def table(self) -> dict[str, Any]:
        """What JSON has of it: all but the reduced body and the options."""
        found = asdict(replace(self, prepared=None, options=DEFAULT))
        return {key: value for key, value in found.items() if key not in ("prepared", "options")}

    def __repr__(self) -> str:
        return drawn("notebook", "plan_line", self)

    def _repr_html_(self) -> str:
        return drawn("notebook", "plan_page", self)


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
    """Neglected physics of a sheet: stretching, and air; with air, its added mass."""
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


def of_ends_and_band(
    scene: Scene, at_ends: float, sudden: float, tolerance: float
) -> tuple[str, ...]:
    """Warnings of absorbing ends of a reduced body, and of motion above `BAND`."""
    return (
        *over_tolerance("the absorbing layer", at_ends, tolerance, "a larger body is"),
        *sudden_over_tolerance(scene, BAND, sudden, tolerance),
    )


def sudden_over_tolerance(
    scene: Scene, band: float, sudden: float, tolerance: float
) -> tuple[str, ...]:
    """Warning of motion above the band in Hz of a response, which it leaves out."""
    smooth = "a load that begins smoothly"
    cure = f"the displacement, or {smooth}," if scene.reading.record.rate else smooth
    what = f"the {scene.quantity} above {band:g} Hz"
    return over_tolerance(what, sudden, tolerance, f"{cure} is")


def of_elements(scene: Scene, h: float, error: float, tolerance: float) -> tuple[str, ...]:
    """Warnings of linear elements of h in metre, with their expected relative error or nan."""
    size = 1e3 * enough(scene.body, h, error, tolerance)
    return (
        *error_unknown(error),
        *rigid_body_drift(scene),
        *over_tolerance(
            f"elements of {1e3 * h:.3g} mm", error, tolerance, f"about {size:.2g} mm is"
        ),
        *under_resolved(h, spot_scale(scene.pressure)),
    )


def of_stretching(scene: Scene, response: Response, tolerance: float) -> tuple[str, ...]:
    """Warning of a linear model of a sheet that deflects or stretches too much."""
    model = named(response.model)
    if model.is_nonlinear or not response.record.of_body:
        return ()
    factor, left = bent(scene, response), stretching_left_out(scene, model, tolerance)
    if factor <= LINEAR and left <= tolerance:
        return ()
    makers = [cures_for(scene, named(name)) for name in NONLINEAR] if scene.body.is_held else []
    cures = next(filter(None, makers), [])
    cure = in_words(cures, "") if cures else "take a thicker sheet or a lower pressure"
    change = f"changes its motion by about {100 * left:.2g} %" if left else "is left out"
    return (
        f"this sheet deflects {factor:.2g} times its thickness, and its stretching {change}; "
        f"{cure}",
    )


def response_warnings(
    scene: Scene, response: Response, predicted: float, tolerance: float
) -> tuple[str, ...]:
    """Warnings of any response in addition to those of its plan. `predicted` is the relative error
    that the plan or the mesh gave.
    """
    return (
        *beyond_prediction(scene, response, predicted, tolerance),
        *of_stretching(scene, response, tolerance),
        *beyond_sampling(scene, response),
        *implausible(scene),
    )


def implausible(scene: Scene) -> tuple[str, ...]:
    """Warnings of a density that no solid has, and of a probe that is given twice."""
    lightest, heaviest = DENSITIES
    odd = sorted({solid.density for solid in scene.body.solids
                  if not lightest <= solid.density <= heaviest})  # fmt: skip
    found = [
        f"density_kg_m3 = {density:g} is that of no solid, {lightest:g} to {heaviest:g}; "
        "give it in kg/m3"
        for density in odd
        if scene.body.of_kind.discretise
    ]
    places = [(*probe, depth) for probe, depth in zip(scene.probes, scene.depths, strict=True)]
    for x, y, _ in sorted({place for place in places if places.count(place) > 1}):
        found.append(f"points_mm has ({1e3 * x:g}, {1e3 * y:g}) mm more than once; leave one out")
    return tuple(found)


def beyond_sampling(scene: Scene, response: Response) -> tuple[str, ...]:
    """Warning of lines of the load that the response leaves out: above half its sampling rate."""
    lines, highest = line_names(scene.pressure, LEFT_OUT), 0.5 / step(response.times)
    above = np.flatnonzero(lines.frequencies >= highest)
    if not len(above):
        return ()
    f, strongest = lines.frequencies[above], above[np.argmax(lines.strengths[above])]
    others = f" and {len(above) - 1} more" if len(above) > 1 else ""
    return (
        f"the load's lines above {highest:.4g} Hz, half the sampling rate, are left out: "
        f"{lines.names[strongest]} at {lines.frequencies[strongest]:.4g} Hz{others}; give times in "
        f"steps below {500 / f.max():.2g} ms",
    )


def error_unknown(error: float) -> tuple[str, ...]:
    """Warning of an unknown discretisation error: a file with a single mesh."""
    if np.isfinite(error):
        return ()
    return (
        "the discretisation error of this mesh is not known, because its file has only one; give a "
        "finer one and compare",
    )


def error_not_estimated(model: str, error: float) -> tuple[str, ...]:
    """Warning of a model that states no error of its own, as one from outside may."""
    if np.isfinite(error):
        return ()
    return (f"the error of {model} is not estimated; compare its response with another model's",)


def rigid_body_drift(scene: Scene) -> tuple[str, ...]:
    """Warning of rigid-body drift under a load with non-zero mean."""
    if scene.body.is_held or not mean_gain(scene):
        return ()
    half_space = ", or take thickness_mm = inf" if scene.body.of_kind.is_layer else ""
    return (
        "this body is unconstrained and drifts under a pressure with non-zero mean: only motion "
        f"about the mean counts; clamp its base or its sides{half_space}",
    )


def over_tolerance(what: str, error: float, tolerance: float, cure: str) -> tuple[str, ...]:
    """Warning of an error above the tolerance; the cure ends before "enough"."""
    if not error > tolerance:
        return ()
    percent = f"{100 * error:.0f}" if error > 0.1 else f"{100 * error:.2g}"
    return (
        f"{what} will have a relative error of about {percent} %, more than the tolerance of "
        f"{100 * tolerance:g} %; {cure} enough",
    )


def beyond_prediction(
    scene: Scene, response: Response, predicted: float, tolerance: float
) -> tuple[str, ...]:
    """Warning of an error above the tolerance that the model measured, and no plan predicted."""
    error = response.expected_error
    if not error > np.fmax(predicted, tolerance):
        return ()
    return (
        f"{response.model} has a relative error of about {100 * error:.2g} % in this "
        f"{scene.reading.record.words}, more than the tolerance of {100 * tolerance:g} %: a thin "
        "plate with the same linear motion differs by that; take the displacement, or smaller "
        "elements and shorter time steps",
    )


def series_over_tolerance(words: str, error: float, tolerance: float) -> tuple[str, ...]:
    """Warning of a Prony series, described by `words`, that a model takes for a modulus law."""
    cure = "flat-body-harmonic or fem-harmonic, which take the law itself, are"
    return over_tolerance(f"the {words},", error, tolerance, cure)


def start_over_tolerance(model: Model, start: float, tolerance: float) -> tuple[str, ...]:
    """Warning of a steady-state model that leaves out a start above the tolerance."""
    what = f"{model.name}, which leaves out the initial transient,"
    return over_tolerance(what, start, tolerance, f"{model.from_rest} is")


def under_resolved(h: float, width: float) -> tuple[str, ...]:
    """Warning of elements that do not resolve the focal spot."""
    if h <= 2 * width:
        return ()
    kept = "neither its force nor its shape" if h > 3 * width else "its force but not its shape"
    return (
        f"elements of {1e3 * h:.3g} mm are wider than twice the standard deviation of the focal "
        f"spot, {1e3 * width:.2g} mm: they preserve {kept}; make them smaller",
    )
